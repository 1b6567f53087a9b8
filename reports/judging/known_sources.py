"""What must be said of two sources of a truth that are apart by a known amount: in place, events, modes or time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np

from crossbody.cases import Event, Mode, Tier, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.reports.judging.asked import Found
from crossbody.reports.judging.made_up import case_of
from crossbody.reports.judging.truth import PARTED, agreement, held_against
from crossbody.reports.measuring.truth import from_run

SAMPLES, TOUCH, RELEASE = 400, 0.31, 0.67
"""Number of samples, and parts of the horizon at which a row closes and opens."""
AWAY, LATE, OTHER = 3e-4, 2e-3, 7
"""What a position is off by, m, an event by, in parts of the horizon, and how many samples have another mode."""
ROUNDED, CLOSE, TOLERANCE = 1e-13, 1e-6, 1e-12
"""What two motions are apart by at first, part by which an answer may differ, and the tolerance of both sources."""
RATES = (17.0, 23.0)
"""Of two motions that part, over the horizon."""


@cache
def wrong() -> tuple[Found, ...]:
    """Return metric, number, least and most, and what is apart, of what is another number than it must be."""
    case = case_of(("m", "m"), (True, True), 5)
    end = case.t_end
    exact = _motion(end)
    truth = from_run(exact, Tier.C, "made up")
    size = float(np.max(np.abs(exact.q)))

    def asked() -> Iterator[tuple[str, float, float, float, str]]:
        for name, seconds, wanted in _apart(exact, end):
            found = agreement(truth, seconds, case)
            for metric in ("position", "event_times", "modes"):
                yield metric, found.get(metric, np.nan), wanted.get(metric, 0.0), CLOSE, f"two sources apart by {name}"
        for rate in np.divide(RATES, end):
            off = ROUNDED * np.exp(rate * exact.t)
            held = held_against(truth, replace(exact, q=exact.q + off[:, None]), case, TOLERANCE)
            told = f"two sources that part by {rate:.3g} /s"
            yield "trusted", held.trusted, float(exact.t[np.argmax(off / size > PARTED)]), CLOSE, told
            yield "growth", held.growth, float(rate), 10.0 * CLOSE, told
        yield "trusted", held_against(truth, exact, case, TOLERANCE).trusted, np.inf, CLOSE, "two sources that agree"

    return tuple(
        (metric, found, ((1.0 - part) * wanted, (1.0 + part) * wanted), said)
        for metric, found, wanted, part, said in asked()
        if not (found == wanted or abs(found - wanted) <= part * wanted + ROUNDED)
    )


def _motion(end: float) -> Trajectory:
    """Return two coordinates that rise, with a row that closes and opens, sampled on both sides of both."""
    touch, release = TOUCH * end, RELEASE * end
    t: Floats = np.sort(np.concatenate([np.linspace(0.0, end, SAMPLES), [touch, release] * 2]))
    q = np.stack([0.5 + t / end, 0.2 + (t / end) ** 2], axis=1)
    closed = np.arange(len(t)) > np.searchsorted(t, touch)
    closed &= np.arange(len(t)) <= np.searchsorted(t, release)
    gap = np.stack([np.where(closed, 0.0, 1.0), 1.0 + t / end], axis=1)
    mode = np.stack([np.where(closed, Mode.CONTACT, Mode.FREE), np.full(len(t), Mode.FREE)], axis=1)
    events = (
        Event(t=touch, contact=0, before=Mode.FREE, after=Mode.CONTACT),
        Event(t=release, contact=0, before=Mode.CONTACT, after=Mode.FREE),
    )
    return Trajectory(
        t=t, q=q, v=np.stack([0.0 * t + 1.0 / end, 2.0 * t / end**2], axis=1), gap=gap,
        lam=1.0 * np.stack([closed, 0.0 * t], axis=1), energy=np.ones((len(t), 2)),
        mode=mode.astype(np.int8), events=events,
    )  # fmt: skip


def _apart(exact: Trajectory, end: float) -> Iterator[tuple[str, Trajectory, dict[str, float]]]:
    """Yield a second source, in what it is another one, and by how much."""
    yield "nothing", exact, {}
    q, amid = exact.q.copy(), SAMPLES // 2
    q[amid, 0] += AWAY
    yield "a position", replace(exact, q=q), {"position": AWAY / float(np.max(np.abs(exact.q)))}
    mode = exact.mode.copy()
    mode[amid : amid + OTHER, 0] = Mode.COLLISION
    yield "modes between events", replace(exact, mode=mode), {"modes": float(OTHER)}
    (first, last), late = exact.events, LATE * end
    yield "an event", replace(exact, events=(first, replace(last, t=last.t + late))), {"event_times": late}
