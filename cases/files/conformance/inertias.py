"""Features of MJCF: inertias, given and of shapes."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.cases.files.conformance.arm import (
    LOWER_INERTIAL,
    UPPER_INERTIAL,
    Feature,
    arm,
    mjcf,
    of_shape,
    rotation,
    weighing,
)
from crossbody.cases.files.inertias import placed, solid

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
    return [
        Feature(f"inertia of a {kind}",
            mjcf(lower_inertial=f'<geom type="{kind}" size="{" ".join(map(str, size))}" pos="0 .02 -.15"/>'),
            arm(lower=weighing(of_shape(kind, size, position=(0.0, 0.02, -0.15)))), f".//geom[@type='{kind}']",
            SHAPE_RULE, SHAPE_WAY)
        for kind, size in sizes.items()
    ]  # fmt: skip


def features() -> list[Feature]:
    """Return the features of inertias."""

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
        return Feature(name, mjcf(head=head, lower_inertial=inertial, **more), arm(lower=lower), finds, rule, rewrite)

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
        of("type of geom not given", '<geom size=".1" pos="0 0 -.1"/>', weighing(ball), ".//body/geom!@type=sphere"),
        of("two geoms",
            '<geom type="sphere" size=".1" pos="0 0 -.1"/><geom type="box" size=".05 .1 .15" pos="0 .2 0"/>',
            weighing(ball, box), ".//body/geom[2]"),
        of("geom from point to point", '<geom type="capsule" size=".05" fromto="0 0 0 0 0 -.4"/>', weighing(capsule),
            ".//geom[@fromto]"),
        of("orientation of a geom", '<geom type="box" size=".05 .1 .15" pos="0 .02 -.15" euler="40 0 0"/>',
            weighing(leaning), ".//geom[@euler] | .//geom[@quat]"),
        of("geoms together with an inertial", LOWER_INERTIAL + '<geom type="box" size=".05 .1 .15"/>', {},
            ".//inertial/../geom", rule="An <inertial> takes precedence over geoms."),
        of("geoms of some groups",
            '<geom type="sphere" size=".1" pos="0 0 -.1" group="1"/><geom type="box" size=".05 .1 .15" group="3"/>',
            weighing(ball), "compiler[@inertiagrouprange]", head='<compiler inertiagrouprange="0 2"/>'),
        Feature("inertia from geoms instead of the given one", mjcf(head='<compiler inertiafromgeom="true"/>',
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
            rule="Masses and moments below the bounds are raised to them.", rewrite="Write the raised numbers."),
        of("balanced inertia", '<inertial pos=".01 .03 -.15" mass="1" diaginertia=".01 .02 .06"/>', {"inertia": (0.03,
            0.03, 0.03, 0.0, 0.0, 0.0)}, "compiler[@balanceinertia]", head='<compiler balanceinertia="true"/>',
            rule=("Moments that no rigid body can have are replaced by "
                "their mean."), rewrite="Write moments of a rigid body."),
        Feature("total mass", mjcf(head='<compiler settotalmass="6"/>'), arm(upper={"mass": 4.0, "inertia": (0.08,
            0.1, 0.04, 0.0, 0.0, 0.0)}, lower=weights), "compiler[@settotalmass]",
            "All masses and inertias are scaled to a given total.", "Write the scaled numbers."),
    ]  # fmt: skip
