"""Features of MJCF: joints and their classes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from crossbody.cases.files.conformance.arm import ELBOW, MOTION, SECOND, SHOULDER, Feature, arm, mjcf, turned, two_trees

AXIS_RULE = "A joint inherits missing attributes from its class, and a class from the class around it."
AXIS_WAY = "Write axis, pos and type at the joint itself."


def features() -> list[Feature]:
    """Return the features of joints and their classes."""
    z = {"axis": (0.0, 0.0, 1.0)}
    hinge = '<joint name="shoulder" axis="0 1 0"/>'
    bare = '<joint name="elbow"/>'
    return [
        Feature("arm", mjcf(), arm(), ".//inertial[@diaginertia]", "An <inertial> gives mass, centre and moments."),
        Feature("no model name", mjcf(model=""), arm(), ".!@model=robot",
            rule="The attribute model of <mujoco> may be left out.",
            rewrite='Write <mujoco model="NAME">.'),
        Feature("integrator", mjcf(head='<option integrator="implicitfast"/>'), arm(), "option[@integrator]",
            "The integrator is a setting of MuJoCo, not a property of the robot.", "Leave it out for other readers."),
        Feature("axis of the main class", mjcf(head='<default><joint axis="0 1 0"/></default>', elbow=bare),
            arm(elbow={"axis": (0.0, 1.0, 0.0)}), "default/joint[@axis]", AXIS_RULE, AXIS_WAY),
        Feature("axis of a class", mjcf(head='<default><default class="a"><joint axis="0 1 0"/></default></default>',
            elbow='<joint name="elbow" class="a"/>'), arm(elbow={"axis": (0.0, 1.0, 0.0)}),
            "default/default/joint[@axis]", AXIS_RULE, AXIS_WAY),
        Feature("axis of a childclass",
            mjcf(head='<default><default class="a"><joint axis="0 1 0"/></default></default>',
            lower='pos="0 .05 -.4" childclass="a"', elbow=bare), arm(elbow={"axis": (0.0, 1.0, 0.0)}),
            ".//body[@childclass]", AXIS_RULE, AXIS_WAY),
        Feature("axis of a childclass of an ancestor",
            mjcf(head='<default><default class="a"><joint axis="0 1 0"/></default></default>',
            upper='pos=".1 .2 1" childclass="a"', elbow=bare), arm(elbow={"axis": (0.0, 1.0, 0.0)}),
            ".//body[@childclass]//body", AXIS_RULE, AXIS_WAY),
        Feature("class inside a class",
            mjcf(head='<default><default class="a"><joint axis="0 1 0"/><default class="b"><joint '
            'damping=".5"/></default></default></default>',
            elbow='<joint name="elbow" class="b"/>'), arm(elbow={"axis": (0.0, 1.0, 0.0), "damping": (0.5, 0.0, 0.0)}),
            "default/default/default/joint", AXIS_RULE, AXIS_WAY, (*MOTION, "damping")),
        Feature("class without a joint of its own",
            mjcf(head='<default><default class="a"><joint axis="0 1 0"/><default class="b"><geom type="box"/>'
            '</default></default></default>',
            elbow='<joint name="elbow" class="b"/>'), arm(elbow={"axis": (0.0, 1.0, 0.0)}),
            ".//default/default/default!joint=", AXIS_RULE, AXIS_WAY),
        Feature("joint position of a class", mjcf(head='<default><joint pos=".1 0 .05"/></default>'),
            arm(shoulder={"anchor": (0.1, 0.0, 0.05)}, elbow={"anchor": (0.1, 0.0, 0.05)}), ".//default/joint[@pos]",
            AXIS_RULE, AXIS_WAY),
        Feature("joint type of a class",
            mjcf(head='<default><default class="a"><joint type="slide"/></default></default>',
            elbow='<joint name="elbow" class="a" axis="1 0 0"/>'), arm(elbow={"type": "slide"}),
            ".//default/joint[@type]", AXIS_RULE, AXIS_WAY),
        Feature("joint position", mjcf(elbow='<joint name="elbow" axis="1 0 0" pos="0 .1 .05"/>'),
            arm(elbow={"anchor": (0.0, 0.1, 0.05)}), ".//body/joint[@pos]",
            "A joint turns about a point of its body."),
        Feature("axis not given", mjcf(elbow=bare), arm(elbow=z), ".//body/joint!@axis=0 0 1",
            rule="A hinge or slide without axis has 0 0 1.",
            rewrite=AXIS_WAY),
        Feature("axis not of length 1", mjcf(elbow='<joint name="elbow" axis="3 0 4"/>'), arm(elbow={"axis": (0.6,
            0.0, 0.8)}), rule="An axis is normalised.", rewrite="Write axes of length 1."),
        Feature("slide", mjcf(elbow='<joint name="elbow" type="slide" axis="1 0 0"/>'), arm(elbow={"type": "slide"}),
            ".//joint[@type='slide']"),
        Feature("ball joint", mjcf(elbow='<joint name="elbow" type="ball"/>'), arm(elbow={"type": "ball"}),
            ".//joint[@type='ball']"),
        Feature("ball joint with a position", mjcf(elbow='<joint name="elbow" type="ball" pos="0 .1 .05"/>'),
            arm(elbow={"type": "ball", "anchor": (0.0, 0.1, 0.05)}), ".//joint[@type='ball'][@pos]"),
        Feature("freejoint", mjcf(shoulder='<freejoint name="shoulder"/>'), arm(shoulder={"type": "free"}),
            ".//freejoint"),
        Feature("joint of type free", mjcf(shoulder='<joint name="shoulder" type="free"/>'),
            arm(shoulder={"type": "free"}), ".//joint[@type='free']",
            'Both <freejoint/> and <joint type="free"/> make a free body.', 'Write <joint type="free"/>.'),
        Feature("free body that is turned",
            mjcf(upper='pos=".1 .2 1" euler="20 30 40"', shoulder='<joint name="shoulder" type="free"/>'),
            arm(shoulder={"type": "free"}, upper=turned(("x", 20), ("y", 30), ("z", 40))), ".//freejoint/..[@quat] | "
            ".//freejoint/..[@euler] | .//joint[@type='free']/..[@quat] | .//joint[@type='free']/..[@euler]",
            "Positions of a free body are in the world frame, whatever its pose in the file.",
            "Leave the body upright, and turn it by a keyframe."),
        Feature("free joint without a name", mjcf(shoulder="<freejoint/>"), arm(shoulder={"type": "free",
            "name": "joint0"}), ".//freejoint"),
        Feature("two joints in a body",
            mjcf(elbow='<joint name="elbow" axis="1 0 0"/><joint name="wrist" axis="0 0 1"/>'),
            arm().replace(joints=(SHOULDER, ELBOW, replace(ELBOW, name="wrist", axis=(0.0, 0.0, 1.0)))),
            ".//body/joint[2]", "Joints of one body act in their order.",
            "Use one joint per body, with massless bodies in between."),
        Feature("three joints in a body",
            mjcf(elbow='<joint name="elbow" type="slide" axis="1 0 0"/><joint name="second" type="slide" '
            'axis="0 1 0"/><joint name="wrist" axis="0 0 1" pos=".1 0 0"/>'),
            arm().replace(joints=(SHOULDER, replace(ELBOW, type="slide"), replace(ELBOW, name="second", type="slide",
            axis=(0.0, 1.0, 0.0)), replace(ELBOW, name="wrist", axis=(0.0, 0.0, 1.0), anchor=(0.1, 0.0, 0.0)))),
            ".//body/joint[3]", "Joints of one body act in their order.",
            "Use one joint per body, with massless bodies in between."),
        Feature("reference", mjcf(elbow='<joint name="elbow" axis="1 0 0" ref="30"/>'),
            arm(elbow={"reference": np.pi / 6}), ".//joint[@ref]",
            "In the pose of the file a joint has the coordinate ref.", "Leave ref out and turn the body."),
        Feature("reference of a slide", mjcf(elbow='<joint name="elbow" type="slide" axis="1 0 0" ref=".2"/>'),
            arm(elbow={"reference": 0.2, "type": "slide"}), ".//joint[@ref]",
            "In the pose of the file a joint has the coordinate ref.", "Leave ref out and shift the body."),
        *(Feature(name, mjcf(shoulder=shoulder, tail=f'<keyframe><key {text}/></keyframe>'), scene,
            "keyframe/key", "A keyframe has positions of all joints, and a number instead of a missing name.", way,
            ("keyframes",), keys=keys)
            for name, shoulder, text, scene, way, keys in (
                ("keyframe", hinge, 'name="home" qpos=".3 -.4"', arm(), "Set the positions in the engine.",
                 {"home": np.array([0.3, -0.4])}),
                ("keyframe without a name", hinge, 'qpos=".3 -.4"', arm(), "Give it a name.",
                 {"key0": np.array([0.3, -0.4])}),
                ("keyframe of a free body", '<joint name="shoulder" type="free"/>',
                 'name="home" qpos="1 2 3 .36 .48 .64 .48 -.4"', arm(shoulder={"type": "free"}),
                 "Set the positions in the engine.",
                 {"home": np.array([1.0, 2.0, 3.0, 0.36, 0.48, 0.64, 0.48, -0.4])}))),
        Feature("two trees", mjcf(behind=SECOND), two_trees(), "worldbody/body[2]"),
    ]  # fmt: skip
