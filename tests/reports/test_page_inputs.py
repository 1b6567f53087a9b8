"""What acts from outside is drawn as it acts: each value from its instant to the next."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from unpacked import numbers

from crossbody import engines
from crossbody.cases import Inputs, load
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.measuring.controlled import acting
from crossbody.reports.measuring.cubics import coordinates
from crossbody.reports.pages import figures
from crossbody.reports.runs import study


def drawn(given: Inputs) -> Any:
    """The figure of a ball beside its truth, both with inputs that it has none of."""
    case = load("bouncing_ball", "linear", t_end=0.5)
    truth = truth_of(case)
    driven = replace(truth, trajectory=replace(truth.trajectory, inputs=given))
    result = SimpleNamespace(case=case, truth=driven, entries=())
    return figures.inputs(study.traces(result))


@pytest.mark.parametrize("seed", range(5))
def test_every_value_is_drawn_from_its_instant_on(seed: int) -> None:
    rng = np.random.default_rng(seed)
    times = np.sort(rng.uniform(0.0, 0.5, 40))
    values = rng.normal(size=(40, 2))
    figure = drawn(Inputs(names=("a [N m]", "b"), times=times, values=values))
    for line, column in zip(figure["data"], values.T, strict=True):
        assert line["line"]["shape"] == "hv"
        np.testing.assert_allclose(numbers(line["x"]), [*times, 0.5], rtol=1e-6)
        np.testing.assert_allclose(numbers(line["y"]), [*column, column[-1]], rtol=1e-6)


def test_of_many_those_are_drawn_that_change_most() -> None:
    sizes = np.arange(1.0, 41.0)
    values = np.stack([0.0 * sizes, sizes])
    names = tuple(f"u{i}" for i in range(40))
    figure = drawn(Inputs(names=names, times=np.array([0.0, 0.1]), values=values))
    tops = [numbers(line["y"]).max() for line in figure["data"]]
    assert tops == list(sizes[-len(tops) :])
    assert f"({len(tops)} of 40, those that change most)" in figure["layout"]["title"]["text"]


MOTORS = [0, 3, 6]


@pytest.mark.parametrize("variant", ["circle", "pd"])
def test_a_controller_among_the_equations_is_drawn_by_what_it_gave(variant: str) -> None:
    """Constant torques between ticks do the work that the run's own account has of its inputs."""
    case = load("delta_tracking", variant, t_end=0.2)
    run = engines.load("reference").prepare(case, "compiled", ledger=True).run()
    found = acting(case, run)
    assert found is not None
    assert found.names == ("torque 1 [N m]", "torque 2 [N m]", "torque 3 [N m]")
    turns = np.diff(coordinates(run, found.times)[:, MOTORS], axis=0)
    work = np.cumsum(np.sum(found.values[:-1] * turns, axis=1))
    assert run.ledger is not None
    given = np.interp(found.times[1:], run.t, run.ledger.input)
    assert np.abs(given).max() > 1e-5, "J"
    np.testing.assert_allclose(work, given, atol=1e-5 * np.abs(given).max())


def test_a_page_says_that_a_controller_was_asked_again() -> None:
    case = load("delta_tracking", "circle", t_end=0.05)
    result = SimpleNamespace(case=case, truth=truth_of(case), entries=())
    traces = study.traces(result)
    assert len(figures.inputs(traces)["data"]) == 3
    assert "computed again" in figures.note("inputs", traces)
