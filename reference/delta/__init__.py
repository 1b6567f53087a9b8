"""The delta robot as a library: parameters, kinematics, statics, control and references.

from crossbody.reference import delta
robot = delta.LIGHT
q = delta.inverse(robot, (0.02, 0.0, 0.6))
z, Jy, X = delta.jacobians(robot, q)
"""

from __future__ import annotations

from crossbody.reference.delta.kinematics import (
    closed_pose,
    flange,
    flanges,
    forward,
    inverse,
    jacobians,
    virtual_jacobian,
)
from crossbody.reference.delta.model import kick, system
from crossbody.reference.delta.reach import inverses
from crossbody.reference.delta.robot import HEAVY, LIGHT, SETS, Robot, Servo
from crossbody.reference.delta.singularity import Margins, elbow_angle, ill_posed_tilts, margins, pendulum_rate
from crossbody.reference.delta.statics import gravity_torque, holding_pose, task_mass

__all__ = [
    "HEAVY",
    "LIGHT",
    "SETS",
    "Margins",
    "Robot",
    "Servo",
    "closed_pose",
    "elbow_angle",
    "flange",
    "flanges",
    "forward",
    "gravity_torque",
    "holding_pose",
    "ill_posed_tilts",
    "inverse",
    "inverses",
    "jacobians",
    "kick",
    "margins",
    "pendulum_rate",
    "system",
    "task_mass",
    "virtual_jacobian",
]
