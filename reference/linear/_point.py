"""Where a mechanism is linearised, and its terms there, in real and complex numbers."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from crossbody.cases import SceneError
from crossbody.cases.control import Control
from crossbody.reference._system import System
from crossbody.reference.kinds import Array, Floats, Index
from crossbody.reference.linear.differences import differences

STEP = 1e-30
SLOW = 1e-9
TIMES = (1e-2, 1e-3, 1e-4, 1e-5)  # steps of differences in time, s, near its start
NO_ROWS: Index = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Point:
    """Where a mechanism is linearised.

    Attributes:
        system: the mechanism.
        t: time, s.
        q (nq,), v (n,), u (nu,): state and inputs.
        active (na,): the rows that are on.
        p: parameters in place of the system's own; complex for a step in one of them.
        alpha (nc, 3), friction (nc,), drift (nc,): in force in place of the system's own.
        sliding: contacts that slide, by their normal rows, and rows that do so against dry
            friction of their own.
        way (nc,): by tangential row, the direction in which one slides whatever its velocity; NaN
            where that says it.
        emerging: contacts that slide in space at hardly any speed, in the direction of their acceleration.
        spins (k,): rates at which the directions of what emerges turn, rad/s; 0 if not given.
        slow: part of its terms below which a slip velocity has no direction.
        idle: rows that follow from the other active ones, which hold them.
        sharing: these and those that they follow from, but for rows that nothing moves.
        held: places in `active` of the idle rows.
        solved: places in `active` of the rows that are solved for: neither idle nor tangential
            ones of what slides.
        slid: every contact that slides, with the places of its normal row, -1 for dry friction,
            and of its tangents.
    """

    system: System
    t: float
    q: Floats
    v: Floats
    u: Floats
    active: Index
    p: Array | None = None
    alpha: Array | None = None
    friction: Array | None = None
    drift: Array | None = None
    sliding: Index = field(default_factory=lambda: NO_ROWS)
    way: Array | None = None
    emerging: Index = field(default_factory=lambda: NO_ROWS)
    spins: Floats | None = None
    slow: float = SLOW
    idle: Index = field(default_factory=lambda: NO_ROWS)
    sharing: Index = field(default_factory=lambda: NO_ROWS)
    held: Index = field(init=False)
    solved: Index = field(init=False)
    slid: tuple[tuple[int, int, Index], ...] = field(init=False)

    def __post_init__(self) -> None:
        """Find the rows that are solved for."""
        held = np.flatnonzero(np.isin(self.active, self.idle)) if len(self.idle) else NO_ROWS
        where = {i: k for k, i in enumerate(self.active.tolist())} if len(self.sliding) else {}
        slid = tuple((i, -1 if self.system.dry[i] else where[i], self.tangents(i)) for i in self.sliding.tolist())
        off = np.concatenate([held, *(places for _, _, places in slid)])
        object.__setattr__(self, "slid", slid)
        object.__setattr__(self, "held", held)
        object.__setattr__(self, "solved", np.delete(np.arange(len(self.active)), off))

    def given(self, name: str) -> Array:
        """What is in force: p, alpha, friction or drift."""
        own = getattr(self, name)
        return np.asarray(getattr(self.system, name) if own is None else own)

    def tangents(self, i: int) -> Index:
        """Places in `active` of the tangential rows of contact i."""
        first, count = int(self.system.tangent[i]), int(self.system.tangents[i])
        return np.flatnonzero((self.active >= first) & (self.active < first + count))


def check_frictionless(system: System) -> None:
    """Refuse contacts with friction.

    Raises:
        SceneError: if there are any.
    """
    if system.frictional:
        raise SceneError(
            "The system has friction (System.mu, System.friction_loss). Derivatives at many states and "
            "estimates of forces exist only for systems without it; valid: linearise, trim, sensitivity."
        )


def check_held(system: System, *, driven: bool = False) -> None:
    """Refuse a system whose inputs follow from its state in a way that has no derivative.

    Raises:
        SceneError: if a controller in Python gives its inputs, or some of them are activations.
    """
    if system.activations is not None and not driven:
        raise SceneError(
            "Actuators with an activation have a state in addition to q and v, which only linearise supports."
        )
    if isinstance(system.control, Control):
        raise SceneError(
            f"System.control is the controller {system.control.label} in Python, which has no derivatives; "
            "valid: the system without it, its inputs held."
        )


def check_coordinates(system: System) -> None:
    """Refuse a system whose positions are not integrals of its velocities, where the tangent space is not enough.

    Raises:
        SceneError: if so, or as `check_held`.
    """
    check_held(system)
    check_frictionless(system)
    if system.velocity is not None:
        raise SceneError(
            "System.velocity is given: q' is not v. Derivatives at many states and estimates "
            "of forces exist only for systems whose velocities are the derivatives of their positions; valid: "
            "linearise, sensitivity."
        )


def rubbing(system: System) -> dict[int, int]:
    """The contact of every tangential row, by its normal row, and of every row with dry friction, which is its own."""
    first, count = np.asarray(system.tangent), np.asarray(system.tangents)
    return {t: i for i in np.flatnonzero(count).tolist() for t in range(first[i], first[i] + count[i])}


def directions(system: System, q: Floats) -> Floats:
    """N (nq, n): how positions change with the coordinates dq of the tangent space at q, which change as v acts."""
    if system.velocity is None:
        return np.eye(system.n)
    return np.stack([system.displacement(q, e) for e in np.eye(system.n)], axis=-1)


def turning(system: System, t: float, q: Floats, v: Floats) -> Floats:
    """T (n, n) of dq' = T dq + dv along a motion: the tangent space moves with it; 0 where q' = v, and at rest.

    With q' = F(q, v) = N(q) v + r(q) and a deviation N dq of the positions, N dq' = (dF/dq) N dq
    - (dN/dt) dq + N dv, which for a quaternion is dq' = dv - v x dq. Both derivatives are complex
    steps through the kernel.
    """
    n = system.n
    if system.velocity is None or not v.any():
        return np.zeros((n, n))
    N, p = directions(system, q), np.asarray(system.p).astype(complex)

    def along(d: Floats, at: Floats) -> Floats:
        """Derivative of F(q, at) along positions d."""
        out = np.zeros(system.nq, complex)
        system.velocity(t, q + 1j * STEP * d, at.astype(complex), p, out)
        return np.asarray(out.imag / STEP)

    flow, still = system.rates(q, v, t), np.zeros(n)
    bent = [along(N[:, k], v) - along(flow, e) + along(flow, still) for k, e in enumerate(np.eye(n))]
    return np.asarray(np.linalg.lstsq(N, np.stack(bent, axis=-1), rcond=None)[0], dtype=np.float64)


def terms(at: Point, q: Array, v: Array, u: Array) -> tuple[Array, Array, Array, Array, Array]:
    """M in blocks (n/k, k, k), f, and of the active rows H, h, H' v; in the type of the state."""
    system, na, given = at.system, len(at.active), at.given("p")
    kind = np.result_type(q, v, u, given)
    p, w = given.astype(kind), np.zeros(system.scratch, kind)
    blocks, f = np.zeros((system.n, system.mass_block), kind), np.zeros(system.n, kind)
    H, h, drift = np.zeros((na, system.n), kind), np.zeros(na, kind), np.zeros(na, kind)
    q, v, u = q.astype(kind), v.astype(kind), u.astype(kind)
    system.dynamics(at.t, q, v, u, p, blocks, f, w)
    system.rows(at.t, q, v, p, w, at.active, na, H, h, drift)
    return blocks.reshape(-1, system.mass_block, system.mass_block), f, H, h, drift


def force_rate(at: Point) -> Floats:
    """Derivative of f by the time that kernels read, at a fixed state (n,): by differences, exactly 0 without any.

    Of a ladder of steps the one counts that agrees best with the next longer one.
    """

    def f(t: Floats) -> Floats:
        return np.asarray(terms(replace(at, t=float(t[0])), at.q, at.v, at.u)[1], dtype=np.float64)

    here, longest = np.array([at.t]), TIMES[0] * (1.0 + abs(at.t))
    if all(np.array_equal(f(here), f(here + sign * longest)) for sign in (1.0, -1.0)):
        return np.zeros(at.system.n)
    tried = [differences(f, here, part * (1.0 + abs(at.t)))[:, 0] for part in TIMES]
    return min(pairwise(tried), key=lambda two: np.abs(two[1] - two[0]).max())[1]


def dense(blocks: Array) -> Array:
    """The block-diagonal matrix (n, n)."""
    count, k, _ = blocks.shape
    M = np.zeros((count, k, count, k), blocks.dtype)
    each = np.arange(count)
    M[each, :, each, :] = blocks
    return M.reshape(count * k, count * k)


def gaps(at: Point, q: Array, v: Array) -> Array:
    """Gaps and rates of all rows (2 nc,)."""
    given = at.given("p")
    kind, nc = np.result_type(q, v, given), at.system.nc
    h, hd = np.zeros(nc, kind), np.zeros(nc, kind)
    at.system.gaps(at.t, q.astype(kind), v.astype(kind), given.astype(kind), h, hd)
    return np.concatenate([h, hd])
