"""The delta robot as a `System`, and the limit of a short pulse on its flange."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from crossbody.cases import InvalidValue, Law, SceneError
from crossbody.cases.entry_points import checked_arguments
from crossbody.reference._system import System
from crossbody.reference.delta.kernels import robot as kernels
from crossbody.reference.delta.kinematics import vector
from crossbody.reference.delta.robot import Robot, Servo
from crossbody.reference.kinds import Floats

if TYPE_CHECKING:
    from crossbody.reference.delta.control import Program

ROWS = 6


@checked_arguments
def system(robot: Robot, *, p: float = 5.0, servo: Servo | None = None, program: Program | None = None) -> System:
    """The robot with its loops closed by h'' + 2 p h' + p^2 h = 0.

    Args:
        robot: the robot.
        p: double pole of the closures, 1/s.
        servo: continuous servos on the motors.
        program: a sampled controller, from `control.program`; a flange force may still be an
            input, motor torques are then the controller's.

    Raises:
        InvalidValue: if p is negative or not finite.
        SceneError: if both a servo and a program are given.
    """
    if not p >= 0.0:
        raise InvalidValue(f"p is {p!r} 1/s; it must be at least 0.")
    if servo is not None and program is not None:
        raise SceneError("Give either continuous servos or a sampled program, not both.")
    closed = System(
        n=9,
        **kernels.KERNELS,
        parameters=robot.array(servo) if program is None else program.parameters,
        a0=np.full(ROWS, p * p),
        a1=np.full(ROWS, 2 * p),
        unilateral=False,
        mass_block=3,
        inputs=6,
        scratch=kernels.SCRATCH,
    )
    if program is None:
        return closed
    return replace(closed, control=program.control, memory=program.memory, tick=program.tick)


def law_of(closed: System, law: Law) -> System:
    """The same system with a law of its own for each of the six rows."""
    return replace(closed, a0=law.a0, a1=law.a1, a2=law.a2, unilateral=law.unilateral)


@checked_arguments
def kick(robot: Robot, q: ArrayLike, v: ArrayLike, impulse: ArrayLike) -> Floats:
    """Velocities (9,) behind a Dirac impulse on the flange.

    A pulse J/T of length T leaves H v as it is when T goes to 0, so v jumps by what J as a force adds to v':
    M dv = Jv^T J + H^T L with H dv = 0.

    Args:
        robot: the robot.
        q: pose (9,), rad.
        v: velocities before (9,), rad/s.
        impulse: J (3,), N s.

    Raises:
        SceneError: if the multipliers are ill posed at this pose.
    """
    pose, before, J = vector("q", q, 9), vector("v", v, 9), vector("impulse", impulse, 3)
    parameters, law, rows = robot.array(), np.zeros((ROWS, 3)), np.arange(ROWS)
    change = np.zeros((2, 9))
    for row, force in zip(change, (np.zeros(3), J), strict=True):
        u, w, lam, hd = np.concatenate([np.zeros(3), force]), np.zeros(kernels.SCRATCH), np.zeros(ROWS), np.zeros(ROWS)
        if kernels.solve(0.0, pose, np.zeros(9), u, parameters, w, law, rows, ROWS, row, lam, hd) != 0:
            raise SceneError(f"The impulse is ill posed at q = {pose.tolist()}: the closures are redundant there.")
    after: Floats = before + change[1] - change[0]
    return after
