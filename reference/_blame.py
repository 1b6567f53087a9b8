"""What a run ended by, told after it by calls of the kernels from Python: values not finite, rows dependent."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from crossbody.cases import Outcome
from crossbody.reference._check import ARGUMENTS
from crossbody.reference._guarded import entry
from crossbody.reference._system import System
from crossbody.reference.kinds import Floats, Index
from crossbody.reference.systems import absent

VANISHED = 1e-6  # part of H M^-1 H^T of a row at the start below which what moves the row is as good as nothing
WHIRLS = 1e6  # radians by which a row would turn, at its rate now, in the time of the run: its direction is none,
FASTER = 30.0  # where motions are so many times faster than at the start
STUCK = (
    Outcome.STEP_TOO_SMALL, Outcome.STEP_LIMIT, Outcome.TIME_LIMIT, Outcome.MODE_CYCLE, Outcome.INCONSISTENT,
)  # fmt: skip
"""How a run ends that hardly goes on, or whose forces jump."""
SURFACE = 1e-9  # part of its radius to which a sphere's centre is on a solid's face
LOOKS = 60  # states ahead, each twice as far as the one before


def not_finite(system: System, t: float, y: Floats, u: Floats, p: Floats, active: Index, ahead: float) -> str:
    """Name the kernel and the entry that first gives NaN or infinity, as the start of a sentence; empty if none does.

    Solvers keep no state at which a kernel gave NaN: what is not found at the last state is
    looked for ahead of it, on the parabola that it sets out on.

    Args:
        system: the mechanism.
        t: time of the last state, s.
        y: q and v there (nq + n,).
        u: inputs in force (nu,).
        p: parameters with the discrete state in force.
        active: rows in force.
        ahead: how far to look, s.
    """
    if not np.all(np.isfinite(u)):
        return f"Kernel control gave {entry('u', ~np.isfinite(u))} = {u[~np.isfinite(u)][0]} by "
    if not np.all(np.isfinite(y)):
        return ""
    q, v = np.split(y, [system.nq])
    with np.errstate(all="ignore"):
        for step, there, speed in _along(system, t, q, v, u, p, ahead):
            for name, key, value in _values(system, t + step, there, speed, u, p, active):
                bad = ~np.isfinite(value)
                if np.any(bad):
                    at = "" if step == 0.0 else f"t = {t + step:.12g} s, q = {there.tolist()}, just after "
                    return f"Kernel {name} gives {entry(key, bad)} = {value[bad][0]} at {at}"
    return ""


def _along(
    system: System, t: float, q: Floats, v: Floats, u: Floats, p: Floats, ahead: float
) -> Iterator[tuple[float, Floats, Floats]]:
    """States at the end of a run, and on the way that it sets out on."""
    yield 0.0, q, v
    M, f, w = np.zeros((system.n, system.mass_block)), np.zeros(system.n), np.zeros(system.scratch)
    system.dynamics(t, q, v, u, p, M, f, w)
    a = np.zeros(system.n)
    for b in range(0, system.n, system.mass_block):
        block = slice(b, b + system.mass_block)
        a[block] = np.linalg.lstsq(M[block], f[block], rcond=None)[0] if np.all(np.isfinite(M[block])) else 0.0
    for step in (ahead * 0.5 ** np.arange(LOOKS)[::-1]).tolist():
        there, speed = q + step * system.rates(q, v + 0.5 * step * a, t, p), v + step * a
        if not (np.all(np.isfinite(there)) and np.all(np.isfinite(speed))):
            return  # no kernel is to blame for what it gives beyond all numbers
        yield step, there, speed


def _values(
    system: System, t: float, q: Floats, v: Floats, u: Floats, p: Floats, active: Index
) -> Iterator[tuple[str, str, Any]]:
    """What every kernel gives at a state: kernel, array and its values; an energy that is nowhere known is left out."""
    n, nc = system.n, system.nc
    rows = np.concatenate([active, np.setdiff1d(np.arange(nc), active)])
    given: dict[str, Any] = {
        "t": t, "q": q, "v": v, "u": u, "p": p, "w": np.zeros(system.scratch), "idx": rows, "na": nc,
    }  # fmt: skip
    filled: dict[str, dict[str, Floats]] = {
        "dynamics": {"M": np.zeros((n, system.mass_block)), "f": np.zeros(n)},
        "gaps": {"h": np.zeros(nc), "hd": np.zeros(nc)},
        "rows": {"H": np.zeros((nc, n)), "h": np.zeros(nc), "Hdv": np.zeros(nc)},
        "energy": {"e": np.zeros(2)}, "power": {"e": np.zeros(2)}, "watch": {"g": np.zeros(system.guards)},
        "velocity": {"qd": np.zeros(system.nq)},
    }  # fmt: skip
    for name, outputs in filled.items():
        kernel = system.kernels[name]
        if kernel is getattr(absent, name, None) or (name in ("gaps", "rows") and not nc):
            continue
        values = given | outputs
        kernel(*(values[argument] for argument in ARGUMENTS[name]))
        yield from ((name, key, value[np.argsort(rows)] if name == "rows" else value) for key, value in outputs.items())


def vanished(system: System, active: Index, start: Floats, q: Floats, v: Floats) -> list[int]:
    """Return the rows in force that hardly anything moves at the end of a run, and something did at its start.

    Such a row, which has still to move, asks for velocities beyond all bounds: a string that its
    law pulls on where it is as short as it can be.

    Args:
        system: the mechanism.
        active: rows in force.
        start: positions at the start (nq,).
        q: positions at the end (nq,).
        v: velocities there (n,).
    """
    sizes = []
    for there, speed in ((start, np.zeros(system.n)), (q, v)):
        M, H = system.mass_matrix(there, speed), system.constraint(there, speed)[0][active]
        if not (np.isfinite(M).all() and np.isfinite(H).all()) or np.linalg.matrix_rank(M) != system.n:
            return []
        sizes.append(np.sum(H * np.linalg.solve(M, H.T).T, axis=1))
    found: list[int] = np.asarray(active)[sizes[1] < VANISHED * sizes[0]].tolist()
    return found


def whirling(system: System, active: Index, v0: Floats, q: Floats, v: Floats, t: float) -> list[int]:
    """Return the rows in force whose direction turns ever faster: they come to where they have none.

    There, as at angle 0 of a ball joint or where two points meet, a row that is still in force, and has to
    move, asks for velocities beyond all bounds.

    Args:
        system: the mechanism.
        active: rows in force.
        v0: velocities at the start (n,).
        q: positions (nq,).
        v: velocities there (n,).
        t: time of the run, s.
    """
    if not len(active) or not np.linalg.norm(v) > FASTER * np.linalg.norm(v0):
        return []
    H, _, Hdv = system.constraint(q, v)
    speeds = np.linalg.norm(H, axis=1) * np.linalg.norm(v)
    return [i for i in np.asarray(active).tolist() if abs(Hdv[i]) * t > WHIRLS * speeds[i] > 0.0]


def undirected(rows: list[int]) -> str:
    """The start of a sentence on rows that have no direction (`whirling`)."""
    return (
        f"Rows {rows} are in force where they have no direction, as the bound of a ball joint at angle 0 or a "
        "distance between points that meet: forces grow without bound near "
    )


def buried(system: System, active: Index, q: Floats, v: Floats) -> str:
    """Say which rows in force are so deep that their direction jumps (`System.cores`); empty if none is.

    From the middle of a solid every way out is as near as another: the row turns for ever between two of them.
    """
    gap = system.gap(q, v)[0]
    deep = [(i, *core) for i, core in system.cores.items() if i in active and gap[i] < -core[1] * (1.0 - SURFACE)]
    return "; ".join(
        f"the centre of the sphere of pair {name!r} (row {i}) is inside the solid, where the nearest side "
        f"changes at once (gap {gap[i]:.6g} m, from {-depth:g} m on)"
        for i, name, depth in deep
    )


KEEP_OUT = (
    "No tolerance helps: keep the centre outside by a stiffer law of the pair (a0, a1), less load, or a start that is "
    "not inside."
)


def dependence(system: System, active: Index, q: Floats, v: Floats) -> str:
    """The condition of H M^-1 H^T of the active rows, as the start of a sentence; empty if there are none.

    Args:
        system: the mechanism.
        active: rows in force.
        q: positions (nq,).
        v: velocities (n,).
    """
    M, H = system.mass_matrix(q, v), system.constraint(q, v)[0][active]
    if not (np.isfinite(M).all() and np.isfinite(H).all()) or np.linalg.eigvalsh(M).min(initial=np.inf) <= 0.0:
        return "The mass matrix is not positive definite near "
    if not len(active):
        return ""
    A = np.linalg.solve(np.linalg.cholesky(M), H.T)
    if len(active) == 1:
        return f"Row [{active[0]}] has H M^-1 H^T = {np.sum(A * A):.3g}: almost nothing can move it near "
    rank = int(np.linalg.matrix_rank(A))
    if rank < len(active):
        return f"Rows {active.tolist()} have a singular H M^-1 H^T, of rank {rank}, near "
    return f"Rows {active.tolist()} have H M^-1 H^T of condition {np.linalg.cond(A) ** 2:.3g} and worse near "
