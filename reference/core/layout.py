"""What a run remembers between calls, and its workspace: nothing is allocated after the start."""

from __future__ import annotations

import numpy as np

from crossbody.reference._cache import compiled
from crossbody.reference._kinds import Array, Bytes, Floats, Index
from crossbody.reference.core._struct import by_reference
from crossbody.reference.core.dop853_table import DENSE_STAGES, DENSE_TERMS

# Return codes of `advance`; the Python side turns them into outcomes.
DONE, MORE, ROWS_FULL, EVENTS_FULL = 0, 1, 2, 3
STEP_TOO_SMALL, NOT_FINITE, ILL_POSED, MODE_CYCLE, DIVERGED = -1, -2, -3, -4, -5

# Machines, methods.
LEVEL, EDGE, MEMORYLESS = 0, 1, 2
EXPLICIT, IMPLICIT, EXACT = 0, 1, 2

# Modes, as in crossbody.cases.Mode.
FREE, CONTACT, BALLISTIC, COLLISION, COLLISION_SEPARATION, BILATERAL = 0, 1, 2, 3, 4, 5

NODES = 5  # a step is watched at its ends and at three points between
NEVER = 2.0  # an event's place in units of the step, when there is none

STATE = np.dtype(
    [
        # options, set once
        ("n", "i8"),
        ("nc", "i8"),
        ("nu", "i8"),
        ("k", "i8"),
        ("nz", "i8"),
        ("ns", "i8"),
        ("nw", "i8"),
        ("fsm", "i8"),
        ("has_solve", "i8"),
        ("constant_mass", "i8"),
        ("affine", "i8"),
        ("implicit", "i8"),
        ("natural", "i8"),
        ("ledger", "i8"),
        ("has_control", "i8"),
        ("rtol", "f8"),
        ("atol", "f8"),
        ("t_end", "f8"),
        ("h_max", "f8"),
        ("tick", "f8"),
        # the run
        ("started", "i8"),
        ("t", "f8"),
        ("t_old", "f8"),
        ("h", "f8"),
        ("hs", "f8"),
        ("h_free", "f8"),
        ("h_active", "f8"),
        ("stop", "f8"),
        ("method", "i8"),
        ("na", "i8"),
        ("fresh", "i8"),
        ("have_dense", "i8"),
        ("have_mass", "i8"),
        ("rejected_last", "i8"),
        ("stalled", "i8"),
        ("hold", "i8"),
        ("trial_steps", "i8"),
        ("trial_rhs", "i8"),
        ("trial_t", "f8"),
        ("explicit_rate", "f8"),
        ("have_jacobian", "i8"),
        ("full_jacobian", "i8"),
        ("jacobian_scale", "f8"),
        ("speed", "f8"),
        ("theta", "f8"),
        ("history", "i8"),
        ("history_t", "f8"),
        ("one_by_one", "i8"),
        ("next_input", "i8"),
        ("next_tick", "i8"),
        ("next_sample", "i8"),
        ("rows", "i8"),
        ("events", "i8"),
        ("bad_trials", "i8"),
        # counters
        ("steps", "i8"),
        ("rejected", "i8"),
        ("rhs", "i8"),
        ("implicit_steps", "i8"),
        ("exact_steps", "i8"),
        ("factorisations", "i8"),
    ]
)


@by_reference
class Model:
    """A system as the compiled code sees it."""

    p: Floats
    alpha: Floats  # (nc, 3) a0, a1, a2
    beta: Floats  # (nc, 3) the fast constants; a0 = 0 where the row has none
    unilateral: Bytes
    follows: Index  # the row whose activity this row shares; -1 for none


@by_reference
class Work:
    """Views into the two flat workspaces; compiled functions take what they need from here."""

    y: Floats  # (2n,) q and v
    y1: Floats
    ys: Floats
    k: Floats  # (16, 2n) stage derivatives
    F: Floats  # (7, 2n) dense output
    z: Floats  # (nz,) ledger: work of every row, of the inputs, of the damping
    z1: Floats
    kz: Floats  # (16, nz)
    Fz: Floats  # (7, nz)
    e: Floats  # (2,)
    u: Floats
    s: Floats  # controller state
    M: Floats  # (n, k)
    L: Floats  # (n, k) Cholesky factor of M
    f: Floats
    w: Floats
    H: Floats  # (nc, n) active rows, compact
    X: Floats  # (nc, n) M^-1 H^T, transposed
    G: Floats  # (nc, nc)
    Hdv: Floats
    r: Floats
    scale: Floats  # size of the terms behind each row's right-hand side
    noise: Floats  # (nc,) what rounding alone may make of each multiplier
    ha: Floats  # active rows, compact: gap, rate, multiplier
    hda: Floats
    la: Floats
    vd: Floats
    law: Floats  # (nc, 3) in force now
    lam: Floats  # (nc,) of all rows at the last evaluation
    lam0: Floats  # at the step's start
    lo: Floats  # least and largest multiplier seen at the stages
    hi: Floats
    gap: Floats
    rate: Floats
    gaps: Floats  # (5, nc) at the nodes of the step
    rates: Floats
    lams: Floats
    hit: Floats  # (nc,) where in the step each contact switches
    J: Floats  # (n, n)
    Jq: Floats
    Jv: Floats
    d: Floats
    g: Floats
    idx: Index  # active rows
    kind: Index  # (nc,) which guard fired
    pivot: Index


@compiled
def _vector(W: Array, cursor: Index, n: int) -> Array:
    start = cursor[0]
    cursor[0] += n
    return W[start : start + n]


@compiled
def _matrix(W: Array, cursor: Index, m: int, n: int) -> Array:
    return _vector(W, cursor, m * n).reshape(m, n)


@compiled
def carve(W: Floats, I: Index, n: int, nc: int, nu: int, k: int, nz: int, ns: int, nw: int) -> Work:  # noqa: E741
    """Name the parts of the flat workspaces; I[0] and I[1] end as the lengths used."""
    c, ci = I[0:1], I[1:2]
    c[0], ci[0] = 0, 2
    return Work(
        _vector(W, c, 2 * n),
        _vector(W, c, 2 * n),
        _vector(W, c, 2 * n),
        _matrix(W, c, DENSE_STAGES, 2 * n),
        _matrix(W, c, DENSE_TERMS, 2 * n),
        _vector(W, c, nz),
        _vector(W, c, nz),
        _matrix(W, c, DENSE_STAGES, nz),
        _matrix(W, c, DENSE_TERMS, nz),
        _vector(W, c, 2),
        _vector(W, c, nu),
        _vector(W, c, ns),
        _matrix(W, c, n, k),
        _matrix(W, c, n, k),
        _vector(W, c, n),
        _vector(W, c, nw),
        _matrix(W, c, nc, n),
        _matrix(W, c, nc, n),
        _matrix(W, c, nc, nc),
        _vector(W, c, nc),
        _vector(W, c, nc),
        _vector(W, c, nc),
        _vector(W, c, nc),
        _vector(W, c, nc),
        _vector(W, c, nc),
        _vector(W, c, nc),
        _vector(W, c, n),
        _matrix(W, c, nc, 3),
        _vector(W, c, nc),
        _vector(W, c, nc),
        _vector(W, c, nc),
        _vector(W, c, nc),
        _vector(W, c, nc),
        _vector(W, c, nc),
        _matrix(W, c, NODES, nc),
        _matrix(W, c, NODES, nc),
        _matrix(W, c, NODES, nc),
        _vector(W, c, nc),
        _matrix(W, c, n, n),
        _matrix(W, c, n, n),
        _matrix(W, c, n, n),
        _vector(W, c, n),
        _vector(W, c, n),
        _vector(I, ci, nc),
        _vector(I, ci, nc),
        _vector(I, ci, n),
    )


@compiled
def _measure(W: Floats, I: Index, n: int, nc: int, nu: int, k: int, nz: int, ns: int, nw: int) -> None:  # noqa: E741
    """Carve, for the lengths alone: the views themselves never reach Python."""
    carve(W, I, n, nc, nu, k, nz, ns, nw)


def workspace(n: int, nc: int, nu: int, k: int, nz: int, ns: int, nw: int) -> tuple[Floats, Index]:
    """Allocate the two flat workspaces, exactly as large as `carve` needs them."""
    bound = 200 * (n + nc + 2) + 5 * (n + nc) ** 2 + 40 * nz + nu + ns + nw
    lengths = np.zeros(2 * (n + nc) + 8, dtype=np.int64)
    _measure(np.empty(bound), lengths, n, nc, nu, k, nz, ns, nw)
    return np.zeros(lengths[0]), np.zeros(lengths[1], dtype=np.int64)
