"""Linear models from Pinocchio's derivatives of the tree, with the rows by the implicit function theorem.

At an equilibrium the accelerations a and the multipliers lam of the rows that are on solve

    rnea(q, v, a) - tau(q, v) - H(q)^T lam = 0        H(q) a + gamma(q, v) = 0

with gamma = H' v + a1 h' + a0 h + a2 h^3. `computeRNEADerivatives` gives the derivative of rnea
at fixed a, `computeABADerivatives` that of a where no row is on. What Pinocchio does not know,
the forces tau and the geometry of the rows, is differenced centrally to fourth order.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin

from crossbody.cases import Case, CaseUnsupported, Mode
from crossbody.cases.arrays import Floats
from crossbody.engines._gates import Gated
from crossbody.engines.linear import Spot, Tangent, in_contact
from crossbody.engines.pinocchio._model import build
from crossbody.engines.pinocchio._native import Native
from crossbody.engines.pinocchio._rows import PinRows, mass_matrix
from crossbody.reference.linear.differences import differences

TURNED = (
    "Pinocchio 4.1.0 turns the force on the second body of a constraint nv times about the "
    "first joint's axis in ddq_dq; ddq_dv and ddq_dtau are right."
)
CLOSE = 2e-2
"""Size of coordinates of what moves among gates, for differences, SI: these are a few of it apart."""
STEP = 1e-3  # of the differences, as a part of the coordinates' sizes
Force = Callable[[Floats, Floats], Floats]  # (q, v) -> a force or an acceleration


@dataclass(frozen=True, slots=True, kw_only=True)
class Stand:
    """A model at an equilibrium, in its own coordinates.

    Attributes:
        model, data: Pinocchio's.
        q, v (nv,): state.
        force: tau (nv,), beside gravity and the rows.
        jacobian: q -> H (na, nv) of the rows that are on.
        law: (q, v) -> gamma (na,).
        size: of the coordinates, for the differences.
        more: (this, right derivative (nv, 2 nv) of v') -> other ways, in the coordinates of the model.
    """

    model: Any
    data: Any
    q: Floats
    v: Floats
    force: Force
    jacobian: Callable[[Floats], Floats]
    law: Force
    size: float = 1.0
    more: Callable[[Stand, Floats], tuple[Tangent, ...]] = lambda _stand, _right: ()

    def differenced(self, function: Force) -> Floats:
        """Derivative of a function of (q, v) by both."""
        n, x = self.model.nv, np.concatenate((self.q, self.v))
        return differences(lambda x: function(x[:n].copy(), x[n:].copy()), x, STEP * self.size)

    def outside(self) -> Floats:
        """Derivative (nv, 2 nv) of the forces beside gravity and the rows."""
        return self.differenced(self.force)


def linearise(case: Case, spot: Spot) -> tuple[Tangent, ...]:
    """What Pinocchio's derivatives make of an equilibrium of a scene."""
    stand = _stand(in_contact(case), spot)
    right = _by_rnea(stand) if spot.rows else _by_aba(stand)
    return (right, *stand.more(stand, right.slope))


def _stand(case: Case, spot: Spot) -> Stand:
    """Return the model of a scene at an equilibrium."""
    scene = build(case, "forwardDynamics")
    if scene.chart is not None:
        raise CaseUnsupported(f"Pinocchio's model of {case.mechanism!r} has other coordinates, no chart here.")
    scene.world.change(spot.t, spot.q, spot.v)
    if scene.world.clock is not None:
        scene.world.clock(spot.t)
    found = of_rows(scene.rows, spot)
    if isinstance(scene.rows.ways, Gated):
        modes = [int(Mode.CONTACT if i in spot.rows else Mode.FREE) for i in range(scene.rows.nc)]
        scene.rows.ways.begin(spot.q)
        scene.rows.ways.hold(spot.q, tuple(modes))
        found = replace(found, size=CLOSE)
    return found if scene.rows.native is None else replace(found, more=_constrained(scene.rows.native))


def _constrained(native: Native) -> Callable[[Stand, Floats], tuple[Tangent, ...]]:
    """Return what gives Pinocchio's derivatives of the constrained dynamics, and what is wrong with them."""

    def ways(stand: Stand, right: Floats) -> tuple[Tangent, ...]:
        q, v = stand.q, stand.v
        by_q, by_v, by_tau = native.derivatives(q, v, stand.force(q, v))
        found = np.hstack([by_q, by_v]) + by_tau @ stand.outside()
        lam = native.data.lambda_c.copy()
        explained = right + native.turned(q, lam, mass_matrix(stand.model, stand.data, q), stand.jacobian(q))
        way = "computeConstraintDynamicsDerivatives"
        return (Tangent(way=way, slope=found, known=TURNED, explained=explained),)

    return ways


def of_rows(rows: PinRows, spot: Spot) -> Stand:
    """The stand of a mechanism of `PinRows` at an equilibrium."""
    on, zero = list(spot.rows), rows.tau.copy()
    a0, a1, a2 = rows.slow[:, on]

    def force(q: Floats, v: Floats) -> Floats:
        if rows.forces is None:
            return zero
        rows.forces(q, v, rows.tau)
        return rows.tau.copy()

    def law(q: Floats, v: Floats) -> Floats:
        h = rows.heights(q)[on]
        gamma: Floats = rows.drift(q, v)[on] + a1 * (rows.jacobian(q)[on] @ v) + (a0 + a2 * h * h) * h
        return gamma

    return Stand(
        model=rows.model, data=rows.data, q=np.array(spot.q), v=np.array(spot.v),
        force=force, jacobian=lambda q: np.array(rows.jacobian(q)[on]), law=law,
    )  # fmt: skip


def _by_aba(stand: Stand) -> Tangent:
    """Of a tree that touches nothing."""
    model, data = stand.model, stand.data
    tau = stand.force(stand.q, stand.v)
    pin.computeABADerivatives(model, data, stand.q, stand.v, tau)
    by_q, by_v, by_tau = data.ddq_dq.copy(), data.ddq_dv.copy(), data.Minv.copy()
    by_tau = np.triu(by_tau) + np.triu(by_tau, 1).T
    return Tangent(way="computeABADerivatives", slope=np.hstack([by_q, by_v]) + by_tau @ stand.outside())


def _by_rnea(stand: Stand) -> Tangent:
    """Of a tree with rows."""
    model, data, q, v, n = stand.model, stand.data, stand.q, stand.v, stand.model.nv
    M, H = mass_matrix(model, data, q), stand.jacobian(q)
    K = np.block([[M, -H.T], [H, np.zeros((len(H), len(H)))]])
    bias = np.array(pin.nonLinearEffects(model, data, q, v))
    a, lam = np.split(np.linalg.solve(K, np.concatenate((stand.force(q, v) - bias, -stand.law(q, v)))), [n])
    pin.computeRNEADerivatives(model, data, q, v, a)
    inertial = np.hstack([data.dtau_dq, data.dtau_dv])

    def rest(q: Floats, v: Floats) -> Floats:
        H = stand.jacobian(q)
        return np.concatenate((-stand.force(q, v) - lam @ H, H @ a + stand.law(q, v)))

    residual = stand.differenced(rest)
    residual[:n] += inertial
    found: Floats = -np.linalg.solve(K, residual)[:n]
    return Tangent(way="computeRNEADerivatives, rows implicitly", slope=found)
