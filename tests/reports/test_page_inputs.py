"""What acts from outside is drawn as it acts: each value from its instant to the next."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from unpacked import numbers

from crossbody.cases import Inputs, load
from crossbody.reports.judging.truth import truth_of
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
