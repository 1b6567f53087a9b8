"""What the parts of an error must be of made-up runs whose error is a + b h^p and, of a reader of files, c more.

Coordinates, and the instants of events, are off by a + b h^p at a step h, each by its own a and b. So the model's part
is a, the step's b h^p and the importer's c, wherever the whole is largest, and the order is p.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from crossbody.cases import Mode, Tier, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.reports.judging.asked import Found
from crossbody.reports.judging.known_answers import UNLIKE
from crossbody.reports.judging.made_up import MadeUp, case_of
from crossbody.reports.judging.parts import Split, Study, part_of, remaining, splits
from crossbody.reports.measuring.truth import Truth

SEED, ORDER, STEPS = 5, 1.5, (0.4, 0.2, 0.1)
NEAR = 1e-3
"""Part of its size by which a coordinate is off: less than by what another clock makes of it."""
SAME, DIGITS = 1e-9, 1e-5
"""Parts of the largest that rounding changes of any, and of an instant that its digits leave out."""


@dataclass(frozen=True)
class Errors:
    """By how much runs are off: coordinates over their largest (n,), and instants of touches, s (touches,).

    Attributes:
        a, b, c: of coordinates: at no step, times h^p, and of the reader.
        late, later: of instants: at no step, and times h^p.
        size: of all coordinates at every sample (samples, 1), up to 1.
    """

    a: Floats
    b: Floats
    c: Floats
    late: Floats
    later: Floats
    size: Floats


@cache
def wrong() -> tuple[Found, ...]:
    """Return metric, number, least and most, and what was split, of parts of made-up errors that are others."""
    made = MadeUp(case_of(*UNLIKE, SEED), SEED)
    errors = _drawn(made)
    return (*_of_steps(made, errors), *_of_tolerances(made, errors), *_of_a_law(made, errors), *_of_none(made, errors))


def _drawn(made: MadeUp) -> Errors:
    """Return errors whose whole is largest where neither part is, and has parts of both signs."""
    draw, n, touches = np.random.default_rng(SEED), len(made.case.coordinates), np.arange(len(made.knots) - 1)
    size = draw.uniform(0.2, 0.8, (len(made.t), 1))
    size[len(made.t) // 3] = 1.0
    first = np.arange(n)
    step = NEAR * np.where(first == n - 1, 0.2, -0.02 * (1.0 + first)) / STEPS[-1] ** ORDER
    model = NEAR * np.where(first == n - 1, 0.05, np.where(first == 1, -0.12, 0.01))
    shortest = float(np.min(np.diff(made.knots)))
    late, later = 0.04 * shortest * np.where(touches == 1, -1.0, 0.5), 0.1 * shortest * (touches == 1)
    later = np.where(touches == 1, -later, 0.01 * shortest) / STEPS[-1] ** ORDER
    return Errors(a=model, b=step, c=NEAR * np.where(first == n - 1, 0.03, 0.06), late=late, later=later, size=size)


def _run(made: MadeUp, errors: Errors, by: float, read: float = 0.0, model: float = 1.0) -> Trajectory:
    """Return the run at a step whose power is `by`; `read` tells whether a reader is off, `model` the model."""
    exact, knots = made.exact, np.array(made.knots)
    lates = knots + np.append(0.0, model * errors.late + by * errors.later)

    def late(t: Floats | float) -> Floats:
        found: Floats = np.interp(t, knots, lates) + np.maximum(np.asarray(t) - knots[-1], 0.0)
        return found

    off = np.abs(exact.q).max(axis=0) * errors.size * (model * errors.a + by * errors.b + read * errors.c)
    events = tuple(replace(e, t=float(late(e.t))) for e in exact.events)
    return replace(exact, t=late(made.t), q=exact.q + off, events=events)


def _power(h: float) -> float:
    return float(h**ORDER)


def _unlike(
    name: str, found: Split | None, there: Mapping[str, float], largest: Mapping[str, float]
) -> Iterator[Found]:
    """Yield the parts that are others, and those that are not told."""
    for part, wanted in there.items():
        told = np.nan if found is None else found.there.get(part, np.nan)
        if not abs(told - wanted) <= SAME:
            yield part_of(name, part), told, (wanted, wanted), "an error of known parts"
        told = np.nan if found is None else found.largest.get(part, np.nan)
        if not abs(told - largest[part]) <= SAME:
            yield f"largest {part_of(name, part)}", told, (largest[part],) * 2, "an error of known parts"
        told = np.nan if found is None else found.known.get(part, np.nan)
        if not told <= SAME:
            yield part_of(name, part), told, (0.0, SAME), "what an error of known parts is known to"


def _laid(parts: Mapping[str, Floats]) -> tuple[dict[str, float], dict[str, float]]:
    """Return part -> its share of the whole where that is largest, and its largest, of parts at the same places."""
    whole = np.sum(list(parts.values()), axis=0)
    worst = int(np.argmax(np.abs(whole)))
    there = {part: float(np.sign(whole[worst]) * error[worst]) for part, error in parts.items()}
    return there, {part: float(np.abs(error).max()) for part, error in parts.items()}


def _parts(errors: Errors, by: float, read: float = 0.0) -> tuple[dict[str, float], dict[str, float]]:
    """Return the shares and largest of the parts of coordinates."""
    parts = {"model": errors.a, "step": by * errors.b} | ({"importer": errors.c} if read else {})
    return _laid(parts)


def _shares(made: MadeUp, errors: Errors, by: float) -> tuple[dict[str, float], dict[str, float]]:
    """Return the same of instants: releases are off as the line between the touches about them is."""
    exact, knots = made.exact, np.array(made.knots)
    at = [e.t for e in exact.events if (e.before, e.after) == (Mode.FREE, Mode.COLLISION) or e.before == Mode.CONTACT]
    parts = {
        part: np.interp(at, knots, np.append(0.0, error))
        for part, error in (("model", errors.late), ("step", by * errors.later))
    }
    return _laid(parts)


def _of_steps(made: MadeUp, errors: Errors) -> Iterator[Found]:
    """Ask for parts of runs at three steps, with and without a reader."""
    by = _power(STEPS[0])
    for read in (0.0, 1.0):
        runs = tuple(_run(made, errors, _power(h)) for h in STEPS)
        judged = _run(made, errors, by, read)
        study = Study(setting="dt", sizes=STEPS, runs=runs, built=runs[0] if read else None)
        found = splits(made.case, made.truth, judged, study)
        yield from _unlike("position", found.get("position"), *_parts(errors, by, read))
        yield from _misplaced(made, errors, by, read, found)
        if not read:
            yield from _unlike("event_times", found.get("event_times"), *_shares(made, errors, by))
            said = found["position"].says if "position" in found else ""
            if f"Order {ORDER:.2f}" not in said:
                yield part_of("position", "step"), np.nan, (ORDER, ORDER), "the order of an error of known parts"


def _misplaced(made: MadeUp, errors: Errors, by: float, read: float, found: Mapping[str, Split]) -> Iterator[Found]:
    """Yield the truth's instant that is named as that of the largest error, where it or the coordinate is another."""
    i, j = int(np.argmax(errors.size)), int(np.argmax(np.abs(errors.a + by * errors.b + read * errors.c)))
    name, t = made.case.coordinates[j].name, float(made.t[i])
    said = found["position"].where.partition(" at t = ") if "position" in found else ("", "", "")
    told = float(said[2].removesuffix(" s") or np.nan)
    if said[0] != name or not abs(told - t) <= DIGITS * t:
        yield part_of("position", "step"), told, (t, t), f"the instant at which {name} is off most: {said[0]}"


def _of_tolerances(made: MadeUp, errors: Errors) -> Iterator[Found]:
    """Ask for parts of runs at two tolerances, of which the tightest has no error of its step."""
    by = _power(STEPS[0])
    study = Study(setting="rtol", sizes=(1e-11, 1e-12), runs=(_run(made, errors, 0.0), _run(made, errors, 0.0)))
    found = splits(made.case, made.truth, _run(made, errors, by), study)
    yield from _unlike("position", found.get("position"), *_parts(errors, by))


def _of_a_law(made: MadeUp, errors: Errors) -> Iterator[Found]:
    """Ask for parts of a run whose equations are known, and not the case's."""
    by, own = _power(STEPS[0]), _run(made, replace(errors, late=0.0 * errors.late, later=0.0 * errors.later), 0.0)
    judged = _run(made, replace(errors, late=0.0 * errors.late, later=0.0 * errors.later), by)

    def at(t: Floats) -> Trajectory:
        near = np.argmin(np.abs(made.t[:, None] - t), axis=0)
        return replace(made.lookup(t), q=own.q[near])

    law = Truth(tier=Tier.A, source="made up", trajectory=own, at=at, agreement={})
    found = splits(made.case, made.truth, judged, Study(), law)
    yield from _unlike("position", found.get("position"), *_parts(errors, by))


def _of_none(made: MadeUp, errors: Errors) -> Iterator[Found]:
    """Ask for parts of runs whose differences grow, which have none, and for what differences sum to that fall."""
    runs = tuple(_run(made, errors, by) for by in (0.01, 0.02, 0.05))
    found = splits(made.case, made.truth, runs[-1], Study(setting="dt", sizes=STEPS, runs=runs)).get("position")
    if found is None or {"model", "step"} & found.there.keys():
        yield part_of("position", "step"), np.nan, (np.nan, np.nan), "a part of errors that do not fall"
    for sizes, most in (((4.0, 1.5, 0.5), 2.0), ((9.0, 8.0, 4.0), 8.0 / np.sqrt(2.0)), ((7.0, 1.0, 3.4), 3.5)):
        wanted, rest = most / (np.sqrt(2.0) - 1.0), remaining([np.array([[x]]) for x in np.cumsum([0.0, *sizes])])
        if not abs(rest - wanted) <= SAME:
            yield part_of("position", "step"), rest, (wanted, wanted), "what differences that fall sum to"
