"""What the text of a robot file says that its compiler would pass over, or take for ever to say.

A file may come from anywhere: it includes nothing from outside its folder, and it has no more
bodies than a scene.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from crossbody.cases.errors import SceneError
from crossbody.cases.regular import open_regular
from crossbody.cases.scene import LARGEST

BYTES = 50_000_000  # of a file
BODIES = ("body", "link")


def check_text(path: Path) -> None:
    """Check a file and what it includes; what is no XML is left to the compiler, which names the line.

    Raises:
        SceneError: for more bodies than a scene may have, for an include from outside the folder,
            for too many bytes.
    """
    _count(path, path.resolve().parent, {path.resolve()})


def _count(path: Path, folder: Path, seen: set[Path]) -> int:
    """Return how many bodies a file has with its includes."""
    total, copies = 0, [1]
    if path.stat().st_size > BYTES:
        raise SceneError(f"{path} has {path.stat().st_size} bytes; valid: at most {BYTES}.")
    with open_regular(path) as file:
        try:
            for event, part in ElementTree.iterparse(file, ("start", "end")):
                if part.tag == "replicate":
                    count = part.get("count", "1")
                    times = int(count) if count.isdecimal() else 1
                    copies = copies[:-1] if event == "end" else [*copies, copies[-1] * times]
                elif event == "start" and part.tag in BODIES:
                    total += copies[-1]
                elif event == "start" and part.tag == "include":
                    total += copies[-1] * _included(part.get("file", ""), path, folder, seen)
                if total > LARGEST:
                    raise SceneError(f"{path} has more than {LARGEST} bodies, the most that a scene may have.")
                part.clear() if event == "end" else None
        except ElementTree.ParseError:
            return total
    return total


def _included(name: str, path: Path, folder: Path, seen: set[Path]) -> int:
    there = (folder / name).resolve()
    if not there.is_relative_to(folder):
        raise SceneError(f"{path} includes {name!r} from outside its folder {folder}; valid: files in there.")
    if there in seen or not there.is_file():
        return 0
    seen.add(there)
    return _count(there, folder, seen)
