"""What the sentence of a verdict must name, of made-up rows: the largest deviation, and what is farthest out.

A sentence that is true of a lesser deviation hides the largest. So runs are drawn whose numbers all differ in size,
some of them above what is claimed and some below, and the one that must be named is found here by its size alone.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from functools import cache

import numpy as np

from crossbody.cases import Tier, Trajectory
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, Scene
from crossbody.reports.judging.asked import Found, rows_of
from crossbody.reports.judging.parts import part_of
from crossbody.reports.judging.remedies import remedy
from crossbody.reports.judging.told import runs_of, sentence
from crossbody.reports.judging.truth_row import start_below
from crossbody.reports.judging.verdict import Row, Verdict, Word
from crossbody.reports.measuring.truth import Truth

DRAWS, SEED, LIMIT = 12, 31, 0.01
METRICS = ("position", "velocity", "energy_drift", "balls_out", "gap_residual")
"""Of which the first is told before all others, and the last two are no quantities of a motion."""
QUANTITIES, NAMED = 3, 3
"""How many of these are, and how many runs are named."""
KINDS = ("largest deviation", "off", "beyond a limit")
WORDS = (Word.EXPECTED, Word.OUTSIDE, Word.INFO)


@cache
def wrong() -> tuple[Found, ...]:
    """Return what is said, number, least and most, and of what, where another number is named than must be."""
    unnamed = (("verdict sentence", math.nan, (value, value), f"made-up rows: {what}") for value, what in _unnamed())
    below = rows_of(_below, lambda why: ("start", math.nan, (0.0, 0.0), f"a start below surfaces, which ends in {why}"))
    return (*unnamed, *below, *_longer())


def _unnamed() -> Iterator[tuple[float, str]]:
    """Yield a number that must be named and is not, and what it is."""
    draw = np.random.default_rng(SEED)
    for _ in range(DRAWS):
        for kind, word in zip(KINDS, WORDS, strict=True):
            rows = _rows(draw, word)
            said = sentence(runs_of(rows))
            wanted = _first(rows) if word is Word.EXPECTED else _named(rows, word)
            places = [said.find(_words(row)) for row in wanted]
            for row, place in zip(wanted, places, strict=True):
                if place < 0 or places != sorted(places):
                    yield row["value"], f"{kind}, {_words(row)}"


def _longer() -> Iterator[Found]:
    """Yield the step, s, that is named as a shorter one of a run and is none, or NaN where none is named."""
    for step in 10.0 ** np.random.default_rng(SEED).uniform(-6.0, 2.0, DRAWS):
        row = _row("e0", METRICS[0], Word.INFO, 1.0, math.nan).row() | {"settings": f"dt={float(step):g}"}
        part = row | {"metric": part_of(METRICS[0], "step"), "known": LIMIT}
        said = re.search(r"shorter step \(--set-engine e0\.dt=([^)]+)\)", remedy("e0:p", [row, part], METRICS[0]))
        named = float(said[1]) if said else math.nan
        if not 0.0 < named < 0.6 * step:  # half the step at least shows what falls with it
            yield "shorter step", named, (0.0, 0.6 * float(step)), "made-up rows: what makes an error smaller"


DEEP = {"knee high": (-0.594, "rad"), "rail low": (-0.0027, "m"), "tip low": (-0.031, "m")}
"""How far a start is beyond bounds."""


def _below() -> Iterator[Found]:
    """Yield how far beyond its bounds a start is, in what unit, where another number is said, or another first."""
    kinds = {"knee": "hinge", "rail": "slide", "tip": "slide", "free": "slide"}
    case = case_of(
        Scene(
            bodies=tuple(Body(name=name, mass=1.0, inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0)) for name in kinds),
            joints=tuple(Joint(name=name, body=name, type=kind, range=(-1.0, 1.0)) for name, kind in kinds.items()),
        ),
        name="made_up", t_end=1.0,
    )  # fmt: skip
    gap = np.array([[next((deep for name, (deep, _) in DEEP.items() if name in row), 0.5) for row in case.contacts]])
    none = np.zeros_like(gap)
    motion = Trajectory(
        t=np.zeros(1),
        q=case.q0[None],
        v=case.v0[None],
        gap=gap,
        lam=none,
        energy=np.ones((1, 2)),
        mode=none.astype(int),
    )
    said = start_below(case, Truth(tier=Tier.A, source="", trajectory=motion, at=lambda _: motion, agreement={}))
    wanted = ", ".join(f"{name} by {-deep:.2g} {unit}" for name, (deep, unit) in sorted(DEEP.items(), key=_deepest))
    if wanted not in said:
        yield "start", math.nan, (0.594, 0.594), f"a start below surfaces: {said!r} lacks {wanted!r},"


def _deepest(one: tuple[str, tuple[float, str]]) -> float:
    return one[1][0]


def _rows(draw: np.random.Generator, word: Word) -> list[Row]:
    """Return rows of some engines beyond their limits, and one of each within."""
    found = []
    for engine in ("e0", "e1", "e2", "e3"):
        for metric in draw.permutation(METRICS[int(draw.integers(2)) :]).tolist():
            expected = float(draw.choice([math.nan, 3.0])) if metric == "balls_out" else math.nan
            off = draw.choice([-1.0, 1.0]) * LIMIT * 10.0 ** draw.uniform(0.5, 4.0)
            found.append(_row(engine, metric, word, off + (0.0 if math.isnan(expected) else expected), expected))
        found.append(_row(engine, "start_error", Word.WITHIN, 0.0, math.nan))
    return [row.row() for row in found]


def _row(engine: str, metric: str, word: Word, value: float, expected: float) -> Verdict:
    return Verdict(
        case="made_up", variant="a", engine=engine, profile="p", metric=metric, value=value, expected=expected,
        unit="1", limit=LIMIT, tier="", verdict=word, why="A cause, which is known.",
    )  # fmt: skip


def _times(row: Row) -> float:
    """Return how many times its limit a number is from what is claimed of it."""
    expected = 0.0 if math.isnan(row["expected"]) else row["expected"]
    return float(abs(row["value"] - expected) / row["limit"])


def _telling(row: Row) -> tuple[bool, bool, float]:
    return row["metric"] != METRICS[0], row["metric"] not in METRICS[:QUANTITIES], -_times(row)


def _first(rows: Sequence[Row]) -> list[Row]:
    """Return the row that tells most: of position, else of another quantity, else of all; the largest of these."""
    return sorted((row for row in rows if row["verdict"] == Word.EXPECTED), key=_telling)[:1]


def _named(rows: Sequence[Row], word: Word) -> list[Row]:
    """Return what is named of the runs that are farthest out: of each its farthest number, or its most telling one."""
    own = [
        min((row for row in run.rows if row["verdict"] == word), key=_telling if word is Word.INFO else _nearest)
        for run in runs_of(rows)
    ]
    return sorted(own, key=_nearest)[:NAMED]


def _nearest(row: Row) -> float:
    return -_times(row)


def _words(row: Row) -> str:
    times = f"{_times(row):.2g}"
    if _times(row) >= 10.0:  # up to 1e5, in plain digits
        times = f"{int(float(times)):,}"
    return f"{row['engine']}:p on made_up:a ({row['metric']} {row['value']:.2g}, {times} times its limit"
