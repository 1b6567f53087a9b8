"""Errors between samples: what a run hides between two of them is told, and what it does not do there is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import Case, Tier, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.rotations import drifts, signed, sizes
from crossbody.reports import metrics
from crossbody.reports.measuring.truth import Truth, from_run, taken

POSITION = metrics.load("position")
SEEDS = range(20)


@pytest.fixture(scope="module")
def case() -> Case:
    return cases.load("bouncing_ball", "listing")


@pytest.fixture(scope="module")
def truth(case: Case) -> Truth:
    run = engines.load("reference").prepare(case, profile="compiled", rtol=1e-11).run()
    return from_run(run, Tier.C, "the reference at 1e-11", case.law.touches)


def swung(t: Floats, amplitude: float, rate: float) -> Trajectory:
    """A motion of one coordinate, without rows."""
    nothing = np.zeros((len(t), 0))
    wave = amplitude * np.stack([np.sin(rate * t), rate * np.cos(rate * t)])[:, :, None]
    return Trajectory(
        t=t, q=wave[0], v=wave[1], gap=nothing, lam=nothing, energy=np.zeros((len(t), 2)),
        mode=np.zeros((len(t), 0), np.int8),
    )  # fmt: skip


def test_a_ball_that_rests_while_the_truth_bounces_is_off_by_the_bounce(case: Case, truth: Truth) -> None:
    rests = engines.load("pinocchio").prepare(case, profile="impulse").run()
    touch = truth.contacts(truth.trajectory)[0].release
    height = float(np.max(truth.trajectory.q[truth.trajectory.t > touch]))
    scale = float(np.max(truth.trajectory.q))
    found = POSITION.measure(truth, rests, case)
    assert found is not None
    assert found >= 0.98 * height / scale
    sparse = taken(rests, np.isin(rests.t, [0.0, *(e.t for e in rests.events), rests.t[-1]]))
    told = POSITION.measure(truth, sparse, case)
    assert told is not None
    assert told >= 0.1 * height / scale


@pytest.mark.parametrize("profile", ["law", "impulse"])
@pytest.mark.parametrize("name", ["bouncing_ball:listing", "bouncing_ball:linear", "newtons_cradle:unequal"])
def test_long_steps_are_told_from_the_inside_and_nothing_else_changes(
    name: str, profile: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = cases.load(*name.split(":"))
    dense = engines.load("pinocchio").prepare(case, profile=profile).run()
    assert np.max(np.diff(dense.t)) <= case.t_end / 200.0 * (1.0 + 1e-9)
    monkeypatch.setattr("crossbody.engines.pinocchio._flow.SHOWN", 1e-9)
    plain = engines.load("pinocchio").prepare(case, profile=profile).run()
    assert (dense.steps, dense.events, dense.counts) == (plain.steps, plain.events, plain.counts)
    at = np.flatnonzero(np.isin(dense.t, plain.t))
    assert np.array_equal(dense.q[at], plain.q)
    assert np.array_equal(dense.v[at], plain.v)
    apart = (dense.mode == 0).all(axis=1)
    free = np.flatnonzero(apart[:-1] & apart[1:])
    fall = dense.q[free + 1] - dense.q[free] - np.diff(dense.t)[free, None] * 0.5 * (dense.v[free] + dense.v[free + 1])
    assert np.max(np.abs(fall)) <= 1e-9


@pytest.mark.parametrize("seed", SEEDS)
def test_between_samples_a_run_is_off_by_what_it_is_off_there(case: Case, seed: int) -> None:
    """A run with few samples tells the same largest error as with many, as far as a cubic can."""
    random = np.random.default_rng(seed)
    pendulum = replace(cases.load("newtons_cradle", "pendulums"), t_end=2.0)
    one = replace(
        pendulum, q0=np.zeros(1), v0=np.zeros(1), scene=None, chaos=None,
        coordinates=pendulum.coordinates[:1], velocities=pendulum.velocities[:1], quaternions=(),
    )  # fmt: skip
    many = np.linspace(0.0, 2.0, 2001)
    few = np.sort([0.0, 2.0, *random.uniform(0.0, 2.0, 60)])
    size, rate, off = random.uniform(0.5, 2.0), random.uniform(1.0, 4.0), 10.0 ** random.uniform(-6.0, -2.0)
    exact = lambda t: swung(t, size, rate)  # noqa: E731
    truth = Truth(tier=Tier.A, source="a sine", trajectory=exact(many), at=exact, agreement={})
    found = [POSITION.measure(truth, swung(t, size * (1.0 + off), rate), one) for t in (many, few)]
    assert found[0] == pytest.approx(off, rel=1e-3)
    assert found[1] == pytest.approx(off, rel=2e-2)
    late = POSITION.measure(truth, swung(few, size, rate), one)
    assert late is not None
    assert late <= 1e-14


@pytest.mark.parametrize("seed", SEEDS)
def test_rates_of_errors_of_rotations_are_their_differences(seed: int) -> None:
    random = np.random.default_rng(seed)
    dt, quaternions = 1e-5, (1,)
    q, other = random.normal(size=(2, 1, 6))
    if seed % 2:  # nearly the same rotation, as of a good run
        other = q + 1e-4 * random.normal(size=(1, 6))
    v, w = random.normal(size=(2, 1, 5))

    def moved(at: Floats, by: Floats, t: float) -> Floats:
        half = 0.5 * t * by[0, 1:4]
        angle = np.linalg.norm(half)
        dw, dx = np.cos(angle), np.sinc(angle / np.pi) * half
        a, x = at[0, 1], at[0, 2:5]
        turn = [a * dw - x @ dx, *(a * dx + dw * x + np.cross(x, dx))]
        return np.array([[at[0, 0] + t * by[0, 0], *turn, at[0, 5] + t * by[0, 4]]])

    for one in (q, other):
        one[:, 1:5] /= np.linalg.norm(one[:, 1:5])
    ends = [signed(moved(q, v, t), moved(other, w, t), quaternions) for t in (-dt, dt)]
    known = (ends[1] - ends[0]) / (2.0 * dt)
    found = drifts(signed(q, other, quaternions), v, w, quaternions)
    assert np.allclose(found, known, rtol=1e-6, atol=1e-6)
    off = signed(q, other, quaternions)
    assert sizes(off, quaternions)[0, 1] == pytest.approx(np.linalg.norm(off[0, 1:4]))
