"""What checks of logs must say of clocks whose faults are known, and of a white residual."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np

from crossbody.hw.checks.clock import ClockCheck
from crossbody.hw.windows.whiteness import autocorrelation
from crossbody.reports.judging.asked import Found, Within, unlike

STEP, SLOW = 0.01, 3e-3
"""Between samples, s, and the part by which a clock is slow."""


@cache
def wrong() -> tuple[Found, ...]:
    """Return what, number, least and most, and of which log, where it is another one."""
    return unlike((_looked,), "log", "a clock that ends in")


def _looked() -> Iterator[Within]:
    """Yield what is found of clocks that drop samples or stand still, and how wide the band of a white residual is."""
    even = STEP * np.arange(60, dtype=np.float64)
    for what, times, check, count in (
        ("a clock without fault", even, "dropped", 0), ("one sample that is lost", np.delete(even, 31), "dropped", 1),
        ("two that are lost apart", np.delete(even, [20, 41]), "dropped", 2),
        ("a time that stands twice", np.insert(even, 9, even[9]), "time", 1),
    ):  # fmt: skip
        clock = ClockCheck(STEP)
        clock.see(np.arange(len(times)), times)
        found = [one.count for one in clock.findings() if one.check == check]
        yield f"{check} samples", what, float(sum(found)), float(count), 0.0
    clock = ClockCheck(STEP)
    clock.see(np.arange(len(even)), (1.0 + SLOW) * even)
    yield "drift", "a clock that is slow", clock.drift, SLOW, 1e-6 * SLOW
    yield "jitter", "a clock that is slow", clock.jitter, 0.0, 1e-6 * STEP
    draw = np.random.default_rng(9).normal(size=400)
    yield "band", "a white residual", autocorrelation(draw).band, 2.5758293035489 / 20.0, 1e-6
