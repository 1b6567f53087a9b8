"""Ranges that clamp, and dead bands: a force with a kink is passed within the tolerance, against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import Outcome
from crossbody.cases.scene import Actuator, Body, Joint, Scene, Tendon

MASS, STIFFNESS, MOST, START = 2.0, 8.0, 3.0, 1.0
RATE = float(np.sqrt(STIFFNESS / MASS))
BEHIND = 0.2  # s after the kink, before the next one

SLIDE = Joint(name="x", body="b", type="slide", axis=(1.0, 0.0, 0.0))
SERVO = Actuator(name="servo", joint="x", bias=(0.0, -STIFFNESS, 0.0))
BODY = Body(name="b", mass=MASS, inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0))
FREE = Scene(bodies=(BODY,), joints=(SLIDE,), gravity=(0.0, 0.0, 0.0))
BAND = Tendon(name="t", joints=("x",), coefficients=(1.0,), stiffness=(STIFFNESS, 0.0, 0.0), rest=(-0.2, 0.375))
SCENES = {
    "forcerange": FREE.replace(actuators=(replace(SERVO, force_range=(-MOST, MOST)),)),
    "actuatorfrcrange": FREE.replace(joints=(replace(SLIDE, force_range=(-MOST, MOST)),), actuators=(SERVO,)),
    "dead band": FREE.replace(tendons=(BAND,)),
}


def end_of(name: str) -> tuple[float, float]:
    """Return an instant behind the kink, s, and where the body is then, m."""
    if name == "dead band":  # a quarter of a swing about its edge, then nothing pulls
        edge = BAND.rest[1]
        return np.pi / (2.0 * RATE) + BEHIND, edge - (START - edge) * RATE * BEHIND
    edge = MOST / STIFFNESS  # as far as that with the largest force, then a swing
    kink = np.sqrt(2.0 * (START - edge) * MASS / MOST)
    speed = -MOST / MASS * kink
    return float(kink) + BEHIND, edge * np.cos(RATE * BEHIND) + speed / RATE * np.sin(RATE * BEHIND)


@pytest.mark.parametrize("rtol", [1e-5, 1e-7, 1e-9, 1e-11])
@pytest.mark.parametrize("profile", ["compiled", "cvode"])
@pytest.mark.parametrize("name", list(SCENES))
def test_a_kink_of_a_force_is_passed_within_the_tolerance(name: str, profile: str, rtol: float) -> None:
    """Each step keeps its error below the tolerance, kink or not; a dozen of them end behind it."""
    t_end, wanted = end_of(name)
    run = engines.load("reference").prepare(cases.from_scene(SCENES[name], q0=[START], t_end=t_end), profile, rtol=rtol)
    found = run.run()
    assert found.outcome is Outcome.FINISHED
    assert abs(found.q[-1, 0] - wanted) <= 20.0 * rtol


@pytest.mark.parametrize("who", ["mujoco:matched", "pinocchio:law"])
@pytest.mark.parametrize("name", list(SCENES))
def test_engines_bound_forces_where_the_scene_does(name: str, who: str) -> None:
    t_end, wanted = end_of(name)
    case, (engine, profile) = cases.from_scene(SCENES[name], q0=[START], t_end=t_end), who.split(":")
    found = engines.load(engine).prepare(case, profile).run()
    assert found.outcome is Outcome.FINISHED
    assert abs(found.q[-1, 0] - wanted) <= 1e-6


@pytest.mark.parametrize("who", ["reference:compiled", "reference:cvode", "mujoco:matched", "pinocchio:law"])
@pytest.mark.parametrize("actuator", [(1.0, 2.0), (-np.inf, np.inf)])
@pytest.mark.parametrize("joint", [(1.0, 2.0), (-np.inf, np.inf)])
def test_a_range_without_zero_pushes_where_nothing_else_does(
    who: str, actuator: tuple[float, float], joint: tuple[float, float]
) -> None:
    """What can exert no force is left out of the sum; the lower bound of a range is a force."""
    dead = Actuator(name="dead", joint="x", force_range=actuator)
    scene = FREE.replace(joints=(replace(SLIDE, force_range=joint),), actuators=(dead,))
    engine, profile = who.split(":")
    found = engines.load(engine).prepare(cases.from_scene(scene, q0=[START], t_end=1.0), profile).run()
    force = 1.0 if actuator[0] == 1.0 or joint[0] == 1.0 else 0.0
    assert found.outcome is Outcome.FINISHED
    assert abs(found.q[-1, 0] - START - force / MASS / 2.0) <= 1e-6
