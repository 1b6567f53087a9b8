"""What is said of numbers on both sides of every bound that a verdict has: of limits, known sizes, and stored bands.

The controls of a case ask this of its own limits. Here are bounds of every kind at once, each with its numbers beside.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache

from crossbody.cases import Claim, Limit, Tier
from crossbody.reports.judging import verdict
from crossbody.reports.judging.asked import Found
from crossbody.reports.judging.verdict import Word, as_stored, band, judge, regression

BESIDE = 1e-3
"""Part of a bound by which a number is beside it."""
LIMIT, STORED, EXPECTED = 1e-6, 3e-3, 4.0
FACTOR, AGAIN, BAND, ROUNDING, NOUGHT = 2.0, 1.05, 10.0, 1e-12, 1e-6
"""As docs/explanation/verdicts.md has them: of known sizes, also of the same version's on the same grid, of bands, of
what differs between machines, of no limit."""
Asked = tuple[str, str, str]


@cache
def wrong() -> tuple[Found, ...]:
    """Return verdict, number, least and most, and of what, where another word is said or another band is kept."""
    return (*_words(), *_bands(), *_regressions())


def _sides(bound: float, below: Word, above: Word) -> Iterator[tuple[float, Word]]:
    """Yield numbers on both sides of a bound, and of zero, with what must be said of them."""
    for sign in (1.0, -1.0):
        yield sign * bound * (1.0 - BESIDE), below
        yield sign * bound * (1.0 + BESIDE), above


def _words() -> Iterator[Found]:
    plain = Limit(metric="m", value=LIMIT, why="a reason")
    known = Limit(metric="m", value=LIMIT, known="a cause")
    sized = Limit(metric="m", value=LIMIT, known="a cause", known_least=STORED, known_size=2.0 * STORED)
    claim = Claim(metric="m", expected=EXPECTED, tier=Tier.A, source="a source")
    asked = [
        ("a limit", (plain, None, None), _sides(LIMIT, Word.WITHIN, Word.OUTSIDE)),
        ("a known cause of a stored size, from above", (known, None, STORED),
         _sides(FACTOR * STORED, Word.EXPECTED, Word.OUTSIDE)),
        ("a known cause of a stored size, from below", (known, None, STORED),
         _sides(STORED / FACTOR, Word.OUTSIDE, Word.EXPECTED)),
        ("a known cause with a least size", (sized, None, None), _sides(STORED, Word.OUTSIDE, Word.EXPECTED)),
        ("a known cause with a largest size", (sized, None, None), _sides(2.0 * STORED, Word.EXPECTED, Word.OUTSIDE)),
        ("a known cause that nobody measured", (known, None, None), iter([(STORED, Word.INFO), (0.0, Word.WITHIN)])),
        ("no number", (plain, None, None), iter([(math.nan, Word.OUTSIDE), (math.inf, Word.OUTSIDE)])),
    ]  # fmt: skip
    for what, (limit, claimed, stored), sides in asked:
        for value, word in sides:
            yield from _said(what, value, word, judge(value, limit, claimed, stored)[0])
    for off, word in _sides(LIMIT, Word.WITHIN, Word.OUTSIDE):
        yield from _said("a claim", EXPECTED + off, word, judge(EXPECTED + off, plain, claim, None)[0])
    for value, word in ((FACTOR * STORED * 1.01, Word.OUTSIDE), (FACTOR * STORED * 0.99, Word.EXPECTED)):
        yield from _said("a stored number without a limit", value, word, as_stored(value, known, STORED)[0])
    for bound, inside, sign in ((AGAIN, Word.EXPECTED, 1.0), (1.0 / AGAIN, Word.EXPECTED, -1.0)):
        for off, word in ((-sign * BESIDE, inside), (sign * BESIDE, Word.OUTSIDE)):
            value = bound * STORED * (1.0 + off)
            yield from _said(
                "a number that is given again", value, word, judge(value, known, None, STORED, verdict.AGAIN)[0]
            )
    small = FACTOR * NOUGHT * (1.0 - BESIDE)
    yield from _said("a stored number that is none", 10.0 * small, Word.INFO, as_stored(10.0 * small, known, small)[0])


def _said(what: str, value: float, word: Word, found: Word) -> Iterator[Found]:
    if found != word:
        yield "verdict", value, (math.nan, math.nan), f"{what}: it is said to be {found}, not {word},"


def _bands() -> Iterator[Found]:
    plain, exact = Limit(metric="m", value=LIMIT), Limit(metric="m", value=0.0)
    claim = Claim(metric="m", expected=EXPECTED, tier=Tier.A, source="a source")
    asked = (
        ("a limit", band(STORED, plain), BAND * STORED), ("an exact number", band(0.0, exact), 0.0),
        ("rounding", band(1e-16, plain), ROUNDING),
        ("rounding of a claim", band(1e-16, plain, claim), EXPECTED * ROUNDING),
        ("a claim that is exact", band(0.0, None, claim), 0.0),
        ("a number without a limit", band(STORED, None), BAND * STORED),
    )  # fmt: skip
    for what, found, wanted in asked:
        if not abs(found - wanted) <= BESIDE * wanted:
            yield "band", found, (wanted, wanted), what
    if not math.isnan(band(None, plain)) or not math.isnan(band(math.nan, plain)):
        yield "band", band(None, plain), (math.nan, math.nan), "nothing stored"


def _regressions() -> Iterator[Found]:
    """Yield deviations beside a stored one that are said to have stayed, or to have left it, where they have not."""
    near, far, large = (1.0 + 0.9 * (AGAIN - 1.0)) * STORED, (1.0 + 1.1 * (AGAIN - 1.0)) * STORED, 1.01 * BAND * STORED
    asked = (
        ("given again", regression(near, BAND * STORED, STORED, verdict.AGAIN), "kept"),
        ("another than the stored one", regression(far, BAND * STORED, STORED, verdict.AGAIN), "lost"),
        ("half of the stored one", regression(0.5 * STORED, BAND * STORED, STORED, verdict.AGAIN), "lost"),
        ("in its band", regression(far, BAND * STORED, STORED, FACTOR), "kept"),
        ("beyond its band", regression(large, BAND * STORED, STORED, FACTOR), "lost"),
        ("nowhere stored", regression(STORED, math.nan, None, FACTOR), ""),
    )
    for what, found, wanted in asked:
        if found != wanted:
            yield (
                "regression",
                STORED,
                (math.nan, math.nan),
                f"a number {what}: it is said to be {found!r}, not {wanted!r},",
            )
