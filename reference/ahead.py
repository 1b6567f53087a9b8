"""What can be compiled before a run needs it: the parts of the reference that are the same for every mechanism."""

from __future__ import annotations

import atexit
import os
import subprocess
import sys
from collections.abc import Iterable
from contextlib import suppress
from functools import cache, partial
from pkgutil import resolve_name
from threading import Thread

from crossbody.cases import UnknownName
from crossbody.cases.parent import die_with_parent
from crossbody.reference.compiling import count

PIECES = {
    "integrator": "_program:program",
    "friction": "_program:friction_code",
    "modes": "_program:instant_code",
    "SUNDIALS": "sundials.compiled.evaluation:compile_equations",
    "ensemble": "_ensemble:compile_loop",
}
"""Name -> what compiles it; the largest first. Each can be compiled in a process of its own."""


BESIDE = "integrator"
"""What another process compiles first: the largest piece of what every run needs. A run compiles the rest meanwhile."""
_alone = False  # whether somebody else sees to the other pieces
_asked = [BESIDE]
_process: subprocess.Popen[str] | None = None


@cache
def begin() -> None:
    """Have `BESIDE` compiled by a process of its own from the first code on that this one compiles, and say so.

    Nothing is begun where the loop is not missing. The process ends with this one.
    """
    from crossbody.reference._program import is_missing

    if _alone or not is_missing():
        return
    if processors() > 1:
        _begin()
    count.need(_missing())
    count.tell()


def _begin() -> None:
    global _process
    pipe, work = subprocess.PIPE, "from crossbody.reference import ahead; ahead.compile_beside()"
    _process = subprocess.Popen(
        [sys.executable, "-c", work], stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL, text=True
    )
    atexit.register(_end, _process)
    Thread(target=_follow, args=(_process.stdout,), daemon=True).start()
    for name in _asked:
        _send(_process, name)


def processors() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def ask(name: str) -> None:
    """Have the process beside, where there is one or will be, compile a piece too that may be needed.

    Args:
        name: of `PIECES`.
    """
    if name not in _asked:
        _asked.append(name)
        if _process is not None:
            _send(_process, name)


def _send(process: subprocess.Popen[str], name: str) -> None:
    assert process.stdin is not None
    with suppress(OSError):  # it may have been ended: what it leaves is compiled here
        process.stdin.write(f"{name}\n")
        process.stdin.flush()


def _missing() -> set[str]:
    """Names of the functions that every run needs, but for those of pieces that are kept."""
    from crossbody.reference._fingerprint import names_within
    from crossbody.reference._program import units
    from crossbody.reference.cache import compiled

    missing = (function for function, signature in units() if compiled(function, lazy=[signature]).lacks(signature))
    return set[str]().union(*map(names_within, missing))


def _follow(names: Iterable[str]) -> None:
    """Count the functions that the other process has ready."""
    for name in names:
        count.done(name.rstrip("\n"))


def compile_beside() -> None:
    """Compile the pieces that the process which began this one asks for, and tell it of each function that is ready.

    Their names come in over stdin, those of functions go out over stdout; the end of either is the end.
    """
    die_with_parent()
    count.pass_on = partial(print, flush=True)
    for name in sys.stdin:
        compile_piece(name.rstrip("\n"))


def meanwhile(name: str) -> None:
    """Compile a piece that will be needed, rather than wait for those that another process may be compiling.

    Args:
        name: of `PIECES`.
    """
    from crossbody.reference._program import is_missing

    if begin.cache_info().currsize and is_missing():
        compile_piece(name)


def _end(process: subprocess.Popen[str]) -> None:
    process.terminate()
    process.wait()


def compile_piece(name: str) -> None:
    """Compile one piece, or read it back.

    Args:
        name: of `PIECES`.

    Raises:
        UnknownName: if there is no such piece.
    """
    if name not in PIECES:
        raise UnknownName("piece", name, PIECES)
    global _alone
    _alone = True
    resolve_name(f"crossbody.reference.{PIECES[name]}")()
