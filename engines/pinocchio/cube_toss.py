"""A cube tossed on a table in Pinocchio: corners as points with Coulomb friction, time stepping with ADMM.

    v+ = v + M^-1 (dt (tau - b) + J^T p)        p in the cones, J v+ + (0, 0, e J_n v) in their duals (de Saxce)

A corner takes part where it is closed half a step ahead (Moreau and Jean); restitution is Newton's.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import numpy as np
import pinocchio as pin

from crossbody.cases import Case, Mode, Outcome, Parameter, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.engines._cube import CORNERS, Cube, cube, quaternion, rotation_vector
from crossbody.engines._log import Log, charted
from crossbody.engines.contract import Run

SETTINGS = {
    "dt": Parameter(default=1e-3, unit="s", doc="time step", low=0.0, open_low=True),
    "tol": Parameter(default=1e-9, doc="absolute tolerance of ADMM", low=1e-15, high=1e-1),
    "max_steps": Parameter(default=200_000, doc="bound on the number of steps", low=1, high=1e9),
}


def why_not(case: Case, profile: str) -> str | None:
    """Friction is in the time stepper alone."""
    if profile == "admm":
        return None
    return "Rows of the law have no friction; the profile admm has a cone at every corner."


def prepare(case: Case, used: Mapping[str, Any]) -> CubeRun:
    """Build the model: one body on a free joint."""
    own, model = cube(case), pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -own.gravity])
    index = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "cube")
    model.appendBodyToJoint(index, pin.Inertia(own.mass, np.zeros(3), own.inertia * np.eye(3)), pin.SE3.Identity())
    return CubeRun(case=case, cube=own, model=model, settings=dict(used), restitution=case.number("restitution"))


@dataclass(slots=True, kw_only=True)
class CubeRun(Run):
    """One prepared run; see `crossbody.engines.Run`."""

    case: Case
    cube: Cube
    model: Any
    settings: Mapping[str, Any]
    restitution: float
    engine: str = "pinocchio"
    profile: str = "admm"
    data: Any = field(init=False)
    options: Any = field(init=False)
    iterations: int = 0

    def __post_init__(self) -> None:
        """Buffers of the model, and how ADMM stops."""
        self.data = self.model.createData()
        self.options = pin.ADMMSolverSettings()
        self.options.max_iterations = 200
        for name in ("absolute_feasibility_tol", "absolute_complementarity_tol"):
            setattr(self.options, name, float(self.settings["tol"]))
        for name in ("relative_feasibility_tol", "relative_complementarity_tol"):
            setattr(self.options, name, 0.0)

    def run(self) -> Trajectory:
        """Step from the start; lam is the vertical force of the table, N."""
        case, log, self.iterations = self.case, Log(), 0
        q = np.concatenate((case.q0[:3], np.roll(quaternion(case.q0[3:]), -1)))
        turn = pin.Quaternion(q[3:]).matrix()
        v = np.concatenate((turn.T @ case.v0[:3], case.v0[3:]))
        start = perf_counter()
        outcome = self._steps(log, q, v, float(self.settings["dt"]))
        wall = perf_counter() - start
        counts = {"iterations": self.iterations}
        return log.trajectory(
            charted(_chart, self.cube.observe), outcome, "", len(log.motion) - 1, wall, counts, _chart
        )

    def _steps(self, log: Log, q: Floats, v: Floats, dt: float) -> Outcome:
        count = int(np.ceil(self.case.t_end / dt - 1e-9))
        if count > int(self.settings["max_steps"]):
            return Outcome.STEP_LIMIT
        mode = (int(Mode.FREE),)
        log.add(0.0, q, v, 0.0, mode)
        for k in range(1, count + 1):
            new, push = self._step(q, v, dt)
            if not np.isfinite(new).all():
                return Outcome.NOT_FINITE
            q, v = pin.integrate(self.model, q, 0.5 * dt * (v + new)), new
            after = (int(Mode.CONTACT if push > 0.0 else Mode.FREE),)
            log.switch(k * dt, mode, after)
            mode = after
            log.add(k * dt, q, v, push, mode)
        return Outcome.FINISHED

    def _step(self, q: Floats, v: Floats, dt: float) -> tuple[Floats, float]:
        """Velocity behind the step, and the mean vertical force of the table in it, N."""
        model, data = self.model, self.data
        free = v + dt * pin.aba(model, data, q, v, np.zeros(6))
        places = self._closed(pin.integrate(model, q, 0.5 * dt * v))
        if not len(places):
            return free, 0.0
        pin.crba(model, data, q, pin.Convention.WORLD)
        turn, centre = data.oMi[1].rotation, data.oMi[1].translation
        J = np.concatenate([np.hstack((turn, -turn @ pin.skew(place))) for place in places])
        offset = J @ free
        offset[2::3] += self.restitution * np.minimum((J @ v)[2::3], 0.0)
        p = self._impulses(offset, [centre + turn @ place for place in places])
        return free + np.linalg.solve(_symmetric(data.M), J.T @ p), float(np.sum(p[2::3])) / dt

    def _closed(self, ahead: Floats) -> Floats:
        """Corners, in the body's axes, that are below the table in a pose."""
        corners = self.cube.half * CORNERS
        heights = ahead[2] + corners @ pin.Quaternion(ahead[3:]).matrix()[2]
        low: Floats = corners[heights <= 0.0]
        return low

    def _impulses(self, offset: Floats, places: list[Floats]) -> Floats:
        """Impulses (3 k,), N s, of points with friction at given places of the world."""
        model, data = self.model, self.data
        models, datas = pin.StdVec_ConstraintModel(), pin.StdVec_ConstraintData()
        for place in places:
            world = pin.SE3(np.eye(3), place)
            point = pin.PointContactConstraintModel(model, 0, world, 1, data.oMi[1].inverse() * world)
            point.setFriction(self.cube.friction)
            models.append(pin.ConstraintModel(point))
            datas.append(models[-1].createData())
        for m, d in zip(models, datas, strict=True):
            m.calc(model, data, d)
        factors = pin.ConstraintCholeskyDecomposition(model, data, models, datas)
        factors.compute(model, data, models, datas, 0.0)
        delassus = factors.getDelassusOperatorCholeskyExpression()
        solver, result = pin.ADMMConstraintSolver(len(offset)), pin.ADMMSolverResult()
        solver.solve(delassus, offset, models, datas, self.options, result)
        self.iterations += int(result.iterations)
        return np.array(result.retrieveConstraintImpulses())

    def audit(self) -> Mapping[str, Any]:
        """The physics read back from the model."""
        return {
            "masses": np.array([self.model.inertias[1].mass]), "constants": {"restitution": self.restitution},
            "gravity": float(np.linalg.norm(self.model.gravity.linear)), "q0": self.case.q0, "v0": self.case.v0,
        }  # fmt: skip


def _symmetric(M: Floats) -> Floats:
    """The whole matrix of its upper triangle."""
    upper = np.triu(M)
    return upper + np.triu(upper, 1).T


def _chart(q: Floats, v: Floats) -> tuple[Floats, Floats]:
    """The case's coordinates: the linear velocity in the world's axes."""
    wxyz = np.roll(q[:, 3:], 1, axis=1)
    linear = np.stack([pin.Quaternion(np.array(x)).matrix() @ rate for x, rate in zip(q[:, 3:], v[:, :3], strict=True)])
    return np.column_stack((q[:, :3], rotation_vector(wxyz))), np.column_stack((linear, v[:, 3:]))
