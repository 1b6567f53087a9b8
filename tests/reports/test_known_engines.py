"""What engines make of settings and controllers has known answers; steps are counted against their setting."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import Case, EngineUnavailable, Inputs, Outcome, Trajectory
from crossbody.reports.judging import known, known_drives, known_engines
from crossbody.reports.judging.known_audits import Falls
from crossbody.reports.judging.steps_taken import miscounted, runaway


@pytest.mark.parametrize("name", engines.REGISTRY.own())
def test_engines_give_their_known_answers(name: str) -> None:
    try:
        engines.load(name)
    except EngineUnavailable as missing:
        pytest.skip(str(missing))
    asked = known.kinds((*known.OF_ENGINES, *known.OF_CONTACTS, *known.OF_DRIVES))
    assert [module.wrong(name) for module in asked] == [()] * len(asked)


@pytest.mark.parametrize(("given", "what"), [({"rtol": 1e-8}, "(steps)"), ({"max_steps": 10_000}, "(max_steps)")])
def test_a_setting_that_does_not_arrive_is_told(
    given: dict[str, Any], what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    engine = engines.load("reference")
    own = type(engine).prepare

    def prepare(self: Any, case: Case, profile: str = "compiled", **asked: Any) -> engines.Run:
        return own(self, case, profile, **{**asked, **{name: given[name] for name in given if name in asked}})

    monkeypatch.setattr(type(engine), "prepare", prepare)
    known_engines.wrong.cache_clear()
    assert f"reference:compiled {what}" in {name for name, *_ in known_engines.wrong("reference")}
    monkeypatch.undo()
    known_engines.wrong.cache_clear()


def test_the_motion_of_a_motor_that_lags_is_that_of_its_equations() -> None:
    from scipy.integrate import solve_ivp

    def rates(u: float) -> Any:
        return lambda _, y: [y[1], known_drives.GAIN / known_drives.MASS * y[2], (u - y[2]) / known_drives.LAG]

    state, wanted = np.array([known_drives.AT, known_drives.FAST, 0.0]), known_drives.motion()
    for u, after in zip(known_drives.CONTROLS, wanted[1:], strict=True):
        state = solve_ivp(rates(u), (0.0, known_drives.TICK), state, rtol=1e-11, atol=1e-13).y[:, -1]
        assert state == pytest.approx(after, rel=1e-8)


def test_steps_are_counted_against_their_setting() -> None:
    case = cases.load("bouncing_ball", "linear")
    run = engines.load("reference").prepare(case, "compiled").run()
    t = np.linspace(0.0, 1.0, 101)
    one = np.ones((101, 1))
    run = replace(
        run, t=t, q=one, v=one, gap=one, lam=one, energy=np.ones((101, 2)), mode=one.astype(np.int8), events=(),
        ledger=None, steps=100,
    )  # fmt: skip
    assert list(miscounted(case, {"dt": 0.01}, run)) == []
    assert list(miscounted(case, {"dt": 0.0100001}, run)) == []  # the last one is cut
    assert list(miscounted(case, {}, run)) == list(miscounted(case, {"dt": 0.01}, replace(run, steps=0))) == []
    assert [wanted for _, wanted, _ in miscounted(case, {"dt": 0.005}, run)] == [200, 200]
    assert [found for found, *_ in miscounted(case, {"dt": 0.02}, run)] == [100]
    assert next(found for found, *_ in miscounted(case, {"dt": 0.01}, replace(run, steps=50))) == 50
    assert list(miscounted(case, {"dt": 0.005}, replace(run, outcome=Outcome.STEP_LIMIT))) == []
    times = np.linspace(0.0, 0.9, 60)
    driven = replace(case, inputs=Inputs(names=("a",), times=times, values=np.zeros((60, 1))))
    assert list(miscounted(driven, {"dt": 0.02}, run)) == []


class _Steps(Falls):
    """A ball that falls by steps of its own, so many times as short as asked for, up to their bound."""

    def run(self) -> Trajectory:
        shorter, bound = float(self.more), int(self.settings["max_steps"])
        dt = float(self.settings["dt"]) / shorter
        count = min(math.ceil(self.case.t_end / dt - 1e-9), bound)
        one = np.ones((count + 1, 1))
        return Trajectory(
            t=dt * np.arange(count + 1), q=one, v=one, gap=one, lam=one, energy=np.ones((count + 1, 2)),
            mode=np.zeros((count + 1, 1), dtype=np.int8), steps=count,
            outcome=Outcome.STEP_LIMIT if count == bound else Outcome.FINISHED,
        )  # fmt: skip


@pytest.mark.parametrize("seed", range(6))
def test_an_engine_that_takes_tiny_steps_is_told_before_it_takes_all_of_them(seed: int) -> None:
    draw, case = np.random.default_rng(seed), cases.load("bouncing_ball", "linear")
    for shorter, told in ((1.0, False), (2.0, False), (float(10.0 ** draw.uniform(2.5, 7.0)), True)):
        runs: list[_Steps] = []

        def prepare(
            first: cases.Case, more: Mapping[str, Any], by: float = shorter, made: list[_Steps] = runs
        ) -> _Steps:
            made.append(_Steps(case=first, settings=more, more=by, late=False))
            return made[-1]

        why = runaway(case, {"dt": case.t_end * 10.0 ** draw.uniform(-5.0, -2.0), "max_steps": 2_000_000}, prepare)
        assert bool(why) == told, (shorter, why)
        assert all(run.run().steps <= 1000 for run in runs)


def test_settings_that_leave_nothing_to_look_at_ask_for_nothing() -> None:
    case = cases.load("bouncing_ball", "linear")
    for settings in ({}, {"dt": 0.001}, {"dt": case.t_end, "max_steps": 9}):
        assert runaway(case, settings, lambda *_: pytest.fail("asked")) == ""
