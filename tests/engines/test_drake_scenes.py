"""Any scene in a MultibodyPlant: the scene's equations in Drake's coordinates, up to the first row that acts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from random_scenes import random_scene, random_state

from crossbody import cases, engines
from crossbody.cases import Case, CaseUnsupported, Outcome
from crossbody.cases.rotations import differences
from crossbody.cases.scene import UNBOUNDED, Actuator, Body, Joint, Scene, Shape

pytest.importorskip("pydrake", reason="Drake is not installed: pip install 'crossbody[drake]' brings it.")
SINGLE = ("hinge", "slide")


def without_rows(seed: int) -> Scene:
    """Return a random scene of what a plant in continuous time has."""
    scene = random_scene(seed, bodies=4)
    return scene.replace(
        loops=(), pairs=(), shapes=(),
        joints=tuple(
            replace(one, range=UNBOUNDED, armature=one.armature * (one.type in SINGLE)) for one in scene.joints
        ),
        tendons=tuple(replace(one, range=UNBOUNDED) for one in scene.tendons),
        actuators=tuple(replace(one, armature=0.0) for one in scene.actuators),
    )  # fmt: skip


def moving(seed: int, t_end: float = 0.02) -> Case:
    scene = without_rows(seed)
    q, v, u = random_state(scene, np.random.default_rng(seed))
    inputs = cases.Inputs(names=scene.inputs, times=np.array([0.0, 0.4 * t_end]), values=np.array([u, -u]))
    return cases.from_scene(scene, q0=q, v0=v, t_end=t_end, inputs=inputs if len(u) else None)


@pytest.mark.parametrize("seed", range(8))
def test_its_mass_matrix_and_bias_are_the_scenes(seed: int) -> None:
    case = moving(seed)
    theirs, ours = (engines.load(name).prepare(case).audit() for name in ("drake", "reference"))
    rng = np.random.default_rng(seed)
    for _ in range(3):
        q, v, _ = random_state(without_rows(seed), rng)
        for name, at in (("M", (q,)), ("bias", (q, v))):
            one, other = theirs[name](*at), ours[name](*at)
            assert np.abs(one - other).max() <= 1e-10 * np.abs(other).max(), name


@pytest.mark.parametrize("seed", range(8))
def test_its_motion_is_the_references(seed: int) -> None:
    case = moving(seed)
    ours = engines.load("reference").prepare(case, rtol=1e-11).run()
    theirs = engines.load("drake").prepare(case).run()
    assert theirs.outcome is Outcome.FINISHED, theirs.message
    assert differences(theirs.q[-1:], ours.q[-1:], case.quaternions).max() <= 1e-8
    assert np.abs(theirs.v[-1] - ours.v[-1]).max() <= 1e-6 * np.abs(ours.v[-1]).max()
    assert theirs.energy[-1].sum() == pytest.approx(ours.energy[-1].sum(), rel=1e-7)


def pendulum(t_end: float = 1.0, **more: object) -> Case:
    """Return a rod that swings from the horizontal."""
    rod = Body(name="rod", mass=1.0, com=(0.0, 0.0, -0.5), inertia=(0.1, 0.1, 0.01, 0.0, 0.0, 0.0))
    hinge = Joint(name="hinge", body="rod", type="hinge", axis=(0.0, 1.0, 0.0), range=(-0.2, 3.0))
    scene = Scene(bodies=(rod,), joints=(hinge,)).replace(**more)
    return cases.from_scene(scene, q0=[1.5], t_end=t_end)


@pytest.mark.parametrize("profile", ["matched", "continuous"])
def test_a_row_that_acts_ends_what_it_can_do(profile: str) -> None:
    engine = engines.load("drake")
    with pytest.raises(CaseUnsupported, match=r"hinge low' acts before t = 0\.\d+ s"):
        engine.prepare(pendulum(), profile).run()
    assert engine.prepare(pendulum(t_end=0.3), profile).run().outcome is Outcome.FINISHED


def test_a_plant_in_discrete_time_has_bounds() -> None:
    found = engines.load("drake").prepare(pendulum(t_end=3.0), "default").run()
    assert found.outcome is Outcome.FINISHED
    assert -0.05 < found.gap[:, 0].min() < 0.05  # without a bound it would swing to -1.5


def test_shapes_that_meet_are_a_row_that_acts() -> None:
    ball = Body(name="ball", mass=1.0, inertia=(0.1, 0.1, 0.1, 0.0, 0.0, 0.0))
    scene = Scene(
        bodies=(ball,), joints=(Joint(name="free", body="ball", type="free"),),
        shapes=(
            Shape(name="floor", type="plane", size=(1.0, 1.0, 0.1)),
            Shape(name="round", body="ball", type="sphere", size=(0.1, 0.0, 0.0)),
        ),
        pairs=(cases.scene.Pair(name="fall", first="floor", second="round"),),
    )  # fmt: skip
    for profile in ("matched", "default"):
        case = cases.from_scene(scene, q0=[0.0, 0.0, 0.2, 1.0, 0.0, 0.0, 0.0], t_end=1.0)
        with pytest.raises(CaseUnsupported, match=r"'fall' acts before t = 0\.[12]"):
            engines.load("drake").prepare(case, profile).run()


def test_activations_and_a_controller_act() -> None:
    motor = Actuator(name="motor", joint="hinge", gain=(3.0, 0.0, 0.0), activation="filter", time_constant=0.1)
    case = pendulum(t_end=0.3, actuators=(motor,))
    case = replace(case, control=cases.Control(lambda t, q, v: [2.0 - q[0] - v[0]], 0.01))
    ours, theirs = (engines.load(name).prepare(case).run() for name in ("reference", "drake"))
    assert theirs.q[-1, 0] == pytest.approx(ours.q[-1, 0], abs=1e-8)
    assert theirs.inputs is not None


def test_what_a_plant_has_not_is_named() -> None:
    engine, loop = engines.load("drake"), cases.scene.Loop(name="held", type="connect", first="rod")
    assert "'held'" in str(engine.why_not(pendulum(loops=(loop,)), "matched"))
    ball = Joint(name="socket", body="rod", type="ball", armature=0.1)
    turning = cases.from_scene(pendulum().scene.replace(joints=(ball,)), q0=[1.0, 0.0, 0.0, 0.0], t_end=0.1)
    assert "'socket'" in str(engine.why_not(turning, "matched"))
