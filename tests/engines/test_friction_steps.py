"""Engines that step contacts with friction: forces in the scene's frames, creep by their parameters, closed forms."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from friction_scenes import G, box_on_floor, rubbed, sphere_on_floor, stack
from scipy.spatial.transform import Rotation

from crossbody import cases, engines
from crossbody.cases import Case, Mode, Trajectory
from crossbody.cases.files.case import case_of
from crossbody.cases.mechanisms.friction.creeps import HOLDS as SLOW
from crossbody.cases.mechanisms.friction.creeps import STEP, STICTION, mixed, regularised
from crossbody.cases.mechanisms.friction.limits import NEAR
from crossbody.cases.scene import Body, Joint, Loop, Pair, Scene, Shape
from crossbody.engines._rubbing import Push, Rubbing
from crossbody.engines.equations import system_of

STEPPED = (
    ("pinocchio", "admm"), ("drake", "matched"), ("drake", "default"), ("dart", "matched"), ("dart", "default"),
)  # fmt: skip
CLOSED = [
    (name, variant)
    for name in ("sliding_block", "rolling_sphere", "block_on_belt", "rocking_block", "stacked_blocks")
    for variant in cases.variants(name)
]
HOLDS = ("rests", "askew")
"""Variants of sliding_block that end in their place on a slope."""


def engine(name: str) -> Any:
    """Return an engine, or skip where it is not installed."""
    try:
        return engines.load(name)
    except cases.EngineUnavailable as error:
        pytest.skip(str(error))


def ran(name: str, profile: str, case: Case, **settings: Any) -> Trajectory:
    """Return a motion."""
    return engine(name).prepare(case, profile, **settings).run()


@pytest.mark.parametrize(("name", "profile"), STEPPED)
@pytest.mark.parametrize(("case", "variant"), CLOSED)
def test_every_closed_form_is_run(name: str, profile: str, case: str, variant: str) -> None:
    """Within what first order leaves of the path: of solids as they come Drake has one contact, on which boxes rock.

    DART's friction is bounded along two axes, and may be sqrt(2) of what it is in a cone.
    """
    given = cases.load(case, variant, t_end=0.1)
    found = ran(name, profile, given, dt=2e-3)
    assert found.outcome.ok, found.message
    assert found.t[-1] == given.t_end
    boxes = case in ("stacked_blocks", "rocking_block") or variant == "flat"
    if (name, profile) == ("drake", "default") and boxes:
        return
    truth = given.closed_form(found.t) if given.closed_form is not None else None
    assert truth is not None
    path = max(float(np.abs(np.diff(truth.q[:, :3], axis=0)).sum(axis=0).max()), 1e-2)
    oblique = name == "dart" and variant in ("askew", "side_spin")
    assert np.abs(found.q - truth.q)[:, :3].max() < (np.sqrt(2.0) - 1.0 if oblique else 0.1) * path


@pytest.mark.parametrize("variant", HOLDS)
@pytest.mark.parametrize(("name", "profile"), [("drake", "matched"), ("drake", "default"), ("dart", "matched")])
def test_a_point_creeps_as_the_engines_parameters_say(name: str, profile: str, variant: str) -> None:
    case = cases.load("sliding_block", variant)
    found, mu, slope = ran(name, profile, case), 0.5, 0.4
    expected = {
        ("drake", "matched"): regularised(slope / mu, "tamsi", SLOW),
        ("drake", "default"): regularised(slope / mu, "lagged", STICTION),
        ("dart", "matched"): mixed(G * np.sin(np.arctan(slope))),
    }
    assert found.mode[-1, 0] == Mode.STICK
    assert np.linalg.norm(found.v[-1, :2]) == pytest.approx(expected[name, profile], rel=NEAR)


@pytest.mark.parametrize(("mu", "stiction"), [(0.45, 1e-3), (0.8, 1e-5)])
@pytest.mark.parametrize("approximation", ["tamsi", "lagged", "similar", "sap"])
def test_drakes_approximations_creep_as_they_are_written(mu: float, stiction: float, approximation: str) -> None:
    case, rho = cases.load("sliding_block", "rests", mu=mu, t_end=0.2), 0.4 / mu
    stiff = 1e9 if approximation == "sap" else 1e5
    found = ran("drake", "matched", case, approximation=approximation, stiction=stiction, stiffness=stiff)
    smooth = stiction * rho / np.sqrt(1.0 - rho * rho)
    expected = {
        "tamsi": stiction * (1.0 - np.sqrt(1.0 - rho)), "lagged": smooth, "similar": smooth,
        "sap": 1e-3 * G * np.sin(np.arctan(0.4)) * STEP / np.sqrt(3.0),  # of its regularisation, near rigid
    }  # fmt: skip
    assert found.v[-1, 0] == pytest.approx(expected[approximation], rel=NEAR)


@pytest.mark.parametrize("seed", range(8))
def test_a_sphere_is_caught_in_the_step_whose_middle_is_below_the_floor_and_comes_back_by_its_restitution(
    seed: int,
) -> None:
    """Neither a step before nor behind; and what parts already, but is pressed back, comes to rest."""
    rng, dt, e, radius = np.random.default_rng(seed), 1e-3, 0.5, 0.1
    scene, turned = sphere_on_floor(0.3, radius), [1.0, 0.0, 0.0, 0.0]

    def steps(gap: float, speed: float, t_end: float) -> Trajectory:
        case = cases.from_scene(scene, q0=[0.0, 0.0, radius + gap, *turned], v0=[0, 0, speed, 0, 0, 0], t_end=t_end)
        return ran("pinocchio", "admm", case, dt=dt, restitution=e)

    found = steps(rng.uniform(0.01, 0.02), -rng.uniform(0.5, 2.0), 0.04)
    k = int(np.flatnonzero(found.lam[:, 0])[0])  # of the step before
    ahead = found.q[:, 2] - radius + 0.5 * dt * found.v[:, 2]
    assert (ahead[: k - 1] > 0.0).all()
    assert ahead[k - 1] <= 0.0
    assert found.v[k, 2] == pytest.approx(-e * found.v[k - 1, 2], rel=1e-6)
    assert steps(-1e-4, rng.uniform(0.1, 0.9) * G * dt, dt).v[-1, 2] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("e", [0.2, 0.6, 0.9])
@pytest.mark.parametrize(("name", "profile"), [("pinocchio", "admm"), ("dart", "matched")])
def test_a_sphere_comes_back_by_the_restitution_that_was_asked_for(name: str, profile: str, e: float) -> None:
    scene, speed = sphere_on_floor(0.3, 0.1), -3.0
    case = cases.from_scene(scene, q0=[0, 0, 0.11, 1.0, 0, 0, 0], v0=[0, 0, speed, 0, 0, 0], t_end=0.02)
    found = ran(name, profile, case, dt=1e-4, restitution=e).v[:, 2]
    k = int(np.argmax(found > 0.0))
    assert found[k] == pytest.approx(-e * found[:k].min(), rel=2e-3)


@pytest.mark.parametrize("dt", [2e-3, 5e-4])
def test_darts_creep_grows_with_its_step(dt: float) -> None:
    case = cases.load("sliding_block", "rests", t_end=0.1)
    expected = mixed(G * np.sin(np.arctan(0.4)), dt)
    assert ran("dart", "matched", case, dt=dt).v[-1, 0] == pytest.approx(expected, rel=NEAR)


def thrown() -> Iterator[tuple[str, Case]]:
    """Yield bodies thrown so that they slide and turn: name and case."""
    one, two = sphere_on_floor(0.4, 0.1), Rotation.from_euler("xyz", [0.3, -0.4, 0.2])
    body = one.bodies[0]
    balls = Scene(
        bodies=(body, Body(name="other", mass=2.0, inertia=body.inertia)),
        joints=tuple(Joint(name=f"of {name}", body=name, type="free") for name in ("sphere", "other")),
        shapes=(one.shapes[1], Shape(name="other", body="other", size=(0.15, 0, 0))),
        pairs=(Pair(name="balls", first="sphere", second="other", friction=(0.4, 0.4, 0, 0, 0), dimension=3),),
        gravity=(0.0, 0.0, 0.0),
    )  # fmt: skip
    turn = two.as_quat(scalar_first=True)
    q0 = [0, 0, 0, 1, 0, 0, 0, *two.apply([0.2499, 0.0, 0.0]), *turn]
    v0 = [*two.apply([0.5, 0.2, -0.1]), 1, 2, 3, 0, 0, 0, 3, -1, 2]
    yield "two spheres", case_of(balls, q0=q0, v0=v0, t_end=0.02)
    back = replace(balls.pairs[0], first="other", second="sphere")
    yield "the other way", case_of(balls.replace(pairs=(back,)), q0=q0, v0=v0, t_end=0.02)
    for name, angle in (("box", 0.0), ("box on a turned floor", 0.7)):
        box = box_on_floor(0.3, turn=angle)
        yield name, case_of(box, q0=[0, 0, 0.1, 1, 0, 0, 0], v0=[1.0, 0.5, 0, 0, 0, 0.5], t_end=0.02)
    ball = sphere_on_floor(0.3, 0.1, turn=0.7)
    yield "sphere", case_of(ball, q0=[0, 0, 0.1, 1, 0, 0, 0], v0=[1.0, 0.5, 0, 3, -5, 4], t_end=0.02)
    yield from rubbed()
    stacked = stack(0.2, 0.3)
    at = [0, 0, 0.1, 1, 0, 0, 0, 0, 0, 0.3, 1, 0, 0, 0]
    yield "stack", case_of(stacked, q0=at, v0=[0.5, 0.2, 0, 0, 0, 0, -0.3, 0, 0, 0, 0, 0], t_end=0.02)


@pytest.mark.parametrize(("name", "profile"), STEPPED)
@pytest.mark.parametrize("thrown", [pytest.param(case, id=name) for name, case in thrown()])
def test_multipliers_explain_the_motion(name: str, profile: str, thrown: Case) -> None:
    """M dv = (f + H^T lam) dt with the reference's H: frames, signs and places are the scene's.

    Drake's one contact of a box as it comes is between corners where a face lies flat: no row tells its torque.
    """
    if (name, profile) == ("drake", "default") and len(thrown.contacts) > 3:
        return
    if (name == "dart") and (why := engine(name).why_not(thrown, profile)):
        assert "cylinder" in why or "FCL's detector treats the capsule" in why
        return
    found = ran(name, profile, thrown, dt=1e-4)
    system, worst, largest = system_of(thrown), 0.0, 0.0
    normals = len(thrown.contacts) // 3
    some = [i for i in range(1, len(found.t)) if found.lam[i].any()]
    some = some[:: max(1, len(some) // 20)]
    assert some
    assert np.abs(found.lam[:, normals:]).max() > 0.1
    for i in some:
        q, v, dt = found.q[i - 1], found.v[i - 1], found.t[i] - found.t[i - 1]
        M, f = system.terms(q, v)[:2]
        given = np.linalg.solve(M, f + system.constraint(q, v)[0].T @ found.lam[i])
        worst = max(worst, float(np.abs((found.v[i] - v) / dt - given).max()))
        largest = max(largest, float(np.abs(given).max()))
    assert worst < 2e-2 * largest


def test_what_cannot_be_stepped_is_a_sentence() -> None:
    arm = Body(name="arm", mass=1.0, inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0))
    ball = sphere_on_floor(0.5, 0.1)
    hinge = Joint(name="hinge", body="arm", type="hinge")
    scene = ball.replace(bodies=(*ball.bodies, arm), joints=(*ball.joints, hinge))
    loop = case_of(scene.replace(loops=(Loop(name="held", type="connect", first="arm"),)))
    bound = case_of(scene.replace(joints=(*ball.joints, replace(hinge, range=(-1.0, 1.0)))))
    for name, profile in STEPPED:
        assert "'held'" in engine(name).why_not(loop, profile)
        told = engine(name).why_not(bound, profile)
        assert told is None if name == "drake" else "'hinge' has bounds" in told
    assert "discrete" in engine("drake").why_not(case_of(ball), "continuous")
    assert "restitution" in engine("dart").why_not(cases.load("bouncing_ball"), "default")


@pytest.mark.parametrize("seed", range(6))
def test_rows_of_a_pair_bear_all_that_an_engine_pushes_with(seed: int) -> None:
    """Several at one place too, and whichever shape is named first."""
    scene, rng = cases.load("tossed_cube", "slides").scene, np.random.default_rng(seed)
    assert scene is not None
    rubbing = Rubbing(scene)
    (contact,) = rubbing.touching.all

    def poses(body: str) -> tuple[np.ndarray, np.ndarray]:
        return np.eye(3), np.array([0.0, 0.0, 0.1]) if body else np.zeros(3)

    met, total, pushes = rubbing.touching.touches(poses), np.zeros(3), []
    for point in met.point[rng.integers(0, contact.places, 6)]:
        force, turned = rng.normal(size=3), bool(rng.random() < 0.5)
        names = (contact.first.name, contact.second.name)
        total += force
        near = point + 1e-4 * rng.normal(size=3)
        pushes.append(Push(*(names[::-1] if turned else names), near, -force if turned else force, False))
    lam, _ = rubbing.rows(poses, pushes)
    normal, along = lam[rubbing.before :][: contact.places], lam[rubbing.before + contact.places :].reshape(-1, 2)
    up = float(total @ met.normal[0])
    assert normal.sum() == pytest.approx(up)
    assert np.linalg.norm(along.sum(axis=0)) == pytest.approx(np.linalg.norm(total - up * met.normal[0]))
