"""The sampled control of the delta robot in NumPy, for engines that must not borrow the reference's.

Written apart from the compiled controller, from the equations of the robot alone, so that each checks the other: a
term that one forgets leaves the motions apart. With y the motor angles, x the six angles that nobody measures,
h(y, x) = 0 the closed loops, X = dx/dy = -h_x^-1 h_y, S = [I; X] and z the flange,

    Jy = dz/dy along the loops     My = S^T M S (exact) or M_yy + M_yx X     tau_g = S^T dV/dq
    u = My Jy^-1 (ki INT e + kp e + kd e' + r'') + S^T D S y' + tau_g,   e = r - z          linearising
    u = kp (y_r - y) + kd (y_r' - y') + tau_g                                               proportional
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.reference.delta import Robot
from crossbody.reference.delta.control import Path, Sampling

NEWTON, CLOSED = 20, 1e-12
"""Steps at most, and the gap of the loops, m, at which the unmeasured angles count as found."""
SINGULAR = 1e10
"""Condition of h_x beyond which there is no control Jacobian."""


@dataclass(frozen=True, slots=True)
class Pose:
    """A closed pose: what the control law reads of it.

    Attributes:
        z (3,): flange, m.
        Jy (3, 3): dz/dy.
        S (9, 3): dq/dy, q arm by arm.
        hold (3,): motor torques against gravity, N m.
        M (9, 9): mass matrix.
    """

    z: Floats
    Jy: Floats
    S: Floats
    hold: Floats
    M: Floats


@dataclass(slots=True)
class Kinematics:
    """The robot in the controller's belief; arrays over arms are (3, 3): q1, q2, q3 of each."""

    robot: Robot
    turns: Floats = field(init=False)

    def __post_init__(self) -> None:
        """Turn the frames of the arms: 0, -120 and +120 degrees about z, times the robot's sign."""
        angles = np.array([0.0, -1.0, 1.0]) * self.robot.sign * 2.0 * np.pi / 3.0
        c, s = np.cos(angles), np.sin(angles)
        self.turns = np.array([[[c[i], -s[i], 0.0], [s[i], c[i], 0.0], [0.0, 0.0, 1.0]] for i in range(3)])

    def tips(self, q: Floats) -> tuple[Floats, Floats]:
        """Ends of the arms (3, 3), m, and their Jacobians by the arm's own angles (3, 3, 3), in world axes."""
        r = self.robot
        (c1, c2, c3), (s1, s2, s3), o = np.cos(q).T, np.sin(q).T, np.zeros(3)
        psi = np.array([r.l2 * s2 * s3, r.r_base - r.r_flange + r.l1 * c1 + r.l2 * c2, r.l1 * s1 + r.l2 * s2 * c3])
        rows = [
            [o, r.l2 * c2 * s3, r.l2 * s2 * c3],
            [-r.l1 * s1, -r.l2 * s2, o],
            [r.l1 * c1, r.l2 * c2 * c3, -r.l2 * s2 * s3],
        ]
        return np.einsum("iab,bi->ia", self.turns, psi), np.einsum("iab,bci->iac", self.turns, np.array(rows))

    def close(self, y: Floats, x: Floats) -> Floats:
        """Q (3, 3) of the closed pose at y by Newton's method from x (3, 2); NaN where it finds none."""
        q = np.column_stack([y, x])
        for _ in range(NEWTON):
            p, J = self.tips(q)
            h, hx = _loops(p), _by_unmeasured(J)
            if np.abs(h).max() < CLOSED:
                return q
            if not np.linalg.cond(hx) < SINGULAR:
                break
            q[:, 1:] -= np.linalg.solve(hx, h).reshape(3, 2)
        return np.full((3, 3), np.nan)

    def pose(self, q: Floats) -> Pose | None:
        """What the law reads of a closed pose (3, 3); None where the control Jacobian is singular."""
        if not np.isfinite(q).all():
            return None
        p, J = self.tips(q)
        hx = _by_unmeasured(J)
        if not np.linalg.cond(hx) < SINGULAR:
            return None
        hy = np.zeros((6, 3))
        hy[:3, 0] = hy[3:, 0] = J[0, :, 0]
        hy[:3, 1], hy[3:, 2] = -J[1, :, 0], -J[2, :, 0]
        S = np.zeros((9, 3))
        S[::3] = np.eye(3)
        S[[1, 2, 4, 5, 7, 8]] = -np.linalg.solve(hx, hy)
        Jy = sum(J[i] @ S[3 * i : 3 * i + 3] for i in range(3)) / 3.0
        return Pose(z=p.mean(axis=0), Jy=Jy, S=S, hold=S.T @ self.weight(q), M=self.mass(q))

    def mass(self, q: Floats) -> Floats:
        """Mass matrix (9, 9): rods that are thin and uniform, a third of the flange at each tip."""
        r, M = self.robot, np.zeros((9, 9))
        a = (r.m1 / 3 + r.m2 + r.m3 / 3) * r.l1**2 + r.jm
        b, c = (r.m2 / 2 + r.m3 / 3) * r.l1 * r.l2, (r.m2 + r.m3) / 3 * r.l2**2
        for i, (q1, q2, q3) in enumerate(q):
            p = b * (np.sin(q1) * np.sin(q2) + np.cos(q1) * np.cos(q2) * np.cos(q3))
            s = -b * np.cos(q1) * np.sin(q2) * np.sin(q3)
            M[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = [[a, p, s], [p, c, 0.0], [s, 0.0, c * np.sin(q2) ** 2]]
        return M

    def weight(self, q: Floats) -> Floats:
        """DV/dq (9,), N m; z points down."""
        r = self.robot
        upper, lower = (r.m1 / 2 + r.m2 + r.m3 / 3) * r.l1, (r.m2 / 2 + r.m3 / 3) * r.l2
        (c1, c2, c3), (_, s2, s3) = np.cos(q).T, np.sin(q).T
        return -r.g * np.column_stack([upper * c1, lower * c2 * c3, -lower * s2 * s3]).ravel()


def _loops(p: Floats) -> Floats:
    return np.concatenate([p[0] - p[1], p[0] - p[2]])


def _by_unmeasured(J: Floats) -> Floats:
    """h_x (6, 6)."""
    hx = np.zeros((6, 6))
    hx[:3, :2] = hx[3:, :2] = J[0, :, 1:]
    hx[:3, 2:4], hx[3:, 4:] = -J[1, :, 1:], -J[2, :, 1:]
    return hx


@dataclass(frozen=True, slots=True, kw_only=True)
class Law:
    """What is computed at a tick; gains are multiples of the identity.

    Attributes:
        linearising: through feedback linearisation of the flange; else proportional on the motors.
        kp, kd, ki: gains.
        clamp: bound on |INT e| in each axis, m s.
        exact: My = S^T M S, else without the part that the loops reflect.
    """

    linearising: bool
    kp: float
    kd: float
    ki: float
    clamp: float
    exact: bool


class Controller:
    """A computer that samples encoders and commands torques, a whole number of samples late.

    Args:
        robot: what it believes the robot to be.
        law: what it computes.
        path: reference of the flange.
        sampling: period, delay, encoder, bound on the torque.
    """

    def __init__(self, robot: Robot, law: Law, path: Path, sampling: Sampling, t_end: float) -> None:
        self.kinematics, self.law, self.path, self.sampling = Kinematics(robot), law, path, sampling
        self.last = sampling.ticks(t_end)[-1]
        self.damping = np.tile([robot.d1, robot.d2, robot.d3], 3)
        self.reset()

    def reset(self) -> None:
        """Forget everything: the next tick is the first."""
        self.integral, self.q, self.before = np.zeros(3), np.zeros((3, 3)), np.zeros(3)
        self.waiting: deque[Floats] = deque()
        self.begun = False

    def tick(self, t: float, q: Floats) -> Floats:
        """Motor torques (3,) from t on, N m; NaN where the control Jacobian is singular.

        Args:
            t: time, s.
            q: the robot's angles (9,); only the motors' are measured, the others start Newton's method once.
        """
        y = self._read(q[::3])
        rate = (y - self.before) / self.sampling.period if self.begun else np.zeros(3)
        if not self.begun:
            self.q = np.array(q, dtype=np.float64).reshape(3, 3)
        self.before = y
        self.q = self.kinematics.close(y, self.q[:, 1:])
        pose = self.kinematics.pose(self.q)
        wanted = np.full(3, np.nan) if pose is None else self._torque(min(t, self.last), pose, y, rate)
        hold = np.full(3, np.nan) if pose is None else pose.hold
        return self._late(self._bounded(wanted), hold)

    def _read(self, y: Floats) -> Floats:
        quantum = self.sampling.quantum
        return np.array(y) if quantum == 0.0 else np.rint(y / quantum) * quantum

    def _bounded(self, torque: Floats) -> Floats:
        limit = self.sampling.limit
        return torque if limit is None else np.clip(torque, -limit, limit)

    def _late(self, torque: Floats, hold: Floats) -> Floats:
        """What was commanded `delay` samples ago; before the first command the pose is held."""
        if not self.begun:
            self.waiting.extend([hold] * self.sampling.delay)
            self.begun = True
        self.waiting.append(torque)
        return self.waiting.popleft()

    def _torque(self, t: float, pose: Pose, y: Floats, rate: Floats) -> Floats:
        law, (r, rd, rdd) = self.law, (part[0] for part in self.path(np.array([t])))
        if not law.linearising:
            target = self._motors(r)
            aim = self.kinematics.pose(target)
            speed = np.full(3, np.nan) if aim is None else np.linalg.solve(aim.Jy, rd)
            return law.kp * (target[:, 0] - y) + law.kd * (speed - rate) + pose.hold
        e, ed = r - pose.z, rd - pose.Jy @ rate
        self.integral = np.clip(self.integral + self.sampling.period * e, -law.clamp, law.clamp)
        a = np.linalg.solve(pose.Jy, law.ki * self.integral + law.kp * e + law.kd * ed + rdd)
        S = pose.S if law.exact else np.kron(np.eye(3), [[1.0], [0.0], [0.0]])
        friction = pose.S.T @ (self.damping * (pose.S @ rate))
        torque: Floats = S.T @ pose.M @ pose.S @ a + friction + pose.hold
        return torque

    def _motors(self, z: Floats) -> Floats:
        """Angles (3, 3) at which the flange is at z: Newton's method from the present pose."""
        q = self.q.copy()
        for _ in range(NEWTON):
            p, J = self.kinematics.tips(q)
            off = p - z
            if np.abs(off).max() < CLOSED:
                return q
            q -= np.array([np.linalg.solve(J[i], off[i]) for i in range(3)])
        return np.full((3, 3), np.nan)


def controller(parameters: Any, robot: Robot, path: Path, sampling: Sampling) -> Controller:
    """The controller that a case's parameters describe."""
    p = parameters
    law = Law(
        linearising=p["controller"] == "linearising",
        kp=float(p["kp"]),
        kd=float(p["kd"]),
        ki=float(p["ki"]),
        clamp=float(p["clamp"]),
        exact=p["mass_matrix"] == "exact",
    )
    return Controller(robot, law, path, sampling, float(p["t_end"]))
