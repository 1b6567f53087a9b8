"""The ball maze in Pinocchio: a revolute joint for the maze, two slides and a spin for the ball (spec 2.3, 4.3)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from crossbody.cases import Case
from crossbody.cases.arrays import Floats
from crossbody.engines._maze.machine import MazeMachine
from crossbody.engines._maze.memory import Memory
from crossbody.engines._maze.scene import BallMaze
from crossbody.engines.pinocchio._rows import ALGEBRA

State = tuple[float, ...]


def tree(maze: BallMaze) -> Any:
    """The model; its coordinates are the case's, gravity lies in the plane of the maze."""
    model, p = pin.Model(), maze.plant
    model.gravity.linear = np.array([0.0, -p.g, 0.0])
    turn = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "theta")
    model.appendBodyToJoint(turn, _inertia(0.0, p.Jm), pin.SE3.Identity())
    x = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
    y = model.addJoint(x, pin.JointModelPY(), pin.SE3.Identity(), "y")
    spin = model.addJoint(y, pin.JointModelRZ(), pin.SE3.Identity(), "phi")
    model.appendBodyToJoint(spin, _inertia(p.mb, p.Jb), pin.SE3.Identity())
    return model


def _inertia(mass: float, about_z: float) -> Any:
    return pin.Inertia(mass, np.zeros(3), np.diag([0.0, 0.0, about_z]))


class MazeLaw:
    """The rows' law: J v' + gamma = 0 with gamma = H' v + a1 h' + a0 h.

    Attributes:
        maze: geometry, masses, controller.
        model, data: Pinocchio's.
    """

    def __init__(self, case: Case, maze: BallMaze, algebra: str) -> None:
        self.maze, self.model = maze, tree(maze)
        self.data = self.model.createData()
        self.a0, self.a1, self.a2 = (a.tolist() for a in (case.law.a0, case.law.a1, case.law.a2))
        self.q, self.v, self.tau = np.zeros(4), np.zeros(4), np.zeros(4)
        self.solve = ALGEBRA[algebra](self.model, self.data, self.tau)

    def accelerate(self, q: State, v: State, memory: Memory) -> tuple[Floats, Floats]:
        """See `crossbody.engines._maze.machine.Accelerate`."""
        self.q[:], self.v[:] = q, v
        self.force(q, v, memory)
        on, lam = memory.active(), np.zeros(self.maze.nc)
        if not on:
            return pin.aba(self.model, self.data, self.q, self.v, self.tau), lam
        J, gamma = self.rows(q, v, memory)
        vd, part = self.solve(self.q, self.v, J, gamma)
        lam[list(on)] = part
        return vd, lam

    def force(self, q: State, v: State, memory: Memory) -> Floats:
        """Of the controller and of rolling damping (4,): the forces that are in force."""
        brake = self.maze.braking(v, memory)
        self.tau[0], self.tau[3] = self.maze.torque(q, v, memory) - brake, brake
        return self.tau.copy()

    def rows(self, q: State, v: State, memory: Memory) -> tuple[Floats, Floats]:
        """J (na, 4) and gamma (na,) of the active rows."""
        on = memory.active()
        formulas, J, gamma = self.maze.rows.at(memory.place), np.empty((len(on), 4)), np.empty(len(on))
        for k, i in enumerate(on):
            h, H, Hdv = formulas[i](q, v)
            J[k] = H
            hd = H[0] * v[0] + H[1] * v[1] + H[2] * v[2] + H[3] * v[3]
            gamma[k] = Hdv + self.a1[i] * hd + (self.a0[i] + self.a2[i] * h * h) * h
        return J, gamma


def audit(case: Case, law: MazeLaw) -> dict[str, Any]:
    """Read back from the model, for the parity audit, with the modes of the start before anything is touched.

    M(q) (4, 4), bias(q, v) (4,), and H(q) (nc, 4) of every row that can be touched there, 0 for the others.
    """
    model, data, maze = law.model, law.data, law.maze
    start = MazeMachine(maze, law.accelerate).untouched(tuple(case.q0.tolist()))
    inertias, ball = [inertia.inertia[2, 2] for inertia in model.inertias[1:]], model.inertias[4].mass

    def M(q: Floats) -> Floats:
        upper = np.triu(pin.crba(model, data, q))
        full: Floats = upper + np.triu(upper, 1).T
        return full

    def bias(q: Floats, v: Floats) -> Floats:
        law.accelerate(tuple(q.tolist()), tuple(v.tolist()), start)
        return np.array(pin.nonLinearEffects(model, data, q, v)) - law.tau

    def H(q: Floats) -> Floats:
        rows = np.zeros((maze.nc, 4))
        for i, formula in maze.rows.at(start.place).items():
            rows[i] = formula(tuple(q.tolist()), (0.0,) * 4)[1]
        return rows

    return {
        "masses": np.array([inertias[0], ball, ball, inertias[3]]),
        "gravity": float(np.linalg.norm(model.gravity.linear)),
        "constants": {"a0": case.law.a0, "a1": case.law.a1, "a2": case.law.a2},
        "q0": case.q0,
        "v0": case.v0,
        "M": M,
        "bias": bias,
        "H": H,
        "hidden": {"lam": "Rows depend on where the ball is: no state has all of them on at once."},
    }
