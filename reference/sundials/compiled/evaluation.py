"""The equations and the guards at one state, compiled: called once for every look of a SUNDIALS solver."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any

from numba import types

from crossbody.reference import kernels
from crossbody.reference._program import address, at_address, bound
from crossbody.reference.cache import compiled
from crossbody.reference.core.bundles import ADDRESSES, TABLE
from crossbody.reference.kinds import Floats
from crossbody.reference.sundials.compiled.equations import accelerate, derivative, residual, take
from crossbody.reference.sundials.compiled.guards import carry, grid, move_on, scan, terms
from crossbody.reference.sundials.compiled.workspace import GOOD, open_work

if TYPE_CHECKING:
    from crossbody.reference._system import System

# What is asked of `evaluate`.
DERIVATIVE, TERMS, FORCES, BEGIN, SCAN, GRID, WATCHED, RESIDUAL = range(8)


def evaluate(
    dynamics: Any, gaps: Any, rows: Any, power: Any, velocity: Any, watch: Any,
    what: int, t: float, y: Floats, out: Floats, lines: Any,
) -> int:  # fmt: skip
    """Do what is asked at (t, y); GOOD or what went wrong, except for SCAN, as `guards.scan`.

    DERIVATIVE: y' into out. TERMS: all terms into out. FORCES: the multipliers. BEGIN: a step begins here. SCAN, GRID:
    a step ends here. WATCHED: as SCAN, unless it is looked at again; out[0] is 0 where the solver is to stop, else 1.
    RESIDUAL: of the implicit equations into out, with the derivative in `slopes`.
    """
    s = open_work(lines)
    if what == DERIVATIVE:
        return int(derivative(dynamics, gaps, rows, power, velocity, s, t, y, out))
    if what == TERMS:
        take(s, y)
        return int(terms(dynamics, gaps, rows, watch, s, t, s.q, s.v, out))
    if what == FORCES:
        take(s, y)
        return int(accelerate(dynamics, rows, s, t, s.q, s.v, False))
    if what == BEGIN:
        code = carry(dynamics, rows, s, t, y)
        move_on(s, t, y)
        return int(code)
    if what == GRID:
        return int(grid(dynamics, gaps, rows, watch, s, t, y))
    if what == RESIDUAL:
        return int(residual(dynamics, gaps, rows, power, velocity, s, t, y, out))
    if what == WATCHED:
        out[0] = 1.0
        if t <= s.clock[2]:  # the solver looks back
            return GOOD
        left = scan(dynamics, gaps, rows, watch, s, t, y)
        if left > 0 or s.count[2] >= s.count[3]:
            out[0] = 0.0
        return int(min(left, 0))
    return int(scan(dynamics, gaps, rows, watch, s, t, y))


_USED = ("dynamics", "gaps", "rows", "power", "velocity", "watch")
_ARGUMENTS = (
    types.int64, types.float64, types.Array(types.float64, 1, "C", readonly=True), types.float64[::1], TABLE,
)  # fmt: skip


dynamics_at, gaps_at, rows_at, power_at, velocity_at, watch_at = (at_address(kernels.REAL[name]) for name in _USED)
SIGNATURE = types.int64(*(kernels.function_type(name) for name in _USED), *_ARGUMENTS)
evaluate_at = at_address(SIGNATURE)


def _evaluate_at(at, what, t, y, out, lines):  # type: ignore[no-untyped-def]
    call = evaluate_at(at[6])
    return call(
        dynamics_at(at[0]), gaps_at(at[1]), rows_at(at[2]), power_at(at[3]), velocity_at(at[4]), watch_at(at[5]),
        what, t, y, out, lines,
    )  # fmt: skip


@cache
def compile_equations() -> tuple[Any, int]:
    """`evaluate` as it is called from Python, and where it stands."""
    call = compiled(_evaluate_at, [types.int64(ADDRESSES, *_ARGUMENTS)])
    return call, address(compiled(evaluate, [SIGNATURE]), SIGNATURE)


def entry(system: System) -> Callable[..., int]:
    """The compiled `evaluate(what, t, y, out, lines)` of one system."""
    call, program = compile_equations()
    return bound(call, _USED, [system.kernels[name] for name in _USED], program)
