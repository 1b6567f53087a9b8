"""Changed forms of a robot file, each opened once, in a folder that looks like the user's and is not."""

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
from crossbody.reports.importers.lines import Node, Place, with_lines

LEVELS = 4  # folders above a file that are there for its meshes
Change = Callable[[Node, Mapping[Node, Place]], None]


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
        """Return the audit of a form; None where that is no robot.

        Args:
            key: of the form.
            change: what makes it, of the file with what it includes.
        """
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
