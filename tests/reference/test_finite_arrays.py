"""Arrays of which one entry is not finite are told, at any length and wherever it stands."""

from __future__ import annotations

import numpy as np
import pytest

from crossbody.reference.core.algebra import all_finite


@pytest.mark.parametrize("length", range(14))
def test_one_entry_that_is_no_number_is_seen_wherever_it_stands(length: int) -> None:
    x = 1e300 * np.random.default_rng(length).normal(size=length)
    assert all_finite(x)
    for place in range(length):
        for wrong in (np.nan, np.inf, -np.inf):
            y = x.copy()
            y[place] = wrong
            assert not all_finite(y), (place, wrong)
