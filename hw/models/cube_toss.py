"""A cube tossed onto a table, with friction; the defaults are those of ContactNets (Pfrommer et al. 2020)."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from crossbody import cases
from crossbody.cases import Case, Coordinate, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.library.tossed_cube import PARAMETERS
from crossbody.hw.models.contract import Model, Numbers, Segment
from crossbody.hw.reading.log import Log

PLACE = ("px", "py", "pz")
TURN = ("qw", "qx", "qy", "qz")
COMPARED = (*(Coordinate(name=p, unit="m") for p in PLACE), *(Coordinate(name=f"r{a}", unit="rad") for a in "xyz"))
RATES = ("wx", "wy", "wz")
SCENE = ("height", "t_end")


def build(numbers: Numbers, segment: Segment) -> Case:
    """One toss from the measured place, attitude and rates; it claims nothing."""
    case = cases.load("tossed_cube", t_end=segment.t_end, **numbers)  # type: ignore[arg-type]
    attitude = Rotation.from_rotvec(segment.y[3:]).as_quat(scalar_first=True)
    return replace(
        case, name="cube_toss", variant="replay", q0=np.append(segment.y[:3], attitude), v0=segment.yd, limits=()
    )


def read(model: Model, log: Log) -> tuple[Floats, Floats | None]:
    """Place and rotation vector (n, 6) from place and quaternion, and the recorded velocities."""
    turned = Rotation.from_quat(log.matrix("coordinates", TURN), scalar_first=True)
    return np.column_stack((log.matrix("coordinates", PLACE), turned.as_rotvec())), log.matrix(
        "velocities", PLACE + RATES
    )


def see(model: Model, run: Trajectory, times: Floats) -> tuple[Floats, Floats]:
    """The run at given times: straight between its steps, rotations along the shortest turn."""
    keep = np.append(np.diff(run.t) > 0.0, True)
    t, q, v = run.t[keep], run.q[keep], run.v[keep]
    inside = np.clip(times, t[0], t[-1])
    found = np.column_stack([np.interp(inside, t, column) for column in q[:, :6].T])
    if len(t) > 1:
        attitude = Slerp(t, Rotation.from_quat(np.array(q[:, 3:]), scalar_first=True))(inside)
        found = np.column_stack((found[:, :3], attitude.as_rotvec()))
    rates = np.column_stack([np.interp(inside, t, column) for column in v.T])
    late = times > t[-1] + 1e-9
    found[late], rates[late] = np.nan, np.nan
    return found, rates


def differ(y: Floats, yhat: Floats) -> Floats:
    """Difference of the places alone (n, 3), m: a cube that rolls over another edge turns otherwise."""
    return y[:, :3] - yhat[:, :3]


MODEL = Model(
    name="cube_toss",
    title="Cube tossed on a table",
    parameters={name: parameter for name, parameter in PARAMETERS.items() if name not in SCENE},
    measured=COMPARED,
    needs=PLACE + TURN,
    seen=tuple(range(6)),
    build=build,
    read=read,
    see=see,
    turns=(3,),
    differ=differ,
    falls=2,
    profiles=MappingProxyType({"pinocchio": "admm", "mujoco": "default"}),
    settings=MappingProxyType({"mujoco": {"timeconst": 4e-3, "cone": "elliptic", "dt": 1e-3}}),
)
