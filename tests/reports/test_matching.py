"""Contacts of a run beside those of the truth: each row's in order, and a clock that only goes forward."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
import pytest

from crossbody.cases import Event, Mode, Tier, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.reports.measuring.alignment import clock, matched
from crossbody.reports.measuring.truth import Truth, from_run

Story = Sequence[tuple[int, float]]
"""Row and touch, s, of contacts that last a thousandth of a second."""
LASTS = 1e-3


def told(story: Story, rows: int) -> Trajectory:
    """A motion with these contacts alone."""
    t = np.sort([0.0, 1.1, *(x for _, touch in story for x in (touch, touch + LASTS))])
    wide = np.zeros((len(t), rows))
    events = [
        Event(t=x, contact=row, before=before, after=after)
        for row, touch in story
        for x, before, after in ((touch, Mode.FREE, Mode.CONTACT), (touch + LASTS, Mode.CONTACT, Mode.FREE))
    ]
    return Trajectory(
        t=t, q=t[:, None], v=np.ones((len(t), 1)), gap=wide + 1.0, lam=wide, energy=np.zeros((len(t), 2)),
        mode=wide.astype(np.int8), events=tuple(sorted(events, key=lambda event: event.t)),
    )  # fmt: skip


def drawn(random: np.random.Generator, rows: int) -> Story:
    touches = [(row, np.sort(random.uniform(0.05, 1.0, random.integers(0, 5)))) for row in range(rows)]
    return [(row, float(t)) for row, ts in touches for t in ts]


def known(story: Story, rows: int) -> Truth:
    return from_run(told(story, rows), Tier.A, "made up")


def of(story: Story, row: int) -> list[float]:
    return [t for one, t in story if one == row]


@pytest.mark.parametrize("seed", range(200))
def test_rows_are_paired_in_order_with_the_least_sum_of_shifts(seed: int) -> None:
    random = np.random.default_rng(seed)
    exact, found = (drawn(random, 3) for _ in range(2))
    pairs = matched(known(exact, 3), told(found, 3))
    assert [a.touch for a, _ in pairs] == sorted(a.touch for a, _ in pairs)
    for row in range(3):
        few, many = sorted((of(exact, row), of(found, row)), key=len)
        own = [(a.touch, b.touch) for a, b in pairs if a.row == b.row == row]
        least = min(sum(abs(x - y) for x, y in zip(few, some, strict=True)) for some in combinations(many, len(few)))
        assert len(own) == len(few)
        assert sum(abs(x - y) for x, y in own) == pytest.approx(least, abs=1e-12)
        assert all(one[1] < other[1] for one, other in combinations(own, 2))


@pytest.mark.parametrize("seed", range(100))
def test_the_clock_goes_forward_and_puts_touches_that_do_not_cross_on_the_truths(seed: int) -> None:
    random = np.random.default_rng(seed)
    exact = drawn(random, 3)
    found = [(row, t + float(random.normal()) * 10.0 ** random.uniform(-5.0, -1.0)) for row, t in exact]
    truth, run = known(exact, 3), told([(row, max(t, 1e-3)) for row, t in found], 3)
    mapped: Floats = clock(truth, run, None)
    assert np.all(np.diff(mapped) >= 0.0)
    for a, b in matched(truth, run)[:1]:
        others = [(c.touch, d.touch) for c, d in matched(truth, run) if c is not a]
        alone = all((c - a.touch) * (d - b.touch) > 0.0 for c, d in others)
        if alone and b.touch > 0.0:
            assert np.interp(b.touch, run.t, mapped) == pytest.approx(a.touch, abs=1e-12)


def test_a_touch_that_one_row_lacks_does_not_end_the_comparison_of_others() -> None:
    exact = [(0, 0.1), (1, 0.2), (0, 0.3), (1, 0.4), (0, 0.5)]
    late = [(1, 0.21), (0, 0.31), (1, 0.41), (0, 0.51)]
    pairs = matched(known(exact, 2), told(late, 2))
    assert [(a.row, a.touch, b.touch) for a, b in pairs] == [
        (1, 0.2, 0.21), (0, 0.3, 0.31), (1, 0.4, 0.41), (0, 0.5, 0.51),
    ]  # fmt: skip
