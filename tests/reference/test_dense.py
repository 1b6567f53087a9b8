"""`simulate(..., dense=True)`: q and v at any instant, as samples there say, with both limits at events."""

from __future__ import annotations

import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import own_case
import pytest
import springs
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from random_scenes import random_scene, random_state
from scenes import BALL

from crossbody import cases
from crossbody.cases import Control, InvalidValue, SceneError
from crossbody.cases.scene import Joint
from crossbody.engines.equations import system_of
from crossbody.reference import _dense, ensemble, simulate

SCENES = ("bouncing_ball", "newtons_cradle", "soft_contact", "red_body", "delta_impulse", "ball_maze")


def scene(name: str) -> tuple[Any, ...]:
    """A case's equations, its start, and some of its time."""
    case = cases.load(name)
    return system_of(case), case.q0, case.v0, min(case.t_end, 1.0)


def agrees(start: tuple[Any, ...], at: Any, **options: Any) -> Any:
    """Check a dense run against the same one without, and against samples; the run."""
    plain, dense = simulate(*start, **options), simulate(*start, dense=True, **options)
    for name in ("t", "q", "v", "lam", "mode"):
        np.testing.assert_array_equal(getattr(plain, name), getattr(dense, name))
    assert (plain.events, plain.outcome, plain.sol) == (dense.events, dense.outcome, None)
    times = np.asarray(at) * dense.sol.t_max
    sampled = simulate(*start, samples=np.sort(times), **options)
    order = np.argsort(times)
    later = np.sort(times) > 0.0
    for one, other in zip(dense.sol(times, side="left"), (sampled.q, sampled.v), strict=True):
        np.testing.assert_allclose(one[order][later], other[later], rtol=1e-12, atol=1e-13)
    return dense


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("room", [_dense.ROOM, 1e5])
def test_it_says_what_samples_say(name: str, room: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """With little room marks are dropped, and steps are taken again."""
    monkeypatch.setattr(_dense, "ROOM", room)
    run = agrees(scene(name), np.random.default_rng(1).uniform(size=99))
    if name == "soft_contact":
        assert (run.sol._marks.every > 1) == (room < _dense.ROOM)
    later = np.r_[np.diff(run.t) > 0.0, True]  # of both sides of an event the one behind it
    for one, other in zip(run.sol(run.t), (run.q, run.v), strict=True):
        np.testing.assert_allclose(one[later], other[later], rtol=1e-12, atol=1e-13)


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 10_000), st.lists(st.floats(0.0, 1.0), min_size=1, max_size=20))
def test_random_trees_with_quaternions(seed: int, at: list[float]) -> None:
    found = random_scene(seed, bodies=3).replace(shapes=(), pairs=(), loops=())
    q, v, _ = random_state(found, np.random.default_rng(seed))
    start = system_of(cases.from_scene(found)), q, v, 0.2
    try:
        assume(simulate(*start, rtol=1e-7).outcome.ok)
    except SceneError as error:  # a random rope may be too long for good
        assume("no coordinate changes it" not in str(error))
        raise
    agrees(start, at, rtol=1e-7)


def test_a_free_body_that_bounces() -> None:
    free = Joint(name="free", body="ball", type="free")
    system = system_of(cases.from_scene(BALL.replace(joints=(free,), actuators=())))
    start = [0.0, 0.0, 0.0, 0.8, 0.0, 0.6, 0.0], [1.0, 0.0, 0.0, 3.0, -1.0, 2.0]
    run = agrees((system, *start, 0.5), np.random.default_rng(2).uniform(size=99))
    assert [event.after.name for event in run.events] == ["CONTACT", "BALLISTIC", "FREE"]
    q, _ = run.sol(np.linspace(0.0, 0.5, 77))
    np.testing.assert_allclose(np.linalg.norm(q[:, 3:], axis=1), 1.0, rtol=1e-14)


@pytest.mark.parametrize("seed", range(3))
def test_closed_forms_across_events(seed: int) -> None:
    case = springs.outside(seed)
    times = np.linspace(0.0, case.t_end, 501)
    truth = case.closed_form(times)
    errors = []
    for rtol in (1e-6, 1e-9):
        q, v = simulate(springs.system_of(case), case.q0, case.v0, case.t_end, rtol=rtol, dense=True).sol(times)
        errors.append(np.abs(q - truth.q).max())
        assert np.abs(v - truth.v).max() < 3e4 * rtol * (1.0 + np.abs(truth.v).max())
    assert errors[1] < 0.05 * errors[0] or errors[1] < 1e-10


def test_it_is_of_order_seven() -> None:
    p = {"mass": 1.0, "stiffness": 4.0}
    times, errors = np.linspace(0.0, 3.0, 301), []
    for step in (0.5, 0.25):
        run = simulate(own_case.system(p, None), [1.0], [0.0], 3.0, rtol=1e-1, atol=1e3, max_step=step, dense=True)
        errors.append(np.abs(run.sol(times)[0][:, 0] - np.cos(2.0 * times)).max())
    assert errors[0] / errors[1] > 2.0**6.5


def test_both_limits_where_a_collision_takes_no_time() -> None:
    run = simulate(*scene("newtons_cradle"), collisions="sequential", dense=True)
    event = next(event for event in run.events if event.impulse)
    (q, v), (q1, v1) = run.sol(event.t, side="left"), run.sol(event.t)
    assert q.shape == (run.q.shape[1],)
    np.testing.assert_array_equal(q, q1)
    assert np.abs(v1 - v).max() > 0.1
    for side, limit in (("left", v), ("right", v1)):
        near = event.t + (1e-9 if side == "right" else -1e-9)
        if near >= 0.0:
            np.testing.assert_allclose(run.sol(near)[1], limit, atol=1e-6)


def test_a_controller_in_python_is_not_asked_again() -> None:
    asked: list[float] = []

    def push(t: float, q: Any, v: Any) -> list[float]:
        asked.append(t)
        return [np.sin(9.0 * t)]

    system = replace(system_of(cases.from_scene(BALL)), control=Control(push, tick=0.01))
    run = simulate(system, [0.0], [0.5], 1.0, dense=True)
    count, t = len(asked), np.linspace(0.0, 1.0, 333)
    q, v = run.sol(t)
    assert len(asked) == count
    sampled = simulate(system, [0.0], [0.5], 1.0, samples=t)
    np.testing.assert_allclose(np.hstack([q, v]), np.hstack([sampled.q, sampled.v]), rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("t", [-1e-9, 1.1, np.nan, np.inf, [0.5, 2.0]])
def test_outside_the_run_is_an_error(t: Any) -> None:
    run = simulate(*scene("bouncing_ball"), dense=True)
    with pytest.raises(InvalidValue, match=r"is outside the run, \[0, 1\] s"):
        run.sol(t)


def test_other_wrong_use() -> None:
    start = scene("bouncing_ball")
    run = simulate(*start, dense=True)
    with pytest.raises(InvalidValue, match="side is 'middle'; valid: 'right' or 'left'"):
        run.sol(0.5, side="middle")
    with pytest.raises(SceneError, match=r"sol\.t is not an array"):
        run.sol("now")
    with pytest.raises(InvalidValue, match="dense is True with solver 'cvode'"):
        simulate(*start, solver="cvode", dense=True)
    with pytest.raises(InvalidValue, match="dense is given"):
        ensemble(start[0], [start[1]], [start[2]], 1.0, dense=True)
    with pytest.raises(TypeError, match="lives in its process"):
        pickle.dumps(run.sol)
    assert run.sol([])[0].shape == (0, 1)
