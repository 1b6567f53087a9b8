"""What a scene does not need, and many runs at once: every row is what its runs took and counted."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import Case, Outcome
from crossbody.reports.bench import skip, throughput

COUNTS = ("guards", "rhs", "exact_steps", "factorisations", "collisions")


@dataclass
class Made:
    """A run that takes and counts what was drawn for it."""

    rng: np.random.Generator

    def __post_init__(self) -> None:
        self.wall = float(self.rng.uniform(1.0, 2.0))
        self.counts = {name: int(self.rng.integers(1, 100)) for name in COUNTS}
        self.steps, self.system = (
            int(self.rng.integers(1, 100)),
            SimpleNamespace(n=1, kernels={"dynamics": None}, parameters=()),
        )
        self.buffers, self.work = ({"a": np.zeros(int(self.rng.integers(1, 100)))} for _ in range(2))

    def warm(self) -> None:
        pass

    def go(self) -> tuple[Outcome, float]:
        return Outcome.FINISHED, self.wall

    def trajectory(self, *_: Any) -> Any:
        return SimpleNamespace(steps=self.steps, counts=self.counts)


@pytest.fixture(params=range(3))
def made(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> list[tuple[Made, Case | None, dict[str, Any]]]:
    """Runs in the order in which they are asked for, with their cases and options."""
    found: list[tuple[Made, Case | None, dict[str, Any]]] = []
    rng = np.random.default_rng(request.param)

    def run(case: Case | None, **options: Any) -> Made:
        found.append((Made(rng), case, options))
        return found[-1][0]

    monkeypatch.setattr(skip, "_run", run)
    monkeypatch.setattr(skip, "prepare", lambda *_: run(None))
    monkeypatch.setattr(skip, "System", SimpleNamespace)
    return found


def test_rows_of_skip_are_ratios_and_counts_of_their_runs(made: list[tuple[Made, Case | None, dict[str, Any]]]) -> None:
    table = skip.measure(1)
    runs = [run for run, *_ in made]
    rings, idle, told, counted = runs[:2], runs[2:4], runs[4:7], runs[7:13]
    (on, off), (few, many) = runs[13:15], runs[15:]
    _, bare, closed, masses, flown, bounced = counted
    held = [sum(part["a"].nbytes for part in (run.buffers, run.work)) for run in (few, many)]
    wanted = [
        rings[1].wall / rings[0].wall,
        idle[1].wall / idle[1].counts["collisions"] / (idle[0].wall / idle[0].counts["collisions"]),
        told[1].wall / told[0].wall,
        told[2].wall / told[0].wall,
        bare.counts["guards"],
        closed.counts["guards"] - closed.steps - 1,
        flown.counts["rhs"],
        bounced.counts["rhs"],
        bounced.counts["exact_steps"],
        masses.counts["factorisations"],
        on.wall / off.wall,
        many.wall / (10.0 * few.wall),
        held[1] - held[0],
    ]
    np.testing.assert_allclose(table["value"], wanted, rtol=1e-12)
    assert table["held"].to_list() == [not value > limit for value, limit in zip(wanted, table["limit"], strict=True)]
    more = [(case.parameters, options) for _, case, options in made if case is not None]
    assert [p["rings"] for p, _ in more[:2]] == [5, 50]
    assert [p["n"] for p, _ in more[2:4]] == [5, 200]
    assert [len(options) for _, options in more[4:7]] == [2, 0, 1]
    assert [options.get("shortcuts") for _, options in more[12:14]] == [True, False]


def test_the_shortest_of_several_runs_counts() -> None:
    walls = {"a": [3.0, 1.0, 2.0], "b": [5.0, 6.0, 4.0]}
    ends = {name: iter([(Outcome.FINISHED, wall) for wall in own]) for name, own in walls.items()}
    runs = {name: SimpleNamespace(go=partial(next, end)) for name, end in ends.items()}
    assert skip._seconds(runs, 3) == {"a": 1.0, "b": 4.0}


@pytest.mark.parametrize(
    ("value", "least", "held"), [(1.0, False, True), (1.1, False, False), (0.9, True, False), (1.0, True, True)]
)
def test_a_ratio_is_held_on_its_side_of_the_limit(value: float, least: bool, held: bool) -> None:
    assert skip.ratio("", value, 1.0, "", "", least=least)["held"] is held


@pytest.mark.parametrize("seed", range(3))
def test_rows_of_throughput_are_ratios_of_their_runs(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Medians of ratios, not ratios of medians; of pairs the best beside which two cores were given."""
    rng, said, cores = np.random.default_rng(seed), [], iter([1.95, 1.92, 1.99, 1.0] * 3)

    def rate(*asked: Any) -> float:
        said.append((asked, float(rng.uniform(10.0, 90.0))))
        return said[-1][1]

    monkeypatch.setattr(throughput, "reference", rate)
    monkeypatch.setattr(throughput, "mujoco", rate)
    monkeypatch.setattr(throughput.best_pair, "__defaults__", (lambda: next(cores),))
    table = throughput.measure(3).set_index("what")
    ratios = [a / b for (_, a), (_, b) in zip(said[0::2], said[1::2], strict=True)]
    assert table["value"].to_list()[:2] == pytest.approx([np.median(ratios[:3]), np.median(ratios[3:6])])
    assert [asked[2] for asked, _ in said[1:12:2]] == ["Euler"] * 3 + ["RK4"] * 3
    two = [1.0 / one for k, one in enumerate(ratios[6:]) if k % 4 != 3]
    assert table["value"].iloc[2] == pytest.approx(max(two))
    assert [asked for asked, _ in said[12:14]] == [(throughput.PAIR_RUNS, 1), (throughput.PAIR_RUNS, 2)]
    limits = [throughput.LEAST_RATIO] * 2 + [throughput.LEAST_TWO]
    assert table["held"].to_list() == [value >= limit for value, limit in zip(table["value"], limits, strict=True)]


def test_mujoco_steps_every_drop_up_to_the_horizon_of_the_case(monkeypatch: pytest.MonkeyPatch) -> None:
    from mujoco import batch

    made = []

    def kept(*given: Any, **more: Any) -> batch.Batch:
        made.append(one := real(*given, **more))
        return one

    real = batch.Batch
    monkeypatch.setattr(batch, "Batch", kept)
    throughput.mujoco(3, 1, "RK4")
    (many,) = made
    assert many.bind("time").ravel() == pytest.approx([cases.load("bouncing_ball", "listing").t_end] * 3, rel=1e-9)


def test_what_is_timed_is_the_motion_of_the_case() -> None:
    """With its inputs, and the collisions that it asks for."""
    for case in (cases.load("delta_impulse", "light", t_end=0.2), cases.load("newtons_cradle", "sliders", gap=1e-3)):
        run = skip._run(case)
        found = run.trajectory(*run.go())
        wanted = engines.load("reference").prepare(case, "compiled", rtol=1e-8).run()
        np.testing.assert_allclose(found.q[-1], wanted.q[-1], atol=1e-6)
        assert len(found.events) == len(wanted.events)
