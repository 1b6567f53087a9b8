"""Scenes with friction in Pinocchio: time stepping with impulses in cones from ADMM, first order in the step.

v+ = v + M^-1 (dt (tau - b) + J^T p)        p in the cones, J v+ + (0, 0, e J_n v) in their duals (de Saxce)

A place takes part where its gap is closed half a step ahead (Moreau and Jean); restitution is
Newton's, and positions go with the mean of both velocities.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from crossbody.cases import Case
from crossbody.cases.arrays import Floats
from crossbody.engines._contacts import Poses, Touches
from crossbody.engines._rubbing import AT_BOUND, RIGID, Push, steps_of
from crossbody.engines.nearest import Pose
from crossbody.engines.pinocchio._model import Bodies, Gaps, mechanics, observer
from crossbody.engines.pinocchio._rows import mass_matrix, point_jacobian

RESTS = 1e-12  # gap, m, below which a place counts as closed: rounding of places that rest
WORST = 1e-6  # largest residual of the conditions, m/s, recomputed here, that still counts as solved
LIFT = np.array([0.0, 0.0, 1.0])
Places = tuple[Touches, list[Floats], Floats]
"""Where rows touch, frames with the normal last, and coefficients of friction (k,)."""


class Cones:
    """A `Stepper` of a scene with friction, with a restitution of every row; settings: dt, tol."""

    def __init__(self, case: Case, used: Mapping[str, Any], e: Sequence[float]) -> None:
        assert case.scene is not None
        self.case, self.bodies, self.dt = case, Bodies(case.scene), steps_of(case, float(used["dt"]))[1]
        own = self.bodies
        self.gaps = Gaps(case.scene, own.forces, (own.model, own.placed), own.to)
        self.touching = self.gaps.touching.contacts
        self.e = np.array(e[self.gaps.own :][: self.touching.count])
        self.carriers = [own.placed[body][0] for body in self.touching.bodies]
        self.observed = observer(case.scene, own, self.gaps.recorded)
        self.tau = np.zeros(own.model.nv)
        self.options = pin.ADMMSolverSettings()
        for name in ("feasibility_tol", "complementarity_tol"):
            setattr(self.options, f"absolute_{name}", float(used["tol"]))
            setattr(self.options, f"relative_{name}", 0.0)
        self.start()

    def start(self) -> tuple[Floats, Floats]:
        """See `Stepper`."""
        own = self.bodies
        own.forces.begin(self.case.act0)
        self.iterations = self.unsolved = 0
        self.q, self.u = own.to.theirs(self.case.q0), np.array(self.case.v0)
        pin.forwardKinematics(own.model, own.data, self.q)
        return self.case.q0, self.case.v0

    def change(self, values: Floats, t: float) -> None:
        """See `Stepper`."""
        self.bodies.forces.change(values, t)

    def step(self, t: float) -> tuple[Floats, Floats, list[Push]]:
        """See `Stepper`."""
        own, q, dt = self.bodies, self.q, self.dt
        model, data, to, v = own.model, own.data, own.to, own.to.back(self.q, self.u)
        own.forces.t = t
        own.apply(q, v, self.tau)
        bias = pin.nonLinearEffects(model, data, q, v)
        M = mass_matrix(model, data, q)
        # In Pinocchio's axes, which turn with a free body, what goes straight would gain speed in every step.
        new = v + dt * (np.linalg.solve(M, self.tau - bias) + to.back(q, to.bend(q, v)))
        closed = np.flatnonzero(self.gaps.touching.heights(self._moved(0.5 * dt, self.u)) <= RESTS)
        pushes: list[Push] = []
        if len(closed):
            met, turns, J = self._places(q, closed.tolist())
            bounce = np.zeros(len(J))
            bounce[2::3] = self.e[closed] * np.minimum((J @ v)[2::3], 0.0)
            mu = np.array([self.touching.all[self.touching.rows[row][0]].friction for row in closed])
            p = self._impulses((met, turns, mu), J @ new + bounce)
            new = new + np.linalg.solve(M, J.T @ p)
            p = p.reshape(-1, 3)
            self.unsolved += not _solved(p, (J @ new + bounce).reshape(-1, 3), mu)
            pushes = self._pushes((met, turns, mu), p / dt, closed.tolist())
        u = to.velocities(q, new)
        self.q, self.u = self._moved(dt, 0.5 * (self.u + u)), u
        pin.forwardKinematics(model, data, self.q)
        return to.ours(self.q), u, pushes

    def _moved(self, dt: float, u: Floats) -> Floats:
        """Return Pinocchio's positions behind a time dt, s, with steady velocities u of the scene."""
        to = self.bodies.to
        found: Floats = pin.integrate(self.bodies.model, self.q, dt * to.back(self.q, u))
        for at, first in to.frees:  # straight, not along a screw
            found[at : at + 3] = self.q[at : at + 3] + dt * u[first : first + 3]
        to.normalise(found)
        return found

    def _places(self, q: Floats, rows: Sequence[int]) -> tuple[Touches, list[Floats], Floats]:
        """Return where rows touch, their frames with the normal last, and J (3 k, nv) of the second over the first."""
        own = self.bodies
        met = self.touching.touches(self.pose_at(q), rows)
        pin.computeJointJacobians(own.model, own.data, q)
        turns = [pin.Quaternion.FromTwoVectors(LIFT, normal).matrix() for normal in met.normal]
        J = [
            turn.T @ (self._point(two, point) - self._point(one, point))
            for turn, point, one, two in zip(turns, met.point, met.first, met.second, strict=True)
        ]
        return met, turns, np.concatenate(J)

    def _point(self, body: int, point: Floats) -> Floats:
        return point_jacobian(self.bodies.model, self.bodies.data, self.carriers[body], point)

    def _impulses(self, places: Places, offset: Floats) -> Floats:
        """Return impulses (3 k,), N s, with a Delassus operator made anew: ADMM changes it."""
        met, turns, mus = places
        model, data = self.bodies.model, self.bodies.data
        models, datas = pin.StdVec_ConstraintModel(), pin.StdVec_ConstraintData()
        for mu, turn, point, *ends in zip(mus.tolist(), turns, met.point, met.first, met.second, strict=True):
            world, joints = pin.SE3(turn, point), [self.carriers[body] for body in ends]
            place = pin.PointContactConstraintModel(
                model, *(part for i in joints for part in (i, data.oMi[i].inverse() * world))
            )
            place.setFriction(mu)
            models.append(pin.ConstraintModel(place))
            datas.append(models[-1].createData())
        pin.crba(model, data, self.q, pin.Convention.WORLD)
        for m, d in zip(models, datas, strict=True):
            m.calc(model, data, d)
        factors = pin.ConstraintCholeskyDecomposition(model, data, models, datas)
        factors.compute(model, data, models, datas, 0.0)
        delassus = factors.getDelassusOperatorCholeskyExpression()
        solver, result = pin.ADMMConstraintSolver(len(offset)), pin.ADMMSolverResult()
        solver.solve(delassus, offset, models, datas, self.options, result)
        self.iterations += int(result.iterations)
        return np.array(result.retrieveConstraintImpulses())

    def _pushes(self, places: Places, forces: Floats, rows: Sequence[int]) -> list[Push]:
        met, turns, mus = places
        found = []
        for row, turn, point, mu, force in zip(rows, turns, met.point, mus, forces, strict=True):
            contact = self.touching.all[self.touching.rows[row][0]]
            slides = bool(np.hypot(force[0], force[1]) >= (1.0 - AT_BOUND) * mu * force[2])
            found.append(Push(contact.first.name, contact.second.name, point, turn @ force, slides))
        return found

    def pose_at(self, q: Floats) -> Poses:
        """Return what gives the poses of bodies at Pinocchio's positions."""
        own = self.bodies
        pin.forwardKinematics(own.model, own.data, q)
        return self.pose

    def pose(self, body: str) -> Pose:
        """See `Stepper`."""
        carrier, where = self.bodies.placed[body]
        world = self.bodies.data.oMi[carrier] * where
        return world.rotation, world.translation

    def observe(self, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """See `Stepper`."""
        to = self.bodies.to
        theirs = to.theirs(q)
        return self.observed(theirs, np.array([to.back(*one) for one in zip(theirs, v, strict=True)]))

    def physics(self) -> Mapping[str, Any]:
        """Return what the audit is told, read back from the model."""
        assert self.case.scene is not None
        return mechanics(self.case.scene, self.bodies) | {
            "gravity": float(np.linalg.norm(self.bodies.model.gravity.linear)),
            "q0": self.case.q0, "v0": self.case.v0,
            "hidden": dict.fromkeys(RIGID, "Its contacts are rigid, and are solved within a step."),
        }  # fmt: skip

    def counts(self) -> Mapping[str, int]:
        """See `Stepper`."""
        return {"iterations": self.iterations, "unsolved": self.unsolved}


def _solved(p: Floats, w: Floats, mu: Floats) -> bool:
    """Return whether impulses (k, 3) and velocities behind them (k, 3) obey Coulomb's law, by the natural map.

    p is the projection of p - r (w + mu |w_t| n) on its cone, for any r > 0; r is what brings
    both to one size.
    """
    pushed = w.copy()
    pushed[:, 2] += mu * np.linalg.norm(w[:, :2], axis=1)
    r = max(float(np.abs(p).max()), 1e-12) / max(float(np.abs(pushed).max()), WORST)
    x = p - r * pushed
    side, up = np.linalg.norm(x[:, :2], axis=1), x[:, 2]
    lift = np.maximum((up + mu * side) / (1.0 + mu**2), 0.0)
    inside, below = side <= mu * up, mu * side <= -up
    onto = np.column_stack((x[:, :2] * np.where(side > 0.0, mu * lift / np.maximum(side, 1e-300), 0.0)[:, None], lift))
    onto = np.where(inside[:, None], x, np.where(below[:, None], 0.0, onto))
    return bool(np.abs(p - onto).max() / r <= WORST)
