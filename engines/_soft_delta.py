"""The soft contact on the delta robot as engines see it: hinges, sliders beside them, and a clock (spec 2.6, 3).

The engine's coordinates are the nine hinges of the tree, then pads, sensors' difference, block and integrals of the
error as in the case, and a slider of unit mass and unit speed whose position is the time. The loops are the engine's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from crossbody.cases import Case, Law
from crossbody.cases.arrays import Floats
from crossbody.cases.mechanisms.soft.scene import numbers
from crossbody.engines import _soft_contact as soft
from crossbody.engines._delta import chart
from crossbody.engines._delta.forces import forces, table
from crossbody.engines._delta.torque import gaps_and_energy, motor_torque, turns
from crossbody.engines._delta.torque import numbers as torque_numbers
from crossbody.engines.linear import Chart
from crossbody.reference.delta import Robot, scene

SLIDERS = {
    "left pad": 1, "right pad": 1, "difference": 1, "block": 3, "integral 1": 1, "integral 2": 1, "integral 3": 1,
    "clock": 1,
}  # fmt: skip
"""Bodies that slide along so many axes: x, then y and z."""
AXES = np.eye(3)
HINGES, CLOCK, NV = 9, 18, 19
MOTORS = slice(0, HINGES, 3)
LEFT, RIGHT, FELT, BLOCK, INTEGRALS = 9, 10, 11, slice(12, 15), slice(15, 18)
LOOPS = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class SoftDelta:
    """The numbers of a case and its equations.

    Attributes:
        p: parameters, SI.
        robot: geometry, masses, gravity, friction.
        numbers: of the robot, as `engines._delta.torque` reads them.
        turns: cosine and sine by which the frame of each arm is turned.
        table: numbers of `engines._delta.forces.forces`.
        masses (10,): of the coordinates of `SLIDERS`, kg; 1 for those that carry the controller, the sensors, the time.
        H (3, 19): dh/dq of the pads' rows and the table's.
        law: of those three rows.
    """

    p: dict[str, float]
    robot: Robot
    numbers: Floats
    turns: tuple[tuple[float, float], ...]
    table: Floats
    masses: Floats
    H: Floats
    law: Law

    def forces(self, q: Floats, v: Floats, tau: Floats) -> None:
        """Write the generalised forces (19,) beside gravity, N or N m."""
        p, t = self.p, float(q[CLOCK])
        x, z, zd = self._flange(q[:HINGES].tolist(), v[:HINGES].tolist())
        left, right = soft.fingers(p, t, (z[0], zd[0]), (q[LEFT], v[LEFT]), (q[RIGHT], v[RIGHT]))
        felt = v[FELT] + p["ks"] * p["pad_mass"] * (v[LEFT] + v[RIGHT])
        depth, depth_rate = self._path(t)
        error = np.array([p["k"] * felt, 0.0, depth]) - zd
        asked = p["gain_i"] * q[INTEGRALS] + p["gain_p"] * v[INTEGRALS] + p["gain_d"] * error
        asked[2] += depth_rate
        given = np.array([0.0, 0.0, 0.0, -left - right, 0.0, 0.0])
        motor_torque(np.ascontiguousarray(q[MOTORS]), x, asked, self.numbers, given[:3])
        forces(t, q[:HINGES], v[:HINGES], given, self.table, tau[:HINGES])
        tau[LEFT], tau[RIGHT], tau[FELT] = left, right, -p["ks"] * (left + right + felt)
        tau[BLOCK] = -p["bt"] * v[12], -p["bt"] * v[13], 0.0
        tau[INTEGRALS], tau[CLOCK] = error, 0.0

    def _flange(self, r: list[float], rd: list[float]) -> tuple[Floats, Floats, Floats]:
        """Angles q2 and q3 of the arms (6,), place of the flange (3,), m, and its velocity: the mean of the tips."""
        others: list[float] = []
        place, rate = [0.0] * 3, [0.0] * 3
        for i, turn in enumerate(self.turns):
            arm = slice(3 * i, 3 * i + 3)
            angles, tip, velocity = self._tip(*r[arm], *rd[arm])
            others += angles
            _add(place, turn, tip)
            _add(rate, turn, velocity)
        return np.array(others), np.array(place) / 3.0, np.array(rate) / 3.0

    def _tip(self, q: float, alpha: float, gamma: float, qd: float, alphad: float, gammad: float) -> tuple[Any, ...]:
        """Angles q2 and q3 of an arm, its tip in the arm's frame, m, and the tip's velocity."""
        robot, phi, phid = self.robot, q + alpha, qd + alphad
        l2, lc, ls = robot.l2, robot.l1 * math.cos(q), robot.l1 * math.sin(q)
        c, s, cg, sg = math.cos(phi), math.sin(phi), math.cos(gamma), math.sin(gamma)
        x, y, z = -sg, cg * c, cg * s
        xd, yd, zd = -cg * gammad, -sg * c * gammad - cg * s * phid, -sg * s * gammad + cg * c * phid
        angles = math.atan2(math.hypot(x, z), y), math.atan2(x, z)
        tip = l2 * x, robot.offset + lc + l2 * y, ls + l2 * z
        return angles, tip, (l2 * xd, l2 * yd - ls * qd, l2 * zd + lc * qd)

    def _path(self, t: float) -> tuple[float, float]:
        """Rate and acceleration of the reference of the flange's depth."""
        p = self.p
        _, down, slowing = soft.smooth(t, 0.0, p["descent"])
        _, up, falling = soft.smooth(t, p["rise"], p["rise"] + p["rise_time"])
        stroke = p["low"] - p["high"]
        return stroke * (down - up), stroke * (slowing - falling)

    @property
    def bodies(self) -> list[float]:
        """Masses of `SLIDERS`, kg."""
        first = np.cumsum([0, *SLIDERS.values()])[:-1]
        masses: list[float] = self.masses[first].tolist()
        return masses

    def heights(self, q: Floats) -> Floats:
        """Gaps (3,) of the pads and of the block above the table, m."""
        half = 0.5 * self.p["width"]
        gaps: Floats = self.H @ q + np.array([-half, -half, self.p["table"] - half])
        return gaps

    def observe(self, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Gaps (n, 9), m, and energies (n, 2), J, of many states of the case (n, 18)."""
        gaps, energy = gaps_and_energy(self.robot, q[:, :HINGES], v[:, :HINGES])
        p = self.p
        own = [self.heights(np.append(state, 0.0)) for state in q]
        energy[:, 0] += 0.5 * p["block_mass"] * (v[:, BLOCK] ** 2).sum(axis=1)
        energy[:, 0] += 0.5 * p["pad_mass"] * (v[:, LEFT] ** 2 + v[:, RIGHT] ** 2)
        energy[:, 1] -= p["block_mass"] * p["gravity"] * q[:, 14]
        return np.column_stack((gaps, own)), energy

    def start(self, case: Case) -> tuple[Floats, Floats]:
        """Positions and velocities (19,) at the start: the clock stands at 0 and runs."""
        return joined(case.q0, case.v0, 0.0)

    def instants(self, t_end: float) -> tuple[float, ...]:
        """Where third derivatives of the jaws' or of the flange's path jump, s."""
        p = self.p
        path = {t for t in (p["descent"], p["rise"], p["rise"] + p["rise_time"]) if t < t_end}
        return tuple(sorted(path | set(soft.instants(p, t_end))))

    @property
    def sizes(self) -> tuple[Floats, Floats]:
        """How far and how fast the coordinates move (19,), for absolute tolerances."""
        p = self.p
        reach, force = p["jaw"] + p["squeeze"], p["kp"] * max(p["squeeze"], 1e-3 * p["jaw"])
        time = p["close_end"] - p["close_start"]
        far = [1.0] * HINGES + [reach, reach, force * time, *(reach,) * 3, *(reach * time,) * 3, time]
        fast = [1.0 / time] * HINGES + [reach / time, reach / time, force, *(reach / time,) * 3, *(reach,) * 3, 1.0]
        return np.array(far), np.array(fast)


def soft_delta(case: Case) -> SoftDelta:
    """The equations of a case.

    Raises:
        SceneError: if the start does not close the loops.
    """
    scene.check_start(case.parameters, case.q0[:HINGES], case.v0[:HINGES])
    p, robot = numbers(case.parameters), scene.robot_of(case.parameters)
    H = np.zeros((3, NV))
    H[0, [LEFT, 12]] = -1.0, 1.0
    H[1, [RIGHT, 12]] = 1.0, -1.0
    H[2, 14] = -1.0
    masses = np.array([p["pad_mass"], p["pad_mass"], 1.0, *(p["block_mass"],) * 3, 1.0, 1.0, 1.0, 1.0])
    parts = {name: getattr(case.law, name)[LOOPS:] for name in ("a0", "a1", "a2", "b0", "b1", "unilateral")}
    return SoftDelta(
        p=p, robot=robot, numbers=torque_numbers(robot), turns=turns(robot),
        table=table(robot, None), masses=masses, H=H, law=Law(**parts),
    )  # fmt: skip


def _add(total: list[float], turn: tuple[float, float], local: tuple[float, float, float]) -> None:
    """Add a vector in an arm's frame to a sum in the base frame."""
    (c, s), (x, y, z) = turn, local
    total[0] += c * x + s * y
    total[1] += c * y - s * x
    total[2] += z


def small_motions(q: Floats) -> Chart:
    """The chart of small motions about one position q (19,) of the engine; the clock is no coordinate of the case."""
    hinges, (T, S) = chart.linear(q[:HINGES]), (np.eye(CLOCK, NV), np.eye(NV, CLOCK))
    T[:HINGES, :HINGES], S[:HINGES, :HINGES] = hinges.T, hinges.S
    return Chart(T=T, S=S)


def joined(q: Floats, v: Floats, t: float) -> tuple[Floats, Floats]:
    """The engine's positions and velocities (19,) of a state of the case (18,) at the time t, s."""
    r, rd = chart.to_tree(q[:HINGES], v[:HINGES])
    return np.concatenate([r, q[HINGES:], [t]]), np.concatenate([rd, v[HINGES:], [1.0]])


def of_case(q: Floats, v: Floats) -> tuple[Floats, Floats]:
    """The case's coordinates (n, 18) of the engine's (n, 19); q_i3 goes on where its angle passes pi."""
    angles, rates = chart.from_tree(q[:, :HINGES], v[:, :HINGES])
    angles[:, 2::3] = np.unwrap(angles[:, 2::3], axis=0)
    return np.hstack([angles, q[:, HINGES:CLOCK]]), np.hstack([rates, v[:, HINGES:CLOCK]])


def linear(q: Floats, v: Floats, M: Floats, bias: Floats) -> tuple[Floats, Floats]:
    """Mass matrix (18, 18) and bias (18,) in the case's coordinates from the engine's; see `chart.absolute`."""
    inverse, drift = _inverse(q), np.zeros(CLOCK)
    drift[:HINGES] = chart.accelerations(q[:HINGES], v[:HINGES], np.zeros(HINGES))
    mass = inverse.T @ M[:CLOCK, :CLOCK] @ inverse
    return mass, inverse.T @ bias[:CLOCK] - mass @ drift


def rows_of_case(q: Floats, H: Floats) -> Floats:
    """Constraint Jacobian (nc, 18) in the case's coordinates from the engine's (nc, 19)."""
    rows: Floats = H[:, :CLOCK] @ _inverse(q)
    return rows


def _inverse(q: Floats) -> Floats:
    """S (18, 18) at positions q (19,): rates of the engine = S v."""
    inverse = np.eye(CLOCK)
    inverse[:HINGES, :HINGES] = np.linalg.inv(chart.rate_matrix(q[:HINGES]))
    return inverse
