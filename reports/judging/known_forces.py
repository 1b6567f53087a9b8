"""What metrics say of motions whose masses are others: the same, or as many times as much where they are of forces.

Forces, energies and impulses of a motion of bodies a thousand times lighter are a thousand times less, and nothing else
of it changes. A metric that compares a force, or an energy, with a number that is none of the motion's says another.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np

from crossbody.cases import Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.between import between
from crossbody.reports import metrics
from crossbody.reports.judging.asked import Asked, Found, unlike_by
from crossbody.reports.judging.known_answers import MADE, measured
from crossbody.reports.judging.made_up import MadeUp, case_of

LIGHTER, EXACT = 1e-3, 1e-9
"""By how much bodies are lighter, and the part by which sums of other sizes differ."""
OF_FORCE = ("N", "N s", "N m", "J", "W")
"""Units of numbers that go with masses."""


@cache
def wrong() -> tuple[Found, ...]:
    """Return metric, number, least and most, and motion, where bodies that are lighter make another number."""
    return unlike_by((_lighter,), "metric", "a made-up motion of light bodies, which ends in", EXACT, 1e-300)


def _lighter() -> Iterator[Asked]:
    for units, opens, seed, rubs in MADE:
        made = MadeUp(case_of(units, opens, seed, rubs), seed)
        run, exact = lighter(made.run), lighter(made.truth.trajectory)
        truth = replace(made.truth, trajectory=exact, at=between(exact))
        own = replace(made.truth, at=between(made.truth.trajectory))
        for name in sorted(metrics.own()):  # what one of the user's says of forces is the user's
            metric = metrics.load(name)
            before, after = measured(name, own, made.run, made.case), measured(name, truth, run, made.case)
            times = LIGHTER if metric.UNIT in OF_FORCE else 1.0
            if before is not None and after is not None and np.isfinite(before):
                yield name, "a made-up motion of light bodies", after, times * before


def lighter(run: Trajectory) -> Trajectory:
    """Return a motion of bodies that are lighter."""
    book = run.ledger

    def less(values: Floats) -> Floats:
        return LIGHTER * values

    return replace(
        run, lam=less(run.lam), energy=less(run.energy),
        events=tuple(replace(event, impulse=LIGHTER * event.impulse) for event in run.events),
        ledger=None if book is None else replace(
            book, contact=less(book.contact), input=less(book.input), dissipated=less(book.dissipated)
        ),
    )  # fmt: skip
