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
from dataclasses import dataclass
from typing import Any

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.mechanisms.delta import chart, pose
from crossbody.cases.mechanisms.soft.form import smooth

NEWTON, CLOSED = 20, 1e-12
"""Steps at most, and the gap of the loops, m, at which the unmeasured angles count as found."""
SINGULAR = 1e10  # condition of h_x beyond which there is no control Jacobian
MOTORS = np.arange(0, 9, 3)
OTHERS = np.delete(np.arange(9), MOTORS)
NONE = np.full(3, np.nan)


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
    """A computer that samples encoders and commands torques, a whole number of samples late.

    Args:
        parameters: of a case, by name: robot, circle, gains and how it is sampled.
    """

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

        Args:
            t: time, s.
            r: angles of the tree (9,); only the motors' are measured, the others start Newton's method once.
            rd: rates, which nobody measures.
        """
        y = np.rint(r[MOTORS] / self.quantum) * self.quantum
        rate = (y - self.before) / self.p["period"] if self.begun else np.zeros(3)
        if not self.begun:
            self.q = chart.from_tree(r, rd)[0]
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
