"""What must be said of logs: of clocks whose faults are known, of a white residual, and of a body that turns steadily.

A body with the angular velocity w in its own axes has R(t) = R(0) exp(t [w]), whatever R(0) is.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from crossbody.hw.checks.clock import ClockCheck
from crossbody.hw.windows import turns
from crossbody.hw.windows.whiteness import autocorrelation
from crossbody.reports.judging.asked import Found, Within, unlike
from crossbody.reports.judging.known_turns import about
from crossbody.reports.replay.known_replay import EVEN, read

STEP, SLOW = 0.01, 3e-3
"""Between samples, s, and the part by which a clock is slow."""
LONG, ALIKE = 600, 0.03
"""Samples of a motion, and the part by which its own bends hide the size of a slip."""
DAMAGED = f"""{EVEN}unit = "m"
"""


@cache
def wrong() -> tuple[Found, ...]:
    """Return what, number, least and most, and of which log, where it is another one."""
    return unlike((_looked, _damaged, _turning), "log", "a record that ends in")


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


def _damaged() -> Iterator[Within]:
    """Yield where values are said to slip or to have spikes, and by how much, of motions without and with some."""
    t = STEP * np.arange(LONG, dtype=np.float64)
    moves, text = np.sin(3.0 * t) + 0.7 * np.sin(7.3 * t + 1.0), ["t,a"]
    for what, check, at, size in (
        ("no fault", "", 0, 0.0), ("a slip", "slips", 200, 0.5), ("a slip back", "slips", 260, -0.5),
        ("a spike", "spikes", 301, 0.4),
    ):  # fmt: skip
        off = size * (np.arange(LONG) >= at if check == "slips" else np.arange(LONG) == at)
        rows = [f"{a!r},{b!r}" for a, b in zip(t.tolist(), (moves + off).tolist(), strict=True)]
        found = read("\n".join([*text, *rows]), DAMAGED).findings
        told = f"a motion with {what}"
        yield "findings", told, float(len(found)), float(bool(check)), 0.0
        for one in found:
            said = re.search(r"by ([+-]\S+) m", one.text)
            yield "kind", told, float(one.check != check), 0.0, 0.0
            yield "row", told, float(one.row), float(at), 0.0
            yield "instant", told, one.t, STEP * at, 1e-9
            yield "size", told, float(said[1]) if said else np.nan, size, ALIKE * abs(size)


def _turning() -> Iterator[Within]:
    """Yield by how much turns are off: a little later, from sample to sample, from the first, and from another."""
    draw = np.random.default_rng(3)
    first, w, t = draw.uniform(-1.0, 1.0, 3), draw.uniform(-2.0, 2.0, 3), STEP * np.arange(9)
    start = about(first, 1.0)
    y = np.array([Rotation.from_matrix(start @ about(w, s)).as_rotvec() for s in t.tolist()])
    later = about(turns.advanced(first, w, np.full(3, SLOW), [0]), 1.0)
    off = draw.uniform(-0.1, 0.1, 3)
    other = Rotation.from_matrix(about(off, 1.0) @ start).as_rotvec()
    for what, mine, theirs in (
        ("advanced", later, start @ about(w, SLOW)), ("way", turns.way(y, [0])[1:], np.outer(t, w)[1:]),
        ("increments", turns.increments(y, [0]), np.tile(STEP * start @ w, (len(t) - 1, 1))),
        ("difference", turns.difference(other[None], first[None], [0])[0], off),
    ):  # fmt: skip
        yield what, "a body that turns steadily", float(np.max(np.abs(mine - theirs))), 0.0, 1e-9
