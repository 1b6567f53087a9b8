"""The folder of compiled code: every file is checked before it is believed.

Reading a file back runs what it says, so that it must be ours: a regular file, no link, that
belongs to this user or to root and that nobody else may write. A digest tells whether it is
whole. What is not is dropped and compiled again. A folder that cannot be used is told once, in a
sentence on stderr, and nothing is kept: no run fails for it.
"""

from __future__ import annotations

import hashlib
import os
import re
import stat
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from crossbody.cases.regular import open_regular
from crossbody.reference.compiling import count

try:
    import fcntl
except ImportError:  # not a POSIX system: every process compiles for itself
    fcntl = None  # type: ignore[assignment]

ANY_FORMAT = b"crossbody compiled code "
MAGIC = ANY_FORMAT + b"1\n"
CODE, LOCK = ".code", ".lock"
OURS = re.compile(r"[\w.<>-]*-[0-9a-f]{32}\.(code|lock)|\.[\w.<>-]*\.part")
UNUSED_DAYS, LARGEST = 90.0, 2 << 30  # what is kept, in days since it was last read and in bytes
TELL_S, WAIT_S, LOOK_S = 2.0, 300.0, 0.05  # when a wait is told, when it ends, and how often it is looked, s
_DAY = 86400.0


_told: set[str] = set()


def tell(text: str) -> None:
    """Say a sentence on stderr, once a process."""
    if text in _told:
        return
    _told.add(text)
    with suppress(OSError, ValueError, AttributeError):  # there may be no stderr
        sys.stderr.write(f"crossbody: {text}\n")


def base() -> Path | None:
    """Return where the folder stands, in `CROSSBODY_CACHE` or in the user's cache folder; None if nowhere."""
    given = os.environ.get("CROSSBODY_CACHE")
    try:
        root = Path(given) if given else Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache") / "crossbody"
        return root.expanduser() / "compiled"
    except RuntimeError:  # a user without a name has no home
        why = f"in {given} (there is no such home folder)" if given else "(there is no home folder)"
        tell(f"compiled code cannot be kept {why}; every process compiles again. " + ADVICE)
        return None


ADVICE = "Set CROSSBODY_CACHE to another folder."


def current() -> Store | None:
    """Return the store in use, as the environment names it now; None if nothing can be kept."""
    where = base()
    return None if where is None else _opened(where)


def named(readable: str, *depends: str) -> str:
    """Return the name of a file: readable, then a digest of all that its content depends on."""
    digest = hashlib.sha256("\0".join(depends).encode("utf-8", "surrogatepass")).hexdigest()
    return f"{readable}-{digest[:32]}"


@cache
def _opened(where: Path) -> Store | None:
    try:
        if not where.is_dir():
            where.parent.mkdir(parents=True, exist_ok=True)
            where.mkdir(mode=0o700, exist_ok=True)
        problem = _problem(where)
    except OSError as error:
        why = f"{error.filename} is a file" if isinstance(error, FileExistsError) else error.strerror
        tell(f"compiled code cannot be kept in {where} ({why}); every process compiles again. " + ADVICE)
        return None
    if problem:
        tell(f"the cache folder {where} {problem}; compiled code is neither read from it nor kept. " + ADVICE)
        return None
    return Store(where)


def _problem(where: Path) -> str:
    """Say what keeps a folder from being trusted; empty if nothing. Our own is made safe from others."""
    found = where.stat()
    if not stat.S_ISDIR(found.st_mode):
        return "is not a folder"
    if not _trusted(found.st_uid):
        return f"belongs to user {found.st_uid}"
    if found.st_uid == _user() and found.st_mode & 0o022:
        with suppress(OSError):
            where.chmod(stat.S_IMODE(found.st_mode) & 0o755)
            found = where.stat()
    return "may be written by other users" if found.st_mode & 0o022 and os.name == "posix" else ""


def _user() -> int:
    return os.geteuid() if hasattr(os, "geteuid") else 0


def _trusted(owner: int) -> bool:
    """Root may do as it likes anyway: a cache that it has filled for all users serves them."""
    return owner in (_user(), 0)


@dataclass(frozen=True, slots=True)
class Store:
    """The files of one folder.

    Attributes:
        folder: where they stand; it may be read-only.
    """

    folder: Path

    def read(self, name: str) -> bytes | None:
        """Return what was written under a name; None if it is not there, or was not whole and is dropped."""
        path = self.folder / (name + CODE)
        try:
            file = open_regular(path, getattr(os, "O_NOFOLLOW", 0))
        except FileNotFoundError:
            return None
        except OSError as error:
            self.drop(name, f"cannot be read ({error.strerror})")
            return None
        with file:
            found = os.fstat(file.fileno())
            if not _trusted(found.st_uid) or found.st_mode & 0o022:
                self.drop(name, "may have been written by another user")
                return None
            try:
                data = file.read()
            except OSError as error:
                self.drop(name, f"cannot be read ({error.strerror})")
                return None
        if time.time() - found.st_mtime > _DAY:
            with suppress(OSError):
                os.utime(path)  # it is in use: not to be pruned
        if data.startswith(ANY_FORMAT) and not data.startswith(MAGIC):  # whole, of another version
            with suppress(OSError):
                path.unlink()
            return None
        start = len(MAGIC) + hashlib.sha256().digest_size
        if data[:start] != MAGIC + _seal(name, memoryview(data)[start:]):
            self.drop(name, "was damaged")
            return None
        return data[start:]

    def has(self, name: str) -> bool:
        """Return whether something was written under a name."""
        return os.path.exists(self.folder / (name + CODE))  # unlike that of Path, it raises nothing

    def drop(self, name: str, why: str) -> None:
        """Remove a file that is not to be believed, and say so."""
        path = self.folder / (name + CODE)
        tell(f"{path} {why}; it is compiled again.")
        with suppress(OSError):
            path.rmdir() if path.is_dir() and not path.is_symlink() else path.unlink()

    def write(self, name: str, data: bytes) -> None:
        """Keep data under a name, whole or not at all; what cannot be kept is told."""
        part = ""
        try:
            descriptor, part = tempfile.mkstemp(prefix=".", suffix=".part", dir=self.folder)  # mode 0600
            with open(descriptor, "wb") as file:
                file.write(MAGIC + _seal(name, data) + data)
            os.replace(part, self.folder / (name + CODE))
        except OSError as error:
            tell(f"compiled code cannot be kept in {self.folder} ({error.strerror}); it is used only by this process.")
            with suppress(OSError):
                os.unlink(part)
            return
        _prune_once(self)

    @contextmanager
    def alone(self, name: str) -> Iterator[None]:
        """Let one process compile while others wait for its code, until it is there or `WAIT_S` have passed."""
        with ExitStack() as held:
            lock = self._lock(name, held) if fcntl is not None else None
            try:
                yield
            finally:
                if lock is not None:
                    with suppress(OSError):
                        lock.unlink()  # who waits for it looks for the code next

    def _lock(self, name: str, held: ExitStack) -> Path | None:
        path, code = self.folder / (name + LOCK), self.folder / (name + CODE)
        if self.has(name):
            return None
        try:
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
            file = held.enter_context(open(descriptor))  # noqa: SIM115 - closed with all that is held
        except OSError:  # a folder that cannot be written needs no lock
            return None
        began = time.monotonic()
        while not os.path.exists(code):
            with suppress(BlockingIOError):
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # let go when the file is closed, also by a death
                return path
            waited = time.monotonic() - began
            if waited > WAIT_S:
                tell(f"another process has held {path} for {waited:.0f} s; this one compiles for itself.")
                return None
            if waited > TELL_S and not count.told:
                tell("another process compiles what this one needs; waiting for it.")
            time.sleep(LOOK_S)
        return None

    def entries(self) -> list[tuple[Path, os.stat_result]]:
        """Return the files that are ours, the longest unused first."""
        found = []
        with suppress(OSError):
            for path in self.folder.iterdir():
                with suppress(OSError):
                    if OURS.fullmatch(path.name):
                        found.append((path, path.lstat()))
        return sorted(found, key=lambda entry: entry[1].st_mtime)

    def prune(self, days: float = UNUSED_DAYS, largest: int = LARGEST) -> int:
        """Remove what was not read for some days, and the longest unused above a size in bytes; return how many."""
        entries, now, removed = self.entries(), time.time(), 0
        size = sum(found.st_size for _, found in entries)
        for path, found in entries:
            unfinished = path.suffix != CODE and now - found.st_mtime > _DAY
            if now - found.st_mtime > days * _DAY or size > largest or unfinished:
                with suppress(OSError):
                    path.unlink()
                    size -= found.st_size
                    removed += 1
        return removed

    def clear(self) -> int:
        """Remove every file of ours; return how many."""
        return self.prune(-1.0)


@cache
def _prune_once(store: Store) -> None:
    store.prune()


def _seal(name: str, data: bytes | memoryview) -> bytes:
    """The digest of a name and what stands under it: a file under another's name is not believed."""
    found = hashlib.sha256(name.encode() + b"\0")
    found.update(data)
    return found.digest()
