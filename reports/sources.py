"""The sources that decide what comes out of a run, as one digest."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from functools import cache
from pathlib import Path

FOLDERS = ("../cases", "../engines", "../reference", "../hw", "judging", "measuring", "metrics", "sweep")


@cache
def code() -> str:
    """Digest of the sources that decide what comes out: of runs, and of how they are judged."""
    found, reports = hashlib.sha256(), Path(__file__).parent
    for folder in FOLDERS:
        for path, name in sorted(_sources(str(reports / folder))):
            with open(path, "rb", buffering=0) as file:
                found.update(name.encode() + file.read())
    return found.hexdigest()[:16]


def _sources(folder: str, below: str = "") -> Iterator[tuple[str, str]]:
    """Yield path and name of every source below a folder: a third of the time that `Path.rglob` takes."""
    for entry in os.scandir(folder):
        if entry.is_dir():
            yield from _sources(entry.path, f"{below}{entry.name}/")
        elif entry.name.endswith(".py"):
            yield entry.path, below + entry.name
