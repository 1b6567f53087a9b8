"""A body that is spared a part of its weight falls slower by that part, in every engine."""

from __future__ import annotations

import numpy as np
import pytest
from friction_scenes import pair

from crossbody import cases, engines
from crossbody.cases import CrossbodyError
from crossbody.cases.scene import Body, Joint, Scene, Shape

T, HEIGHT, G = 0.3, 2.0, 9.81
STEPPED = 1e-2
"""Part of the fall by which a first-order step of a millisecond may be off."""


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    "who", ["reference:compiled", "mujoco:default", "pinocchio:law", "dart:matched", "drake:default", "exudyn:matched"]
)
def test_a_spared_body_falls_slower(who: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    spared, mass = float(rng.uniform(0.1, 1.4)), float(rng.uniform(0.2, 3.0))
    inertia = (0.1 * mass, 0.1 * mass, 0.1 * mass, 0.0, 0.0, 0.0)
    scene = Scene(
        bodies=(Body(name="b", mass=mass, inertia=inertia, weightless=spared),),
        joints=(Joint(name="free", body="b", type="free"),),
        shapes=(Shape(name="floor", type="plane"), Shape(name="ball", body="b", type="sphere", size=(0.1, 0.0, 0.0))),
        pairs=(pair("floor", "ball", 0.4),),
    )  # fmt: skip
    case = cases.from_scene(scene, q0=[0.0, 0.0, HEIGHT, 1.0, 0.0, 0.0, 0.0], t_end=T)
    name, profile = who.split(":")
    try:
        run = engines.load(name).prepare(case, profile).run()
    except (CrossbodyError, ModuleNotFoundError) as error:
        pytest.skip(f"{who}: {error}")
    fall = 0.5 * (1.0 - spared) * G * T**2
    assert HEIGHT - run.q[-1, 2] == pytest.approx(fall, abs=STEPPED * 0.5 * G * T**2)
