"""A bound on time is one on what a run computes, whatever else the machine does; and on waiting, ten times as long."""

from __future__ import annotations

import time

import pytest

from crossbody.reference import _elapsed
from crossbody.reference._elapsed import WAITING, Elapsed


@pytest.mark.parametrize(("used", "clock", "wanted"), [(2.0, 2.0, 2.0), (2.0, 15.0, 2.0), (0.0, 15.0, 1.5)])
def test_a_machine_that_does_other_things_takes_nothing_off(
    used: float, clock: float, wanted: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = {"thread_time": 7.0, "perf_counter": 100.0}
    for name in now:
        monkeypatch.setattr(_elapsed.time, name, lambda name=name: now[name])
    elapsed = Elapsed()
    now["thread_time"] += used
    now["perf_counter"] += clock
    assert elapsed.exceeds(0.99 * wanted)
    assert not elapsed.exceeds(1.01 * wanted)


def test_what_waits_is_counted_as_a_part_of_the_clock() -> None:
    elapsed = Elapsed()
    began = time.perf_counter()
    time.sleep(0.05)
    assert elapsed.exceeds(0.9 * 0.05 / WAITING)
    assert not elapsed.exceeds(0.5 * (time.perf_counter() - began))
