"""`linearise`: the linear model of a mechanism in a given set of modes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from crossbody.cases import SceneError, UnknownName
from crossbody.cases.arrays import frozen
from crossbody.cases.entry_points import checked_arguments
from crossbody.reference._indices import different
from crossbody.reference._system import System
from crossbody.reference.kinds import Floats, Index
from crossbody.reference.linear._analytic import check_analytic
from crossbody.reference.linear._derivatives import Derivatives, derivatives
from crossbody.reference.linear._driven import driven
from crossbody.reference.linear._point import Point, check_held, rubbing, turning
from crossbody.reference.linear._rubbing import independent
from crossbody.reference.linear.model import LinearModel

OUTPUTS = ("q", "v", "gap", "lam")


@checked_arguments
def linearise(
    system: System, q: ArrayLike, v: ArrayLike | None = None, u: ArrayLike | None = None,
    active: Sequence[int] | None = None, *, sliding: Sequence[int] = (), outputs: Sequence[str] | None = None,
    reduce: bool = False, names: Sequence[str] | None = None, t: float = 0.0, colliding: Sequence[int] = (),
    activations: ArrayLike | None = None,
) -> LinearModel:  # fmt: skip
    """First-order model dx' = A dx + B du, dy = C dx + D du of v' = M^-1 (f + H_A^T lam) about a state, lam eliminated.

    The derivatives are exact (complex step through the kernels); time is frozen at t. It
    describes small motions about an equilibrium; about a moving state it is the tangent of the
    right-hand side there. A compiled sampled controller (`System.control`) is not part of it.

    Where q' is not v (quaternions) it lives on the tangent space: n coordinates dq that change as
    the velocities act, for a quaternion the rotation vector from q in body axes, so that dq' = dv
    - v x dq about a turning state.

    Activations of actuators are states behind q and v. Where a force or a control is beyond its bounds, or an
    activation leans on an end of its range, the model is that side's: small motions that stay there.

    Contacts with friction that are on stick, unless they are among `sliding`: small motions keep them
    below their bounds. Those that slide push by mu lam_n against their velocity, wherever that turns. What
    holds a load together with others while none of them slides needs no part of its own, but has no lam.

    Args:
        system: the mechanism with the law of its rows.
        q: positions (nq,).
        v: velocities (n,), zero if not given.
        u: inputs (nu,), zero if not given; without those that stand for activations.
        active: rows that are on, all others are free; those that are always on (not unilateral), if not
            given. Tangential rows are on with their normal rows, and rows with dry friction always.
        sliding: which of these slide, by normal rows and by rows with dry friction of their own.
        outputs: which of "q", "v", "gap", "lam" make up y, in this order, gap and lam of every
            row; all of them if not given, but lam where rows share their load.
        reduce: hold the active rows at rest (dh = 0, dh' = 0) instead of following their law: a minimal
            set of states without the law's own poles (Baumgarte's double pole of a closed loop, say).
        names: of the coordinates (n,); "q[0]", ..., or "dq[0]", ... on a tangent space, if not given.
        t: time, s.
        colliding: active rows that follow their fast constants (COLLISION).
        activations: of the actuators that have one (na,); those of the start if not given.

    Returns:
        x = (q, v, a), or the part of it that remains; inputs "u[0]", ...; a velocity is named as
        its coordinate, primed, an activation "a[0]".

    Raises:
        SceneError: for a state of another shape, rows that do not exist, that are redundant here,
            or, with `reduce`, that move; and where friction has no derivative: a contact sticks
            that bears all that it can, slides at no speed, jams, or shares with others a load of
            which the law leaves open what each of them bears.
        UnknownName: for another output.
    """
    acts = driven(system, u, activations, t)
    at = point(system, q, v, acts.u, active, t, colliding, sliding, driven=True)
    if outputs is None:
        outputs = OUTPUTS[:3] if len(at.sharing) else OUTPUTS
    elif "lam" in outputs and len(at.sharing):
        raise SceneError(
            f"linearise: rows {at.sharing.tolist()} share their load, and small motions do not determine how it "
            "changes; "
            'valid: outputs without "lam".'
        )
    found = acts.widened(derivatives(at))
    n, (na, nu) = system.n, acts.B.shape
    letter, T = "q" if system.velocity is None else "dq", turning(system, t, at.q, at.v)
    chosen = tuple(f"{letter}[{i}]" for i in range(n)) if names is None else tuple(names)
    states = (*chosen, *(f"{name}'" for name in chosen), *acts.names)
    if len(chosen) != n:
        raise SceneError(f"linearise.names has {len(chosen)} entries; the system has {n} coordinates.")
    C, D, read = _outputs(system, at.active, found, outputs, states)
    own = np.hstack([np.zeros((na, 2 * n)), np.diag(acts.A)])
    model = LinearModel(
        A=np.vstack([np.hstack([T, np.eye(n), np.zeros((n, na))]), found.vd_x, own]),
        B=np.vstack([np.zeros((n, nu)), found.vd_u, acts.B]),
        C=C, D=D, states=states, inputs=tuple(f"u[{i}]" for i in range(nu)), outputs=read,
    )  # fmt: skip
    if not reduce:
        return model
    whole = np.vstack([
        np.hstack([np.abs(T), np.eye(n), np.zeros((n, na + nu))]), found.size,
        np.hstack([np.abs(own), np.abs(acts.B)]),
    ])  # fmt: skip
    held = at.active[at.solved]
    return model.restricted(np.vstack([found.gap_x[held], found.rate_x[held]]), size=whole)


def point(
    system: System, q: ArrayLike, v: ArrayLike | None, u: ArrayLike | None, active: Sequence[int] | None,
    t: float, colliding: Sequence[int] = (), sliding: Sequence[int] = (), *, driven: bool = False,
) -> Point:  # fmt: skip
    """Where to linearise, checked; `driven` where activations are known.

    Raises:
        SceneError: for a state of another shape, rows that do not exist, rows that collide or slide
            without being on, rows that slide while they share a load, or kernels that are not analytic.
    """
    check_held(system, driven=driven)
    on = np.flatnonzero(np.asarray(system.unilateral) == 0).tolist() if active is None else active
    rows = different("active", with_friction(system, on), system.nc)
    slid, rubs = different("sliding", sliding, system.nc), np.asarray(system.tangents) > 0
    if not set(slid.tolist()) <= set(rows[rubs[rows]].tolist()):
        raise SceneError(
            f"linearise.sliding is {list(sliding)}; valid: normal rows with friction of those "
            f"on, and rows with dry friction, {rows[rubs[rows]].tolist()}."
        )
    if not set(colliding) <= set(rows.tolist()):
        raise SceneError(f"linearise.colliding is {list(colliding)}; valid: rows of those on, {rows.tolist()}.")
    alpha = np.array(system.alpha)
    alpha[list(colliding)] = system.beta[list(colliding)]
    inputs: Floats = np.array(frozen("linearise", "u", np.zeros(system.inputs) if u is None else u, (system.inputs,)))
    q, v = system.checked_state("q", q), system.checked_state("v", np.zeros(system.n) if v is None else v)
    check_analytic(system, t, q, v, inputs)
    at = Point(
        system=system, t=t, q=q, v=v, u=inputs, active=rows, alpha=alpha if len(colliding) else None, sliding=slid
    )  # fmt: skip
    return independent(at) if system.frictional else at


def with_friction(system: System, active: Sequence[int]) -> list[int]:
    """Rows that are on, with the tangential ones of contacts, and those with dry friction, behind them."""
    on = list(active)
    return on + [t for t, i in rubbing(system).items() if t not in on and (i in on or i == t)]


def _outputs(
    system: System, active: Index, found: Derivatives, outputs: Sequence[str], states: tuple[str, ...]
) -> tuple[Floats, Floats, tuple[str, ...]]:
    """C, D and the names of their rows."""
    n, nu, nc = system.n, found.vd_u.shape[1], system.nc
    whole = np.eye(len(states))
    lam_x, lam_u = np.zeros((nc, len(states))), np.zeros((nc, nu))
    lam_x[active], lam_u[active] = found.lam_x, found.lam_u
    known = {
        "q": (whole[:n], np.zeros((n, nu)), states[:n]),
        "v": (whole[n : 2 * n], np.zeros((n, nu)), states[n : 2 * n]),
        "gap": (found.gap_x, np.zeros((nc, nu)), tuple(f"gap[{i}]" for i in range(nc))),
        "lam": (lam_x, lam_u, tuple(f"lam[{i}]" for i in range(nc))),
    }
    for name in outputs:
        if name not in known:
            raise UnknownName("output of linearise", name, known)
    none: tuple[str, ...] = ()
    parts = [(np.zeros((0, len(states))), np.zeros((0, nu)), none), *(known[name] for name in outputs)]
    C, D = np.vstack([part[0] for part in parts]), np.vstack([part[1] for part in parts])
    return C, D, tuple(name for part in parts for name in part[2])
