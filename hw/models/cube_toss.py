"""A cube tossed on a table, with friction; the defaults are those of ContactNets (Pfrommer et al. 2020)."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from crossbody.cases import Case, Coordinate, Law, Parameter, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.hw.models._contract import Model, Numbers, Segment
from crossbody.hw.reading.log import Log

PLACE = ("px", "py", "pz")
TURN = ("qw", "qx", "qy", "qz")
COMPARED = (*(Coordinate(name=p, unit="m") for p in PLACE), *(Coordinate(name=f"r{a}", unit="rad") for a in "xyz"))
RATES = ("wx", "wy", "wz")


def build(numbers: Numbers, segment: Segment) -> Case:
    """One toss; the law is that of MuJoCo's solref: a0 = 1/(zeta tau)^2, a1 = 2/tau."""
    tau, zeta = float(numbers["timeconst"]), float(numbers["dampratio"])
    return Case(
        name="cube_toss", variant="replay", title="Cube tossed on a table", mechanism="cube_toss", parameters=numbers,
        coordinates=COMPARED, contacts=("table",), q0=segment.y, v0=segment.yd, t_end=segment.t_end,
        law=Law(
            a0=np.array([1.0 / (zeta * tau) ** 2]), a1=np.array([2.0 / tau]), a2=np.zeros(1),
            unilateral=np.ones(1, np.bool_),
        ),
    )  # fmt: skip


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
    found = np.column_stack([np.interp(inside, t, column) for column in q.T])
    if len(t) > 1:
        found[:, 3:] = Slerp(t, Rotation.from_rotvec(np.array(q[:, 3:])))(inside).as_rotvec()
    rates = np.column_stack([np.interp(inside, t, column) for column in v.T])
    late = times > t[-1] + 1e-9
    found[late], rates[late] = np.nan, np.nan
    return found, rates


def differ(y: Floats, yhat: Floats) -> Floats:
    """Difference of the places alone (n, 3), m: the turn of a cube that rolls over another edge is another motion."""
    return y[:, :3] - yhat[:, :3]


MODEL = Model(
    name="cube_toss",
    title="Cube tossed on a table",
    parameters={
        "side": Parameter(default=0.1048, unit="m", doc="side", low=1e-3, high=1e2),
        "mass": Parameter(default=0.37, unit="kg", doc="mass", low=1e-6, high=1e4),
        "inertia": Parameter(default=0.00081, unit="kg m^2", doc="moment of inertia", low=1e-12, high=1e4),
        "gravity": Parameter(default=9.81, unit="m/s^2", doc="down", low=0.0, high=100.0),
        "friction": Parameter(default=0.18, unit="1", doc="Coulomb's coefficient", low=1e-3, high=2.0),
        "timeconst": Parameter(default=4e-3, unit="s", doc="time constant of the contact (solref)", low=1e-3, high=0.1),
        "dampratio": Parameter(default=1.0, unit="1", doc="damping ratio of the contact (solref)", low=0.05, high=5.0),
        "restitution": Parameter(default=0.125, unit="1", doc="of an engine that has one", low=0.0, high=1.0),
    },
    measured=COMPARED,
    needs=PLACE + TURN,
    seen=tuple(range(6)),
    build=build,
    read=read,
    see=see,
    turns=(3,),
    differ=differ,
    falls=2,
    engine="mujoco",
    why_not=MappingProxyType(
        {"reference": "Rows of the reference push along their normal: no Coulomb friction sticks and slips."}
    ),
    profiles=MappingProxyType({"pinocchio": "admm"}),
)
