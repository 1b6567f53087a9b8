"""Digests of sources: the bytes that stand in the files, whatever their times and sizes."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from functools import cache


def readable() -> bool:
    """Return whether sources stand in files: an archive, or compiled modules alone, say nothing about them."""
    return __file__.endswith(".py") and os.path.isfile(__file__)


@cache
def digest(folder: str) -> str:
    """Return the digest of names and bytes of all sources below a folder, as they are when it is first asked for."""
    found = hashlib.sha256()
    for path, name in sorted(_sources(folder)):
        with open(path, "rb", buffering=0) as file:
            found.update(name.encode() + file.read())
    return found.hexdigest()


def _sources(folder: str, below: str = "") -> Iterator[tuple[str, str]]:
    """Yield path and name of every source below a folder: a third of the time that `Path.rglob` takes."""
    for entry in os.scandir(folder):
        if entry.is_dir():
            yield from _sources(entry.path, f"{below}{entry.name}/")
        elif entry.name.endswith(".py"):
            yield entry.path, below + entry.name
