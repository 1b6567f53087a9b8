"""Points, and axes, of two bodies that meet or stay within a distance, by Pinocchio's own kinematics; dependent rows.

Points: h = x1 - x2, H = J1 - J2, H' v = their accelerations at v' = 0. Axes: with the quaternion
(e0, e) of R2' R1 and A = s/2 (e0 1 - [e]x) R2', h = s e, H = A (J1 - J2) of the angular
velocities w1, w2, and at v' = 0

    H' v = A (w1' - w2' - w2 x w1) - s/4 |w1 - w2|^2 e
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from crossbody.cases.arrays import Floats
from crossbody.cases.scene import UPRIGHT, Loop, Tendon
from crossbody.engines.nearest import cross as crossed
from crossbody.engines.pinocchio._contacts import carried, poses_of
from crossbody.engines.pinocchio._rows import ROUNDING, Solve, pose

PULLS = (ROUNDING, *10.0 ** np.arange(-12.0, 1.0))  # parts of the largest multiplier
NO_SUCH = 1e-10  # residual below which inequalities have no solution
DEPENDENT = 1e-7  # singular value of the rows, over the largest, that counts as zero
NEAR = (1e-8, 1e-4)  # what a row adds to the others, over the first: below it follows, above it holds by itself
AXES = pin.LOCAL_WORLD_ALIGNED


class Joined:
    """Rows of the loops in space: three of points, and three of axes where it is a weld.

    A copy of Pinocchio's model gets a frame for every end.
    """

    def __init__(self, model: Any, placed: dict[str, tuple[int, Any]], loops: Sequence[Loop]) -> None:
        self.loops, self.model = loops, model.copy()
        self.ends = [
            (
                _end(self.model, placed[loop.first], loop.first_position, loop.orientation),
                _end(self.model, placed[loop.second], loop.second_position, UPRIGHT),
            )
            for loop in loops
        ]
        self.data, self.none = self.model.createData(), np.zeros(model.nv)

    def heights(self, q: Floats) -> Floats:
        """Return h (rows,)."""
        pin.framesForwardKinematics(self.model, self.data, q)
        return self._heights()

    def gradients(self, q: Floats) -> tuple[Floats, Floats]:
        """Return h (rows,) and H (rows, nv)."""
        model, data = self.model, self.data
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)

        def of_both(one: int, two: int) -> Floats:
            return _velocity_of(model, data, one) - _velocity_of(model, data, two)

        H = self._stacked(
            lambda one, two: of_both(one, two)[:3],
            lambda one, two, scale: scale * self._map(one, two) @ of_both(one, two)[3:],
        )
        return self._heights(), H.reshape(-1, model.nv)

    def drift(self, q: Floats, v: Floats) -> Floats:
        """Return H' v (rows,)."""
        model, data = self.model, self.data
        moving(model, data, q, v, self.none)

        def bent(one: int, two: int, scale: float) -> Floats:
            w1, w2 = (pin.getFrameVelocity(model, data, end, AXES).angular for end in (one, two))
            c1, c2 = (pin.getFrameClassicalAcceleration(model, data, end, AXES).angular for end in (one, two))
            own = self._map(one, two) @ (c1 - c2 - cross(w2, w1))
            bent: Floats = scale * (own - 0.25 * (w1 - w2) @ (w1 - w2) * self._between(one, two)[1])
            return bent

        def pulled(end: int) -> Floats:
            found: Floats = pin.getFrameClassicalAcceleration(model, data, end, AXES).linear
            return found

        return self._stacked(lambda one, two: pulled(one) - pulled(two), bent)

    def _heights(self) -> Floats:
        poses = self.data.oMf
        return self._stacked(
            lambda one, two: poses[one].translation - poses[two].translation,
            lambda one, two, scale: scale * self._between(one, two)[1],
        )

    def _stacked(
        self, points: Callable[[int, int], Floats], axes: Callable[[int, int, float], Floats]
    ) -> Floats:  # fmt: skip
        """Return what each loop's rows are, one below the other."""
        parts: list[Floats] = []
        for loop, (one, two) in zip(self.loops, self.ends, strict=True):
            parts += [points(one, two)] + ([axes(one, two, loop.torque_scale)] if loop.type == "weld" else [])
        return np.concatenate(parts)

    def _between(self, one: int, two: int) -> tuple[float, Floats]:
        """Return e0 and e of the first's axes seen from the second's."""
        poses = self.data.oMf
        x, y, z, w = pin.Quaternion(poses[two].rotation.T @ poses[one].rotation).coeffs()
        sign = 1.0 if w >= 0.0 else -1.0
        return sign * w, sign * np.array([x, y, z])

    def _map(self, one: int, two: int) -> Floats:
        """Return A over the torque scale."""
        e0, e = self._between(one, two)
        found: Floats = 0.5 * (e0 * np.eye(3) - pin.skew(e)) @ self.data.oMf[two].rotation.T
        return found


def cross(a: Floats, b: Floats) -> Floats:
    """Return a x b of two vectors (3,): a tenth of the time that NumPy's takes of arrays of any shape."""
    (a0, a1, a2), (b0, b1, b2) = a.tolist(), b.tolist()
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


def moving(model: Any, data: Any, q: Floats, v: Floats, none: Floats) -> None:
    """Let the frames move with v, and with no more acceleration (nv,) than that makes of itself."""
    pin.forwardKinematics(model, data, q, v, none)
    pin.updateFramePlacements(model, data)


def _velocity_of(model: Any, data: Any, end: int) -> Floats:
    """Return the Jacobian (6, nv) of the velocity of a frame, after computeJointJacobians."""
    found: Floats = pin.getFrameJacobian(model, data, end, AXES).reshape(6, -1)  # of one column it is a vector
    return found


class Spans:
    """Distances of two points: lengths, and their derivatives along Pinocchio's velocities.

    With W = v2 - v1 of the points and n from the first to the second, W_t what of W is not along n:

        d' = n.W,    d'' at v' = 0 = n.(a2 - a1) + |W_t|^2 / d

    Args:
        model, placed: as of `Joined`.
        tendons: those between points.
    """

    def __init__(self, model: Any, placed: dict[str, tuple[int, Any]], tendons: Sequence[Tendon]) -> None:
        self.model, self.data = model, model.createData()
        points = [tuple(zip(tendon.bodies, tendon.positions, strict=True)) for tendon in tendons]
        known = list(dict.fromkeys(point for pair in points for point in pair))
        ends = [(placed[body][0], placed[body][1] * pose(place, UPRIGHT)) for body, place in known]
        which = [[known.index(point) for point in pair] for pair in points]
        self.one, self.two = np.array(which, dtype=int).reshape(-1, 2).T
        self.joints, self.arms = [joint for joint, _ in ends], np.array([at.translation for _, at in ends])
        self.moving = np.array([carried(model, joint) for joint in self.joints])

    def _apart(self) -> tuple[Floats, Floats, Floats]:
        """Return the points of the ends (ne, 3), distances (nt,), directions from first to second (nt, 3)."""
        turned, origins = poses_of(self.data, self.joints)
        arms = (turned @ self.arms[:, :, None])[:, :, 0]
        # What moves alike stays as far apart to the last bit: bodies that hang side by side touch, or do not.
        way = self._between(origins) + self._between(arms)
        d = np.sqrt((way * way).sum(axis=1))
        return origins + arms, d, way / d[:, None]

    def _between(self, points: Floats) -> Floats:
        """Return the ways (nt, 3) from the first to the second ends."""
        return points.take(self.two, 0) - points.take(self.one, 0)

    def lengths(self, q: Floats) -> Floats:
        """Return l (nt,)."""
        pin.forwardKinematics(self.model, self.data, q)
        return self._apart()[1]

    def __call__(self, q: Floats) -> tuple[Floats, Floats]:
        """Return l (nt,) and dl/dv (nt, nv): an end's n.v is n.(linear) + (x cross n).(angular)."""
        pin.computeJointJacobians(self.model, self.data, q)
        points, d, n = self._apart()
        J = self.data.J.reshape(6, -1)  # of one column it is a vector

        linear = n @ J[:3]

        def along(ends: Any) -> Floats:
            found: Floats = self.moving.take(ends, 0) * (linear + crossed(points.take(ends, 0), n) @ J[3:])
            return found

        return d, along(self.two) - along(self.one)

    def bend(self, q: Floats, v: Floats) -> Floats:
        """Return d'' at v' = 0 (nt,)."""
        pin.computeJointJacobiansTimeVariation(self.model, self.data, q, v)
        points, d, n = self._apart()
        own = self.moving * v
        twist, change = (own @ part.reshape(6, -1).T for part in (self.data.J, self.data.dJ))
        rate = twist[:, :3] + crossed(twist[:, 3:], points)
        bent = change[:, :3] + crossed(change[:, 3:], points) + crossed(twist[:, 3:], rate)
        W, a = self._between(rate), self._between(bent)
        across = W - (n * W).sum(axis=1)[:, None] * n
        total: Floats = (n * a).sum(axis=1) + (across * across).sum(axis=1) / d
        return total


class Strings:
    """Bounds of the distances of two points, in the order of the scene's tendons, the lower one first."""

    def __init__(self, model: Any, placed: dict[str, tuple[int, Any]], tendons: Sequence[Tendon]) -> None:
        self.spans = Spans(model, placed, tendons)
        rows = [
            (i, sign, bound + sign * tendon.margin)
            for i, tendon in enumerate(tendons)
            for sign, bound in zip((1.0, -1.0), tendon.range, strict=True)
            if np.isfinite(bound)
        ]
        of, self.sign, self.bound = np.array(rows).reshape(-1, 3).T
        self.of = of.astype(int)

    @property
    def chained(self) -> bool:
        """Whether the ends move apart from each other, or as one, and bounds make no ring of them."""
        from scipy.sparse import coo_array  # which takes longer to import than most runs
        from scipy.sparse.csgraph import connected_components

        kinds, group = np.unique(self.spans.moving, axis=0, return_inverse=True)
        one, two = (group[ends][self.of] for ends in (self.spans.one, self.spans.two))
        joined = connected_components(coo_array((np.ones(len(one)), (one, two)), (len(kinds),) * 2), directed=False)[0]
        return bool((np.count_nonzero(kinds, axis=0) <= 1).all()) and len(one) == len(kinds) - joined

    def heights(self, q: Floats) -> Floats:
        """Return h (rows,)."""
        found: Floats = self.sign * (self.spans.lengths(q)[self.of] - self.bound)
        return found

    def gradients(self, q: Floats) -> tuple[Floats, Floats]:
        """Return h (rows,) and H (rows, nv)."""
        lengths, rows = self.spans(q)
        return self.sign * (lengths[self.of] - self.bound), self.sign[:, None] * rows[self.of]

    def drift(self, q: Floats, v: Floats) -> Floats:
        """Return H' v (rows,)."""
        found: Floats = self.sign * self.spans.bend(q, v)[self.of]
        return found


def _end(model: Any, placed: tuple[int, Any], position: Any, orientation: Any) -> int:
    """Return the number of a new frame at a pose on a body."""
    joint, where = placed
    frame = pin.Frame(f"end {model.nframes}", joint, where * pose(position, orientation), pin.FrameType.OP_FRAME)
    number: int = model.addFrame(frame)
    return number


def loose_rows(A: Floats, widths: Sequence[int], rank: int) -> tuple[list[int], float]:
    """Return which rows of loops are left out, and the singular value over the largest that counts as zero.

    By Gram and Schmidt, each time the row that is longest behind those before it: what is nearly
    dependent is left out (what follows but for rounding is not: the least norm deals with it), or
    all that is beyond a rank.

    Args:
        A: H M^-1/2 of the loops (rows, nv) where they are closed.
        widths: rows of each loop; they are scaled by one length.
        rank: how many hold; below 0 those that surely do.
    """
    left = np.concatenate(
        [part / (np.linalg.norm(part, axis=1).max() or 1.0) for part in np.split(A, np.cumsum(widths)[:-1])]
    )
    order: list[int] = []
    pivots: list[float] = []
    while len(order) < len(A):
        sizes = np.linalg.norm(left, axis=1)
        sizes[order] = -1.0
        order.append(int(np.argmax(sizes)))
        pivots.append(float(sizes[order[-1]]) / (pivots[0] if pivots else 1.0))
        way = left[order[-1]] / (sizes[order[-1]] or 1.0)
        left = left - np.outer(left @ way, way)
    if rank >= 0:
        return order[rank:], min(DEPENDENT, 1e-2 * min(pivots[1:rank], default=1.0))
    near = [row for row, pivot in zip(order[1:], pivots[1:], strict=True) if NEAR[0] <= pivot < NEAR[1]]
    return near, DEPENDENT


def by_least_norm(
    model: Any, data: Any, tau: Floats, left_out: Sequence[int] = (), dependent: float = DEPENDENT
) -> Solve:  # fmt: skip
    """The same equations where rows may depend on each other: v' is unique, lam the least.

    Among the first rows some are left out and do not hold; a singular value of the rows counts as
    zero below `dependent` times the largest.
    """

    @cache
    def holding(count: int) -> NDArray[np.intp]:
        return np.setdiff1d(np.arange(count), left_out)

    def solve(q: Floats, v: Floats, J: Floats, gamma: Floats) -> tuple[Floats, Floats]:
        holds = holding(len(J))
        root = np.linalg.cholesky(pin.crba(model, data, q).T)  # which reads what is below the diagonal alone
        right = np.vstack([tau - pin.nonLinearEffects(model, data, q, v), J[holds]])
        parts = np.linalg.solve(root, right.T)
        free, A = parts[:, 0], parts[:, 1:].T
        U, s, Vt = np.linalg.svd(A, full_matrices=False)
        kept = s > dependent * s[0]
        missing = -gamma[holds] - A @ free
        wanted = U[:, kept].T @ missing / s[kept]
        vd = np.linalg.solve(root.T, free + Vt[kept].T @ wanted)
        lam = np.zeros(len(J))
        lam[holds] = U[:, kept] @ (wanted / s[kept])
        return vd, lam

    return solve


def none_pulling(lam: Floats, J: Floats, one_sided: Sequence[bool]) -> Floats:
    """Return the least multipliers that exert the forces of these, none of a one-sided row below zero.

    Args:
        lam: multipliers (na,) of rows that depend on each other.
        J: the rows (na, nv).
        one_sided: which of them may not pull.

    Returns:
        They (na,). Where rows have to let go none is such: they pull by as little as they must, to a factor of ten, as
        the instant at which they let go is where that begins.
    """
    _, s, Vt = np.linalg.svd(J.T)
    free = Vt[int((s > DEPENDENT * s[0]).sum()) :].T  # what multipliers may change by without another force
    # The multiplier of a row that none of these has is unique: it may be as small as it likes beside the others.
    pushing = np.asarray(one_sided) & (np.abs(free).max(axis=1, initial=0.0) > DEPENDENT)
    least = lam - free @ (free.T @ lam)
    largest = float(np.abs(least).max(initial=0.0))
    for pull in PULLS:
        shifted = _at_least(-pull * largest, least, free, pushing)
        if shifted is not None:
            shifted[pushing] = np.maximum(shifted[pushing], (ROUNDING - pull) * largest)
            return shifted
    return lam


def _at_least(bound: float, least: Floats, free: Floats, pushing: Floats) -> Floats | None:
    """Return the multipliers (na,) nearest to the least ones with those that push at a bound or above, if any are."""
    G, h = free[pushing], bound - least[pushing]
    size = float(h.max(initial=0.0))
    if size <= 0.0:
        return least
    E, target = np.vstack([G.T, h / size]), np.append(np.zeros(free.shape[1]), 1.0)
    from scipy.optimize import nnls  # which takes longer to import than most runs

    found, off = nnls(E, target)  # the least x with G x >= h: Lawson and Hanson 1974, ch. 23
    if off < NO_SUCH:
        return None
    tight = found > 0.0  # to rounding, where nnls is to a tolerance
    shifted: Floats = least + free @ np.linalg.lstsq(G[tight], h[tight], rcond=DEPENDENT)[0]
    return shifted
