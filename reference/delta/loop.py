"""The controlled robot as a linear model in continuous time, about a pose at which it is held.

The plant is linearised with the loops closed exactly, in the flange's own coordinates through the
virtual Jacobian Jv of the simulation. The controller computes with the control Jacobian Jy; its
own compiled code is differenced.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from crossbody.reference.delta.control import Linearising, Proportional, knots
from crossbody.reference.delta.kernels import control as compiled
from crossbody.reference.delta.kinematics import MOTORS, OTHERS, closed_pose, flange, jacobians, virtual_jacobian
from crossbody.reference.delta.model import system
from crossbody.reference.delta.robot import Robot
from crossbody.reference.delta.statics import gravity_torque
from crossbody.reference.kinds import Floats
from crossbody.reference.linear.differences import differences
from crossbody.reference.linear.linearisation import linearise
from crossbody.reference.linear.model import LinearModel

STEP = 1e-3
AXES = "xyz"


def closed_loop(robot: Robot, q: ArrayLike, controller: Linearising | Proportional | None = None) -> LinearModel:
    """The robot under a controller that is evaluated at every instant, with its gains at t = 0.

    Args:
        robot: the plant, and what the controller believes.
        q: a closed pose (9,), where the reference rests.
        controller: `Linearising()` if not given.

    Returns:
        States z, z' of the flange and INT e (9,), which is left out where nobody reads it; inputs
        r, r', r'' (9,), outputs z (3,), m.

    Raises:
        SceneError: for a pose that is not closed or is singular.
    """
    pose = closed_pose(robot, q)
    A, B, back = _plant(robot, pose)
    K = differences(_torque(robot, pose, controller or Linearising()), np.zeros(24), STEP)
    feedback = np.hstack([K[:, :9] @ back[:9] + K[:, 9:12] @ back[9:][MOTORS], K[:, 12:15]])
    zero, one = np.zeros((3, 3)), np.eye(3)
    loop = np.vstack([np.hstack([A, np.zeros((6, 3))]) + B @ feedback, np.hstack([-one, zero, zero])])
    given = np.vstack([B @ K[:, 15:], np.hstack([one, zero, zero])])
    return LinearModel(
        A=loop, B=given, C=np.eye(3, 9), D=np.zeros((3, 9)),
        states=_named("flange {}", "flange {}'", "integral of the error in {}"),
        inputs=_named("r {}", "r' {}", "r'' {}"), outputs=_named("flange {}"),
    ).without_idle()  # fmt: skip


def characteristic(loop: LinearModel) -> Floats:
    """Coefficients of z''' + c2 z'' + c1 z' + c0 z: c2, c1, c0 as matrices (3, 3, 3); (s + 7)^3 has 21, 147, 343."""
    by_z, by_rate, by_integral = np.hsplit(loop.A[3:6], 3)
    return np.stack([-by_rate, -by_z, by_integral])


def _named(*patterns: str) -> tuple[str, ...]:
    return tuple(pattern.format(axis) for pattern in patterns for axis in AXES)


def _plant(robot: Robot, q: Floats) -> tuple[Floats, Floats, Floats]:
    """A (6, 6) and B (6, 3) of (z, z') under motor torques, and dq, dv (18, 6) that go with z, z'."""
    hold = np.concatenate([gravity_torque(robot, q)[0], np.zeros(3)])
    small = linearise(system(robot), q, u=hold, outputs=("q", "v"), reduce=True)
    J = np.asarray(virtual_jacobian(robot, q))
    T = np.vstack([J @ small.C[:9], J @ small.C[9:]])
    inverse: Floats = np.linalg.inv(T).astype(np.float64)
    return T @ small.A @ inverse, T @ small.B[:, :3], small.C @ inverse


def _torque(robot: Robot, q: Floats, controller: Linearising | Proportional) -> Callable[[Floats], Floats]:
    """Motor torques (3,) as a function of small changes: angles (9,), motor rates, INT e (3,), and r, r', r'' (9,)."""
    gains, rest = knots(controller.gains)[0, 1:].copy(), np.concatenate([flange(robot, q), np.zeros(6)])
    if isinstance(controller, Proportional):
        Kp, Kd, _ = gains.reshape(3, 3, 3)
        to_motors = np.linalg.inv(jacobians(robot, q)[1])

        def proportional(x: Floats) -> Floats:
            error, rate = to_motors @ x[15:18] - x[:9][MOTORS], to_motors @ x[18:21] - x[9:12]
            total: Floats = Kp @ error + Kd @ rate + gravity_torque(robot, q + x[:9])[0]
            return total

        return proportional
    flags = controller.exact, controller.feedforward, controller.friction

    def linearising(x: Floats) -> Floats:
        tau, at, integral = np.zeros(3), q + x[:9], x[12:15].copy()
        given = at[MOTORS].copy(), at[OTHERS].copy(), x[9:12].copy(), rest + x[15:]
        compiled.command(robot.array(), *given, integral, gains, *flags, 0.0, controller.clamp, tau)
        return tau

    return linearising
