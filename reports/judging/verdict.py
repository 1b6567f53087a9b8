"""From a number and its limit to a verdict."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

from crossbody.cases import Claim, Limit


class Word(StrEnum):
    """What is said of one number."""

    WITHIN = "within"
    OUTSIDE = "outside"
    EXPECTED = "expected-outside"
    INFO = "not judged"
    SKIPPED = "skipped"


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """One row of the table: what was measured on which run, and what is to be thought of it.

    Attributes:
        case, variant, engine, profile, metric: which number of which run.
        value: the number, in `unit`; NaN if there is none.
        expected: what the case claims; NaN if it claims nothing (then 0 is meant, if there is a limit).
        limit: largest distance from that; NaN where nothing is judged.
        tier: how the truth is known.
        verdict: the word.
        why: reason of the limit, known property of the engine, or what was claimed by whom.
        command: what reproduces the row.
        settings: of the engine, in words.
    """

    case: str
    variant: str
    engine: str
    profile: str
    metric: str
    value: float
    expected: float = math.nan
    unit: str
    limit: float = math.nan
    tier: str
    verdict: Word
    why: str = ""
    command: str = ""
    settings: str = ""

    def row(self) -> dict[str, Any]:
        """As plain values."""
        return asdict(self) | {"verdict": self.verdict.value}


def limit_for(limits: Iterable[Limit], metric: str, engine: str, profile: str) -> Limit | None:
    """The limit that speaks most precisely of a run; of equals the last."""
    covering = [x for x in limits if x.metric == metric and x.covers(engine, profile)]
    return max(reversed(covering), key=lambda x: (x.engine != "*") + (x.profile != "*"), default=None)


def judge(value: float, limit: Limit | None, claim: Claim | None) -> tuple[Word, str]:
    """The word and the reason for one number.

    A claim without a limit must come out exactly. What is not finite is outside, even where nothing is judged.
    """
    if not math.isfinite(value):
        return Word.OUTSIDE, "The value is not finite."
    if limit is None and claim is None:
        return Word.INFO, ""
    allowed = 0.0 if limit is None else limit.value
    said = "" if claim is None else f"{claim.expected:g} claimed: {claim.source}. "
    why = "" if limit is None else limit.why
    deviation = abs(value - (0.0 if claim is None else claim.expected))
    if deviation <= allowed:
        return Word.WITHIN, (said + why).strip()
    if limit is not None and limit.known and deviation <= limit.known_size:
        return Word.EXPECTED, limit.known
    if limit is not None and limit.known:
        why = f"Beyond {limit.known_size:g}, which a known property explains: {limit.known}"
    return Word.OUTSIDE, (said + why).strip()


def exit_code(words: Iterable[str]) -> int:
    """0 if nothing is outside (a known deviation counts as fine), else 1."""
    return int(any(word == Word.OUTSIDE for word in words))
