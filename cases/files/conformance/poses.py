"""Features of MJCF: where bodies stand."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from crossbody.cases.files.conformance.arm import HAND, LOWER, LOWER_INERTIAL, UPPER, Feature, arm, mjcf, turned
from crossbody.cases.scene import Body

POSE_RULE = (
    "A body's orientation is a quaternion, or euler, axisangle, xyaxes or zaxis in the compiler's unit and sequence."
)
POSE_WAY = "Write it as quat, of length 1."


def features() -> list[Feature]:
    """Return the features of where bodies stand."""

    def of(name: str, lower: str, turns: dict[str, Any], finds: str, head: str = "") -> Feature:
        return Feature(
            name, mjcf(head=head, lower=f'pos="0 .05 -.4" {lower}'), arm(lower=turns), finds, POSE_RULE, POSE_WAY
        )

    c, s = float(np.cos(0.2)), float(np.sin(0.2))
    root = Body(name="root", position=(0.3, 0.0, 0.1), **turned(("x", 40), ("z", 30)))
    w, x, y, z = root.orientation
    fixed = f'<body name="root" pos=".3 0 .1" quat="{w!r} {x!r} {y!r} {z!r}">'
    hand = replace(HAND, **turned(("y", 50)))
    hw, hx, hy, hz = hand.orientation
    return [
        of("quaternion", f'quat="{c!r} 0 {s!r} 0"', {"orientation": (c, 0.0, s, 0.0)}, ".//body[@quat]"),
        of("quaternion not of length 1", 'quat="2 0 1 0"', {"orientation": tuple(np.array([2.0, 0.0, 1.0,
            0.0]) / 5**0.5)}, ""),
        of("euler angles", 'euler="20 30 40"', turned(("x", 20), ("y", 30), ("z", 40)), ".//body[@euler]"),
        of("euler angles in radians", 'euler=".3 .4 .5"', turned(*zip("xyz", np.degrees([0.3, 0.4, 0.5]),
            strict=True)), "compiler[@angle='radian']", '<compiler angle="radian"/>'),
        of("euler sequence of moving axes", 'euler="20 30 40"', turned(("z", 20), ("y", 30), ("x", 40)),
            "compiler[@eulerseq]", '<compiler eulerseq="zyx"/>'),
        of("euler sequence of fixed axes", 'euler="20 30 40"', turned(("z", 40), ("y", 30), ("x", 20)),
            "compiler[@eulerseq]", '<compiler eulerseq="XYZ"/>'),
        of("axis and angle", 'axisangle="0 1 0 35"', turned(("y", 35)), ".//body[@axisangle]"),
        of("axis and angle, axis not of length 1", 'axisangle="0 2 0 35"', turned(("y", 35)), ".//body[@axisangle]"),
        of("two axes", 'xyaxes="0 1 0 -1 0 0"', turned(("z", 90)), ".//body[@xyaxes]"),
        of("two axes that are not perpendicular", 'xyaxes="0 2 0 -1 1 0"', turned(("z", 90)), ".//body[@xyaxes]"),
        of("direction of z", 'zaxis="1 0 0"', turned(("y", 90)), ".//body[@zaxis]"),
        Feature("fixed body with a pose under the world", mjcf(before=fixed, behind="</body>"),
            arm().replace(bodies=(root, replace(UPPER, parent="root"), LOWER)),
            "worldbody/body[@pos]!joint,freejoint | worldbody/body[@quat]!joint,freejoint",
            ("A body without joints is fixed to its parent at "
                "its pose."), "Merge its pose into those of its child bodies."),
        Feature("fixed body in the tree",
            mjcf(lower_inertial=LOWER_INERTIAL + f'<body name="hand" pos="0 .1 -.3" quat="{hw!r} {hx!r} {hy!r} '
            f'{hz!r}"><inertial pos=".02 0 .01" mass=".5" diaginertia=".003 .004 .005"/></body>'),
            arm().replace(bodies=(UPPER, LOWER, hand)), ".//body/body!joint,freejoint",
            rule="A body without joints is part of its parent."),
        Feature("frame", mjcf(inside='<frame pos="0 0 -.1" euler="0 0 90">',
            behind="").replace("</body>\n    </body>", "</body></frame>\n    </body>"), arm(lower={"position": (-0.05,
            0.0, -0.5)} | turned(("z", 90))), ".//frame", "A <frame> moves its contents.",
            "Merge its pose into those of its contents."),
        Feature("included file", mjcf(inside="", lower_inertial='<include file="part.xml"/>'), arm(), ".//include",
            "The content of a file is placed where it is included.", "Write one file.",
            files={"part.xml": f"<mujocoinclude>{LOWER_INERTIAL}</mujocoinclude>"}),
    ]  # fmt: skip
