"""What can be compiled before a run needs it: the parts of the reference that are the same for every mechanism."""

from __future__ import annotations

import atexit
import os
import subprocess
import sys
from pkgutil import resolve_name

from crossbody.cases import UnknownName

PIECES = {
    "integrator": "_program:compile_loop",
    "modes": "_program:instant_code",
    "friction": "_program:friction_code",
    "SUNDIALS": "sundials.compiled.evaluation:compile_equations",
    "ensemble": "_ensemble:compile_loop",
}
"""Name -> what compiles it; the largest first. Each can be compiled in a process of its own."""


BESIDE = ("modes", "SUNDIALS")
"""What nearly every run needs beside the integrator."""
_alone = False
"""Whether somebody else sees to the other pieces."""


def begin() -> None:
    """Have `BESIDE` compiled by a process of its own while the integrator is compiled here; it ends with this one."""
    if _alone or (os.cpu_count() or 1) < 2:
        return
    work = f"from crossbody.reference.ahead import compile_piece\nfor name in {BESIDE!r}: compile_piece(name)"
    none = subprocess.DEVNULL
    atexit.register(_end, subprocess.Popen([sys.executable, "-c", work], stdin=none, stdout=none, stderr=none))


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
