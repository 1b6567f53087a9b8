"""What the compiled equations of the SUNDIALS solvers read and write, and the kinds of terms of their guards."""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING

import numpy as np

from crossbody.reference.core.bundles import bundle_type, opener, table
from crossbody.reference.kinds import Array, Floats, Floats2, Index

if TYPE_CHECKING:
    from crossbody.reference._system import System


class Kind(IntEnum):
    """What a term of a guard is."""

    GAP = 0
    BELOW = 1
    """The gap's negative."""
    RATE = 2
    FORCE = 3
    """The multiplier of an active row."""
    PRESS = 4
    """Minus the multiplier that an inactive row would have."""
    SPENT = 5
    """One side of the hand-over c |h'| + b0 |h| <= eps lam / (G^-1)_ii of a collision."""
    WATCH = 6
    """A function of the mechanism's `watch`."""


GAP, BELOW, RATE, FORCE, PRESS, SPENT, WATCH = (int(kind) for kind in Kind)
GOOD, ILL_POSED, NOT_FINITE = range(3)

DEGREE = 8
POINTS = 16  # even places of a step at which a re-check looks


class Workspace:
    """Everything that `evaluate` reads and writes."""

    size: Index  # n, nc, k, nz, na, terms, guards, nq, 1 where q' is not v, and how many rows stand beside the active
    count: Index  # evaluations, steps, steps in a row that stability binds, the most of these, guards undecided
    clock: Floats  # last instant, fastest damped pole, end of the last step and its start
    p: Floats
    u: Floats
    w: Floats
    blocks: Floats2  # (n, k)
    f: Floats
    q: Floats
    v: Floats
    law_q: Floats  # the state put onto the law
    law_v: Floats
    H: Floats2  # (nc, n), compact, as h, Hdv
    h: Floats
    Hdv: Floats
    gap: Floats
    rate: Floats
    lam: Floats  # (nc,) of all rows at the last evaluation
    lam1: Floats  # at the end of the step
    arc: Floats2  # (nc, 3) instant, gap and rate from which an active row has followed its law; instant NaN: unknown
    two: Floats
    matrix: Floats2  # (n + nc, n + nc + 2): the last columns are right-hand sides
    solution: Floats2  # (n + nc, 2)
    slopes: Floats  # derivative of the solver's vector, where it is implicit
    scale: Floats  # (nc,) of the rows' equations there
    rigid: Index  # (nc,) place of a row's second multiplier there, -1 for a row held by its law
    law: Floats2  # (nc, 3) in force
    law_if: Floats2  # the same, with every inactive row as it would be
    idx: Index  # the active rows; behind them those that share their load, and depend on them
    trial: Index
    let_go: Floats  # (nc,) instant at which others lifted a row off that shared a load with them
    tied: Index  # 1 for open rows that depend on the active ones
    depends: Floats2  # (n + nc, nc) how a row beside the active ones depends on these, below n zeros; a column a row
    share: Floats2  # (nc, 1) multipliers of the rows beside
    follows: Index
    watched: Floats  # (guards of the mechanism,)
    kind: Index  # of every term
    row: Index
    side: Floats2  # (terms, 2) signs of h' and h on one side of the hand-over
    shift: Floats
    group: Index  # the guard that a term belongs to
    values: Floats2  # (nodes, terms)
    check: Floats2  # (4, terms) at two places, without the quintic's error and with it
    grid: Floats2  # (POINTS, terms)
    ends: Floats2  # (2, of the solver's vector) the last step's start and end
    y0: Floats  # (nq + n,) start of the step
    y1: Floats
    qd: Floats  # (nq,) q'
    curve: Floats  # (n,) v' of the quintic
    a0: Floats  # (n,)
    a1: Floats
    undecided: Index  # (guards,) whether a guard may fire inside the step


WORKSPACE = bundle_type(Workspace)
open_work = opener(WORKSPACE)


def workspace(system: System, p: Floats, u: Floats, terms: int, nz: int) -> tuple[dict[str, Array], Array]:
    """Arrays of `Workspace` by name, and the table that compiled code reads them by.

    Args:
        system: the mechanism.
        p: parameters in force, shared and not copied.
        u: inputs in force, likewise.
        terms: largest number of terms of its guards.
        nz: accounts of work.
    """
    n, nq, nc, all_ = system.n, system.nq, system.nc, system.n + system.nc
    ny = nq + n
    shapes: dict[str, tuple[int, ...]] = {
        "size": (10,), "count": (5,), "clock": (4,), "w": (system.scratch,), "blocks": (n, system.mass_block),
        "depends": (all_, nc), "share": (nc, 1),
        **dict.fromkeys(("q", "qd", "law_q"), (nq,)), **dict.fromkeys(("f", "v", "law_v", "a0", "a1", "curve"), (n,)),
        "H": (nc, n), "two": (2,), "matrix": (all_, all_ + 2), "solution": (all_, 2), "law": (nc, 3),
        "law_if": (nc, 3), "arc": (nc, 3), "trial": (nc + 1,), "slopes": (ny + 2 * nc + nz,),
        "watched": (system.guards if system.watch is not None else 0,),
        **dict.fromkeys(("kind", "row", "shift", "group", "undecided"), (terms,)), "side": (terms, 2),
        "values": (DEGREE + 1, terms), "check": (4, terms), "grid": (POINTS, terms),
        "y0": (ny,), "y1": (ny,), "ends": (2, ny + 2 * nc + nz),
    }  # fmt: skip
    kinds = {"Index": np.int64}
    arrays = {
        name: np.zeros(shapes.get(name, (nc,)), dtype=kinds.get(kind, np.float64))
        for name, kind in Workspace.__annotations__.items()
    }
    arrays["p"], arrays["u"] = p, u
    arrays["follows"][:] = system.follows
    arrays["arc"][:, 0], arrays["let_go"][:] = np.nan, -np.inf
    arrays["size"][:4] = n, nc, system.mass_block, nz
    arrays["size"][7:9] = nq, system.velocity is not None
    return arrays, table([*arrays.values()])
