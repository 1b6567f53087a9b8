"""What an identification says of parameters that hardly matter."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from crossbody.cases import Parameter
from crossbody.hw.fitting.covariance import Layout
from crossbody.hw.fitting.difference import Differences


def test_a_parameter_that_hardly_matters_is_told_with_the_change_of_the_rmse(monkeypatch: pytest.MonkeyPatch) -> None:
    """The sentence has the last value that is flat, and by how much its residuals are larger."""
    random = np.random.default_rng(0)
    best, off = random.standard_normal(80), 0.02 * random.standard_normal(80)
    problem = object.__new__(Differences)
    problem.free = ("k",)
    problem.model = SimpleNamespace(parameters={"k": Parameter(default=1.0, unit="N/m", low=0.0, high=9.0)})
    monkeypatch.setattr(Differences, "layout", Layout(samples=(10,) * 8, k=1))
    monkeypatch.setattr(Differences, "residual", lambda self, x: best + (x[0] != 3.0) * off)
    change = 100.0 * (np.linalg.norm(best + off) / np.linalg.norm(best) - 1.0)
    assert problem.flat(np.array([3.0])) == {0: f"at 6 N/m the rmse changes by {change:+.1f} %"}
