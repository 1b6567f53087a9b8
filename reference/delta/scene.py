"""Robot, servos and controller from the named numbers of a scene.

every scene: r_base r_flange l1 l2 m1 m2 m3 jm gravity d1 d2 d3 sign
start of most: x y z, the flange, m
servos: kp kd; with ramp, start_angle and offset they move to the elbow pose, else they hold the start
sampled control: controller period delay bits limit, its gains, and the circle: radius frequency fade
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from crossbody.cases import Law, SceneError
from crossbody.reference._system import System
from crossbody.reference.delta import control, paths
from crossbody.reference.delta.kinematics import MOTORS, closed_pose, inverse
from crossbody.reference.delta.model import ROWS, law_of, system
from crossbody.reference.delta.robot import Robot, Servo
from crossbody.reference.delta.singularity import elbow_angle
from crossbody.reference.delta.statics import closure_jacobian

Numbers = Mapping[str, Any]
STANDING = 1e-9  # largest |h|, m, and |h'|, m/s, of a start that counts as closed

_OWN = ("r_base", "r_flange", "l1", "l2", "m1", "m2", "m3", "jm", "d1", "d2", "d3", "sign")


def robot_of(parameters: Numbers) -> Robot:
    """The robot.

    Raises:
        InvalidValue: naming the attribute outside its range.
    """
    return Robot(g=float(parameters["gravity"]), **{name: float(parameters[name]) for name in _OWN})


def servo_of(parameters: Numbers) -> Servo | None:
    """Continuous servos, or None.

    Raises:
        InvalidValue: if the start cannot be reached.
    """
    if "kp" not in parameters or "period" in parameters:
        return None
    robot = robot_of(parameters)
    kp, kd = (float(parameters[name]) for name in ("kp", "kd"))
    if "ramp" not in parameters:
        a, b, c = inverse(robot, _start(parameters))[MOTORS].tolist()
        return Servo(kp=kp, kd=kd, y_start=(a, b, c), y_end=(a, b, c))
    begin, end = float(parameters["start_angle"]), elbow_angle(robot) + float(parameters["offset"])
    return Servo(
        kp=kp, kd=kd, end=float(parameters["ramp"]), y_start=(begin,) * 3, y_end=(end,) * 3, feedforward=True
    )  # fmt: skip


def path_of(parameters: Numbers) -> control.Path | None:
    """The circle that a sampled controller follows, or None."""
    if "period" not in parameters:
        return None
    circle = (float(parameters[name]) for name in ("radius", "frequency", "fade"))
    return paths.circle(_start(parameters), *circle)


def sampling_of(parameters: Numbers) -> control.Sampling:
    """How the controller is sampled."""
    return control.Sampling(
        period=float(parameters["period"]),
        delay=int(parameters["delay"]),
        bits=int(parameters["bits"]),
        limit=float(parameters["limit"]) or None,
    )


def controller_of(parameters: Numbers) -> control.Linearising | control.Proportional:
    """What a sampled controller computes."""
    gains = control.Gains(**{name: float(parameters[name]) for name in ("kp", "kd", "ki")})
    if parameters["controller"] != "linearising":
        return control.Proportional(gains=gains)
    exact = parameters["mass_matrix"] == "exact"
    return control.Linearising(gains=gains, clamp=float(parameters["clamp"]), exact=exact)


def program_of(parameters: Numbers) -> control.Program | None:
    """The sampled controller, or None.

    Raises:
        InvalidValue: for a number outside its range or a path that leaves the workspace.
    """
    path = path_of(parameters)
    if path is None:
        return None
    law, t_end = controller_of(parameters), float(parameters["t_end"])
    return control.program(robot_of(parameters), law, path, t_end, sampling_of(parameters))


def build(parameters: Numbers, law: Law) -> System:
    """The mechanism of a scene.

    Args:
        parameters: as above.
        law: of the six rows.

    Raises:
        SceneError: if the law has not six rows.
        InvalidValue: for a number outside its range.
    """
    if len(law.a0) != ROWS:
        raise SceneError(f"The delta robot has {ROWS} rows; the law has {len(law.a0)}.")
    robot = robot_of(parameters)
    return law_of(system(robot, servo=servo_of(parameters), program=program_of(parameters)), law)


def check_start(parameters: Numbers, q0: ArrayLike, v0: ArrayLike) -> None:
    """Check that a start closes the loops.

    Raises:
        SceneError: if it does not; the message offers one that does.
    """
    robot = robot_of(parameters)
    q, v = closed_pose(robot, q0, STANDING), np.asarray(v0, dtype=np.float64)
    H = closure_jacobian(robot, q)
    speed = float(np.abs(H @ v).max())
    if speed > STANDING:
        near = v - np.linalg.lstsq(H, H @ v, rcond=1e-9)[0]
        raise SceneError(
            f"The start opens the loops: |h'| = {speed:.3g} m/s. The nearest velocity that "
            f"keeps them closed is v = {near.tolist()}."
        )


def _start(parameters: Numbers) -> list[float]:
    return [float(parameters[name]) for name in ("x", "y", "z")]
