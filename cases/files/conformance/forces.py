"""Features of MJCF: gravity, and what acts at joints."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from crossbody.cases.files.conformance.arm import Feature, arm, mjcf
from crossbody.cases.files.conformance.joints import AXIS_RULE
from crossbody.cases.scene import Actuator


def features() -> list[Feature]:
    """Return the features of gravity and what acts at joints."""

    def elbow(
        name: str, attributes: str, finds: str, change: dict[str, Any], about: str, *words: Any, **more: str
    ) -> Feature:  # fmt: skip
        text = mjcf(elbow=f'<joint name="elbow" axis="1 0 0" {attributes}/>', **more)
        return replace(Feature(name, text, arm(elbow=change), finds, *words), about=(about,))

    motor = '<actuator><motor name="m" joint="elbow"/></actuator>'
    geared, turn = Actuator(name="m", joint="elbow", gear=(3.0,)), np.pi / 180
    return [
        Feature("gravity", mjcf(head='<option gravity="1 -2 -3"/>'), arm(gravity=(1.0, -2.0, -3.0)),
            "option[@gravity]", "Gravity is a vector of the option.", "Set gravity in the engine."),
        Feature("gravity switched off", mjcf(head='<option><flag gravity="disable"/></option>'), arm(gravity=(0.0,
            0.0, 0.0)), "option/flag[@gravity]", "The flag gravity disables it.", "Set gravity in the engine."),
        Feature("gravity compensation", mjcf(lower='pos="0 .05 -.4" gravcomp=".5"'),
            arm(lower={"weightless": 0.5}), ".//body[@gravcomp]", "gravcomp is a force that compensates the weight.",
            "Apply that force in the engine.", ("gravity",)),
        *(Feature(f"gravity compensation by actuators{name}", mjcf(lower='pos="0 .05 -.4" gravcomp=".5"',
            elbow='<joint name="elbow" axis="1 0 0" actuatorgravcomp="true"/>', tail=tail),
            arm(lower={"weightless": 0.5}, actuators=motors), ".//joint[@actuatorgravcomp]",
            ("With actuatorgravcomp, the compensating force counts as an actuator force, even if there are no "
                "actuators."),
            "Write gravcomp without actuatorgravcomp.", ("gravity",))
            for name, tail, motors in (("", motor, (Actuator(name="m", joint="elbow", gear=(1.0,)),)),
                                       (", of which there are none", "", ()))),
        elbow("armature", 'armature=".1"', ".//joint[@armature]", {"armature": 0.1}, "armature",
            ("Armature belongs to the joint, whether it is driven "
                "or not."), "Drive the joint by a motor, or set it in the engine."),
        Feature("armature of a driven joint",
            mjcf(elbow='<joint name="elbow" axis="1 0 0" armature=".1"/>', tail=motor),
            arm(elbow={"armature": 0.1}, actuators=(Actuator(name="m", joint="elbow", gear=(1.0,)),)),
            ".//joint[@armature]", "Armature belongs to the joint.", about=("armature",)),
        *(Feature(f"{name} of an actuator",
            mjcf(tail=f'<actuator><motor name="m" joint="elbow" gear="3" {name}=".1"/></actuator>'),
            arm(actuators=(heavy,)), f".//motor[@{name}]",
            f"The {name} of an actuator counts at its joint, times the square of the gear.",
            "Write it at the joint, times the square of the gear.", (name,))
            for name, heavy in (("armature", replace(geared, armature=0.1)),
                                ("damping", replace(geared, damping=0.1)))),
        Feature("gain of an actuator that varies with the joint", mjcf(tail='<actuator><general name="m" joint="elbow" '
            'gear="3" gaintype="affine" gainprm="2 .5 .1" biastype="affine" biasprm=".3 -.4 -.2"/></actuator>'),
            arm(actuators=(replace(geared, gain=(2.0, 0.5, 0.1), bias=(0.3, -0.4, -0.2)),)), ".//general[@gaintype]",
            "An affine gain is g0 + g1 l + g2 l' with the actuator's length l, and multiplies the control.",
            about=("actuators",)),
        Feature("armature of a class", mjcf(head='<default><joint armature=".1"/></default>'),
            arm(shoulder={"armature": 0.1}, elbow={"armature": 0.1}), ".//default/joint[@armature]", AXIS_RULE,
            "Write it at the joint itself.", ("armature",)),
        elbow("damping", 'damping=".7"', ".//joint[@damping]", {"damping": (0.7, 0.0, 0.0)}, "damping"),
        Feature("damping of a ball joint", mjcf(elbow='<joint name="elbow" type="ball" damping=".7"/>'),
            arm(elbow={"type": "ball", "damping": (0.7, 0.0, 0.0)}), ".//joint[@type='ball'][@damping]",
            about=("damping",)),
        Feature("damping of a class", mjcf(head='<default><joint damping=".7"/></default>'),
            arm(shoulder={"damping": (0.7, 0.0, 0.0)}, elbow={"damping": (0.7, 0.0, 0.0)}),
            ".//default/joint[@damping]", AXIS_RULE, "Write it at the joint itself.", ("damping",)),
        elbow("spring", 'stiffness="5"', ".//joint[@stiffness]", {"stiffness": (5.0, 0.0, 0.0)}, "springs",
            "A joint's spring is at rest at springref.", "Apply the spring in the engine."),
        elbow("damper of three terms", 'damping=".7 .2 .1"', ".//joint[@damping]", {"damping": (0.7, 0.2, 0.1)},
            "damping", "Damping is b0 v + b1 v |v| + b2 v^3.", "Apply the damper in the engine."),
        elbow("spring of three terms", 'stiffness="5 2 3"', ".//joint[@stiffness]", {"stiffness": (5.0, 2.0, 3.0)},
            "springs", "A spring is k0 x + k1 x^2 + k2 x^3.", "Apply the spring in the engine."),
        elbow("rest of a spring", 'stiffness="5" springref="20"', ".//joint[@springref]", {"stiffness": (5.0, 0.0,
            0.0), "rest": (20 * turn,)}, "springs", "springref is in the compiler's unit.",
            "Apply the spring in the engine."),
        elbow("bound of the forces of actuators", 'actuatorfrcrange="-3 4"', ".//joint[@actuatorfrcrange]",
            {"force_range": (-3.0, 4.0)}, "effort", "actuatorfrcrange bounds the sum of the actuators on a joint.",
            "Bound it in the engine."),
        elbow("dry friction", 'frictionloss=".3"', ".//joint[@frictionloss]", {"friction_loss": 0.3}, "friction"),
        elbow("bounds in degrees", 'range="-30 60" limited="true"', ".//joint[@range]", {"range": (-30 * turn,
            60 * turn)}, "limits", "Angles are in degrees unless the compiler says radian.",
            'Write <compiler angle="radian"/> and radians.'),
        elbow("bounds in radians", 'range="-.5 1" limited="true"', "compiler[@angle='radian']", {"range": (-0.5, 1.0)},
            "limits", head='<compiler angle="radian"/>'),
        elbow("bounds without limited", 'range="-30 60"', ".//joint[@range]", {"range": (-30 * turn, 60 * turn)},
            "limits", "A joint with a range is bounded (autolimits).", 'Write limited="true".'),
        elbow("range without effect", 'range="-30 60" limited="false"', ".//joint[@limited='false']", {},
            "limits", 'limited="false" disables the range.', "Leave the range out."),
        Feature("bounds of a slide",
            mjcf(elbow='<joint name="elbow" type="slide" axis="1 0 0" range="-.2 .3" limited="true"/>'),
            arm(elbow={"type": "slide", "range": (-0.2, 0.3)}), ".//joint[@type='slide'][@range]", about=("limits",)),
        elbow("bounds with a reference", 'range="-30 60" ref="20"', ".//joint[@ref][@range]",
            {"range": (-30 * turn, 60 * turn), "reference": 20 * turn}, "limits",
            "A range refers to the coordinate, which is ref in the pose of the file.", "Leave ref out."),
        Feature("bounds of an outer class",
            mjcf(head='<default><default class="a"><joint range="-30 60"/><default class="b"><geom type="box"/>'
            "</default></default></default>", elbow='<joint name="elbow" class="b" axis="1 0 0"/>'),
            arm(elbow={"range": (-30 * turn, 60 * turn)}), ".//default/default/default!joint=", AXIS_RULE,
            "Write it at the joint itself.", ("limits",)),
        Feature("bounds of a class", mjcf(head='<default><joint range="-30 60"/></default>'),
            arm(shoulder={"range": (-30 * turn, 60 * turn)}, elbow={"range": (-30 * turn, 60 * turn)}),
            ".//default/joint[@range]", AXIS_RULE, "Write it at the joint itself.", ("limits",)),
    ]  # fmt: skip
