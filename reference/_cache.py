"""Where compiled code is kept between processes.

numba notices a change of the compiled function's own file only, so a stale helper would go unnoticed. Each folder of
compiled sources therefore keeps its code in a place named by a hash of all its files, of numba's version and of the
processor. Compiled functions call only compiled functions of their own folder.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numba
import numba.core.config as numba_config

try:
    import fcntl
except ImportError:  # not a POSIX system: every process compiles for itself
    fcntl = None  # type: ignore[assignment]


@cache
def folder(sources: tuple[Path, ...]) -> Path:
    """The place for code compiled from these sources on this machine, created if it is not there.

    `CROSSBODY_CACHE` names another base than the user's cache folder. Where neither can be written, a fresh
    temporary folder serves this process alone.
    """
    base = os.environ.get("CROSSBODY_CACHE") or Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache") / "crossbody"
    chosen = Path(base).expanduser() / _fingerprint(sources)
    try:
        chosen.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=chosen):
            return chosen
    except OSError:
        return Path(tempfile.mkdtemp(prefix="crossbody-cache-"))


def _fingerprint(sources: tuple[Path, ...]) -> str:
    digest = hashlib.sha256(f"{numba.__version__} {llvm.get_host_cpu_name()}".encode())
    for source in sources:
        digest.update(source.name.encode() + b"\0" + source.read_bytes())
    return digest.hexdigest()[:16]


def _sources(function: Callable[..., Any]) -> tuple[Path, ...]:
    """The files whose change makes a function's compiled code stale; of a user's own folder, its own file alone."""
    own = Path(function.__code__.co_filename)
    if Path(__file__).parent in own.parents:
        return tuple(sorted(own.parent.glob("*.py")))
    return (own,) if own.is_file() else ()


def compiled(function: Callable[..., Any], signatures: Any = None, *, nogil: bool = False) -> Any:
    """Compile a function and keep the code on disk; other users' numba functions keep their own places.

    A function typed at a prompt has no file to stand beside: it is compiled for this process alone. With nogil, threads
    may run it side by side.
    """
    sources = _sources(function)
    before = numba_config.CACHE_DIR
    place = folder(sources) if sources else None
    numba_config.CACHE_DIR = str(place) if place else before
    done = _mark(place, function, signatures) if place and signatures else None
    try:
        with _alone(place if done and not done.exists() else None):
            found = numba.njit(signatures, cache=bool(sources), error_model="numpy", nogil=nogil)(function)
        if done and not done.exists():
            done.touch()
        return found
    finally:
        numba_config.CACHE_DIR = before


def _mark(place: Path, function: Callable[..., Any], signatures: Any) -> Path:
    """The file that says that this code is there: who only reads it back need not wait for others that compile."""
    code = function.__code__
    what = f"{code.co_filename}:{code.co_firstlineno} {function.__qualname__} {signatures}"
    return place / f"{hashlib.sha256(what.encode()).hexdigest()[:16]}.compiled"


_INSIDE = threading.RLock()
_depth = 0


@contextmanager
def _alone(place: Path | None) -> Iterator[None]:
    """Let one process compile while the others wait for its code: a sweep starts many workers at once.

    One lock serves all folders, and a process takes it once: reading compiled code back may import what compiles too.
    """
    global _depth
    if place is None or fcntl is None:
        yield
        return
    with _INSIDE, ExitStack() as held:
        if _depth == 0:
            with suppress(OSError):  # a place that only this process can write needs no lock
                lock = held.enter_context((place.parent / "compiling").open("a"))
                fcntl.flock(lock, fcntl.LOCK_EX)  # let go when the file is closed, also by a death
        _depth += 1
        try:
            yield
        finally:
            _depth -= 1


def inlined(function: Callable[..., Any]) -> Any:
    """Make a function part of whatever compiled function calls it.

    A compiled function carries all that it calls, optimised anew: what is called from one place, or is short, is
    therefore written out there, and only the few parts that many places share are compiled on their own.
    """
    return numba.njit(inline="always", error_model="numpy")(function)
