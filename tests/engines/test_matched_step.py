"""The step that MuJoCo's matched profile takes by itself: accurate for what moves, stable for what only decays."""

from __future__ import annotations

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import Case, Outcome
from crossbody.cases.scene import Actuator, Body, Joint, Loop, RowLaw, Scene, Tendon
from crossbody.engines.mujoco import _model


def swinging(seed: int, rate: float) -> Case:
    """Return an arm on a spring that carries a light rod, which a damper holds at so many 1/s, and a ring on a loop."""
    rng = np.random.default_rng(seed)
    inertia, spin = 10.0 ** rng.uniform(-6.0, -4.0), tuple(rng.normal(size=3))
    bodies = (
        Body(name="arm", mass=1.0, com=(0.2, 0.0, 0.0), inertia=(0.01, 0.03, 0.03, 0.0, 0.0, 0.0)),
        Body(name="rod", parent="arm", position=(0.4, 0.0, 0.0), mass=1e-3, inertia=(*[inertia] * 3, 0.0, 0.0, 0.0)),
        Body(name="ring", parent="arm", position=(0.1, 0.0, 0.0), mass=1e-2, inertia=(*[1e-5] * 3, 0.0, 0.0, 0.0)),
    )
    joints = (
        Joint(name="shoulder", body="arm", type="hinge", axis=(0.0, 1.0, 0.0),
              stiffness=(float(rng.uniform(1.0, 30.0)), 0.0, 0.0), rest=(float(rng.normal()),)),
        Joint(name="twist", body="rod", type="ball", damping=(rate * inertia, 0.0, 0.0)),
        Joint(name="turn", body="ring", type="hinge", axis=(0.0, 1.0, 0.0), damping=(0.01, 0.0, 0.0)),
    )  # fmt: skip
    coupled = Loop(
        name="held",
        type="joint",
        first="turn",
        second="shoulder",
        polynomial=(0.0, 1.0, 0.0, 0.0, 0.0),
        law=RowLaw(a0=1e3, a1=60.0),
    )
    scene = Scene(bodies=bodies, joints=joints, loops=(coupled,), gravity=(0.0, 0.0, -9.81))
    return cases.from_scene(scene, q0=[0.0, 1.0, 0.0, 0.0, 0.0, 0.0], v0=[1.0, *spin, 1.0], t_end=0.4)


@pytest.mark.parametrize("rate", [300.0, 3e3, 3e4])
@pytest.mark.parametrize("seed", range(3))
def test_what_only_decays_is_followed_as_far_as_it_moves(seed: int, rate: float) -> None:
    """And a joint that a loop holds does not count: MuJoCo keeps a softness of the loop, which bears its damper."""
    case = swinging(seed, rate)
    run = engines.load("mujoco").prepare(case, "matched")
    dt = float(run.settings["dt"])
    assert min(1e-3, 0.05 / rate) <= dt <= 0.5 / rate or dt == 1e-3
    moved = run.run()
    exact = engines.load("reference").prepare(case, "compiled", rtol=1e-12).run()
    assert moved.outcome is exact.outcome is Outcome.FINISHED
    assert np.abs(moved.q[-1] - exact.q[-1]).max() <= 1e-7


@pytest.mark.parametrize("kind", ["servo", "band"])
@pytest.mark.parametrize("seed", range(3))
def test_forces_with_bounds_and_springs_with_dead_bands_are_within_limits(seed: int, kind: str) -> None:
    """Wherever they are at the start: held at a bound, or slack, they tell nothing of how fast they change."""
    rng = np.random.default_rng(seed)
    body = Body(name="wheel", mass=1.0, inertia=(0.05, 0.05, 0.05, 0.0, 0.0, 0.0))
    stiff, most = float(rng.uniform(10.0, 40.0)), float(rng.uniform(1.0, 3.0))
    joint = Joint(name="turn", body="wheel", type="hinge", axis=(0.0, 1.0, 0.0))
    servo = Actuator(name="servo", joint="turn", bias=(0.0, -stiff, -0.05 * stiff), force_range=(-most, most))
    rope = Tendon(name="rope", joints=("turn",), coefficients=(1.0,), stiffness=(stiff, 0.0, 0.0), rest=(-0.3, 0.2))
    own = {"actuators": (servo,)} if kind == "servo" else {"tendons": (rope,)}
    start = 1.0 if kind == "servo" else 0.0
    case = cases.from_scene(Scene(bodies=(body,), joints=(joint,), **own), q0=[start], v0=[2.0], t_end=1.0)
    run = engines.load("mujoco").prepare(case, "matched").run()
    exact = engines.load("reference").prepare(case, "compiled", rtol=1e-12).run()
    assert np.abs(run.q[-1] - exact.q[-1]).max() <= 1e-6 * np.abs(exact.q).max()
    assert np.abs(run.v[-1] - exact.v[-1]).max() <= 1e-5 * np.abs(exact.v).max()


@pytest.mark.parametrize("seed", range(12))
def test_a_mode_that_decays_counts_by_what_a_unit_state_makes_of_it(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its part of positions is what is left of exp(A t) without the other modes, by the inverse of all vectors."""
    rng, n = np.random.default_rng(seed), 4
    turn = np.linalg.qr(rng.normal(size=(n, n)))[0]
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-np.eye(n), -(turn * 10.0 ** rng.uniform(1.0, 3.0, n)) @ turn.T]])
    monkeypatch.setattr(_model, "_slopes", lambda *given: A)
    rates, R = np.linalg.eig(A)
    inverse = np.linalg.inv(R)
    moved = [np.abs(np.outer(R[:n, k], inverse[k])).max() for k in range(2 * n)]
    counts = np.minimum(moved, 1.0) ** 0.25
    assert counts[np.argmax(np.abs(rates) * counts)] > _model.OF_RATE / _model.STABLE
    wanted = np.max(np.abs(rates) * counts)
    assert _model.fastest(Scene(), np.zeros(n), np.zeros(n)) == pytest.approx(wanted, rel=1e-6)
