"""Where the elements of a robot file stand, and changed forms of it, each opened once.

A form is opened in a folder that looks like the user's and is not.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Lock
from types import TracebackType
from typing import Any
from uuid import uuid4
from xml.etree import ElementTree
from xml.parsers import expat

from crossbody.cases import CrossbodyError
from crossbody.cases.regular import open_regular

Node = ElementTree.Element
Place = tuple[Path, int]
NAMED_BY = ("name", "joint", "joint1", "body1", "tendon")  # what of an element names a part
LEVELS = 4  # folders above a file that are there for its meshes
Change = Callable[[Node, Mapping[Node, Place]], None]


def with_lines(path: Path, folder: Path | None = None) -> tuple[Node, dict[Node, Place]]:
    """Return the root of a file with its includes, and file and line of every element and <include>."""
    builder, parser, places = ElementTree.TreeBuilder(), expat.ParserCreate(), dict[Node, Place]()

    def start(tag: str, attributes: dict[str, str]) -> None:
        places[builder.start(tag, attributes)] = (path, parser.CurrentLineNumber)

    parser.StartElementHandler, parser.EndElementHandler = start, builder.end
    with open_regular(path) as file:
        parser.ParseFile(file)
    root, folder = builder.close(), folder or path.parent
    for node in list(root.iter()):
        for child in [child for child in node if child.tag == "include"]:
            try:
                part, own = with_lines(folder / child.get("file", ""), folder)
            except (OSError, expat.ExpatError):
                continue
            at = list(node).index(child)
            node[at : at + 1] = list(part)
            places |= own
    return root, places


def files_of(path: Path) -> set[Path]:
    """Return the files that a robot file is made of: itself, what it includes, what its parts name."""
    try:
        root, places = with_lines(path)
    except expat.ExpatError:
        return {path.resolve()}
    folders = [path.parent, *(path.parent / one.get(key, "") for one in root.iter("compiler") for key in (
        "meshdir", "texturedir", "assetdir"))]  # fmt: skip
    named = {node.get(key, "") for node in root.iter() for key in ("file", "filename")} - {""}
    return {file.resolve() for file, _ in places.values()} | {
        (base / name).resolve() for base in folders for name in named
    }


def names(node: Node, around: Mapping[Node, Node]) -> set[str]:
    """Return the names of a part, of its children, of what it speaks of and of its body."""
    own = {node, *node}
    if node.tag not in ("body", "link") and node in around and around[node].tag in ("body", "link", "joint"):
        own |= {around[node], *around[node]}
    return {one.get(key, "") for one in own for key in ("name", "class", "joint", "joint1", "joint2", "body1", "body2",
                                                       "tendon")} - {""}  # fmt: skip


def named(path: Path) -> dict[int, dict[str, set[str]]]:
    """Return line of a file -> tag -> names of the parts that stand there, or of the body around them."""
    try:
        root, places = with_lines(path)
    except expat.ExpatError:
        return {}
    around, found = {child: node for node in root.iter() for child in node}, dict[int, dict[str, set[str]]]()
    for node, (file, line) in places.items():
        if file == path and node.tag not in ("worldbody", "mujoco", "robot", "default", "compiler", "option"):
            parts = {node} if node.get("name") else {node, around.get(node, node)}
            here = found.setdefault(line, {}).setdefault(node.tag, set())
            here.update(name for one in parts for key in NAMED_BY if (name := one.get(key)))
    return found


class Forms:
    """Forms of one file, each audited as `open_form` returns it, which are there as long as it is entered."""

    def __init__(self, path: Path, open_form: Callable[[Path], Any]) -> None:
        self.path, self._open = path, open_form
        self._opened: dict[object, Any] = {}
        self._lock = Lock()

    def __enter__(self) -> Forms:
        self._temporary = TemporaryDirectory(prefix="crossbody-forms-")
        self._folder: Path | None = None
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._temporary.cleanup()

    def opened(self, key: object, change: Change) -> Any:
        """Return the audit of the form that a change makes of the file; None where that is no robot."""
        return self.made(key, lambda out: written(self.path, change, out))

    def made(self, key: object, write: Callable[[Path], None]) -> Any:
        """Return the audit of a form that is written by something else."""
        with self._lock:
            if key not in self._opened:
                self._opened[key] = None
                self._folder = self._folder or _mirrored(self.path, Path(self._temporary.name))
                out = self._folder / f"{uuid4().hex}{self.path.suffix}"  # links to the user's files stand there too
                with suppress(CrossbodyError, expat.ExpatError):
                    write(out)
                    self._opened[key] = self._open(out)
            return self._opened[key]


def written(path: Path, change: Change, out: Path) -> None:
    """Write a changed form of a file."""
    root, places = with_lines(path)
    change(root, places)
    ElementTree.ElementTree(root).write(out, encoding="utf-8")


def removed(root: Node, node: Node) -> None:
    """Take an element out of a tree."""
    for parent in [one for one in root.iter() if node in list(one)]:
        parent.remove(node)


def _mirrored(path: Path, at: Path) -> Path:
    """Return a folder of links to what stands beside a file, and above it, where meshes may be."""
    above = [*reversed(path.resolve().parents[:LEVELS])]
    for k, folder in enumerate(above):
        at /= folder.name
        at.mkdir(exist_ok=True)
        with suppress(OSError):
            for one in folder.iterdir():
                if one not in above[k + 1 :]:
                    (at / one.name).symlink_to(one)
    return at
