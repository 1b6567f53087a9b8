"""The truth of a scene is held against Pinocchio, which shares the scene alone: a wrong tree is seen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from random_scenes import random_scene, random_state

from crossbody.cases import Case, EngineUnavailable, Outcome, Tier, load
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, Scene
from crossbody.reference.sundials.level_machine import LevelMachine
from crossbody.reference.tree import system as tree
from crossbody.reports.judging import truth as judging
from crossbody.reports.judging.truth_row import truth_row
from crossbody.reports.judging.verdict import Word

INERTIA = (0.02, 0.03, 0.04, 0.0, 0.0, 0.0)
ARM = Scene(
    bodies=(
        Body(name="upper", mass=1.0, com=(0.0, 0.1, -0.3), inertia=INERTIA),
        Body(name="lower", parent="upper", position=(0.0, 0.0, -0.6), mass=0.5, com=(0.1, 0.0, -0.2), inertia=INERTIA),
    ),
    joints=(
        Joint(name="shoulder", body="upper", type="ball"),
        Joint(name="elbow", body="lower", type="hinge", axis=(0.0, 1.0, 0.0), range=(-0.4, 2.0)),
    ),
)


@pytest.fixture
def arm() -> Case:
    return case_of(ARM, q0=[0.9, 0.3, 0.2, 0.1, 0.5], v0=[0.5, -1.0, 2.0, -3.0], t_end=0.5)


def heavier(scene: Scene) -> Scene:
    return scene.replace(gravity=tuple(1.001 * g for g in scene.gravity))


def rounder(scene: Scene) -> Scene:
    *others, last = scene.bodies
    return scene.replace(bodies=(*others, replace(last, inertia=tuple(1.001 * x for x in last.inertia))))


@pytest.mark.parametrize("wrong", [heavier, rounder])
def test_a_wrong_tree_is_seen(wrong: Callable[[Scene], Scene], arm: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    (right,) = truth_row(arm, judging.truth_of(arm), "")
    assert right.verdict == Word.WITHIN
    assert "they share only the scene" in right.why
    own = tree.system

    def planted(scene: Scene, *args: Any, **more: Any) -> Any:
        return own(wrong(scene), *args, **more)

    monkeypatch.setattr(tree, "system", planted)
    (row,) = truth_row(arm, judging.truth_of(arm), "")
    assert row.verdict == Word.OUTSIDE
    monkeypatch.setattr(judging, "_witness", lambda *_: "left out")  # a solver of the same equations has the same fault
    (blind,) = truth_row(arm, judging.truth_of(arm), "")
    assert blind.verdict == Word.WITHIN


@pytest.mark.parametrize("seed", range(3))
def test_a_witness_is_given_as_many_steps_as_its_time_allows(
    seed: int, arm: Case, monkeypatch: pytest.MonkeyPatch
) -> None:  # fmt: skip
    """At the pace of its first part, a twentieth of the whole, of which the time was measured."""
    rng = np.random.default_rng(seed)
    first, steps, limit = (
        float(rng.uniform(0.5, 1.0)),
        int(rng.integers(10_000, 20_000)),
        float(rng.uniform(25.0, 90.0)),
    )
    given = []

    def prepare(case: Case, profile: str, **settings: Any) -> Any:
        given.append((case.t_end, settings))
        return SimpleNamespace(run=lambda: SimpleNamespace(outcome=Outcome.FINISHED))

    monkeypatch.setattr("crossbody.engines.load", lambda name: SimpleNamespace(prepare=prepare))
    monkeypatch.setattr(judging, "estimated", lambda *_: (20.0 * first, steps))
    judging._witness(arm, limit)
    ((t_end, settings),) = given
    assert t_end == arm.t_end
    assert settings["max_steps"] == pytest.approx(limit / (first / steps), rel=1e-3)


def test_where_there_is_no_witness_the_truth_says_why(arm: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(judging, "estimated", lambda *_: (2e4, 10))
    said = judging.truth_of(arm).source
    assert "they share only the equations of the mechanism (Pinocchio would share only the scene, but take" in said

    monkeypatch.setattr(judging, "estimated", lambda *_: (1.0, 10))
    long = replace(arm, t_end=500.0)  # its first part seemed cheap: a thousand steps are all that it is given
    assert str(judging._witness(long, 40.0)).startswith("Pinocchio ends step_limit at t = ")

    def absent(_: str) -> Any:
        raise EngineUnavailable("Pinocchio is not installed.")

    monkeypatch.setattr("crossbody.engines.load", absent)
    assert judging._witness(arm, 40.0) == "Pinocchio is not installed"


@pytest.mark.parametrize("seed", [pytest.param(k, marks=[pytest.mark.slow] if k > 1 else []) for k in range(8)])
def test_both_witnesses_of_a_random_scene_agree(seed: int) -> None:
    scene = random_scene(seed, bodies=2)
    motors = tuple(one for one in scene.actuators if one.joint)
    scene = scene.replace(loops=(), tendons=(), pairs=(), shapes=(), actuators=motors)
    q, v, _ = random_state(scene, np.random.default_rng(seed))
    case = case_of(scene, q0=q, v0=0.3 * v, t_end=0.05)
    found = judging.truth_of(case)
    (row,) = truth_row(case, found, "")
    assert "they share only the scene" in row.why
    assert row.verdict == Word.WITHIN, row.why


@pytest.mark.parametrize("seed", [5, 7])
@pytest.mark.parametrize(
    ("engine", "profile"),
    [
        ("reference", "compiled"),
        ("reference", "cvode"),
        pytest.param("pinocchio", "law", marks=pytest.mark.slow),
    ],
)
def test_a_string_that_cannot_get_shorter_ends_a_motion_with_a_sentence(seed: int, engine: str, profile: str) -> None:
    """Its law pulls on where it is square to all that could shorten it: velocities have no bound, in every engine."""
    from crossbody import engines
    from crossbody.cases import Outcome

    scene = random_scene(seed, bodies=3).replace(loops=(), pairs=(), shapes=())
    run = engines.load(engine).prepare(case_of(scene, t_end=0.5), profile).run()
    assert run.outcome is Outcome.ILL_POSED
    assert run.t[-1] == pytest.approx({5: 0.02570867479, 7: 0.00196796183}[seed], rel=1e-6)
    said = "in force where they have no direction" if engine == "reference" else "almost nothing can move"
    assert said in run.message


@pytest.mark.timeout(100)
def test_a_second_machine_that_does_not_end_is_left_in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a case with kernels of its own too: one that is wrong may switch for ever, and the truth says so."""
    case = load("ball_maze", "free")
    monkeypatch.setattr(LevelMachine, "contradicts", lambda *_: True)  # it switches after every step
    monkeypatch.setattr(judging, "OF_KERNELS", 0.1)
    truth = judging.truth_of(case, budget=1.0)
    assert truth.tier is Tier.D
    assert "CVODE, which shares only the equations, takes longer than --budget allows: up to t = " in truth.source
