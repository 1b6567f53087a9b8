"""What is complete of a command that is still running: each part is on disk as soon as it is there.

The same command goes on with them if it was interrupted or killed; when it comes to its end they
are taken away.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from crossbody.cases import InvalidValue, OutputError, UnknownName
from crossbody.reports import voice
from crossbody.reports.runs import files, manifest, output, watch

PARTS = ".crossbody-parts."
ABOUT = "command.json"


class Parts:
    """The parts of one command in its output folder; the folder is made with the first of them.

    Args:
        out: the output folder, as `output.check` lets it pass.
        command: what was typed.
        identity: what decides what comes out: two commands with the same identity share their parts.

    Raises:
        OutputError: if the disk refuses, or another process is running the same command here.
    """

    def __init__(self, out: Path, command: str, identity: Mapping[str, Any]) -> None:
        digest = hashlib.sha256(json.dumps(identity, sort_keys=True, default=repr).encode()).hexdigest()[:16]
        self.out, self.path = out.absolute(), out.absolute() / f"{PARTS}{digest}"
        self.command, self.lock = command, -1
        self.first = output.first_missing(self.out)
        if self.path.exists():
            self.begin()
        self._tell()

    def begin(self) -> None:
        """Make the folder, which this process alone writes from now on.

        Raises:
            OutputError: if the disk refuses, or another process is running the same command here.
        """
        if self.lock >= 0:
            return
        try:
            self._open()
        except OutputError:
            raise
        except OSError as error:
            if self.lock >= 0:
                self.__exit__(OutputError)
            raise OutputError(f"Output folder {self.out} cannot be written: {error.strerror or error}.") from None

    def _open(self) -> None:
        self.out.mkdir(parents=True, exist_ok=True)
        with files.directory(self.out, self.path.name, make=True) as handle:
            self.lock = os.dup(handle)
        try:
            fcntl.flock(self.lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise OutputError(f"The same command is running in {self.out} already; name another folder.") from None
        for name in files.listed(self.path):
            if name.startswith("."):
                shutil.rmtree(self.path / name, ignore_errors=True)
        manifest.replace_text(self.path / ABOUT, json.dumps({"command": self.command}))

    def keep(self) -> None:
        """Say what an interrupt leaves, once something is complete."""
        if self.found:
            watch.resumable(f"Nothing was replaced; {self._kept()}")

    @property
    def found(self) -> int:
        """How many parts are complete, whichever process wrote them."""
        return len([name for name in files.listed(self.path) if name != ABOUT and not name.startswith(".")])

    def _kept(self) -> str:
        return f"what is complete is kept in {self.out}, and the same command continues."

    def _tell(self) -> None:
        """Say what is there already, of this command and of others."""
        self.keep()
        if self.found:
            voice.note(
                f"{self.found} parts of an interrupted run of this command are in {self.out}: it continues with them."
            )
        for name in files.listed(self.out) if self.out.is_dir() else ():
            if name.startswith(PARTS) and name != self.path.name and not (self.out / name).is_symlink():
                _offer(self.out / name)

    def part(self, key: str) -> Path:
        """Folder of a part, which is there if the part is complete."""
        return self.path / hashlib.sha256(key.encode()).hexdigest()[:16]

    def has(self, key: str) -> bool:
        """Whether a part is complete."""
        part = self.part(key)
        return part.is_dir() and not part.is_symlink()

    @contextmanager
    def put(self, key: str) -> Iterator[Path]:
        """Write a part into a folder that counts when all is written."""
        self.begin()
        made = Path(tempfile.mkdtemp(prefix=".", dir=self.path))
        try:
            yield made
            if watch.stopping():  # a library may have swallowed it, and done less than it should
                raise watch.Stopped
            os.rename(made, self.part(key))
            self.keep()
        except OSError as error:
            raise OutputError(f"{made} cannot be written: {error.strerror or error}.") from error
        finally:
            shutil.rmtree(made, ignore_errors=True)

    def __enter__(self) -> Parts:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Take the parts away when what they are for is written, if there are none, and after wrong use."""
        if kind is None or not self.found or issubclass(kind, (InvalidValue, UnknownName)):
            shutil.rmtree(self.path, ignore_errors=True)
            output.take_away(self.out, self.first)
        elif issubclass(kind, OutputError):
            voice.note(self._kept())
        if self.lock >= 0:
            os.close(self.lock)
            self.lock = -1


def _offer(left: Path) -> None:
    try:
        told = files.decoded(files.read_inside(left, ABOUT))
        command = str(told["command"])
    except (OSError, ValueError, KeyError, TypeError):
        command = "a command"
    count = len([name for name in files.listed(left) if name != ABOUT and not name.startswith(".")])
    voice.note(
        f"{left} holds {count} parts of an interrupted `{command}`: repeat it to continue, or remove the folder."
    )
