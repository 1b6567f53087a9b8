"""Every number of a robot's file goes to its own place in the scene: a file in which no two of a kind are equal."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import mujoco
import pytest

from crossbody.cases.files.mjcf import scene_of
from crossbody.cases.scene import RowLaw

FILE = """
<mujoco><compiler angle="radian" autolimits="false"/><option timestep="1e-4" gravity="1 2 -3"/><worldbody>
<geom name="floor" type="plane" size="1 1 1"/>
<body name="one" pos=".1 .2 .3" quat="0 1 0 0" gravcomp=".4">
<inertial pos=".01 .02 .03" mass="1.1" diaginertia=".5 .6 .7"/>
<joint name="hinge" type="hinge" axis="0 1 0" pos=".04 .05 .06" ref=".07" springref=".08" stiffness="1.2" damping="1.3"
 armature="1.4" frictionloss="1.5" limited="true" range="-.9 1.6" margin=".011" actuatorfrclimited="true"
 actuatorfrcrange="-2.1 2.2" solreflimit="-100 -10" solimplimit=".5 .91 .1" solreffriction="-101 -11"/>
<geom name="ball" type="sphere" size=".21" pos=".22 .23 .24" margin=".012" friction=".31 .32 .33"/>
<site name="start" pos=".25 .26 .27"/>
<body name="two" pos=".4 .5 .6"><inertial pos="0 0 0" mass="1.7" diaginertia=".8 .9 1"/>
<joint name="slide" type="slide" axis="1 0 0" limited="true" range="-.7 .8" margin=".013" solreflimit="-102 -12"
 solimplimit=".5 .92 .1" solreffriction="-103 -13"/>
<site name="end" pos=".28 .29 .3"/></body></body></worldbody>
<tendon>
<spatial name="rope" limited="true" range=".1 .9" margin=".014" stiffness="2.3" damping="2.4" springlength=".34 .35"
 frictionloss="2.5" solreflimit="-104 -14" solimplimit=".5 .93 .1" solreffriction="-105 -15" solimpfriction=".5 .94 .1">
<site site="start"/><site site="end"/></spatial>
<fixed name="sum" limited="true" range="-.2 .3" margin=".015" solreflimit="-106 -16" solimplimit=".5 .95 .1"
 solreffriction="-107 -17"><joint joint="hinge" coef="2.6"/><joint joint="slide" coef="2.7"/></fixed></tendon>
<equality>
<connect name="pin" body1="two" body2="one" anchor=".36 .37 .38" solref="-108 -18" solimp=".5 .96 .1"/>
<joint name="gears" joint1="slide" joint2="hinge" polycoef=".1 .2 .3 .4 .5" solref="-109 -19" solimp=".5 .97 .1"/>
<tendon name="pulleys" tendon1="sum" tendon2="rope" polycoef=".6 .7 .8 .9 1" solref="-110 -20" solimp=".5 .98 .1"/>
</equality>
<contact><pair name="meet" geom1="floor" geom2="ball" condim="1" margin=".016" friction=".41 .42 .43 .44 .45"
 solref="-111 -21" solimp=".5 .89 .1" solreffriction="-112 -22"/></contact>
<actuator><general name="drive" joint="hinge" gear="3.1" gaintype="affine" gainprm="3.2 3.3 3.4" biastype="affine"
 biasprm="3.5 3.6 3.7" ctrllimited="true" ctrlrange="-3.8 3.9" forcelimited="true" forcerange="-4.1 4.2"
 dyntype="filterexact" dynprm="4.3" actlimited="true" actrange="-4.4 4.5"/></actuator>
</mujoco>
"""


def law(stiffness: float, damping: float, dmax: float) -> RowLaw:
    """MuJoCo's direct form over its impedance."""
    return RowLaw(a0=stiffness / dmax, a1=damping / dmax)


WANTED: dict[tuple[str, int], dict[str, Any]] = {
    ("bodies", 0): {
        "name": "one", "parent": "", "position": (0.1, 0.2, 0.3), "orientation": (0.0, 1.0, 0.0, 0.0), "mass": 1.1,
        "com": (0.01, 0.02, 0.03), "inertia": (0.5, 0.6, 0.7, 0.0, 0.0, 0.0), "weightless": 0.4,
    },
    ("bodies", 1): {"name": "two", "parent": "one", "position": (0.4, 0.5, 0.6), "mass": 1.7},
    ("joints", 0): {
        "name": "hinge", "body": "one", "type": "hinge", "axis": (0.0, 1.0, 0.0), "anchor": (0.04, 0.05, 0.06),
        "reference": 0.07, "rest": (0.08,), "stiffness": (1.2, 0.0, 0.0), "damping": (1.3, 0.0, 0.0), "armature": 1.4,
        "friction_loss": 1.5, "range": (-0.9, 1.6), "margin": 0.011, "force_range": (-2.1, 2.2),
        "law": law(100.0, 10.0, 0.91),
    },
    ("joints", 1): {
        "name": "slide", "body": "two", "type": "slide", "axis": (1.0, 0.0, 0.0), "range": (-0.7, 0.8),
        "margin": 0.013, "law": law(102.0, 12.0, 0.92),
    },
    ("shapes", 1): {
        "name": "ball", "body": "one", "type": "sphere", "position": (0.22, 0.23, 0.24), "margin": 0.012,
        "friction": (0.31, 0.32, 0.33),
    },
    ("pairs", 0): {
        "name": "floor:ball", "first": "floor", "second": "ball", "margin": 0.016, "dimension": 1,
        "friction": (0.41, 0.42, 0.43, 0.44, 0.45), "law": law(111.0, 21.0, 0.89),
    },
    ("loops", 0): {
        "name": "pin", "type": "connect", "first": "two", "second": "one", "first_position": (0.36, 0.37, 0.38),
        "law": law(108.0, 18.0, 0.96),
    },
    ("loops", 1): {
        "name": "gears", "type": "joint", "first": "slide", "second": "hinge",
        "polynomial": (0.1, 0.2, 0.3, 0.4, 0.5), "law": law(109.0, 19.0, 0.97),
    },
    ("loops", 2): {
        "name": "pulleys", "type": "tendon", "first": "sum", "second": "rope",
        "polynomial": (0.6, 0.7, 0.8, 0.9, 1.0), "law": law(110.0, 20.0, 0.98),
    },
    ("tendons", 0): {
        "name": "rope", "bodies": ("one", "two"), "positions": ((0.25, 0.26, 0.27), (0.28, 0.29, 0.3)),
        "range": (0.1, 0.9), "margin": 0.014, "stiffness": (2.3, 0.0, 0.0), "damping": (2.4, 0.0, 0.0),
        "rest": (0.34, 0.35), "friction_loss": 2.5, "law": law(104.0, 14.0, 0.93),
    },
    ("tendons", 1): {
        "name": "sum", "joints": ("hinge", "slide"), "coefficients": (2.6, 2.7), "range": (-0.2, 0.3),
        "margin": 0.015, "law": law(106.0, 16.0, 0.95),
    },
    ("actuators", 0): {
        "name": "drive", "joint": "hinge", "gain": (3.2, 3.3, 3.4), "bias": (3.5, 3.6, 3.7),
        "control_range": (-3.8, 3.9), "force_range": (-4.1, 4.2), "activation": "filter", "time_constant": 4.3,
        "activation_range": (-4.4, 4.5),
    },
}  # fmt: skip


@pytest.mark.parametrize(("part", "number"), WANTED, ids=lambda each: str(each))
def test_every_number_of_a_file_goes_to_its_place(part: str, number: int) -> None:
    scene = scene_of(mujoco.MjModel.from_xml_string(FILE))
    found, wanted = getattr(scene, part)[number], WANTED[part, number]
    assert scene.gravity == (1.0, 2.0, -3.0)
    for name, value in wanted.items():
        mine = getattr(found, name)
        if isinstance(value, RowLaw):
            assert asdict(mine) == pytest.approx(asdict(value), rel=1e-12), name
        else:
            assert mine == (pytest.approx(value, rel=1e-12) if name == "inertia" else value), name
