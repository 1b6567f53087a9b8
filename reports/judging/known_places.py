"""Which coordinate and instant must be named of errors of position that stand at one sample each, of made-up runs.

What is off by a known amount at one instant is off there and nowhere else: of two runs that are judged side by side,
each by its own. So is a body that is turned, by its angle. What leaves one sample at a rate that is off by r, and comes
back to the next, h later, at as much less, is off by r h/4 amid both.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np

from crossbody.cases import Case, Coordinate, Limit, Trajectory
from crossbody.reports.judging.asked import Found, Within, unlike
from crossbody.reports.judging.made_up import MadeUp, case_of
from crossbody.reports.judging.run_verdicts import Entry, verdicts

SEEDS, TURNED = (3, 4, 5), "turned"
UNITS, QUATERNION = ("m", "rad", "m/s", "m"), ("qw", "qx", "qy", "qz")
"""Of coordinates; and how those of a body that turns are named, behind them."""
APART = 0.02
"""Part of the horizon by which a sample is away from both beside it: more than the digits of an instant."""
OF_SIZE, OF_INSTANT = 0.051, 0.0051
"""Parts of numbers by which so many digits of them may be others."""
LOOKED = 9.0
"""Parts of the time between samples at whose ends errors are looked at."""
_SAID = re.compile(r"(.*) by (\S+) (\S+) at (\S+) s")


@cache
def wrong() -> tuple[Found, ...]:
    """Return what is named, number, least and most, and of what, where it is another than it must be."""
    return unlike((_places,), "place of an error", "an error at one sample:")


def _case(seed: int) -> Case:
    """Return a case whose coordinates have names and units of their own, with a limit that all errors are beyond."""
    case = case_of((*UNITS, *("1",) * 4), (False,), seed)
    names = [*(f"c{k}" for k in range(len(UNITS))), *(f"{TURNED} {entry}" for entry in QUATERNION)]
    named = tuple(Coordinate(name=name, unit=c.unit) for name, c in zip(names, case.coordinates, strict=True))
    limit = Limit(metric="position", value=1e-12, why="none is within")
    rates = (*named[: len(UNITS)], *(Coordinate(name=f"{TURNED} {axis}", unit="rad") for axis in "xyz"))
    return replace(
        case, coordinates=named, velocities=rates, v0=case.v0[: len(rates)], quaternions=(len(UNITS),), limits=(limit,)
    )


def _places() -> Iterator[Within]:
    """Yield coordinate, size and instant that are named of runs, two of each truth."""
    for seed in SEEDS:
        draw, made = np.random.default_rng(seed), MadeUp(_case(seed), seed)
        t = made.exact.t[: made.trusted]
        alone = np.flatnonzero(np.minimum(np.diff(t)[:-1], np.diff(t)[1:]) > APART * made.case.t_end) + 1
        first = 2 * SEEDS.index(seed)
        for i, j in zip(draw.choice(alone, 2, replace=False).tolist(), (first, first + 1), strict=True):
            j %= len(UNITS) + 1
            run, size = _off(made.exact, i, j, float(draw.uniform(0.2, 0.5)))
            name, unit = (TURNED, "rad") if j == len(UNITS) else (f"c{j}", UNITS[j])
            yield from _named(made, run, name, unit, size, float(t[i]), OF_INSTANT * float(t[i]))
        i, j = int(np.argmax(np.diff(t))), seed % len(UNITS)
        h = float(t[i + 1] - t[i])
        v, rate = made.exact.v.copy(), float(np.abs(made.exact.q[:, j]).max()) / h
        v[i : i + 2, j] += rate, -rate
        run = replace(made.exact, v=v)
        yield from _named(made, run, f"c{j}", UNITS[j], rate * h / 4.0, float(t[i] + h / 2.0), h / LOOKED)


def _off(exact: Trajectory, i: int, j: int, part: float) -> tuple[Trajectory, float]:
    """Return a run that is off at a sample, by part of what its largest is or in angle, and by how much."""
    q = exact.q.copy()
    if j < len(UNITS):
        size = part * float(np.abs(q[:, j]).max())
        q[i, j] += size
        return replace(exact, q=q), size
    c, s = math.cos(part / 2.0), math.sin(part / 2.0)
    w, x, y, z = q[i, j:]
    q[i, j:] = c * w - s * z, c * x + s * y, c * y - s * x, c * z + s * w
    return replace(exact, q=q), part


def _named(made: MadeUp, run: Trajectory, name: str, unit: str, size: float, t: float, late: float) -> Iterator[Within]:
    """Yield whether what a row of position names is this, size, and instant, which may be so late."""
    entry = Entry(engine="made up", profile=name, run=run, settings={})
    rows = [row for row in verdicts(made.case, entry, made.truth, "") if row.metric == "position"]
    found = _SAID.fullmatch(rows[0].where if rows else "")
    what = f"an error of {name}"
    yield "rows that name a place", what, float(found is not None), 1.0, 0.0
    if found is not None:
        yield "places named", what, float((found[1], found[3]) == (name, unit)), 1.0, 0.0
        yield "size of an error", what, float(found[2]), size, OF_SIZE * size
        yield "instant of an error", what, float(found[4]), t, late
