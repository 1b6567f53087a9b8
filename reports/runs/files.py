"""Files inside a folder of results, which a stranger may have sent: no link inside it is followed."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path, PurePosixPath
from typing import Any, BinaryIO

from crossbody.cases import OutputError
from crossbody.cases.regular import open_regular

NAME = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9_.+ -]{0,200}")
"""One part of the name of a file of ours: it cannot climb out, and does not begin with a dot."""
DEPTH = 2  # folder and file: nothing of ours lies deeper


def is_plain(name: object) -> bool:
    """Whether a text is the relative name of a file that could be ours."""
    parts = name.split("/") if isinstance(name, str) else []
    return 0 < len(parts) <= DEPTH and all(NAME.fullmatch(part) for part in parts)


def file_name(label: str) -> str:
    """A label as the name of a file and an id: distinct for distinct labels, no path in it.

    A colon becomes a dot; whatever else is not a letter, digit, hyphen or underscore, or is too
    long, is replaced and told apart by a hash.
    """
    plain = label.replace(":", ".", 1)
    if re.fullmatch(r"[A-Za-z0-9_-]{1,80}(\.[A-Za-z0-9_-]{1,80})?", plain) and "." not in label:
        return plain
    return f"{re.sub(r'[^A-Za-z0-9_-]+', '-', label)[:60]}-{hashlib.sha256(label.encode()).hexdigest()[:8]}"


@contextmanager
def directory(folder: Path, name: str = "", make: bool = False) -> Iterator[int]:
    """Open a folder, or one inside it, without following a link below `folder`.

    Args:
        folder: where it is; may be reached over links, since the user named it.
        name: of the folder inside it.
        make: whether it is made where it is not there.

    Yields:
        Its descriptor.

    Raises:
        OutputError: if it is a link or no folder.
        OSError: if it is not there, or the system refuses.
    """
    outer = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        if make and name and not _is_there(outer, name):
            os.mkdir(name, dir_fd=outer)
        inner = _inside(outer, name, folder) if name else os.dup(outer)
    finally:
        os.close(outer)
    try:
        yield inner
    finally:
        os.close(inner)


def _is_there(where: int, name: str) -> bool:
    try:
        os.stat(name, dir_fd=where, follow_symlinks=False)
    except FileNotFoundError:
        return False
    return True


def _inside(where: int, name: str, folder: Path) -> int:
    try:
        return os.open(name, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW, dir_fd=where)
    except OSError as error:
        if error.errno not in (errno.ELOOP, errno.ENOTDIR):
            raise
        raise OutputError(f"{folder / name} is a link, or not a folder; crossbody follows no links there.") from None


def decoded(text: bytes) -> Any:
    """JSON that a stranger may have written.

    Raises:
        ValueError: for what is no JSON, is nested too deeply, or holds half of a surrogate pair,
            which no file can be written with.
    """
    try:
        found = json.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    if b"\\ud" in text.lower():
        json.dumps(found, ensure_ascii=False).encode()
    return found


def open_inside(folder: Path, name: str) -> BinaryIO:
    """Open a file in a folder for reading.

    Raises:
        OutputError: if it, or the folder that it is in, is a link, a pipe or a device.
        OSError: if it is not there or not readable.
    """
    place = PurePosixPath(name)
    with directory(folder, "" if len(place.parts) == 1 else str(place.parent)) as where:
        mode = os.stat(place.name, dir_fd=where, follow_symlinks=False).st_mode
        if not stat.S_ISREG(mode):
            raise OutputError(f"{folder / name} is a link, or not a file; crossbody follows no links there.")
        return open_regular(place.name, os.O_NOFOLLOW, where)


def read_inside(folder: Path, name: str) -> bytes:
    """Return what a file in a folder holds; errors as `open_inside`."""
    with open_inside(folder, name) as file:
        return file.read()


def digest(folder: Path, name: str) -> str:
    """Return the digest of a file in a folder; errors as `open_inside`."""
    with open_inside(folder, name) as file:
        status = os.fstat(file.fileno())
        return _digest(str(folder / name), status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns)


@lru_cache(maxsize=4096)
def _digest(path: str, *_status: int) -> str:
    """Digest what has not changed since only once a process."""
    place = Path(path)
    made = hashlib.blake2b(digest_size=16)
    with open_inside(place.parent, place.name) as file:
        while block := file.read(1 << 20):
            made.update(block)
    return made.hexdigest()


def listed(folder: Path, name: str = "") -> list[str]:
    """Names in a folder, or in one inside it, sorted; none where it is not there.

    Raises:
        OutputError: if it is a link.
    """
    try:
        with directory(folder, name) as where:
            return sorted(os.listdir(where))
    except FileNotFoundError:
        return []


def walked(folder: Path) -> list[str]:
    """Relative names of all files of a folder that could be ours, sorted."""
    found = []
    for name in listed(folder):
        kind = os.lstat(folder / name).st_mode
        inside = [f"{name}/{below}" for below in listed(folder, name)] if stat.S_ISDIR(kind) else [name]
        found += [each for each in inside if is_plain(each) and stat.S_ISREG(os.lstat(folder / each).st_mode)]
    return found


def move(source: Path, target: Path, name: str) -> None:
    """Move a file from one folder into another under the same relative name, over what is there."""
    place = PurePosixPath(name)
    inside = "" if len(place.parts) == 1 else str(place.parent)
    with directory(source, inside) as here, directory(target, inside, make=True) as there:
        os.rename(place.name, place.name, src_dir_fd=here, dst_dir_fd=there)


def remove(folder: Path, names: Iterable[str]) -> None:
    """Remove files, and the folders inside `folder` that are empty then; what is no file is left."""
    parents = set()
    for name in names:
        place = PurePosixPath(name)
        inside = "" if len(place.parts) == 1 else str(place.parent)
        try:
            with directory(folder, inside) as where:
                if stat.S_ISREG(os.stat(place.name, dir_fd=where, follow_symlinks=False).st_mode):
                    os.unlink(place.name, dir_fd=where)
        except (FileNotFoundError, OutputError):
            continue
        parents |= {inside} - {""}
    for parent in parents:
        if not listed(folder, parent):
            os.rmdir(folder / parent)
