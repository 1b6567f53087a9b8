"""Features of MJCF: equalities and actuators."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from crossbody.cases.files.conformance.arm import LOWER_INERTIAL, SECOND, Feature, arm, mjcf, two_trees
from crossbody.cases.scene import Actuator, Loop, Tendon

WEIGHT = "The armature a of a tendon adds a J'J to M, J the rates of its length."
WEIGHT_WAY = "Add it to M in the engine, or leave it out."


def features() -> list[Feature]:
    """Return the features of equalities and actuators."""

    def row(name: str, equality: str, loop: Loop, finds: str, before: str = "", inside: str = "") -> Feature:
        return Feature(
            name,
            mjcf(tail=f"<equality>{equality}</equality>", lower_inertial=LOWER_INERTIAL + before, inside=inside),
            arm(loops=(loop,)),
            finds,
            about=("loops",),
            rewrite="Add the row in the engine.",
            rule="Equalities hold from the start.",
        )

    def driven(name: str, actuator: str, finds: str, **more: Any) -> Feature:
        return Feature(
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
        row("sites of two bodies", '<connect name="c" site1="s" site2="t"/>', Loop(name="c", type="connect",
            first="lower", second="upper", first_position=(0.0, 0.0, -0.3), second_position=(0.0, 0.05, -0.6)),
            ".//connect[@site1]", before='<site name="s" pos="0 0 -.3"/>', inside='<site name="t" pos="0 .05 -.6"/>'),
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
        *(Feature(f"{what} of a tendon", mjcf(tail=both.replace('"t"', f'"t" {attributes}')),
            arm(tendons=(replace(tendon, **change),)), f".//fixed[@{finds}]", about=("tendons",),
            rule="A fixed tendon is a sum of joints.", rewrite="Apply its force at the joints in the engine.")
            for what, attributes, finds, change in (
                ("spring", 'stiffness="5" springlength=".2"', "stiffness", {"stiffness": (5.0, 0.0, 0.0),
                 "rest": (0.2, 0.2)}),
                ("dead band", 'stiffness="5" springlength="-.1 .2"', "springlength", {"stiffness": (5.0, 0.0, 0.0),
                 "rest": (-0.1, 0.2)}),
                ("damping", 'damping=".7"', "damping", {"damping": (0.7, 0.0, 0.0)}),
                ("bound", 'range="-.5 1" limited="true"', "range", {"range": (-0.5, 1.0)}))),
        Feature("armature of a tendon", mjcf(tail=both.replace('"t"', '"t" armature=".1"')), arm(tendons=(tendon,)),
            ".//fixed[@armature]", WEIGHT, WEIGHT_WAY, ("M",), heavier=((0.1, 0.2), (0.2, 0.4))),
        Feature("armature of a tendon across branches",
            mjcf(behind=SECOND, tail=both.replace('"elbow"', '"other"').replace('"t"', '"t" armature=".1"')),
            two_trees(tendons=(replace(tendon, joints=("shoulder", "other")),)),
            ".//fixed[@armature]", WEIGHT, WEIGHT_WAY, ("M",),
            heavier=((0.1, 0.0, 0.2), (0.0, 0.0, 0.0), (0.2, 0.0, 0.4))),
        Feature("actuator on a tendon", mjcf(tail=both + '<actuator><motor name="m" tendon="t"/></actuator>'),
            arm(tendons=(tendon,), actuators=(Actuator(name="m", tendon="t", gear=(1.0,)),)),
            ".//motor[@tendon] | .//general[@tendon]", about=("actuators",), rule="A fixed tendon is a sum of joints.",
            rewrite="Drive the joints in the engine."),
    ]  # fmt: skip
