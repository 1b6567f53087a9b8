"""Plots of fewer points show the ends, single peaks and all that is about an event."""

from __future__ import annotations

import numpy as np
import pytest

from crossbody.reports.runs.thin import keep


@pytest.mark.parametrize("seed", range(12))
def test_fewer_points_keep_ends_peaks_and_neighbours_of_events(seed: int) -> None:
    random = np.random.default_rng(seed)
    n, points = int(random.integers(3000, 20_000)), int(random.integers(200, 1500))
    t = np.sort(random.uniform(0.0, 3.0, n))
    y = np.sin(9.0 * t) + 0.01 * random.normal(size=n)
    peaks = random.choice(np.arange(50, n - 50), 4, replace=False)
    y[peaks] += random.choice([-5.0, 5.0], 4)
    y[random.integers(n, size=3)] = np.nan
    events = np.append(random.choice(t, 3), [t[0], t[-1]])
    kept = keep(t, y, events, points)
    assert np.all(np.diff(kept) > 0)
    assert len(kept) <= points + 12 * len(events) + 2
    assert {0, n - 1} <= set(kept.tolist())
    assert set(peaks[np.isfinite(y[peaks])].tolist()) <= set(kept.tolist())
    for event in events:
        at = int(np.searchsorted(t, event))
        assert set(range(max(at - 5, 0), min(at + 7, n))) <= set(kept.tolist())
    assert keep(t[:points], y[:points], events, points).tolist() == list(range(points))
