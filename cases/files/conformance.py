"""Features of robot files, one a file, each with the scene that it means: written here, not read by anybody.

Most are an arm of two links, told in another way; what it is to be stands beside as changes of that arm.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.files.inertias import Inertia, placed, six, solid, together
from crossbody.cases.rotations import matrices
from crossbody.cases.scene import Actuator, Body, Joint, Loop, Scene, Tendon

MOTION = ("coordinates", "inertia", "M", "gravity", "bias", "energy", "frames")


@dataclass(frozen=True, slots=True, kw_only=True)
class Feature:
    """One way of writing something.

    Attributes:
        name: of the file too.
        format: mjcf or urdf.
        text: the smallest file that has it.
        scene: what it means.
        about: quantities by which a reader is judged.
        finds: paths of ElementTree by which a file is seen to use it; behind a ! children and @attributes that are
            not there; empty for what no path tells.
        rule: what the format says, in a sentence.
        rewrite: how to write it so that every reader reads the same; empty where there is no such way.
        files: what else stands beside it, name -> text.
    """

    name: str
    format: str = "mjcf"
    text: str
    scene: Scene
    about: tuple[str, ...] = MOTION
    finds: tuple[str, ...] = ()
    rule: str = ""
    rewrite: str = ""
    files: Mapping[str, str] = field(default_factory=dict)


UPPER = Body(
    name="upper", position=(0.1, 0.2, 1.0), mass=2.0, com=(0.05, 0.02, -0.2), inertia=(0.04, 0.05, 0.02, 0.0, 0.0, 0.0)
)
LOWER = Body(
    name="lower", parent="upper", position=(0.0, 0.05, -0.4), mass=1.0, com=(0.01, 0.03, -0.15),
    inertia=(0.02, 0.03, 0.015, 0.0, 0.0, 0.0),
)  # fmt: skip
SHOULDER = Joint(name="shoulder", body="upper", type="hinge", axis=(0.0, 1.0, 0.0))
ELBOW = Joint(name="elbow", body="lower", type="hinge", axis=(1.0, 0.0, 0.0))
UPPER_INERTIAL = '<inertial pos=".05 .02 -.2" mass="2" diaginertia=".04 .05 .02"/>'
LOWER_INERTIAL = '<inertial pos=".01 .03 -.15" mass="1" diaginertia=".02 .03 .015"/>'
ELBOW_TEXT = '<joint name="elbow" axis="1 0 0"/>'


def arm(upper: Any = (), lower: Any = (), shoulder: Any = (), elbow: Any = (), **more: Any) -> Scene:
    """Return the arm with changes of its parts."""
    bodies = (replace(UPPER, **dict(upper)), replace(LOWER, **dict(lower)))
    joints = (replace(SHOULDER, **dict(shoulder)), replace(ELBOW, **dict(elbow)))
    return Scene(**({"bodies": bodies, "joints": joints} | more))


def mjcf(
    *, head: str = "", upper: str = 'pos=".1 .2 1"', shoulder: str = '<joint name="shoulder" axis="0 1 0"/>',
    upper_inertial: str = UPPER_INERTIAL, lower: str = 'pos="0 .05 -.4"', elbow: str = ELBOW_TEXT,
    lower_inertial: str = LOWER_INERTIAL, before: str = "", behind: str = "", tail: str = "", inside: str = "",
    model: str = ' model="conformance"',
) -> str:  # fmt: skip
    """Return the arm as MJCF, with parts of it written in another way."""
    return (
        f'<mujoco{model}>\n  {head}\n  <worldbody>\n    {before}<body name="upper" {upper}>\n      {shoulder}\n'
        f'      {upper_inertial}\n      {inside}<body name="lower" {lower}>\n        {elbow}\n        '
        f"{lower_inertial}\n"
        f"      </body>\n    </body>{behind}\n  </worldbody>\n  {tail}\n</mujoco>\n"
    )


def link(name: str, pos: str, mass: float, inertia: str, rpy: str = "0 0 0") -> str:
    """Return a link of a URDF."""
    return (
        f'<link name="{name}"><inertial><origin xyz="{pos}" rpy="{rpy}"/><mass value="{mass:g}"/><inertia {inertia}/>'
        "</inertial></link>"
    )


def moments(xx: float, yy: float, zz: float, xy: float = 0.0, xz: float = 0.0, yz: float = 0.0) -> str:
    """Return the attributes of a URDF's inertia."""
    return f'ixx="{xx:g}" iyy="{yy:g}" izz="{zz:g}" ixy="{xy:g}" ixz="{xz:g}" iyz="{yz:g}"'


def urdf_joint(name: str, parent: str, child: str, more: str, kind: str = "revolute") -> str:
    """Return a joint of a URDF."""
    bounds = '<limit lower="-3" upper="3" effort="100" velocity="10"/>' if kind in ("revolute", "prismatic") else ""
    bounds = "" if "<limit" in more else bounds
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{more}{bounds}</joint>'


UPPER_AT, LOWER_AT = '<origin xyz=".1 .2 1"/>', '<origin xyz="0 .05 -.4"/>'
UPPER_LINK = link("upper", ".05 .02 -.2", 2.0, moments(0.04, 0.05, 0.02))
LOWER_LINK = link("lower", ".01 .03 -.15", 1.0, moments(0.02, 0.03, 0.015))


def urdf(
    *, base: str = '<link name="base"/>', upper: str = UPPER_LINK, lower: str = LOWER_LINK,
    shoulder: str = urdf_joint("shoulder", "base", "upper", UPPER_AT + '<axis xyz="0 1 0"/>'),
    elbow: str = urdf_joint("elbow", "upper", "lower", LOWER_AT + '<axis xyz="1 0 0"/>'), more: str = "",
) -> str:  # fmt: skip
    """Return the arm as URDF, with parts of it written in another way."""
    return '<robot name="conformance">\n  ' + "\n  ".join((base, upper, lower, shoulder, elbow, more)) + "\n</robot>\n"


BOUNDED = {"range": (-3.0, 3.0)}


def urdf_arm(shoulder: Any = (), elbow: Any = (), base: bool = True, **more: Any) -> Scene:
    """Return the arm of a URDF, whose joints are bounded and whose base stands on the world."""
    made = arm(shoulder=BOUNDED | dict(shoulder), elbow=BOUNDED | dict(elbow), **more)
    root = Body(name="base")
    hung = (replace(made.bodies[0], parent="base"), *made.bodies[1:])
    return made.replace(bodies=(root, *hung)) if base else made


def rotation(axis: str, degrees: float) -> Floats:
    """Return a turn about one of the axes x, y and z."""
    i = "xyz".index(axis)
    half = np.radians(degrees) / 2
    return matrices(np.array([np.cos(half), *(np.sin(half) * np.eye(3)[i])]))


def quaternion(R: Floats) -> tuple[float, ...]:
    """Return the quaternion (w first) of a rotation of less than half a turn."""
    w = np.sqrt(1.0 + np.trace(R)) / 2
    return (float(w), *(float(x) for x in (R[[2, 0, 1], [1, 2, 0]] - R[[1, 2, 0], [2, 0, 1]]) / (4 * w)))


def turned(*turns: tuple[str, float]) -> dict[str, Any]:
    """Return the orientation of a body behind turns about its own axes, one behind the other."""
    R = np.eye(3)
    for axis, degrees in turns:
        R = R @ rotation(axis, degrees)
    return {"orientation": quaternion(R)}


def weighing(*parts: Inertia) -> dict[str, Any]:
    """Return mass, centre and inertia of a body that is made of solids."""
    mass, com, about = together(parts)
    return {"mass": mass, "com": tuple(com.tolist()), "inertia": six(about)}


def of_shape(kind: str, size: tuple[float, ...], density: float = 1000.0, **at: Any) -> Inertia:
    """Return a solid of a density."""
    volume, unit = solid(kind, size)
    return placed(density * volume, unit, **at)


AXIS_RULE = (
    "A joint takes what it does not say from its class, and a class what it does not say from the class around it."
)
AXIS_WAY = "Write axis, pos and type at the joint itself."
POSE_RULE = (
    "A body's orientation is a quaternion, or euler, axisangle, xyaxes or zaxis in the compiler's unit and sequence."
)
POSE_WAY = "Write it as quat, of length 1."
SHAPE_RULE = "A body without <inertial> has the inertia of its geoms: volume times density (1000), or their mass."
SHAPE_WAY = "Write an <inertial> with pos, mass and fullinertia."


def _shapes() -> list[Feature]:
    sizes = {
        "sphere": (0.1,),
        "capsule": (0.05, 0.2),
        "cylinder": (0.06, 0.15),
        "box": (0.05, 0.1, 0.15),
        "ellipsoid": (0.05, 0.1, 0.15),
    }
    found = []
    for kind, size in sizes.items():
        geom = f'<geom type="{kind}" size="{" ".join(map(str, size))}" pos="0 .02 -.15"/>'
        found.append(Feature(
            name=f"inertia of a {kind}", text=mjcf(lower_inertial=geom),
            scene=arm(lower=weighing(of_shape(kind, size, position=(0.0, 0.02, -0.15)))), about=MOTION,
            finds=(f".//geom[@type='{kind}']",), rule=SHAPE_RULE, rewrite=SHAPE_WAY,
        ))  # fmt: skip
    return found


def _written(
    name: str,
    text: str,
    scene: Scene,
    finds: str = "",
    rule: str = "",
    rewrite: str = "",
    about: tuple[str, ...] = MOTION,
    **more: Any,
) -> Feature:
    return Feature(
        name=name,
        text=text,
        scene=scene,
        about=about,
        finds=tuple(filter(None, finds.split(" | "))),
        rule=rule,
        rewrite=rewrite,
        **more,
    )


def _joints() -> list[Feature]:
    z = {"axis": (0.0, 0.0, 1.0)}
    bare = '<joint name="elbow"/>'
    return [
        _written("arm", mjcf(), arm(), ".//inertial[@diaginertia]", "An <inertial> says mass, centre and moments."),
        _written("no model name", mjcf(model=""), arm(), ".!@model",
            rule="The attribute model of <mujoco> may be left out.",
            rewrite='Write <mujoco model="NAME">.'),
        _written("integrator", mjcf(head='<option integrator="implicitfast"/>'), arm(), "option[@integrator]",
            "The integrator is MuJoCo's own and no physics of the robot.", "Leave it out for other readers."),
        _written("axis of the main class", mjcf(head='<default><joint axis="0 1 0"/></default>', elbow=bare),
            arm(elbow={"axis": (0.0, 1.0, 0.0)}), "default/joint[@axis]", AXIS_RULE, AXIS_WAY),
        _written("axis of a class", mjcf(head='<default><default class="a"><joint axis="0 1 0"/></default></default>',
            elbow='<joint name="elbow" class="a"/>'), arm(elbow={"axis": (0.0, 1.0, 0.0)}),
            "default/default/joint[@axis]", AXIS_RULE, AXIS_WAY),
        _written("axis of a childclass",
            mjcf(head='<default><default class="a"><joint axis="0 1 0"/></default></default>',
            lower='pos="0 .05 -.4" childclass="a"', elbow=bare), arm(elbow={"axis": (0.0, 1.0, 0.0)}),
            ".//body[@childclass]", AXIS_RULE, AXIS_WAY),
        _written("axis of a childclass further up",
            mjcf(head='<default><default class="a"><joint axis="0 1 0"/></default></default>',
            upper='pos=".1 .2 1" childclass="a"', elbow=bare), arm(elbow={"axis": (0.0, 1.0, 0.0)}),
            ".//body[@childclass]//body", AXIS_RULE, AXIS_WAY),
        _written("class inside a class",
            mjcf(head='<default><default class="a"><joint axis="0 1 0"/><default class="b"><joint '
            'damping=".5"/></default></default></default>',
            elbow='<joint name="elbow" class="b"/>'), arm(elbow={"axis": (0.0, 1.0, 0.0), "damping": (0.5, 0.0, 0.0)}),
            "default/default/default/joint", AXIS_RULE, AXIS_WAY, (*MOTION, "damping")),
        _written("class without a joint of its own",
            mjcf(head='<default><default class="a"><joint axis="0 1 0"/><default class="b"><geom type="box"/>'
            '</default></default></default>',
            elbow='<joint name="elbow" class="b"/>'), arm(elbow={"axis": (0.0, 1.0, 0.0)}),
            ".//default/default/default!joint", AXIS_RULE, AXIS_WAY),
        _written("joint position of a class", mjcf(head='<default><joint pos=".1 0 .05"/></default>'),
            arm(shoulder={"anchor": (0.1, 0.0, 0.05)}, elbow={"anchor": (0.1, 0.0, 0.05)}), ".//default/joint[@pos]",
            AXIS_RULE, AXIS_WAY),
        _written("joint type of a class",
            mjcf(head='<default><default class="a"><joint type="slide"/></default></default>',
            elbow='<joint name="elbow" class="a" axis="1 0 0"/>'), arm(elbow={"type": "slide"}),
            ".//default/joint[@type]", AXIS_RULE, AXIS_WAY),
        _written("joint position", mjcf(elbow='<joint name="elbow" axis="1 0 0" pos="0 .1 .05"/>'),
            arm(elbow={"anchor": (0.0, 0.1, 0.05)}), ".//body/joint[@pos]",
            "A joint turns about a point of its body."),
        _written("axis not given", mjcf(elbow=bare), arm(elbow=z), ".//body/joint!@axis",
            rule="A hinge or slide without axis has 0 0 1.",
            rewrite=AXIS_WAY),
        _written("axis not of length 1", mjcf(elbow='<joint name="elbow" axis="3 0 4"/>'), arm(elbow={"axis": (0.6,
            0.0, 0.8)}), rule="An axis is brought to length 1.", rewrite="Write axes of length 1."),
        _written("slide", mjcf(elbow='<joint name="elbow" type="slide" axis="1 0 0"/>'), arm(elbow={"type": "slide"}),
            ".//joint[@type='slide']"),
        _written("ball joint", mjcf(elbow='<joint name="elbow" type="ball"/>'), arm(elbow={"type": "ball"}),
            ".//joint[@type='ball']"),
        _written("ball joint with a position", mjcf(elbow='<joint name="elbow" type="ball" pos="0 .1 .05"/>'),
            arm(elbow={"type": "ball", "anchor": (0.0, 0.1, 0.05)}), ".//joint[@type='ball'][@pos]"),
        _written("freejoint", mjcf(shoulder='<freejoint name="shoulder"/>'), arm(shoulder={"type": "free"}),
            ".//freejoint"),
        _written("joint of type free", mjcf(shoulder='<joint name="shoulder" type="free"/>'),
            arm(shoulder={"type": "free"}), ".//joint[@type='free']",
            'Both <freejoint/> and <joint type="free"/> make a free body.', 'Write <joint type="free"/>.'),
        _written("free body that is turned",
            mjcf(upper='pos=".1 .2 1" euler="20 30 40"', shoulder='<joint name="shoulder" type="free"/>'),
            arm(shoulder={"type": "free"}, upper=turned(("x", 20), ("y", 30), ("z", 40))), ".//freejoint/..[@quat] | "
            ".//freejoint/..[@euler] | .//joint[@type='free']/..[@quat] | .//joint[@type='free']/..[@euler]",
            "Positions of a free body are the world's, however it stands in the file.",
            "Leave the body upright, and turn it by a keyframe."),
        _written("free joint without a name", mjcf(shoulder="<freejoint/>"), arm(shoulder={"type": "free",
            "name": "joint0"}), ".//freejoint"),
        _written("two joints in a body",
            mjcf(elbow='<joint name="elbow" axis="1 0 0"/><joint name="wrist" axis="0 0 1"/>'),
            arm().replace(joints=(SHOULDER, ELBOW, replace(ELBOW, name="wrist", axis=(0.0, 0.0, 1.0)))),
            ".//body/joint[2]", "Joints of one body act in their order.",
            "One joint a body, through bodies without mass."),
        _written("three joints in a body",
            mjcf(elbow='<joint name="elbow" type="slide" axis="1 0 0"/><joint name="second" type="slide" '
            'axis="0 1 0"/><joint name="wrist" axis="0 0 1" pos=".1 0 0"/>'),
            arm().replace(joints=(SHOULDER, replace(ELBOW, type="slide"), replace(ELBOW, name="second", type="slide",
            axis=(0.0, 1.0, 0.0)), replace(ELBOW, name="wrist", axis=(0.0, 0.0, 1.0), anchor=(0.1, 0.0, 0.0)))),
            ".//body/joint[3]", "Joints of one body act in their order.",
            "One joint a body, through bodies without mass."),
        _written("reference", mjcf(elbow='<joint name="elbow" axis="1 0 0" ref="30"/>'),
            arm(elbow={"reference": np.pi / 6}), ".//joint[@ref]",
            "At the pose of the file a joint has the coordinate ref.", "Leave ref out and turn the body."),
        _written("reference of a slide", mjcf(elbow='<joint name="elbow" type="slide" axis="1 0 0" ref=".2"/>'),
            arm(elbow={"reference": 0.2, "type": "slide"}), ".//joint[@ref]",
            "At the pose of the file a joint has the coordinate ref.", "Leave ref out and shift the body."),
        _written("two trees",
            mjcf(behind='<body name="other" pos="2 0 1"><joint name="other" axis="0 1 0"/>' + LOWER_INERTIAL +
            "</body>"),
            arm().replace(bodies=(UPPER, LOWER, replace(LOWER, name="other", parent="", position=(2.0, 0.0, 1.0))),
            joints=(SHOULDER, ELBOW, Joint(name="other", body="other", type="hinge", axis=(0.0, 1.0, 0.0)))),
            "worldbody/body[2]"),
    ]  # fmt: skip


def _poses() -> list[Feature]:
    def of(name: str, lower: str, turns: dict[str, Any], finds: str, head: str = "") -> Feature:
        return _written(
            name, mjcf(head=head, lower=f'pos="0 .05 -.4" {lower}'), arm(lower=turns), finds, POSE_RULE, POSE_WAY
        )

    c, s = float(np.cos(0.2)), float(np.sin(0.2))
    root = Body(name="root", position=(0.3, 0.0, 0.1), **turned(("x", 40), ("z", 30)))
    w, x, y, z = root.orientation
    fixed = f'<body name="root" pos=".3 0 .1" quat="{w!r} {x!r} {y!r} {z!r}">'
    hand = Body(
        name="hand",
        parent="lower",
        position=(0.0, 0.1, -0.3),
        mass=0.5,
        com=(0.02, 0.0, 0.01),
        inertia=(0.003, 0.004, 0.005, 0.0, 0.0, 0.0),
        **turned(("y", 50)),
    )
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
        _written("fixed body with a pose under the world", mjcf(before=fixed, behind="</body>"),
            arm().replace(bodies=(root, replace(UPPER, parent="root"), LOWER)),
            "worldbody/body[@pos]!joint,freejoint | worldbody/body[@quat]!joint,freejoint",
            "A body without joints stands in its parent at its pose.", "Put its pose into that of the bodies on it."),
        _written("fixed body in the tree",
            mjcf(lower_inertial=LOWER_INERTIAL + f'<body name="hand" pos="0 .1 -.3" quat="{hw!r} {hx!r} {hy!r} '
            f'{hz!r}"><inertial pos=".02 0 .01" mass=".5" diaginertia=".003 .004 .005"/></body>'),
            arm().replace(bodies=(UPPER, LOWER, hand)), ".//body/body!joint,freejoint",
            rule="A body without joints is part of its parent."),
        _written("frame", mjcf(inside='<frame pos="0 0 -.1" euler="0 0 90">',
            behind="").replace("</body>\n    </body>", "</body></frame>\n    </body>"), arm(lower={"position": (-0.05,
            0.0, -0.5)} | turned(("z", 90))), ".//frame", "A <frame> moves what stands in it.",
            "Put its pose into that of what stands in it."),
        _written("included file", mjcf(inside="", lower_inertial='<include file="part.xml"/>'), arm(), ".//include",
            "A file stands where it is included.", "Write one file.",
            files={"part.xml": f"<mujocoinclude>{LOWER_INERTIAL}</mujocoinclude>"}),
    ]  # fmt: skip


def _inertias() -> list[Feature]:
    def of(
        name: str,
        inertial: str,
        lower: dict[str, Any],
        finds: str = "",
        head: str = "",
        rule: str = SHAPE_RULE,
        rewrite: str = SHAPE_WAY,
        **more: Any,
    ) -> Feature:
        return _written(name, mjcf(head=head, lower_inertial=inertial, **more), arm(lower=lower), finds, rule, rewrite)

    tilted = placed(1.0, np.diag([0.02, 0.03, 0.015]), (0.01, 0.03, -0.15), rotation("x", 40))
    ball, box = (
        of_shape("sphere", (0.1,), position=(0.0, 0.0, -0.1)),
        of_shape("box", (0.05, 0.1, 0.15), position=(0.0, 0.2, 0.0)),
    )
    heavy = placed(3.0, solid("box", (0.05, 0.1, 0.15))[1])
    capsule = of_shape("capsule", (0.05, 0.2), position=(0.0, 0.0, -0.2))
    leaning = of_shape("box", (0.05, 0.1, 0.15), position=(0.0, 0.02, -0.15), R=rotation("x", 40))
    hull = " ".join(f"{x} {y} {z}" for x in (-0.0625, 0.0625) for y in (-0.125, 0.125) for z in (-0.25, 0.25))
    rule_full, way = "fullinertia is xx yy zz xy xz yz.", "Write fullinertia, without an orientation."
    weights = {"mass": 2.0, "inertia": (0.04, 0.06, 0.03, 0.0, 0.0, 0.0)}
    return [
        of("full inertia", '<inertial pos=".01 .03 -.15" mass="1" fullinertia=".02 .03 .025 .002 -.003 .004"/>',
            {"inertia": (0.02, 0.03, 0.025, 0.002, -0.003, 0.004)}, ".//inertial[@fullinertia]", rule=rule_full,
            rewrite=""),
        of("inertia with a quaternion",
            '<inertial pos=".01 .03 -.15" quat="0.9396926207859084 0.3420201433256687 0 0" mass="1" '
            'diaginertia=".02 .03 .015"/>',
            weighing(tilted), ".//inertial[@quat]", rule="The moments of an <inertial> are those about its own axes.",
            rewrite=way),
        of("inertia with euler angles",
            '<inertial pos=".01 .03 -.15" euler="40 0 0" mass="1" diaginertia=".02 .03 .015"/>', weighing(tilted),
            ".//inertial[@euler]", rule="The moments of an <inertial> are those about its own axes.", rewrite=way),
        *_shapes(),
        of("mass of a geom", '<geom type="box" size=".05 .1 .15" mass="3"/>', weighing(heavy), ".//geom[@mass]"),
        of("density of a geom", '<geom type="sphere" size=".1" pos="0 0 -.1" density="500"/>',
            weighing(of_shape("sphere", (0.1,), 500.0, position=(0.0, 0.0, -0.1))), ".//body/geom[@density]"),
        of("density of a class", '<geom type="sphere" size=".1" pos="0 0 -.1"/>', weighing(of_shape("sphere", (0.1,),
            500.0, position=(0.0, 0.0, -0.1))), ".//default/geom[@density]",
            head='<default><geom density="500"/></default>'),
        of("shape of a class", '<geom name="g"/>', weighing(of_shape("box", (0.05, 0.1, 0.15))),
            ".//default/geom[@size]", head='<default><geom type="box" size=".05 .1 .15"/></default>'),
        of("type of geom not given", '<geom size=".1" pos="0 0 -.1"/>', weighing(ball), ".//body/geom!@type"),
        of("two geoms",
            '<geom type="sphere" size=".1" pos="0 0 -.1"/><geom type="box" size=".05 .1 .15" pos="0 .2 0"/>',
            weighing(ball, box), ".//body/geom[2]"),
        of("geom from point to point", '<geom type="capsule" size=".05" fromto="0 0 0 0 0 -.4"/>', weighing(capsule),
            ".//geom[@fromto]"),
        of("orientation of a geom", '<geom type="box" size=".05 .1 .15" pos="0 .02 -.15" euler="40 0 0"/>',
            weighing(leaning), ".//geom[@euler] | .//geom[@quat]"),
        of("geoms beside an inertial", LOWER_INERTIAL + '<geom type="box" size=".05 .1 .15"/>', {},
            ".//inertial/../geom", rule="An <inertial> is taken, whatever geoms there are."),
        of("geoms of some groups",
            '<geom type="sphere" size=".1" pos="0 0 -.1" group="1"/><geom type="box" size=".05 .1 .15" group="3"/>',
            weighing(ball), "compiler[@inertiagrouprange]", head='<compiler inertiagrouprange="0 2"/>'),
        _written("inertia from geoms although it is given", mjcf(head='<compiler inertiafromgeom="true"/>',
            upper_inertial=UPPER_INERTIAL + '<geom type="box" size=".05 .1 .15" pos="0 .2 0"/>',
            lower_inertial=LOWER_INERTIAL + '<geom type="sphere" size=".1" pos="0 0 -.1"/>'), arm(upper=weighing(box),
            lower=weighing(ball)), "compiler[@inertiafromgeom='true']",
            "With inertiafromgeom all inertias are those of the geoms.", SHAPE_WAY),
        of("shell", '<geom type="sphere" size=".1" pos="0 0 -.1" shellinertia="true" mass="2"/>', weighing(placed(2.0,
            np.eye(3) * 2 / 3 * 0.01, (0.0, 0.0, -0.1))), ".//geom[@shellinertia]"),
        of("mesh by its vertices", '<geom type="mesh" mesh="m" mass="3"/>', weighing(placed(3.0, solid("box", (0.0625,
            0.125, 0.25))[1])), ".//mesh[@vertex]", head=f'<asset><mesh name="m" vertex="{hull}"/></asset>'),
        of("geom without mass",
            '<geom type="sphere" size=".1" pos="0 0 -.1"/><geom type="box" size=".05 .1 .15" mass="0"/>',
            weighing(ball), ".//geom[@mass='0']"),
        of("least mass and inertia", '<inertial pos=".01 .03 -.15" mass=".001" diaginertia="1e-6 1e-6 1e-6"/>',
            {"mass": 0.5, "inertia": (0.015, 0.015, 0.015, 0.0, 0.0, 0.0)},
            "compiler[@boundmass] | compiler[@boundinertia]", head='<compiler boundmass=".5" boundinertia=".015"/>',
            rule="Masses and moments below the bounds are raised.", rewrite="Write the raised numbers."),
        of("balanced inertia", '<inertial pos=".01 .03 -.15" mass="1" diaginertia=".01 .02 .06"/>', {"inertia": (0.03,
            0.03, 0.03, 0.0, 0.0, 0.0)}, "compiler[@balanceinertia]", head='<compiler balanceinertia="true"/>',
            rule="Moments of no rigid body are replaced by their mean.", rewrite="Write moments of a rigid body."),
        _written("total mass", mjcf(head='<compiler settotalmass="6"/>'), arm(upper={"mass": 4.0, "inertia": (0.08,
            0.1, 0.04, 0.0, 0.0, 0.0)}, lower=weights), "compiler[@settotalmass]",
            "All masses and inertias are scaled to a sum.", "Write the scaled numbers."),
    ]  # fmt: skip


def _forces() -> list[Feature]:
    def elbow(
        name: str,
        attributes: str,
        finds: str,
        change: dict[str, Any],
        about: str,
        rule: str = "",
        rewrite: str = "",
        head: str = "",
        tail: str = "",
    ) -> Feature:
        text = mjcf(head=head, elbow=f'<joint name="elbow" axis="1 0 0" {attributes}/>', tail=tail)
        return _written(name, text, arm(elbow=change), finds, rule, rewrite, (about,))

    motor = '<actuator><motor name="m" joint="elbow"/></actuator>'
    turn = np.pi / 180
    return [
        _written("gravity", mjcf(head='<option gravity="1 -2 -3"/>'), arm(gravity=(1.0, -2.0, -3.0)),
            "option[@gravity]", "Gravity is a vector of the option.", "Set gravity in the engine."),
        _written("gravity switched off", mjcf(head='<option><flag gravity="disable"/></option>'), arm(gravity=(0.0,
            0.0, 0.0)), "option/flag[@gravity]", "The flag gravity switches it off.", "Set gravity in the engine."),
        _written("weight that is taken off", mjcf(lower='pos="0 .05 -.4" gravcomp=".5"'),
            arm(lower={"weightless": 0.5}), ".//body[@gravcomp]", "gravcomp is a force against the weight.",
            "Apply that force in the engine.", ("gravity",)),
        elbow("armature", 'armature=".1"', ".//joint[@armature]", {"armature": 0.1}, "armature",
            "Armature belongs to the joint, driven or not.", "Drive the joint by a motor, or set it in the engine."),
        _written("armature of a driven joint",
            mjcf(elbow='<joint name="elbow" axis="1 0 0" armature=".1"/>', tail=motor),
            arm(elbow={"armature": 0.1}, actuators=(Actuator(name="m", joint="elbow", gear=(1.0,)),)),
            ".//joint[@armature]", "Armature belongs to the joint.", about=("armature",)),
        _written("armature of a class", mjcf(head='<default><joint armature=".1"/></default>'),
            arm(shoulder={"armature": 0.1}, elbow={"armature": 0.1}), ".//default/joint[@armature]", AXIS_RULE,
            "Write it at the joint itself.", ("armature",)),
        elbow("damping", 'damping=".7"', ".//joint[@damping]", {"damping": (0.7, 0.0, 0.0)}, "damping"),
        _written("damping of a ball joint", mjcf(elbow='<joint name="elbow" type="ball" damping=".7"/>'),
            arm(elbow={"type": "ball", "damping": (0.7, 0.0, 0.0)}), ".//joint[@type='ball'][@damping]",
            about=("damping",)),
        _written("damping of a class", mjcf(head='<default><joint damping=".7"/></default>'),
            arm(shoulder={"damping": (0.7, 0.0, 0.0)}, elbow={"damping": (0.7, 0.0, 0.0)}),
            ".//default/joint[@damping]", AXIS_RULE, "Write it at the joint itself.", ("damping",)),
        elbow("spring", 'stiffness="5"', ".//joint[@stiffness]", {"stiffness": (5.0, 0.0, 0.0)}, "springs",
            "A joint's spring is at rest at springref.", "Apply the spring in the engine."),
        elbow("rest of a spring", 'stiffness="5" springref="20"', ".//joint[@springref]", {"stiffness": (5.0, 0.0,
            0.0), "rest": (20 * turn,)}, "springs", "springref is in the compiler's unit.",
            "Apply the spring in the engine."),
        elbow("dry friction", 'frictionloss=".3"', ".//joint[@frictionloss]", {"friction_loss": 0.3}, "friction"),
        elbow("bounds in degrees", 'range="-30 60" limited="true"', ".//joint[@range]", {"range": (-30 * turn,
            60 * turn)}, "limits", "Angles are in degrees unless the compiler says radian.",
            'Write <compiler angle="radian"/> and radians.'),
        elbow("bounds in radians", 'range="-.5 1" limited="true"', "compiler[@angle='radian']", {"range": (-0.5, 1.0)},
            "limits", head='<compiler angle="radian"/>'),
        elbow("bounds without limited", 'range="-30 60"', ".//joint[@range]", {"range": (-30 * turn, 60 * turn)},
            "limits", "A joint with a range is bounded (autolimits).", 'Write limited="true".'),
        elbow("range that is not in force", 'range="-30 60" limited="false"', ".//joint[@limited='false']", {},
            "limits", 'limited="false" leaves the range without effect.', "Leave the range out."),
        _written("bounds of a slide",
            mjcf(elbow='<joint name="elbow" type="slide" axis="1 0 0" range="-.2 .3" limited="true"/>'),
            arm(elbow={"type": "slide", "range": (-0.2, 0.3)}), ".//joint[@type='slide'][@range]", about=("limits",)),
        elbow("bounds beside a reference", 'range="-30 60" ref="20"', ".//joint[@ref][@range]",
            {"range": (-30 * turn, 60 * turn), "reference": 20 * turn}, "limits",
            "A range is that of the coordinate, which is ref at the pose of the file.", "Leave ref out."),
        _written("bounds of the class around a class",
            mjcf(head='<default><default class="a"><joint range="-30 60"/><default class="b"><geom type="box"/>'
            "</default></default></default>", elbow='<joint name="elbow" class="b" axis="1 0 0"/>'),
            arm(elbow={"range": (-30 * turn, 60 * turn)}), ".//default/default/default!joint", AXIS_RULE,
            "Write it at the joint itself.", ("limits",)),
        _written("bounds of a class", mjcf(head='<default><joint range="-30 60"/></default>'),
            arm(shoulder={"range": (-30 * turn, 60 * turn)}, elbow={"range": (-30 * turn, 60 * turn)}),
            ".//default/joint[@range]", AXIS_RULE, "Write it at the joint itself.", ("limits",)),
    ]  # fmt: skip


def _rows() -> list[Feature]:
    def row(name: str, equality: str, loop: Loop, finds: str, before: str = "") -> Feature:
        return _written(
            name,
            mjcf(tail=f"<equality>{equality}</equality>", lower_inertial=LOWER_INERTIAL + before),
            arm(loops=(loop,)),
            finds,
            about=("loops",),
            rewrite="Add the row in the engine.",
            rule="Equalities hold from the start.",
        )

    def driven(name: str, actuator: str, finds: str, **more: Any) -> Feature:
        return _written(
            name,
            mjcf(tail=f"<actuator>{actuator}</actuator>"),
            arm(actuators=(Actuator(name="m", joint="elbow", gear=(1.0,), **more),)),
            finds,
            about=("actuators",),
            rule="An actuator acts on a joint by its name.",
            rewrite="Drive the joint in the engine.",
        )

    tendon = Tendon(name="t", joints=("shoulder", "elbow"), coefficients=(1.0, 2.0))
    both = '<tendon><fixed name="t"><joint joint="shoulder" coef="1"/><joint joint="elbow" coef="2"/></fixed></tendon>'
    return [
        row("points of two bodies", '<connect name="c" body1="lower" body2="upper" anchor="0 0 -.3"/>', Loop(name="c",
            type="connect", first="lower", second="upper", first_position=(0.0, 0.0, -0.3),
            second_position=(0.0, 0.05, -0.7)), ".//connect[@body1]"),
        row("point of the world", '<connect name="c" body1="lower" anchor="0 0 -.3"/>', Loop(name="c", type="connect",
            first="lower", first_position=(0.0, 0.0, -0.3), second_position=(0.1, 0.25, 0.3)), ".//connect[@body1]"),
        row("two frames", '<weld name="c" body1="lower" body2="upper"/>', Loop(name="c", type="weld", first="lower",
            second="upper", first_position=(0.0, -0.05, 0.4)), ".//weld[@body1]"),
        row("coupled joints", '<joint name="c" joint1="elbow" joint2="shoulder" polycoef="0 2 0 0 0"/>', Loop(name="c",
            type="joint", first="elbow", second="shoulder", polynomial=(0.0, 2.0, 0.0, 0.0, 0.0)), "equality/joint"),
        row("fixed joint by an equality", '<joint name="c" joint1="elbow"/>', Loop(name="c", type="joint",
            first="elbow"), "equality/joint"),
        driven("motor", '<motor name="m" joint="elbow"/>', ".//motor"),
        driven("position servo", '<position name="m" joint="elbow" kp="10"/>', ".//position", gain=(10.0, 0.0, 0.0),
            bias=(0.0, -10.0, 0.0)),
        driven("velocity servo", '<velocity name="m" joint="elbow" kv="2"/>', ".//velocity", gain=(2.0, 0.0, 0.0),
            bias=(0.0, 0.0, -2.0)),
        driven("general actuator", '<general name="m" joint="elbow" gainprm="10"/>', ".//general",
            gain=(10.0, 0.0, 0.0)),
        _written("actuator on a tendon", mjcf(tail=both + '<actuator><motor name="m" tendon="t"/></actuator>'),
            arm(tendons=(tendon,), actuators=(Actuator(name="m", tendon="t", gear=(1.0,)),)),
            ".//motor[@tendon] | .//general[@tendon]", about=("actuators",), rule="A fixed tendon is a sum of joints.",
            rewrite="Drive the joints in the engine."),
    ]  # fmt: skip


def _urdf() -> list[Feature]:
    def of(
        name: str,
        text: str,
        scene: Scene,
        finds: str = "",
        rule: str = "",
        rewrite: str = "",
        about: tuple[str, ...] = MOTION,
    ) -> Feature:
        return _written(f"URDF: {name}", text, scene, finds, rule, rewrite, about, format="urdf")

    def elbow(more: str, kind: str = "revolute") -> str:
        return urdf_joint("elbow", "upper", "lower", more, kind)

    x = '<axis xyz="1 0 0"/>'
    fixed_rpy = matrices(
        np.array(
            quaternion(rotation("z", np.degrees(0.5)) @ rotation("y", np.degrees(0.4)) @ rotation("x", np.degrees(0.3)))
        )
    )
    tilted = placed(1.0, np.diag([0.02, 0.03, 0.015]), (0.01, 0.03, -0.15), fixed_rpy)
    hand = Body(
        name="hand",
        parent="lower",
        position=(0.0, 0.1, -0.3),
        mass=0.5,
        com=(0.02, 0.0, 0.01),
        inertia=(0.003, 0.004, 0.005, 0.0, 0.0, 0.0),
        orientation=quaternion(fixed_rpy),
    )
    hung = link("hand", ".02 0 .01", 0.5, moments(0.003, 0.004, 0.005)) + urdf_joint(
        "grip", "lower", "hand", '<origin xyz="0 .1 -.3" rpy=".3 .4 .5"/>', "fixed"
    )
    tip = Body(name="tip", parent="lower", position=(0.0, 0.0, -0.3))
    plain = urdf_arm()
    free = {"range": (-np.inf, np.inf)}
    return [
        of("arm", urdf(), plain, "link/inertial", "An <inertial> says mass, centre and moments."),
        of("origin of a joint with angles", urdf(elbow=elbow('<origin xyz="0 .05 -.4" rpy=".3 .4 .5"/>' + x)),
            urdf_arm(lower={"orientation": quaternion(fixed_rpy)}), ".//joint/origin[@rpy]",
            "rpy are turns about fixed x, y and z."),
        of("origin of an inertia with angles", urdf(lower=link("lower", ".01 .03 -.15", 1.0, moments(0.02, 0.03,
            0.015), ".3 .4 .5")), urdf_arm(lower=weighing(tilted)), ".//inertial/origin[@rpy]",
            "Moments are about the axes of the inertia's origin.", "Write the inertia in the link's axes, rpy 0."),
        of("products of inertia", urdf(lower=link("lower", ".01 .03 -.15", 1.0, moments(0.02, 0.03, 0.025, 0.002,
            -0.003, 0.004))), urdf_arm(lower={"inertia": (0.02, 0.03, 0.025, 0.002, -0.003, 0.004)}),
            "link/inertial/inertia"),
        of("fixed joint", urdf(more=hung), plain.replace(bodies=(*plain.bodies, hand)), "joint[@type='fixed']",
            "A fixed joint makes two links one body."),
        of("continuous joint", urdf(elbow=elbow(LOWER_AT + x, "continuous")), urdf_arm(elbow=free),
            "joint[@type='continuous']", "A continuous joint turns without bounds."),
        of("prismatic joint", urdf(elbow=elbow(LOWER_AT + x, "prismatic")), urdf_arm(elbow={"type": "slide"}),
            "joint[@type='prismatic']"),
        of("floating joint", urdf(shoulder=urdf_joint("shoulder", "base", "upper", UPPER_AT, "floating")),
            urdf_arm(shoulder={"type": "free", **free}, base=False), "joint[@type='floating']",
            "A floating joint has six degrees of freedom.", about=("coordinates", "inertia")),
        of("axis not given", urdf(elbow=elbow(LOWER_AT)), plain, "joint!axis", rule="A joint without axis has 1 0 0.",
            rewrite="Write the axis."),
        of("axis not of length 1", urdf(elbow=elbow(LOWER_AT + '<axis xyz="3 0 4"/>')), urdf_arm(elbow={"axis": (0.6,
            0.0, 0.8)}), rule="An axis is brought to length 1.", rewrite="Write axes of length 1."),
        of("mimic", urdf(elbow=elbow(LOWER_AT + x + '<mimic joint="shoulder" multiplier="2" offset=".1"/>')),
            urdf_arm(loops=(Loop(name="elbow mimics", type="joint", first="elbow", second="shoulder", polynomial=(0.1,
            2.0, 0.0, 0.0, 0.0)),)), ".//mimic", "A joint that mimics is one of two coupled coordinates.",
            "Couple the joints in the engine.", ("loops",)),
        of("damping", urdf(elbow=elbow(LOWER_AT + x + '<dynamics damping=".7"/>')), urdf_arm(elbow={"damping": (0.7,
            0.0, 0.0)}), ".//dynamics[@damping]", about=("damping",)),
        of("friction", urdf(elbow=elbow(LOWER_AT + x + '<dynamics friction=".3"/>')),
            urdf_arm(elbow={"friction_loss": 0.3}), ".//dynamics[@friction]", about=("friction",)),
        of("bounds", urdf(elbow=elbow(LOWER_AT + x + '<limit lower="-.5" upper="1" effort="10" velocity="1"/>')),
            urdf_arm(elbow={"range": (-0.5, 1.0)}), ".//limit[@lower]", about=("limits",)),
        of("safety limits",
            urdf(elbow=elbow(LOWER_AT + x + '<safety_controller soft_lower_limit="-.1" soft_upper_limit=".1" '
            'k_velocity="1"/>')),
            plain, ".//safety_controller", "Safety limits are of the controller, not of the joint.", about=("limits",
            *MOTION)),
        of("link without mass", urdf(more='<link name="tip"/>' + urdf_joint("end", "lower", "tip",
            '<origin xyz="0 0 -.3"/>', "fixed")), plain.replace(bodies=(*plain.bodies, tip)), "link",
            "A link without <inertial> has no mass."),
        of("inertia of the root", urdf(base=link("base", "0 0 .1", 3.0, moments(0.1, 0.1, 0.1))),
            plain.replace(bodies=(replace(plain.bodies[0], mass=3.0, com=(0.0, 0.0, 0.1), inertia=(0.1, 0.1, 0.1, 0.0,
            0.0, 0.0)), *plain.bodies[1:])), "link/inertial",
            "The root stands on the world unless a joint says otherwise."),
        of("root that is called world", urdf(base='<link name="world"/>', shoulder=urdf_joint("shoulder", "world",
            "upper", UPPER_AT + '<axis xyz="0 1 0"/>')), urdf_arm(base=False), "link[@name='world']",
            "A link called world is the world."),
        of("transmission",
            urdf(more='<transmission name="t"><type>transmission_interface/SimpleTransmission</type><joint '
            'name="elbow"><hardwareInterface>EffortJointInterface</hardwareInterface></joint><actuator '
            'name="m"><mechanicalReduction>1</mechanicalReduction></actuator></transmission>'),
            plain, ".//transmission", "A transmission couples a motor to a joint and moves nothing by itself."),
    ]  # fmt: skip


FEATURES = (*_joints(), *_poses(), *_inertias(), *_forces(), *_rows(), *_urdf())
"""All of them, in the order of the table."""
