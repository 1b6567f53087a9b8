"""The sampled control of the delta robot in NumPy, for runs on a scene, which must not borrow the reference's.

Written apart from the compiled controller, from the equations of the robot alone, so that each checks
the other: a term that one forgets leaves the motions apart. With y the motor angles, x the six angles
that nobody measures, h(y, x) = 0 the closed loops, X = dx/dy = -h_x^-1 h_y, S = [I; X] and z the flange,

    Jy = dz/dy along the loops     My = S^T M S (exact) or M_yy + M_yx X     tau_g = S^T dV/dq
    u = My Jy^-1 (ki INT e + kp e + kd e' + r'') + S^T D S y' + tau_g,   e = r - z          linearising
    u = kp (y_r - y) + kd (y_r' - y') + tau_g                                               proportional
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.mechanisms.delta import pose
from crossbody.cases.mechanisms.soft.form import smooth

COS = (1.0, -0.5, -0.5)
SIN = (0.0, -(0.75**0.5), 0.75**0.5)
"""Of what turns each arm's frame into the base's about z, the sine times the robot's sign."""
NEWTON, CLOSED = 20, 1e-12
"""Steps at most, and the gap of the loops, m, at which the unmeasured angles count as found."""
SINGULAR = 1e10  # condition of h_x beyond which there is no control Jacobian
MOTORS = np.arange(0, 9, 3)
OTHERS = np.delete(np.arange(9), MOTORS)
NONE = np.full(3, np.nan)


def numbers(p: Mapping[str, float]) -> Floats:
    """Return what `motor_torque` reads: thin uniform rods, a third of the flange at each tip."""
    m1, m2, m3, l1, l2 = (p[name] for name in ("m1", "m2", "m3", "l1", "l2"))
    inertia = (m1 / 3 + m2 + m3 / 3) * l1**2 + p["jm"], (m2 / 2 + m3 / 3) * l1 * l2, (m2 + m3) / 3 * l2**2
    weight = (m1 / 2 + m2 + m3 / 3) * l1 * p["gravity"], (m2 / 2 + m3 / 3) * l2 * p["gravity"]
    return np.array([l1, l2, p["sign"], *inertia, *weight], dtype=np.float64)


def motor_torque(y: Floats, x: Floats, asked: Floats, p: Floats, u: Floats) -> None:
    """Write the torques u (3,), N m; NaN where the loops or the flange lose a direction.

    From motor angles y (3,), the six others x, arm by arm, and the acceleration asked of the flange
    (3,), m/s^2; p are `numbers` of the robot.
    """
    l1, l2, sign, a, b, c, upper, lower = p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7]
    J, M, pull = np.zeros((3, 3, 3)), np.zeros((9, 9)), np.empty(9)
    for i in range(3):
        c1, s1, k = np.cos(y[i]), np.sin(y[i]), 3 * i
        c2, s2, c3, s3 = np.cos(x[2 * i]), np.sin(x[2 * i]), np.cos(x[2 * i + 1]), np.sin(x[2 * i + 1])
        J[i, 0, 1], J[i, 0, 2] = l2 * c2 * s3, l2 * s2 * c3
        J[i, 1, 0], J[i, 1, 1] = -l1 * s1, -l2 * s2
        J[i, 2, 0], J[i, 2, 1], J[i, 2, 2] = l1 * c1, l2 * c2 * c3, -l2 * s2 * s3
        cs, sn = COS[i], sign * SIN[i]
        for j in range(3):
            along, across = J[i, 0, j], J[i, 1, j]
            J[i, 0, j], J[i, 1, j] = cs * along - sn * across, sn * along + cs * across
        coupled, sideways = b * (s1 * s2 + c1 * c2 * c3), -b * c1 * s2 * s3
        M[k, k], M[k + 1, k + 1], M[k + 2, k + 2] = a, c, c * s2 * s2
        M[k, k + 1] = M[k + 1, k] = coupled
        M[k, k + 2] = M[k + 2, k] = sideways
        pull[k], pull[k + 1], pull[k + 2] = -upper * c1, -lower * c2 * c3, lower * s2 * s3
    hx, hy, S, Jy = np.zeros((6, 6)), np.zeros((6, 3)), np.zeros((9, 3)), np.zeros((3, 3))
    for r in range(3):
        hy[r, 0] = hy[3 + r, 0] = J[0, r, 0]
        hy[r, 1], hy[3 + r, 2] = -J[1, r, 0], -J[2, r, 0]
        for j in range(2):
            hx[r, j] = hx[3 + r, j] = J[0, r, 1 + j]
            hx[r, 2 + j], hx[3 + r, 4 + j] = -J[1, r, 1 + j], -J[2, r, 1 + j]
    u[:] = np.nan
    if np.linalg.det(hx) == 0.0:
        return
    X = np.linalg.solve(hx, hy)
    for i in range(3):
        S[3 * i, i] = 1.0
        S[3 * i + 1], S[3 * i + 2] = -X[2 * i], -X[2 * i + 1]
        Jy += J[i] @ S[3 * i : 3 * i + 3] / 3.0
    if np.linalg.det(Jy) == 0.0:
        return
    St = np.ascontiguousarray(S.T)
    u[:] = St @ (M @ (S @ np.linalg.solve(Jy, asked))) + St @ pull


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


class Controller:
    """A computer that samples encoders and commands torques, a whole number of samples late."""

    def __init__(self, parameters: Any) -> None:
        self.words = {name: value for name, value in parameters.items() if isinstance(value, str)}
        self.p = p = {name: float(value) for name, value in parameters.items() if name not in self.words}
        self.quantum = 2.0 * math.pi / 2.0 ** p["bits"]
        self.last = math.floor(p["t_end"] / p["period"] * (1.0 + 1e-12)) * p["period"]
        self.damping = np.tile([p["d1"], p["d2"], p["d3"]], 3)
        self.reset()

    def reset(self) -> None:
        """Forget everything: the next tick is the first."""
        self.integral, self.q, self.before = np.zeros(3), np.zeros(9), np.zeros(3)
        self.waiting: deque[Floats] = deque()
        self.begun = False

    def __call__(self, t: float, r: Floats, rd: Floats) -> Floats:
        """Return the motor torques (3,) from t on, N m; NaN where the control Jacobian is singular.

        Of the tree's angles (9,) only the motors' are measured, the others start Newton's method
        once.
        """
        y = np.rint(r[MOTORS] / self.quantum) * self.quantum
        rate = (y - self.before) / self.p["period"] if self.begun else np.zeros(3)
        if not self.begun:
            self.q = pose.from_tree(r, rd)[0]
        self.before = y
        self.q = self._closed(y, self.q)
        at = self._pose(self.q)
        wanted = NONE if at is None else self._torque(min(t, self.last), at, y, rate)
        limit = self.p["limit"] or math.inf
        return self._late(np.clip(wanted, -limit, limit), NONE if at is None else at.hold)

    def _closed(self, y: Floats, near: Floats) -> Floats:
        """Return the closed pose (9,) at y by Newton's method; NaN where it finds none."""
        q = near.copy()
        q[MOTORS] = y
        for _ in range(NEWTON):
            tips, hx = pose.tips(self.p, q), pose.closure(self.p, q)[:, OTHERS]
            h = np.concatenate([tips[0] - tips[1], tips[0] - tips[2]])
            if np.abs(h).max() < CLOSED:
                return q
            if not np.linalg.cond(hx) < SINGULAR:
                break
            q[OTHERS] -= np.linalg.solve(hx, h)
        return np.full(9, np.nan)

    def _pose(self, q: Floats) -> Pose | None:
        """Return what the law reads of a closed pose; None where the control Jacobian is singular."""
        if not np.isfinite(q).all():
            return None
        p, H, J = self.p, pose.closure(self.p, q), pose.tip_jacobians(self.p, q)
        if not np.linalg.cond(H[:, OTHERS]) < SINGULAR:
            return None
        S = np.zeros((9, 3))
        S[MOTORS] = np.eye(3)
        S[OTHERS] = -np.linalg.solve(H[:, OTHERS], H[:, MOTORS])
        Jy = np.hstack(list(J)) @ S / 3.0
        return Pose(
            z=pose.tips(p, q).mean(axis=0), Jy=Jy, S=S, hold=S.T @ pose.gravity(p, q), M=pose.mass(p, q)
        )  # fmt: skip

    def _late(self, torque: Floats, hold: Floats) -> Floats:
        """Return what was commanded `delay` samples ago; before the first command the pose is held."""
        if not self.begun:
            self.waiting.extend([hold] * int(self.p["delay"]))
            self.begun = True
        self.waiting.append(torque)
        return self.waiting.popleft()

    def _torque(self, t: float, at: Pose, y: Floats, rate: Floats) -> Floats:
        p, (r, rd, rdd) = self.p, self._path(t)
        if self.words["controller"] != "linearising":
            target = pose.pose(p, r)
            aim = self._pose(target)
            speed = NONE if aim is None else np.linalg.solve(aim.Jy, rd)
            return p["kp"] * (target[MOTORS] - y) + p["kd"] * (speed - rate) + at.hold
        e, ed = r - at.z, rd - at.Jy @ rate
        self.integral = np.clip(self.integral + p["period"] * e, -p["clamp"], p["clamp"])
        a = np.linalg.solve(at.Jy, p["ki"] * self.integral + p["kp"] * e + p["kd"] * ed + rdd)
        S = at.S if self.words["mass_matrix"] == "exact" else np.eye(9)[:, MOTORS]
        torque = S.T @ at.M @ at.S @ a + at.S.T @ (self.damping * (at.S @ rate)) + at.hold
        return torque

    def _path(self, t: float) -> tuple[Floats, Floats, Floats]:
        """Return place (3,), velocity and acceleration of the circle that the flange is to follow."""
        p, w = self.p, 2.0 * math.pi * self.p["frequency"]
        g, gd, gdd = (p["radius"] * part for part in smooth(t, 0.0, p["fade"]))
        e, n = (np.array([math.cos(w * t + a), math.sin(w * t + a), 0.0]) for a in (0.0, 0.5 * math.pi))
        centre = np.array([p["x"], p["y"], p["z"]])
        return centre + g * e, gd * e + g * w * n, (gdd - g * w * w) * e + 2.0 * gd * w * n
