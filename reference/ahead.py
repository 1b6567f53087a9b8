"""What can be compiled before a run needs it: the parts of the reference that are the same for every mechanism."""

from __future__ import annotations

import atexit
import os
import subprocess
import sys
from functools import cache
from pkgutil import resolve_name

from crossbody.cases import UnknownName
from crossbody.reference import code_store

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
    code_store.tell(code_store.COMPILING)
    if (os.cpu_count() or 1) < 2:
        return
    work = f"from crossbody.reference.ahead import compile_piece\nfor name in {BESIDE!r}: compile_piece(name)"
    none = subprocess.DEVNULL
    atexit.register(_end, subprocess.Popen([sys.executable, "-c", work], stdin=none, stdout=none, stderr=none))


def meanwhile(name: str) -> None:
    """Compile a piece that will be needed, rather than wait for those that another process may be compiling.

    Args:
        name: of `PIECES`.
    """
    from crossbody.reference._program import is_missing

    if begin.cache_info().currsize and is_missing():
        compile_piece(name)


def _end(process: subprocess.Popen[bytes]) -> None:
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
