"""Sampled control of the delta robot: the law, how it is sampled, and its tables for the kernels."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from crossbody.cases import InvalidValue
from crossbody.reference.delta.kernels import control as compiled
from crossbody.reference.delta.kinematics import MOTORS, inverse, jacobians
from crossbody.reference.delta.robot import Robot, Servo
from crossbody.reference.kinds import Floats

Path = Callable[[Floats], tuple[Floats, Floats, Floats]]
"""A reference: times (n,) to position, velocity and acceleration (n, 3)."""

_NO_LIMIT = 1e300


def matrix(name: str, value: ArrayLike) -> Floats:
    """A gain as a 3 x 3 matrix; a number stands for that many times the identity.

    Raises:
        InvalidValue: if it is neither, or not finite.
    """
    array = np.asarray(value, dtype=np.float64)
    full = np.asarray(array * np.eye(3) if array.ndim == 0 else array, dtype=np.float64)
    if full.shape != (3, 3) or not np.all(np.isfinite(full)):
        raise InvalidValue(f"{name} has shape {array.shape}; it must be one finite number or a finite 3 x 3 matrix.")
    return full


@dataclass(frozen=True, slots=True, kw_only=True)
class Sampling:
    """How a controller sees and moves the robot.

    Attributes:
        period: sample time, s.
        delay: whole samples between a measurement and its torque.
        bits: counts per motor turn are 2^bits, readings are rounded to nearest; None for an exact reading.
        limit: bound on each torque, N m; None for no bound.
    """

    period: float = 0.88e-3
    delay: int = 1
    bits: int | None = 18
    limit: float | None = None

    def __post_init__(self) -> None:
        """Check ranges.

        Raises:
            InvalidValue: naming the attribute.
        """
        if not 0 < self.period < math.inf:
            raise InvalidValue(f"Sampling: period is {self.period!r} s; it must be above 0 s.")
        if not _whole(self.delay, 0, 1000):
            raise InvalidValue(f"Sampling: delay is {self.delay!r}; it must be a whole number of samples, 0 to 1000.")
        if self.bits is not None and not _whole(self.bits, 1, 52):
            raise InvalidValue(f"Sampling: bits is {self.bits!r}; it must be a whole number, 1 to 52, or None.")
        if self.limit is not None and not 0 < self.limit < math.inf:
            raise InvalidValue(f"Sampling: limit is {self.limit!r} N m; it must be above 0, or None.")

    @property
    def quantum(self) -> float:
        """One count, rad; 0 for an exact reading."""
        return 0.0 if self.bits is None else 2 * math.pi / 2**self.bits

    def ticks(self, t_end: float) -> Floats:
        """Sampling instants from 0 to t_end, s."""
        if not 0 < t_end < math.inf:
            raise InvalidValue(f"The horizon is {t_end!r} s; it must be above 0 s.")
        return self.period * np.arange(math.floor(t_end / self.period * (1 + 1e-12)) + 1, dtype=np.float64)


def _whole(value: Any, low: int, high: int) -> bool:
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool) and bool(low <= value <= high)


@dataclass(frozen=True, slots=True, kw_only=True)
class Gains:
    """Three gains, each a number or a full 3 x 3 matrix in the task frame; the defaults are those of (s + 7)^3.

    A matrix gives an impedance of its own to each direction; R K R^T turns it into the frame R of a task.
    """

    kp: ArrayLike = 147.0
    kd: ArrayLike = 21.0
    ki: ArrayLike = 343.0

    def values(self) -> Floats:
        """Kp, Kd, Ki by rows (27,)."""
        return np.concatenate([matrix(name, getattr(self, name)).ravel() for name in ("kp", "kd", "ki")])


@dataclass(frozen=True, slots=True, kw_only=True)
class Linearising:
    """PID on the flange through feedback linearisation.

        u = My Jy^-1 (Ki INT e + Kp e + Kd e' + r'') + tau_g,   e = r - z

    Attributes:
        gains: at all times, or at given instants (s), linear between them.
        clamp: bound on |INT e| in each axis, m s (anti-windup).
        exact: My = S^T M S; else the approximation M11 - M12 h_x^-1 h_y.
        feedforward: add r''.
        friction: add the reflected viscous friction of the robot; without it the damping of the
            loop is larger.
    """

    gains: Gains | Mapping[float, Gains] = Gains()
    clamp: float = 1.0
    exact: bool = True
    feedforward: bool = True
    friction: bool = True

    def __post_init__(self) -> None:
        """Check the clamp.

        Raises:
            InvalidValue: if it is not above 0.
        """
        if not 0 < self.clamp < math.inf:
            raise InvalidValue(f"Linearising: clamp is {self.clamp!r} m s; it must be above 0 m s.")


@dataclass(frozen=True, slots=True, kw_only=True)
class Proportional:
    """PD on the motors with gravity compensation: u = Kp (y_r - y) + Kd (y_r' - y') + tau_g.

    Attributes:
        gains: as in `Linearising`, N m/rad and N m s/rad; ki is not used.
    """

    gains: Gains | Mapping[float, Gains] = Gains(kp=1.0, kd=0.25, ki=0.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Program:
    """What a `System` needs to run a controller: the kernel, p with its tables, the length of s, the period."""

    control: Any
    parameters: Floats
    memory: int
    tick: float


def knots(gains: Gains | Mapping[float, Gains]) -> Floats:
    """Instants and gains by rows (m, 28).

    Raises:
        InvalidValue: for instants that are not finite or do not increase.
    """
    table = {0.0: gains} if isinstance(gains, Gains) else dict(gains)
    times = np.array(list(table), dtype=np.float64)
    if not len(times) or not np.all(np.isfinite(times)) or np.any(np.diff(times) <= 0):
        raise InvalidValue(f"Gains are given at {times.tolist()} s; the instants must be finite and increasing.")
    return np.column_stack([times, [g.values() for g in table.values()]])


def task_reference(robot: Robot, path: Path, ticks: Floats) -> Floats:
    """r, r', r'' (n, 9) at the ticks.

    Raises:
        InvalidValue: if the path leaves the workspace; it says when, and which arm cannot reach.
    """
    r = np.hstack(path(ticks))
    for t, z in zip(ticks[:: max(1, len(ticks) // 500)], r[:: max(1, len(ticks) // 500), :3], strict=True):
        try:
            inverse(robot, z)
        except InvalidValue as error:
            raise InvalidValue(f"At t = {t:.6g} s: {error}") from None
    return r


def motor_reference(robot: Robot, path: Path, ticks: Floats) -> Floats:
    """y_r and y_r' (n, 6) of the motors at the ticks for a path of the flange.

    Raises:
        InvalidValue: if the path leaves the workspace.
        SceneError: if it meets a singular pose.
    """
    rows = np.empty((len(ticks), compiled.JOINT_TICK))
    r, rd, _ = path(ticks)
    for row, z, zd in zip(rows, r, rd, strict=True):
        q = inverse(robot, z)
        row[:3], row[3:] = q[MOTORS], np.linalg.solve(jacobians(robot, q)[1], zd)
    return rows


def program(
    robot: Robot,
    controller: Linearising | Proportional,
    path: Path,
    t_end: float,
    sampling: Sampling | None = None,
) -> Program:
    """Lay out a controller and its reference for the kernels.

    Args:
        robot: what the controller believes the robot to be, and the plant.
        controller: what is computed at a tick.
        path: reference of the flange.
        t_end: until when, s; the last reference holds afterwards.
        sampling: period, delay, encoder; the rig's if not given.

    Raises:
        InvalidValue: for a number outside its range or a path that cannot be followed.
    """
    timing = sampling or Sampling()
    ticks, table = timing.ticks(t_end), knots(controller.gains)
    linear = isinstance(controller, Linearising)
    reference = task_reference(robot, path, ticks) if linear else motor_reference(robot, path, ticks)
    header = {
        "period": timing.period,
        "quantum": timing.quantum,
        "delay": timing.delay,
        "limit": timing.limit or _NO_LIMIT,
        "ticks": len(ticks),
        "knots": len(table),
        **({k: float(getattr(controller, k)) for k in ("clamp", "exact", "feedforward", "friction")} if linear else {}),
    }
    numbers = np.array([header.get(name, 0.0) for name in compiled.HEADER], dtype=np.float64)
    return Program(
        control=compiled.linearising if linear else compiled.proportional,
        parameters=np.concatenate([robot.array(Servo()), numbers, table.ravel(), reference.ravel()]),
        memory=compiled.STATE + 3 * timing.delay,
        tick=timing.period,
    )
