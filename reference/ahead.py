"""What can be compiled before a run needs it: the parts of the reference that are the same for every mechanism."""

from __future__ import annotations

from pkgutil import resolve_name

from crossbody.cases import UnknownName

PIECES = {
    "integrator": "_program:compile_loop",
    "friction": "_program:friction_code",
    "SUNDIALS": "sundials.compiled.evaluation:compile_equations",
    "ensemble": "_ensemble:compile_loop",
}
"""Name -> what compiles it; the largest first. Each can be compiled in a process of its own."""


def compile_piece(name: str) -> None:
    """Compile one piece, or read it back.

    Args:
        name: of `PIECES`.

    Raises:
        UnknownName: if there is no such piece.
    """
    if name not in PIECES:
        raise UnknownName("piece", name, PIECES)
    resolve_name(f"crossbody.reference.{PIECES[name]}")()
