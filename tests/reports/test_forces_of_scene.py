"""Forces of motors, dampers and springs are held against the scene's own numbers, whatever else contradicts none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from crossbody import cases
from crossbody.cases import Case
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Actuator, Body, Joint, Scene, Tendon
from crossbody.engines import equations
from crossbody.reports.judging import forces_of_scene as judge

DRIVEN = Path(__file__).parents[1] / "support" / "driven_ball.xml"


def arm(seed: int) -> Case:
    """A chain of slides and hinges with motors, servos, activations, tendons, springs and dampers at random."""
    draw = np.random.default_rng(seed)
    bodies, joints = [], []
    for k in range(4):
        bodies.append(Body(name=f"b{k}", parent=f"b{k - 1}" if k else "", mass=draw.uniform(0.5, 2.0),
                           com=tuple(draw.uniform(-0.2, 0.2, 3)), position=tuple(draw.uniform(-0.5, 0.5, 3)),
                           inertia=(0.1, 0.2, 0.15, 0.0, 0.0, 0.0)))  # fmt: skip
        joints.append(Joint(
            name=f"j{k}", body=f"b{k}", type=str(draw.choice(["slide", "hinge"])), axis=tuple(draw.normal(size=3)),
            damping=tuple(draw.uniform(0.0, 1.0, 3)), stiffness=(draw.uniform(1.0, 9.0), 0.0, draw.uniform(0.0, 1.0)),
            force_range=(-2.0, 7.0) if k == 1 else (-np.inf, np.inf),
        ))  # fmt: skip
    rope = Tendon(name="rope", joints=("j0", "j2"), coefficients=(1.5, -0.7), damping=(0.3, 0.2, 0.1),
                  stiffness=(4.0, 0.0, 0.0), rest=(-0.1, 0.2))  # fmt: skip
    motors = (
        Actuator(name="motor", joint="j0", gear=(2.0,), control_range=(-1.0, 2.0), damping=0.4),
        Actuator(name="servo", joint="j1", gain=(9.0, 0.5, 0.1), bias=(0.1, -9.0, -0.6), force_range=(-3.0, 4.0)),
        Actuator(
            name="sum", tendon="rope", gain=(5.0, 0.0, 0.0), activation="integrator", activation_range=(-1.0, 1.0)
        ),
        Actuator(
            name="lag",
            joint="j3",
            gain=(2.0, 0.0, 0.0),
            activation="filter",
            time_constant=0.1,
            control_range=(-1.5, 2.0),
        ),
    )
    scene = Scene(bodies=tuple(bodies), joints=tuple(joints), tendons=(rope,), actuators=motors)
    return case_of(scene, name="arm", t_end=0.5)


@pytest.mark.parametrize("seed", range(6))
def test_forces_of_any_scene_are_those_of_its_numbers(seed: int) -> None:
    rows = judge.forces_of_scene(arm(seed))
    assert [row.quantity for row in rows] == ["forces of motors", "forces of dampers", "forces at rest"]
    assert all(row.ok for row in rows), rows


OFF: dict[str, tuple[str, dict[str, Any], str]] = {
    "a range of a force": ("actuators", {"force_range": (-3.0, 4.04)}, "forces of motors"),
    "a gain": ("actuators", {"gain": (9.01, 0.5, 0.1)}, "forces of motors"),
    "a bias by the rate": ("actuators", {"bias": (0.1, -9.0, -0.601)}, "forces of dampers"),
    "a damper": ("joints", {"damping": (0.4, 0.5, 0.601)}, "forces of dampers"),
    "a sum's range": ("joints", {"force_range": (-2.02, 7.0)}, "forces of motors"),
}


@pytest.mark.parametrize("what", OFF)
def test_equations_that_are_of_another_scene_are_told(what: str) -> None:
    case, (kind, changes, quantity) = arm(3), OFF[what]
    assert case.scene is not None
    parts = list(getattr(case.scene, kind))
    parts[1] = replace(parts[1], **changes)
    other = equations.system_of(replace(case, scene=replace(case.scene, **{kind: tuple(parts)})))
    assert quantity in [row.quantity for row in judge.forces_against(case, other) if not row.ok]


def test_a_file_s_forces_are_held_against_its_numbers() -> None:
    rows = judge.forces_of_scene(cases.from_file(DRIVEN))
    assert len(rows) == 3
    assert all(row.ok for row in rows)
    assert judge.forces_of_scene(cases.load("bouncing_ball", "linear")) == ()
