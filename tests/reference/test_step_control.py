"""Step sizes: few steps are rejected where the error varies, and none is shorter for it where it does not."""

from __future__ import annotations

import numpy as np
import pytest
from mechanisms import oscillator

from crossbody import cases, engines
from crossbody.reference import simulate


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-11])
def test_steps_of_a_steady_motion_are_as_long_as_its_error_allows(rtol: float) -> None:
    """An oscillator's error is the same in every step, and so is their length."""
    found = simulate(oscillator(wall=-2.0), [1.0], [0.0], t_end=200.0, rtol=rtol, ledger=False)
    lengths = np.diff(found.t)[5:-2]
    assert found.counts["rejected"] <= 1
    assert lengths.mean() > 0.9 * lengths.max()


@pytest.mark.parametrize("variant", ["light", "heavy", "undamped"])
@pytest.mark.parametrize("rtol", [1e-8, 1e-9])
def test_few_steps_of_an_uneven_motion_are_rejected(variant: str, rtol: float) -> None:
    """A robot that swings through: of steps chosen by SAFETY alone more than one in five was rejected."""
    case = cases.load("delta_free", variant=variant)
    counts = engines.load("reference").prepare(case, "compiled", rtol=rtol, ledger=False).run().counts
    assert counts["rejected"] < counts["rhs"] / 12 / 6
