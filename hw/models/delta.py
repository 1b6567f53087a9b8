"""The delta robot of the rig: three motor angles, three torques, the reference of the flange, sampled control."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np

from crossbody.cases import Case, Coordinate, Inputs, Law, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.library.delta_tracking import PARAMETERS
from crossbody.cases.mechanisms.delta.form import in_tree
from crossbody.cases.mechanisms.delta.scene import JOINTS, LOOPS, NAMES, ROBOT
from crossbody.hw.models.contract import Model, Numbers, Segment
from crossbody.hw.reading.log import Log
from crossbody.reference import simulate
from crossbody.reference.delta import control, forward, jacobians, paths, scene
from crossbody.reference.delta.kernels import arm as arm
from crossbody.reference.delta.kinematics import MOTORS, OTHERS
from crossbody.reference.delta.model import law_of, system
from crossbody.reference.delta.robot import Robot

CONTROLLER = ("controller", "mass_matrix", "kp", "kd", "ki", "clamp", "period", "delay", "bits", "limit")
TITLE = "Delta robot: recorded torques, or the recorded reference through the rig's controller"
RTOL = 1e-8
AXES = ("x", "y", "z")


def state(robot: Robot, y: Floats, yd: Floats) -> tuple[Floats, Floats]:
    """All nine angles and rates of the closed pose from those of the motors (3,)."""
    q = forward(robot, y)
    v = np.zeros(9)
    v[MOTORS], v[OTHERS] = yd, jacobians(robot, q)[2] @ yd
    return q, v


def build(numbers: Numbers, segment: Segment) -> Case:
    """One stretch driven by recorded torques."""
    robot = {key: numbers[key] for key in ROBOT}
    q0, v0 = state(scene.robot_of(robot), segment.y, segment.yd)
    inputs = None
    if len(segment.times):
        u = np.zeros((len(segment.times), 6))
        u[:, : segment.inputs.shape[1]] = segment.inputs
        inputs = Inputs(names=NAMES, times=segment.times, values=u)
    return Case(
        name="delta", variant="replay", title=TITLE, mechanism="delta", parameters=robot,
        coordinates=tuple(Coordinate(name=joint, unit="rad") for joint in JOINTS), contacts=LOOPS,
        q0=q0, v0=v0, t_end=segment.t_end, inputs=inputs, law=_law(numbers), form=in_tree,
    )  # fmt: skip


def _law(numbers: Numbers) -> Law:
    p = float(numbers["p"])
    return Law(a0=np.full(6, p * p), a1=np.full(6, 2.0 * p), a2=np.zeros(6), unilateral=np.zeros(6, dtype=np.bool_))


def loop(numbers: Numbers, segment: Segment, log: Log) -> Trajectory:
    """One stretch under the rig's controller, which follows the recorded reference; run by the reference.

    The recorded positions become a path with a rate and an acceleration by a spline through them.
    """
    robot, t = scene.robot_of(numbers), log.time - log.time[0]
    gains = control.Gains(**{name: float(numbers[name]) for name in ("kp", "kd", "ki")})
    law: control.Linearising | control.Proportional = control.Proportional(gains=gains)
    if numbers["controller"] == "linearising":
        law = control.Linearising(
            gains=gains, clamp=float(numbers["clamp"]), exact=numbers["mass_matrix"] == "exact"
        )  # fmt: skip
    path = paths.recorded(t, log.matrix("references", AXES))
    program = control.program(robot, law, path, segment.t_end, scene.sampling_of(numbers))
    closed = law_of(system(robot, program=program), _law(numbers))
    q0, v0 = state(robot, segment.y, segment.yd)
    return simulate(closed, q0, v0, segment.t_end, rtol=RTOL, samples=np.clip(t, 0.0, segment.t_end))


PLACES = {("gravity" if name == "g" else name): i for i, name in enumerate(arm.NAMES)}

MODEL = Model(
    name="delta",
    title=TITLE,
    parameters={**ROBOT, **{key: PARAMETERS[key] for key in CONTROLLER}},
    measured=tuple(Coordinate(name=JOINTS[i], unit="rad") for i in MOTORS),
    seen=tuple(int(i) for i in MOTORS),
    inputs=("torque 1", "torque 2", "torque 3"),
    forces=("force x", "force y", "force z"),
    build=build,
    places=MappingProxyType({key: i for key, i in PLACES.items() if key != "sign"}),
    loop=loop,
    references=AXES,
    restart=1.0,
    start_span=0.05,
)
