"""The output folder: complete or not there, and never somebody else's."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from crossbody.cases import OutputError

MARKER = ".crossbody"


def check(path: Path) -> None:
    """Say before anything is computed whether the folder can be written.

    Raises:
        OutputError: if it is a file, holds something that is not ours, or its parent cannot be written.
    """
    if path.is_symlink() or (path.exists() and not path.is_dir()):
        raise OutputError(f"Output {path} is not a folder; name a new folder or one that crossbody wrote.")
    if path.is_dir():
        try:
            foreign = any(path.iterdir()) and not (path / MARKER).is_file()
        except OSError as error:
            raise OutputError(f"Output folder {path} cannot be read: {error.strerror}.") from None
        if foreign:
            raise OutputError(f"Output folder {path} holds files that crossbody did not write; name a new folder.")
    parent = next(p for p in path.absolute().parents if p.exists())
    try:  # permissions alone do not tell: the file system has its own say
        os.rmdir(tempfile.mkdtemp(prefix=".crossbody-", dir=parent))
    except OSError:
        raise OutputError(f"Output folder {path} cannot be made: {parent} cannot be written.") from None


@contextmanager
def folder(path: Path) -> Iterator[Path]:
    """A temporary sibling to write into; it takes the folder's place when all is written, and is gone if not.

    Raises:
        OutputError: as `check`, or if the disk refuses.
    """
    check(path)
    path = path.absolute()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        made = Path(tempfile.mkdtemp(prefix=f".{path.name}.", dir=path.parent))
    except OSError as error:
        raise OutputError(f"Output folder {path} cannot be made: {error.strerror}.") from None
    try:
        made.chmod(0o755)
        (made / MARKER).write_text("Written by crossbody; it may be replaced by the next run.\n", encoding="utf-8")
        yield made
        _swap(made, path)
    except OSError as error:
        raise OutputError(f"Output folder {path} cannot be written: {error.strerror or error}.") from error
    finally:
        shutil.rmtree(made, ignore_errors=True)


def _swap(made: Path, path: Path) -> None:
    if not path.exists():
        made.rename(path)
        return
    old = Path(tempfile.mkdtemp(prefix=f".{path.name}.", dir=path.parent))
    path.rename(old / "old")
    try:
        made.rename(path)
    except OSError:
        (old / "old").rename(path)
        raise
    finally:
        shutil.rmtree(old, ignore_errors=True)


def replace_text(path: Path, text: str) -> None:
    """Write one file of a folder that is ours already, whole or not at all."""
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        file.write(text)
    Path(name).chmod(0o644)
    os.replace(name, path)
