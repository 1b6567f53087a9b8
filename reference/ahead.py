"""What can be compiled before a run needs it: the parts of the reference that are the same for every mechanism."""

from __future__ import annotations

import atexit
import os
import subprocess
import sys
from collections.abc import Iterable
from functools import cache, partial
from pkgutil import resolve_name
from threading import Thread

from crossbody.cases import UnknownName
from crossbody.reference.compiling import count

PIECES = {
    "integrator": "_program:program",
    "modes": "_program:instant_code",
    "friction": "_program:friction_code",
    "SUNDIALS": "sundials.compiled.evaluation:compile_equations",
    "ensemble": "_ensemble:compile_loop",
}
"""Name -> what compiles it; the largest first. Each can be compiled in a process of its own."""


BESIDE = ("integrator", "SUNDIALS", "modes")
"""What runs need beside the kernels of their mechanism, in order: a run compiles the last itself, meanwhile."""
_alone = False  # whether somebody else sees to the other pieces


@cache
def begin() -> None:
    """Have `BESIDE` compiled by a process of its own from the first code on that this one compiles, and say so.

    Nothing is begun where nothing is missing. The process ends with this one.
    """
    from crossbody.reference._program import is_missing

    if _alone or not is_missing():
        return
    count.need(_missing())
    count.tell()
    if (os.cpu_count() or 1) < 2:
        return
    none, work = subprocess.DEVNULL, "from crossbody.reference import ahead; ahead.compile_beside()"
    process = subprocess.Popen([sys.executable, "-c", work], stdin=none, stdout=subprocess.PIPE, stderr=none, text=True)
    atexit.register(_end, process)
    Thread(target=_follow, args=(process.stdout,), daemon=True).start()


def _missing() -> set[str]:
    """Names of the functions that `BESIDE` compiles, but for those of pieces that are kept."""
    from crossbody.reference._fingerprint import names_within
    from crossbody.reference._program import units
    from crossbody.reference.cache import compiled
    from crossbody.reference.sundials.compiled.evaluation import SIGNATURE, evaluate

    needed = (*units(), (evaluate, SIGNATURE))
    missing = (function for function, signature in needed if compiled(function, lazy=[signature]).lacks(signature))
    return set[str]().union(*map(names_within, missing))


def _follow(names: Iterable[str]) -> None:
    """Count the functions that the other process has ready."""
    for name in names:
        count.done(name.rstrip("\n"))


def compile_beside() -> None:
    """Compile `BESIDE`, and print the name of each function that is ready, for the process that began this one."""
    count.pass_on = partial(print, flush=True)
    for name in BESIDE:
        compile_piece(name)


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
