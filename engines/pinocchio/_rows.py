"""The deck's law through Pinocchio: J v' + gamma = 0 with gamma = H' v + a1 h' + a0 h + a2 h^3 (spec 4.3)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from crossbody.cases import Law
from crossbody.cases._arrays import Floats

Solve = Callable[[Floats, Floats, Floats, Floats], tuple[Floats, Floats]]
"""(q, v, J (na, nv), gamma (na,)) -> v' (nv,), lam (na,)."""


def by_forward_dynamics(model: Any, data: Any, tau: Floats) -> Solve:
    """Pinocchio's own solver of M v' + b = tau + J^T lam, J v' + gamma = 0 (upstream calls it unsupported)."""

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
        upper = np.triu(pin.crba(model, data, q))
        K[:nv, :nv] = upper + np.triu(upper, 1).T
        K[nv:, :nv], K[:nv, nv:] = J, J.T
        right[:nv] = tau - pin.nonLinearEffects(model, data, q, v)
        right[nv:] = -gamma
        x = np.linalg.solve(K, right)
        return x[:nv], -x[nv:]

    return solve


ALGEBRA = {"forwardDynamics": by_forward_dynamics, "kkt": by_dense_kkt}


class PinRows:
    """Rows of a mechanism; see `crossbody.engines._machines.Rows`. The engine's coordinates are the case's.

    Attributes:
        model, data: Pinocchio's.
        tau (nv,): generalised forces beside gravity and the rows, N or N m.
        jacobian: q -> H (nc, nv).
        heights: q -> h (nc,), m.
        drift: (q, v) -> H' v (nc,), m/s^2.
        law: constants of every row.
    """

    def __init__(
        self,
        model: Any,
        jacobian: Callable[[Floats], Floats],
        heights: Callable[[Floats], Floats],
        drift: Callable[[Floats, Floats], Floats],
        law: Law,
        algebra: str = "forwardDynamics",
    ) -> None:
        self.model, self.data = model, model.createData()
        self.jacobian, self.heights, self.drift = jacobian, heights, drift
        self.nc, self.unilateral = len(law.a0), law.unilateral.tolist()
        self.tau = np.zeros(model.nv)
        self.a0, self.a1, self.a2 = law.a0, law.a1, law.a2
        self._sets: dict[tuple[int, ...], Any] = {}
        self.solve = ALGEBRA[algebra](model, self.data, self.tau)

    def rigid(self) -> PinRows:
        """The same rows with h'' = 0 instead of the law."""
        self.a0 = self.a1 = self.a2 = np.zeros(self.nc)
        self._sets.clear()
        return self

    def gaps(self, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Gap and its rate of every row (nc,)."""
        return self.heights(q), self.jacobian(q) @ v

    def gap_acceleration(self, q: Floats, v: Floats, vd: Floats) -> Floats:
        """H'' of every row (nc,)."""
        total: Floats = self.jacobian(q) @ vd + self.drift(q, v)
        return total

    def accelerate(self, q: Floats, v: Floats, active: Sequence[int]) -> tuple[Floats, Floats]:
        """Acceleration (nv,) and multipliers (nc,)."""
        if not active:
            return pin.aba(self.model, self.data, q, v, self.tau), np.zeros(self.nc)
        rows, a0, a1, a2 = self._chosen(active)
        J, h = self.jacobian(q)[rows], self.heights(q)[rows]
        gamma = self.drift(q, v)[rows] + a1 * J.dot(v) + (a0 + a2 * h * h) * h
        vd, part = self.solve(q, v, J, gamma)
        if len(part) == self.nc:
            return vd, part
        lam = np.zeros(self.nc)
        lam[rows] = part
        return vd, lam

    def _chosen(self, active: Sequence[int]) -> Any:
        """The index of the active rows and their constants; made once for every set."""
        key = tuple(active)
        if key not in self._sets:
            rows = slice(None) if len(key) == self.nc else list(key)
            self._sets[key] = (rows, self.a0[rows], self.a1[rows], self.a2[rows])
        return self._sets[key]

    def strike(self, q: Floats, v: Floats, struck: Sequence[int], e: float) -> Floats:
        """Velocities behind an impact of the rows `struck` with restitution e (spec 4.3)."""
        return np.array(pin.impulseDynamics(self.model, self.data, q, v, self.jacobian(q)[list(struck)], e, 0.0))
