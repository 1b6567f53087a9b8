"""The law through Pinocchio: J v' + gamma = 0 with gamma = H' v + a1 h' + a0 h + a2 h^3."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from crossbody.cases import Case, Law, Mode
from crossbody.cases.arrays import Floats
from crossbody.engines._log import Modes
from crossbody.engines._machines import active, elastic_part

if TYPE_CHECKING:
    from crossbody.engines._gates import Gated
    from crossbody.engines.pinocchio._contacts import Ways
    from crossbody.engines.pinocchio._native import Native


Solve = Callable[[Floats, Floats, Floats, Floats], tuple[Floats, Floats]]
"""(q, v, J (na, nv), gamma (na,)) -> v' (nv,), lam (na,)."""
Chosen = Sequence[int] | slice  # indices of rows; all of them as slice(None)
Shared = Callable[[Floats, Floats, Any], Floats]
"""(lam (na,), J (na, nv), which rows may not pull (na,)) -> lam (na,) that exert the same forces."""
Forces = Callable[[Floats, Floats, Floats], None]
"""(q, v, tau): writes the generalised forces tau (nv,) beside gravity and the rows, N or N m."""
ULP = 2.3e-16
ROUNDING = 1e-13  # part of the largest term of a sum that rounding may make of the sum
SMALL = 1e-14  # part of the largest velocity below which a gap that is held stands still


def by_forward_dynamics(model: Any, data: Any, tau: Floats) -> Solve:
    """Pinocchio's own solver of M v' + b = tau + J^T lam, J v' + gamma = 0 (unsupported upstream)."""

    def solve(q: Floats, v: Floats, J: Floats, gamma: Floats) -> tuple[Floats, Floats]:
        vd = pin.forwardDynamics(model, data, q, v, tau, J, gamma, 0.0)
        return vd, np.array(data.lambda_c)

    return solve


def by_dense_kkt(model: Any, data: Any, tau: Floats) -> Solve:
    """The same equations from crba and nonLinearEffects, as one dense symmetric system."""
    nv = model.nv

    def solve(q: Floats, v: Floats, J: Floats, gamma: Floats) -> tuple[Floats, Floats]:
        size = nv + len(gamma)
        K, right = np.zeros((size, size)), np.empty(size)
        K[:nv, :nv] = mass_matrix(model, data, q)
        K[nv:, :nv], K[:nv, nv:] = J, J.T
        right[:nv] = tau - pin.nonLinearEffects(model, data, q, v)
        right[nv:] = -gamma
        x = np.linalg.solve(K, right)
        return x[:nv], -x[nv:]

    return solve


ALGEBRA = {"forwardDynamics": by_forward_dynamics, "kkt": by_dense_kkt}


def mass_matrix(model: Any, data: Any, q: Floats) -> Floats:
    """M(q) (nv, nv); crba fills the upper triangle alone."""
    full: Floats = np.array(pin.crba(model, data, q))
    below = _below(len(full))
    full[below] = full.T[below]
    return full


@cache
def _below(n: int) -> Any:
    return np.tril_indices(n, -1)


def pose(position: Any, orientation: Any) -> Any:
    """A place (3,) and a quaternion, w first and of any length above 0, as SE3."""
    w, x, y, z = orientation
    return pin.SE3(pin.Quaternion(w, x, y, z).normalized().matrix(), np.array(position))


def point_jacobian(model: Any, data: Any, joint: int, point: Floats) -> Floats:
    """Jacobian (3, nv) of the velocity of a point that a joint carries, after computeJointJacobians."""
    if joint == 0:
        return np.zeros((3, model.nv))
    found = pin.getJointJacobian(model, data, joint, pin.LOCAL_WORLD_ALIGNED)
    J = found.reshape(6, model.nv)  # of one column it is a vector
    linear: Floats = J[:3] - pin.skew(point - data.oMi[joint].translation) @ J[3:]
    return linear


class PinRows:
    """Rows of a mechanism; see `crossbody.engines._machines.Rows`.

    Attributes:
        model, data: Pinocchio's.
        tau (nv,): generalised forces beside gravity and the rows, N or N m.
        forces: writes tau for a state; None where tau is constant between changes of the inputs.
        jacobian: q -> H (nc, nv).
        heights: q -> h (nc,), m.
        drift: (q, v) -> H' v (nc,), m/s^2.
        drift_of, gradient_of: (q, v, rows) -> that of some rows, and (q, rows) -> their h and H;
            given where these cost less than those of all.
        law: constants of every row.
        near: as of `crossbody.engines._machines.Rows`.
        follows: index of the row whose mode each one shares; -1 for none.
        ways: how pairs of shapes lie to each other that may in two ways, or discrete variables
            that say which rows can be touched; None where there is none.
        native: the rows as Pinocchio's own constraints, where none ever opens; None elsewhere.
        shared: what makes multipliers of rows that depend on each other such that none pulls;
            None where rows do not.
    """

    def __init__(
        self,
        model: Any,
        jacobian: Callable[[Floats], Floats],
        heights: Callable[[Floats], Floats],
        drift: Callable[[Floats, Floats], Floats],
        law: Law,
        algebra: str = "forwardDynamics",
        follows: Sequence[int] = (),
        forces: Forces | None = None,
        drift_of: Callable[[Floats, Floats, Chosen], Floats] | None = None,
        gradient_of: Callable[[Floats, Chosen], tuple[Floats, Floats]] | None = None,
    ) -> None:
        self.model, self.data = model, model.createData()
        self.jacobian, self.heights, self.drift, self.forces = jacobian, heights, drift, forces
        self.drift_of = drift_of or (lambda q, v, rows: drift(q, v)[rows])
        self.gradient_of = gradient_of or (lambda q, rows: (heights(q)[rows], jacobian(q)[rows]))
        self.nc = len(law.a0)
        self.unilateral: Sequence[bool] = law.unilateral.tolist()
        self.follows: Sequence[int] = tuple(follows) or (-1,) * self.nc
        self.near: Floats = np.full(self.nc, np.inf)
        self.tau = np.zeros(model.nv)
        self.slow = np.stack((law.a0, law.a1, law.a2))
        self.fast: Sequence[bool] = (law.b0 > 0.0).tolist()
        quick = np.stack((law.b0, law.b1, np.zeros(self.nc)))
        self.entered = np.where(law.b0 > 0.0, quick, self.slow)  # what a row has that is just entered
        self._sets: dict[Modes, Any] = {}
        self.ways: Ways | Gated | None = None
        self.shared: Shared | None = None
        self.native: Native | None = None
        self.solve = ALGEBRA[algebra](model, self.data, self.tau)

    def rigid(self) -> PinRows:
        """The same rows with h'' = 0 instead of the law."""
        self.slow = self.entered = np.zeros((3, self.nc))
        self.fast = [False] * self.nc
        self._sets.clear()
        return self

    def gaps(self, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Gap and its rate of every row (nc,)."""
        h, H = self.gradient_of(q, slice(None))
        return np.array(h), H @ v

    def pressure(
        self, q: Floats, v: Floats, vd: Floats, rows: Chosen = slice(None)
    ) -> tuple[Floats, Floats]:  # fmt: skip
        """-(h'' + law) of rows if they were entered now (n,), and its rounding (n,), m/s^2."""
        (h, H), (a0, a1, a2) = self.gradient_of(q, rows), self.entered[:, rows]
        hdd, spring, damper = H @ vd + self.drift_of(q, v, rows), (a0 + a2 * h * h) * h, a1 * (H @ v)
        state = 8 * ULP * (a0 * np.abs(q).max() + a1 * np.abs(v).max())
        noise: Floats = ROUNDING * (np.abs(hdd) + np.abs(spring) + np.abs(damper)) + state
        return -(hdd + spring + damper), noise

    def delassus(self, q: Floats) -> Floats:
        """G = H M^-1 H^T (nc, nc)."""
        H = self.jacobian(q)
        return H @ np.linalg.solve(mass_matrix(self.model, self.data, q), H.T)

    def elastic(self, q: Floats, v: Floats) -> Floats:
        """max(b1, sqrt(b0)) |h'| + b0 |h| of every row (nc,), m/s^2."""
        h, hd = self.gaps(q, v)
        return elastic_part(self.entered[:2], h, hd)

    def accelerate(self, q: Floats, v: Floats, modes: Modes) -> tuple[Floats, Floats]:
        """Acceleration (nv,) and multipliers (nc,)."""
        if self.forces is not None:
            self.forces(q, v, self.tau)
        if self.native is not None:
            return self.native.accelerate(q, v, self.tau)
        rows, one_sided, a0, a1, a2 = self._chosen(modes)
        if rows is None:
            return pin.aba(self.model, self.data, q, v, self.tau), np.zeros(self.nc)
        h, J = self.gradient_of(q, rows)
        gamma = self.drift_of(q, v, rows) + a1 * J.dot(v) + (a0 + a2 * h * h) * h
        vd, part = self.solve(q, v, J, gamma)
        if self.shared is not None and np.min(part[one_sided], initial=0.0) < 0.0:
            part = self.shared(part, J, one_sided)
        if len(part) == self.nc:
            return vd, part
        lam = np.zeros(self.nc)
        lam[rows] = part
        return vd, lam

    def _chosen(self, modes: Modes) -> Any:
        """The index of the active rows and the constants of their modes; made once for every set of modes."""
        if (found := self._sets.get(modes)) is None:
            on = list(active(modes))
            rows = None if not on else slice(None) if len(on) == self.nc else on
            law = np.where([m == Mode.COLLISION for m in modes], self.entered, self.slow)
            found = self._sets[modes] = (rows, np.array(self.unilateral, dtype=bool)[on], *law[:, on])
        return found

    def strike(self, q: Floats, v: Floats, struck: Sequence[int], e: Sequence[float]) -> tuple[Floats, Floats]:
        """Velocities behind an impact of the rows `struck`, and their impulses (ns,), N s: H v+ = -e H v.

        impulseDynamics knows one restitution: where rows differ, the same equations are solved densely.

        Args:
            q: positions.
            v: velocities before it.
            struck: rows that may carry an impulse.
            e: restitution of each of them; one that is held, H v = 0, may have any.
        """
        J = self.jacobian(q)[list(struck)]
        bounce = {b for b, rate in zip(e, J @ v, strict=True) if b > 0.0 and rate != 0.0}
        rigid = all(b > 0.0 or abs(rate) <= SMALL * np.abs(v).max() for b, rate in zip(e, J @ v, strict=True))
        if not bounce or (len(bounce) == 1 and rigid):
            after = pin.impulseDynamics(self.model, self.data, q, v, J, max(bounce, default=0.0), 0.0)
            return np.array(after), np.array(self.data.impulse_c)
        X = np.linalg.solve(mass_matrix(self.model, self.data, q), J.T)
        p: Floats = np.asarray(np.linalg.solve(J @ X, -(1.0 + np.array(e)) * (J @ v)))
        return v + X @ p, p


def audit(case: Case, rows: PinRows, constants: Mapping[str, Any]) -> Mapping[str, Any]:
    """Numbers read back from the model, and M(q), bias(q, v), H(q) and lam(q, v) of all rows together.

    lam has no bound: it is what the law of a row just entered asks for, negative where the row would pull.
    """
    model, data = rows.model, rows.data

    on = tuple(int(Mode.COLLISION if fast else Mode.CONTACT) for fast in rows.fast)
    return {
        "masses": np.array([inertia.mass for inertia in model.inertias[1:]]),
        "gravity": float(np.linalg.norm(model.gravity.linear)),
        "constants": constants,
        "q0": case.q0,
        "v0": case.v0,
        "M": lambda q: mass_matrix(model, data, q),
        "bias": lambda q, v: np.array(pin.nonLinearEffects(model, data, q, v)),
        "H": rows.jacobian,
        "lam": lambda q, v: rows.accelerate(q, v, on)[1],
    }
