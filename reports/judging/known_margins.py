"""What must be read from an MJCF of what most files have none of: margins, anchors, joints and tendons of other kinds.

A margin that is lost shows in no motion that stays away from its bound, nor does a bound. Each number stands in the
file once and is none that would be there by itself (`tests/cases/test_known_files.py` holds all fields of a scene's
parts against those that are asked for here and in `known_files`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np

from crossbody.reports.judging.asked import Found
from crossbody.reports.judging.known_files import DMAX, WEAK, Asked, fields, scene_of, softened, unlike_read

MJCF = """<mujoco><compiler angle="radian" autolimits="true"/><worldbody>
<geom name="ground" type="plane" size="1 1 1" margin="0.003" friction="0.1 0.001 0.0001"/>
<site name="hook" pos="0.1 0.2 3"/>
<body name="ball" pos="0 0 1" gravcomp="0.3">
<joint name="socket" type="ball" pos="0.1 0.2 0.3" range="0 1.2" margin="0.05"/>
<geom name="egg" type="ellipsoid" size=".1 .2 .3" pos="0.01 0.02 0.03" euler="0 0 0.5" mass="2" margin="0.004"
 friction="0.5 0.02 0.003" condim="6"/>
<body name="rod" pos="0 0 .5">
<joint name="knee" axis="0 1 0" pos="0 0 -0.1" range="-1 1" margin="0.02" actuatorfrcrange="-5 6"/>
<geom name="stick" type="capsule" size=".05 .2" mass="1"/><site name="eye" pos=".01 .02 .03"/></body></body>
<body name="cart" pos="1 0 1"><joint name="rail" type="slide" axis="1 0 0" range="-1 1" margin="0.01"/>
<geom name="cube" type="box" size=".1 .1 .1" mass="1"/></body></worldbody>
<contact><pair geom1="egg" geom2="cube" margin="0.006" friction="0.4 0.3 0.02 0.001 0.002" condim="4"
 solref="0.05 0.7"/></contact>
<equality><connect name="pin" body1="rod" body2="cart" anchor="0.1 0.2 0.3"/>
<weld name="glue" body1="rod" body2="cart" anchor="0.1 0.2 0.3" relpose="0.3 0.4 0.5 0.8 0 0.6 0" torquescale="0.7"/>
<tendon name="tie" tendon1="sum" tendon2="other" polycoef="0.1 1.5 0 0 0"/></equality>
<tendon><spatial name="wire" range="0.5 2" margin="0.03" damping="0.4" frictionloss="0.2">
<site site="hook"/><site site="eye"/></spatial>
<fixed name="sum"><joint joint="knee" coef="1"/><joint joint="rail" coef="2"/></fixed>
<fixed name="other"><joint joint="rail" coef="-1"/></fixed></tendon>
<actuator><motor name="push" joint="rail" gear="3" armature="0.04" damping="0.5"/>
<general name="soft" joint="rail" gaintype="affine" gainprm="2 0.3 0.04"/>
<general name="hard" joint="rail" gaintype="fixed" gainprm="5 0.6 0.07"/></actuator></mujoco>"""


@cache
def wrong() -> tuple[Found, ...]:
    """Return what was read, as it is, least and most; nothing where no compiler is installed."""
    return unlike_read(_unusual)


def _unusual() -> Iterator[Asked]:
    scene, usual = scene_of(MJCF, "beside.xml"), softened(DMAX, WEAK, 1.0)
    half, away = 0.25, math.hypot(0.09, 0.18, 1.47)
    first, second, third = (0.2 * 2.0 * (b * b + c * c) for b, c in ((0.2, 0.3), (0.1, 0.3), (0.1, 0.2)))
    mean, apart = 0.5 * (first + second), 0.5 * (first - second)  # turned by twice a quarter about z
    egg = (mean + apart * math.cos(4.0 * half), mean - apart * math.cos(4.0 * half), third)
    place, none = (0.1, 0.2, 0.3), (0.0, 0.0, 0.0)
    parts: dict[tuple[str, str], dict[str, Any]] = {
        ("bodies", "ball"): {"mass": 2.0, "com": (0.01, 0.02, 0.03), "weightless": 0.3,
                             "inertia": (*egg, apart * math.sin(4.0 * half), 0.0, 0.0)},
        ("joints", "socket"): {"type": "ball", "body": "ball", "anchor": place, "range": (-np.inf, 1.2),
                               "margin": 0.05, "law": usual, "rest": (1.0, 0.0, 0.0, 0.0)},
        ("joints", "knee"): {"type": "hinge", "body": "rod", "anchor": (0.0, 0.0, -0.1), "range": (-1.0, 1.0),
                             "margin": 0.02, "force_range": (-5.0, 6.0)},
        ("joints", "rail"): {"type": "slide", "body": "cart", "axis": (1.0, 0.0, 0.0), "margin": 0.01},
        ("shapes", "egg"): {"type": "ellipsoid", "size": place, "position": (0.01, 0.02, 0.03), "margin": 0.004,
                            "orientation": (math.cos(half), 0.0, 0.0, math.sin(half)), "friction": (0.5, 0.02, 0.003)},
        ("shapes", "ground"): {"type": "plane", "body": "", "margin": 0.003},
        ("pairs", "egg:cube"): {"first": "egg", "second": "cube", "margin": 0.006, "dimension": 4,
                                "friction": (0.4, 0.3, 0.02, 0.001, 0.002), "law": softened(DMAX, 0.05, 0.7)},
        ("pairs", "ground:egg"): {"margin": 0.007, "dimension": 6, "friction": (0.5, 0.5, 0.02, 0.003, 0.003)},
        ("loops", "pin"): {"type": "connect", "first": "rod", "second": "cart", "first_position": place,
                           "second_position": (-0.9, 0.2, 0.8), "law": usual},
        ("loops", "glue"): {"type": "weld", "first": "rod", "second": "cart", "first_position": (0.3, 0.4, 0.5),
                            "second_position": place, "orientation": (0.8, 0.0, 0.6, 0.0), "torque_scale": 0.7},
        ("loops", "tie"): {"type": "tendon", "first": "sum", "second": "other",
                           "polynomial": (0.1, 1.5, 0.0, 0.0, 0.0)},
        ("tendons", "wire"): {"positions": ((0.1, 0.2, 3.0), (0.01, 0.02, 0.03)), "range": (0.5, 2.0), "margin": 0.03,
                              "damping": (0.4, *none[:2]), "friction_loss": 0.2, "rest": (away,) * 2,
                              "law": usual},
        ("tendons", "sum"): {"coefficients": (1.0, 2.0), "rest": (0.0, 0.0)},
        ("actuators", "soft"): {"joint": "rail", "gain": (2.0, 0.3, 0.04), "bias": none},
        ("actuators", "hard"): {"joint": "rail", "gain": (5.0, 0.0, 0.0), "bias": none},
        ("actuators", "push"): {"joint": "rail", "armature": 0.04, "damping": 0.5,
                                "gear": (3.0, 0.0, 0.0, 0.0, 0.0, 0.0)},
    }  # fmt: skip
    for (group, name), wanted in parts.items():
        yield from fields(scene, group, name, wanted)
    joined = {one.name: " ".join(one.joints or one.bodies) for one in scene.tendons}
    yield from ((f"joints of {name}", joined[name], said) for name, said in (("sum", "knee rail"), ("other", "rail")))
    yield "bodies of wire", joined["wire"], " rod"
