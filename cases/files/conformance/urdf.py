"""Features of URDF, by the same arm."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from crossbody.cases.files.conformance.arm import HAND, MOTION, Feature, arm, quaternion, rotation, weighing
from crossbody.cases.files.inertias import placed
from crossbody.cases.rotations import matrices
from crossbody.cases.scene import Body, Loop, Scene


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


TETRAHEDRON = "v 0 0 0\nv .1 0 0\nv 0 .2 0\nv 0 0 .3\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
SHAPED = '<link name="tip"><collision><geometry><box size=".1 .2 .3"/></geometry></collision></link>' + urdf_joint(
    "end", "lower", "tip", '<origin xyz="0 0 -.3"/>', "fixed"
)
MESHED = (
    '<link name="tip"><collision><geometry><mesh filename="package://conformance/part.obj"/></geometry></collision>'
    "</link>" + urdf_joint("end", "lower", "tip", '<origin xyz="0 0 -.3"/>', "fixed")
)


def features() -> list[Feature]:
    """Return the features of URDF."""

    def of(name: str, *words: Any, **more: Any) -> Feature:
        return replace(Feature(f"URDF: {name}", *words, **more), format="urdf")

    def elbow(more: str, kind: str = "revolute") -> str:
        return urdf_joint("elbow", "upper", "lower", more, kind)

    x = '<axis xyz="1 0 0"/>'
    fixed_rpy = matrices(
        np.array(
            quaternion(rotation("z", np.degrees(0.5)) @ rotation("y", np.degrees(0.4)) @ rotation("x", np.degrees(0.3)))
        )
    )
    tilted = placed(1.0, np.diag([0.02, 0.03, 0.015]), (0.01, 0.03, -0.15), fixed_rpy)
    hand = replace(HAND, orientation=quaternion(fixed_rpy))
    stand = Body(name="stand", position=(0.3, 0.0, 0.5), orientation=quaternion(fixed_rpy))
    hung = link("hand", ".02 0 .01", 0.5, moments(0.003, 0.004, 0.005)) + urdf_joint(
        "grip", "lower", "hand", '<origin xyz="0 .1 -.3" rpy=".3 .4 .5"/>', "fixed"
    )
    tip = Body(name="tip", parent="lower", position=(0.0, 0.0, -0.3))
    plain = urdf_arm()
    free = {"range": (-np.inf, np.inf)}
    return [
        of("arm", urdf(), plain, "link/inertial", "An <inertial> gives mass, centre and moments."),
        of("origin of a joint with angles", urdf(elbow=elbow('<origin xyz="0 .05 -.4" rpy=".3 .4 .5"/>' + x)),
            urdf_arm(lower={"orientation": quaternion(fixed_rpy)}), ".//joint/origin[@rpy]",
            "rpy are rotations about the fixed axes x, y and z."),
        of("origin of an inertia with angles", urdf(lower=link("lower", ".01 .03 -.15", 1.0, moments(0.02, 0.03,
            0.015), ".3 .4 .5")), urdf_arm(lower=weighing(tilted)), ".//inertial/origin[@rpy]",
            "Moments are about the axes of the inertia's origin.", "Write the inertia in the link's axes, rpy 0."),
        of("products of inertia", urdf(lower=link("lower", ".01 .03 -.15", 1.0, moments(0.02, 0.03, 0.025, 0.002,
            -0.003, 0.004))), urdf_arm(lower={"inertia": (0.02, 0.03, 0.025, 0.002, -0.003, 0.004)}),
            "link/inertial/inertia"),
        of("fixed joint", urdf(more=hung), plain.replace(bodies=(*plain.bodies, hand)), "joint[@type='fixed']",
            "A fixed joint makes two links one body."),
        of("continuous joint", urdf(elbow=elbow(LOWER_AT + x, "continuous")), urdf_arm(elbow=free),
            "joint[@type='continuous']", "A continuous joint rotates without bounds."),
        of("prismatic joint", urdf(elbow=elbow(LOWER_AT + x, "prismatic")), urdf_arm(elbow={"type": "slide"}),
            "joint[@type='prismatic']"),
        of("floating joint", urdf(shoulder=urdf_joint("shoulder", "base", "upper", UPPER_AT, "floating")),
            urdf_arm(shoulder={"type": "free", **free}, base=False), "joint[@type='floating']",
            "A floating joint has six degrees of freedom, and is at its origin when they are 0."),
        of("floating joint below a fixed one", urdf(base='<link name="base"/><link name="stand"/>' + urdf_joint("post",
            "base", "stand", '<origin xyz=".3 0 .5" rpy=".3 .4 .5"/>', "fixed"), shoulder=urdf_joint("shoulder",
            "stand", "upper", '<origin xyz=".1 .2 1" rpy=".3 0 0"/>', "floating")),
            urdf_arm(shoulder={"type": "free", **free}, base=False).replace(bodies=(stand, *arm().bodies)),
            "joint[@type='fixed']", "A floating joint on a link that is fixed to the root is free in the world.",
            "Let it float on the root."),
        of("axis not given", urdf(elbow=elbow(LOWER_AT)), plain, "joint!axis=xyz=1 0 0",
            rule="A joint without axis has 1 0 0.", rewrite="Write the axis."),
        of("axis not of length 1", urdf(elbow=elbow(LOWER_AT + '<axis xyz="3 0 4"/>')), urdf_arm(elbow={"axis": (0.6,
            0.0, 0.8)}), rule="An axis is normalised.", rewrite="Write axes of length 1."),
        of("mimic", urdf(elbow=elbow(LOWER_AT + x + '<mimic joint="shoulder" multiplier="2" offset=".1"/>')),
            urdf_arm(loops=(Loop(name="elbow mimics", type="joint", first="elbow", second="shoulder", polynomial=(0.1,
            2.0, 0.0, 0.0, 0.0)),)), ".//mimic", "A mimic joint is coupled to another coordinate.",
            "Couple the joints in the engine.", ("loops",)),
        of("damping", urdf(elbow=elbow(LOWER_AT + x + '<dynamics damping=".7"/>')), urdf_arm(elbow={"damping": (0.7,
            0.0, 0.0)}), ".//dynamics[@damping]", about=("damping",)),
        of("friction", urdf(elbow=elbow(LOWER_AT + x + '<dynamics friction=".3"/>')),
            urdf_arm(elbow={"friction_loss": 0.3}), ".//dynamics[@friction]", about=("friction",)),
        of("bounds", urdf(elbow=elbow(LOWER_AT + x + '<limit lower="-.5" upper="1" effort="10" velocity="1"/>')),
            urdf_arm(elbow={"range": (-0.5, 1.0)}), ".//limit[@lower]", about=("limits",)),
        *(of(name, urdf(elbow=elbow(LOWER_AT + x + f'<limit lower="-3" upper="3" effort="{most:g}" velocity="1"/>')),
            urdf_arm(elbow={"force_range": (0.0 - most, most)}, shoulder={"force_range": (-100.0, 100.0)}), finds,
            ("effort is the largest force of a joint, also if "
                "it is 0."), way, ("effort",)) for name, most, finds, way in (
                ("bound of a force", 7.0, ".//limit[@effort]", "Bound it in the engine."),
                ("largest force of 0", 0.0, ".//limit[@effort='0']", "Write the largest force of the joint."))),
        of("safety limits",
            urdf(elbow=elbow(LOWER_AT + x + '<safety_controller soft_lower_limit="-.1" soft_upper_limit=".1" '
            'k_velocity="1"/>')),
            plain, ".//safety_controller", "Safety limits belong to the controller, not to the joint.", about=("limits",
            *MOTION)),
        of("link without mass", urdf(more='<link name="tip"/>' + urdf_joint("end", "lower", "tip",
            '<origin xyz="0 0 -.3"/>', "fixed")), plain.replace(bodies=(*plain.bodies, tip)), "link",
            "A link without <inertial> has no mass."),
        of("shape of a link without mass", urdf(more=SHAPED), plain.replace(bodies=(*plain.bodies, tip)),
            "link[collision]!inertial", "A link without <inertial> has no mass, whatever shapes it has.",
            "Write an <inertial> of mass 0."),
        of("inertia of the root", urdf(base=link("base", "0 0 .1", 3.0, moments(0.1, 0.1, 0.1))),
            plain.replace(bodies=(replace(plain.bodies[0], mass=3.0, com=(0.0, 0.0, 0.1), inertia=(0.1, 0.1, 0.1, 0.0,
            0.0, 0.0)), *plain.bodies[1:])), "link/inertial",
            "The root is fixed to the world unless a joint says otherwise."),
        of("root called world", urdf(base='<link name="world"/>', shoulder=urdf_joint("shoulder", "world",
            "upper", UPPER_AT + '<axis xyz="0 1 0"/>')), urdf_arm(base=False), "link[@name='world']",
            "A link called world is the world."),
        of("mesh of a package", urdf(more=MESHED), plain.replace(bodies=(*plain.bodies, tip)),
            "link/visual/geometry/mesh/../.. | link/collision/geometry/mesh/../..",
            "package://NAME/FILE is a file of the package NAME, whose folder a reader must know.",
            "Write its path relative to the file, as --fix does.", ("reading",),
            files={"conformance/part.obj": TETRAHEDRON}),
        of("transmission",
            urdf(more='<transmission name="t"><type>transmission_interface/SimpleTransmission</type><joint '
            'name="elbow"><hardwareInterface>EffortJointInterface</hardwareInterface></joint><actuator '
            'name="m"><mechanicalReduction>1</mechanicalReduction></actuator></transmission>'),
            plain, ".//transmission", "A transmission couples a motor to a joint, and has no effect by itself."),
    ]  # fmt: skip
