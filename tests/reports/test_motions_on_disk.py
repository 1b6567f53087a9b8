"""What a run leaves on disk is what it was: every field of a motion, and every number of an audit."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import Ledger, Trajectory
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.runs import choice, jobs, store, study

NOT_KEPT = {"switches", "inputs", "sol", "determined_until", "unique_until"}
"""Of a motion, what pages and later comparisons do not ask for."""


def same(a: Any, b: Any) -> bool:
    if isinstance(a, Ledger):
        return all(same(getattr(a, field.name), getattr(b, field.name)) for field in fields(a))
    return np.array_equal(a, b, equal_nan=True) if isinstance(a, np.ndarray) else bool(a == b)


@pytest.mark.parametrize(
    ("label", "who"),
    [("newtons_cradle:sliders", "reference:compiled"), ("rolling_sphere:side_spin", "reference:compiled"),
     ("bouncing_ball:listing", "mujoco:matched"), ("red_body:resolved", "pinocchio:impulse")],
)  # fmt: skip
def test_a_motion_is_read_back_as_it_was(label: str, who: str, tmp_path: Path) -> None:
    """With impulses of events, an account, and what was counted."""
    case, (engine, profile) = cases.load(*label.split(":")), who.split(":")
    run: Trajectory = engines.load(engine).prepare(case, profile).run()
    about = study._about(case, engine, profile)
    (folder := tmp_path / "motions").mkdir()
    store.save(folder / "run.parquet", store.Trace(about=about, run=run))
    back = store.load(folder / "run.parquet").run
    for field in fields(Trajectory):
        if field.name not in NOT_KEPT:
            assert same(getattr(run, field.name), getattr(back, field.name)), field.name


def test_impulses_are_kept() -> None:
    """The law above would pass where no event has one."""
    run = engines.load("reference").prepare(cases.load("newtons_cradle", "sliders"), "compiled").run()
    assert any(event.impulse for event in run.events)


def test_a_table_of_an_audit_has_the_engines_number_as_its_value() -> None:
    case = cases.load("bouncing_ball", "listing")
    result = jobs.run_case(case, choice.picks(["mujoco:default"]), truth=truth_of(case))
    told = {row["quantity"]: row for row in study._audit([result])}
    rows = {row.quantity: row for entry in result.entries for row in entry.audit}
    assert told.keys() == rows.keys() != set()
    for name, row in rows.items():
        assert (told[name]["value"], told[name]["reference"]) == (row.mine, row.theirs)
    assert any(row.mine != row.theirs for row in rows.values())


@pytest.mark.parametrize("who", ["mujoco:matched", "mujoco:default", "pinocchio:admm"])
def test_the_time_of_a_run_is_that_of_its_steps(who: str) -> None:
    """Of thousands of steps nearly all; a clock read before or behind them has next to nothing."""
    engine, profile = who.split(":")
    made = engines.load(engine).prepare(cases.load("bouncing_ball", "listing"), profile)
    made.run()
    began = perf_counter()
    run = made.run()
    took = perf_counter() - began
    assert 0.2 * took < run.wall_s <= took
