"""What must be read from an MJCF and a URDF whose numbers all differ: no engine contradicts what all are given.

Engines are given the scene that was read, so that none of them contradicts what is read wrongly. What stands in the
files is written out here in the scene's terms: degrees in radians, products of inertia in their places, rotations by
roll, pitch and yaw about fixed axes, laws of rows by solref and solimp (docs/explanation).
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from crossbody import cases
from crossbody.cases.arrays import Floats
from crossbody.cases.scene import Scene
from crossbody.reports.judging.asked import Found, rows_of
from crossbody.reports.judging.planting import Range
from crossbody.reports.judging.start_of_file import start_of_file

EXACT = 1e-9
"""What compilers leave of a number, of its size: they turn inertias into their axes and back."""
MJCF = """<mujoco><compiler angle="degree" autolimits="true"/><option timestep="0.004" gravity="0 0.5 -9"/>
<default><joint armature="0.02" damping="0.3 0.04 0.005" frictionloss="0.1"/><geom density="500" friction="0.7 0 0"/>
<default class="soft"><geom solref="0.003 0.8" solimp="0.8 0.9 0.01"/></default></default>
<worldbody><geom name="floor" type="plane" size="1 1 1"/>
<body name="arm" pos="1 2 3" euler="0 0 90">
<joint name="turn" axis="0 1 0" range="-90 45" ref="30" stiffness="2 0.6 0.07" springref="10"/>
<geom name="box" type="box" size=".1 .2 .3" class="soft"/>
<body name="tip" pos="0 0 1"><joint name="slide" type="slide" axis="0 0 2" range="-0.4 0.5" solreflimit="0.003 0.5"/>
<inertial pos=".1 0 0" mass="2" fullinertia="1 2 2.5 .1 .2 .3"/></body></body></worldbody>
<equality><joint name="gear" joint1="slide" joint2="turn" polycoef="0.1 0.2 0.3 0 0" solref="-400 -30"/></equality>
<tendon><fixed name="rope" stiffness="5" damping="0.5" range="-1 2" springlength="0.2">
<joint joint="turn" coef="2"/><joint joint="slide" coef="-3"/></fixed></tendon>
<actuator><position name="servo" joint="turn" kp="7" kv="0.6" ctrlrange="-1 2" forcerange="-3 4" gear="2"/>
<general name="lag" joint="slide" dyntype="filterexact" dynprm="0.25" gainprm="9" actrange="-0.5 0.7"/>
<general name="slow" joint="slide" dyntype="filter" dynprm="0.5" gainprm="8"/>
<general name="sum" tendon="rope" dyntype="integrator" gainprm="3" biastype="affine" biasprm="1 2 3"/></actuator>
</mujoco>"""
DMAX, STIFF, WEAK = 0.95, 0.008, 0.02
"""MuJoCo's largest impedance; twice the step of the file, below which no row is softened, and its usual time, s."""
MIXED = (0.5 * (0.95 + 0.9), 0.5 * (0.02 + 0.003), 0.5 * (1.0 + 0.8))
"""Impedance, time and ratio of the pair of two shapes: the mean of theirs."""
URDF = """<robot name="known"><link name="base"/>
<link name="arm"><inertial><origin xyz=".1 .02 -.03" rpy=".3 .5 .7"/><mass value="1.4"/>
<inertia ixx=".03" ixy=".002" ixz=".004" iyy=".05" iyz="-.003" izz=".04"/></inertial></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><origin xyz="0 0.1 1" rpy=".2 -.4 .9"/>
<axis xyz="0 1 0"/><limit lower="-1" upper="2" effort="50" velocity="9"/>
<dynamics damping=".05" friction="0.2"/></joint></robot>"""
FLOATS = """<robot name="known"><link name="base"/><link name="stand"/><link name="ship"><inertial><mass value="1"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<joint name="stands" type="fixed"><parent link="base"/><child link="stand"/>
<origin xyz="1 2 3" rpy="0 0 1.5707963267948966"/></joint>
<joint name="floats" type="floating"><parent link="stand"/><child link="ship"/>
<origin xyz=".5 0 .25" rpy="0 .6 0"/></joint></robot>"""
STARTS = """<mujoco><worldbody><body><joint name="rail" type="slide" axis="1 0 0"/><geom size=".1"/></body></worldbody>
<actuator><motor joint="rail"/></actuator>
<keyframe><key name="one" qpos=".3" qvel="-2" ctrl=".7"/></keyframe></mujoco>"""
OTHER = 1e-6
"""By which another start is off."""
Asked = tuple[str, Any, Any]


@cache
def wrong() -> tuple[Found, ...]:
    """Return what was read, as it is, least and most, and of which file; nothing where no compiler is installed."""
    return unlike_read(_mjcf, _urdf, _floating, _start)


def unlike_read(*kinds: Callable[[], Iterable[Asked]]) -> tuple[Found, ...]:
    """Return what of these is another than it must be, as `wrong`."""
    return tuple(
        (f"reader of {kind.__name__.strip('_')}", *one, what)
        for kind in (kinds if find_spec("mujoco") else ())
        for what, mine, right in rows_of(kind, lambda why: (why, np.nan, ""))  # what cannot be read has no numbers
        if (one := _off(mine, right))
    )


def _off(mine: Any, right: Any) -> tuple[float, Range] | None:
    """Return the number that differs most, and what it must be; 1 for words that differ."""
    if isinstance(right, str):
        return None if mine == right else (np.nan, (np.nan, np.nan))
    a, b = (np.atleast_1d(np.asarray(one, dtype=np.float64)).ravel() for one in (mine, right))
    if a.shape != b.shape:
        return float(len(a)), (float(len(b)),) * 2
    with np.errstate(invalid="ignore"):  # of two that are infinite
        apart = np.abs(a - b)
    off = np.where(a == b, 0.0, apart - EXACT * np.max(np.abs(b[np.isfinite(b)]), initial=1e-3))
    worst = int(np.argmax(off))
    return (float(a[worst]), (float(b[worst]),) * 2) if not off[worst] <= 0.0 else None


def scene_of(text: str, name: str) -> Scene:
    """Return the scene that is read from a text, under the name of a file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_text(text, encoding="utf-8")
        scene = cases.load(str(path)).scene
    assert scene is not None
    return scene


def softened(dmax: float, time: float, ratio: float) -> tuple[float, float]:
    """Return a0 and a1 of a row by its largest impedance, its time and its damping ratio."""
    return 1.0 / (dmax * time**2 * ratio**2), 2.0 / (dmax * time)


def fields(scene: Scene, group: str, name: str, wanted: dict[str, Any]) -> Iterator[Asked]:
    """Yield fields of a part of a scene, and what they must be."""
    part = next(one for one in getattr(scene, group) if one.name == name)
    for key, right in wanted.items():
        mine = (part.law.a0, part.law.a1) if key == "law" else getattr(part, key)
        yield f"{key} of {name}", mine, right


def _mjcf() -> Iterator[Asked]:
    scene, usual, turn = scene_of(MJCF, "known.xml"), softened(DMAX, WEAK, 1.0), math.radians
    mass, half = 500.0 * 8.0 * 0.1 * 0.2 * 0.3, math.sqrt(0.5)
    box = [mass * (b * b + c * c) / 3.0 for b, c in ((0.2, 0.3), (0.1, 0.3), (0.1, 0.2))]
    free, passive = (-np.inf, np.inf), {"armature": 0.02, "damping": (0.3, 0.04, 0.005), "friction_loss": 0.1}
    yield "gravity", scene.gravity, (0.0, 0.5, -9.0)
    parts: dict[tuple[str, str], dict[str, Any]] = {
        ("bodies", "arm"): {"position": (1.0, 2.0, 3.0), "orientation": (half, 0.0, 0.0, half), "mass": mass,
                            "com": (0.0, 0.0, 0.0), "inertia": (*box, 0.0, 0.0, 0.0)},
        ("bodies", "tip"): {"parent": "arm", "position": (0.0, 0.0, 1.0), "mass": 2.0, "com": (0.1, 0.0, 0.0),
                            "inertia": (1.0, 2.0, 2.5, 0.1, 0.2, 0.3)},
        ("joints", "turn"): passive | {
            "type": "hinge", "axis": (0.0, 1.0, 0.0), "range": (turn(-90.0), turn(45.0)), "reference": turn(30.0),
            "rest": turn(10.0), "stiffness": (2.0, 0.6, 0.07), "law": usual, "force_range": free,
        },
        ("joints", "slide"): passive | {"type": "slide", "axis": (0.0, 0.0, 1.0), "range": (-0.4, 0.5), "rest": 0.0,
                                        "stiffness": (0.0, 0.0, 0.0), "law": softened(DMAX, STIFF, 0.5)},
        ("loops", "gear"): {"type": "joint", "first": "slide", "second": "turn",
                            "polynomial": (0.1, 0.2, 0.3, 0.0, 0.0), "law": (400.0 / DMAX, 30.0 / DMAX)},
        ("tendons", "rope"): {"coefficients": (2.0, -3.0), "stiffness": (5.0, 0.0, 0.0), "damping": (0.5, 0.0, 0.0),
                              "rest": (0.2, 0.2), "range": (-1.0, 2.0), "law": usual},
        ("actuators", "servo"): {"joint": "turn", "gear": (2.0, 0.0, 0.0, 0.0, 0.0, 0.0), "gain": (7.0, 0.0, 0.0),
                                 "bias": (0.0, -7.0, -0.6), "control_range": (-1.0, 2.0), "force_range": (-3.0, 4.0)},
        ("actuators", "lag"): {"activation": "filter", "time_constant": 0.25, "activation_range": (-0.5, 0.7),
                               "gain": (9.0, 0.0, 0.0), "force_range": free, "control_range": free},
        ("actuators", "slow"): {"activation": "filter", "time_constant": 0.5, "activation_range": free},
        ("actuators", "sum"): {"activation": "integrator", "tendon": "rope", "gain": (3.0, 0.0, 0.0),
                               "bias": (1.0, 2.0, 3.0)},
        ("shapes", "box"): {"type": "box", "size": (0.1, 0.2, 0.3), "body": "arm"},
        ("pairs", "floor:box"): {"friction": (0.7, 0.7, 0.0, 0.0, 0.0), "law": softened(*MIXED), "dimension": 3},
    }  # fmt: skip
    for (group, name), wanted in parts.items():
        yield from fields(scene, group, name, wanted)


def _turned(roll: float, pitch: float, yaw: float) -> Floats:
    """Return the rotation about fixed axes x, y and z, one after the other."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(x), math.sin(x)) for x in (roll, pitch, yaw))
    x = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    y = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    z = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    found: Floats = z @ y @ x
    return found


def _urdf() -> Iterator[Asked]:
    scene = scene_of(URDF, "known.urdf")
    own, R = np.array([[0.03, 0.002, 0.004], [0.002, 0.05, -0.003], [0.004, -0.003, 0.04]]), _turned(0.3, 0.5, 0.7)
    about, stands = R @ own @ R.T, _turned(0.2, -0.4, 0.9)
    six = [about[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    yield from fields(scene, "bodies", "arm", {
        "position": (0.0, 0.1, 1.0), "mass": 1.4, "com": (0.1, 0.02, -0.03), "inertia": six,
    })  # fmt: skip
    yield from fields(scene, "joints", "turn", {
        "type": "hinge", "axis": (0.0, 1.0, 0.0), "range": (-1.0, 2.0), "force_range": (-50.0, 50.0),
        "damping": (0.05, 0.0, 0.0), "friction_loss": 0.2,
    })  # fmt: skip
    w, *along = next(body.orientation for body in scene.bodies if body.name == "arm")
    trace = float(np.trace(stands))
    yield "turn of arm", 4.0 * w * w - 1.0, trace
    turns = np.array([stands[2, 1] - stands[1, 2], stands[0, 2] - stands[2, 0], stands[1, 0] - stands[0, 1]])
    yield "axis of the turn of arm", 4.0 * w * np.array(along), turns


def _floating() -> Iterator[Asked]:
    """Yield where a body stands that floats on a fixed link, turned by a right angle about z, and at 0.6 rad to it."""
    right, c, s = math.sqrt(0.5), math.cos(0.3), math.sin(0.3)
    yield from fields(scene_of(FLOATS, "known.urdf"), "bodies", "ship", {
        "position": (1.0, 2.5, 3.25), "orientation": (right * c, -right * s, right * s, right * c),
    })  # fmt: skip


def _start() -> Iterator[Asked]:
    """Yield how many rows about the start of a file are wrong: of its own start none, of others one each."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "known.xml"
        path.write_text(STARTS, encoding="utf-8")
        case = cases.load(str(path), "one")
        assert case.inputs is not None
        others = {
            "its own": case, "another place": replace(case, q0=case.q0 + OTHER),
            "another speed": replace(case, v0=case.v0 - OTHER),
            "another control": replace(case, inputs=replace(case.inputs, values=case.inputs.values + OTHER)),
        }  # fmt: skip
        for what, one in others.items():
            wrong_ = sum(not row.ok for row in start_of_file(one))
            yield f"rows of a start that is {what}", wrong_, int(one is not case)
