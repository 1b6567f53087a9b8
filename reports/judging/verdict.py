"""From a number and its limit to a verdict."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from typing import Any

from crossbody.cases import Claim, Limit

FACTOR = 2.0
"""A known property takes an engine between a FACTOR-th of what a stored run gave and FACTOR times it."""
AGAIN = 1.05
"""The same where the same version of an engine steps on the same grid: all but rounding is as it was."""
BAND = 10.0
"""A number that was right may become so many times what a stored run gave before it counts as lost."""
NOUGHT = 1e-6
"""A number that nothing limits is as good as none below, in its unit: it may be but a thousand default tolerances."""
ROUNDING = 1e-12
"""Below this part of what is claimed, or of one unit of the metric, numbers differ between machines."""

LACKS = "The run lacks this number, which the truth has."
NOT_MEASURED = "Not measured. "
"""How the reason begins why a part of an error is not known."""
UNMEASURED = "Known, but no size of it is stored to judge this by: "
"""How the reason of a number begins that is beyond its limit, nobody knows how far it may be."""
IDENTITIES = frozenset(
    {
        "start_error",
        "mode_residual",
        "mode_contradicted",
        "event_gap",
        "energy_residual",
        "gap_residual",
        "largest position (importer)",
        "largest event_times (importer)",
    }
)
"""Metrics that hold a run against itself or the case's own numbers, and what a reader makes of a
file: no known property of an engine explains them, but one that a case limits on both sides."""


class Word(StrEnum):
    """What is said of one number."""

    WITHIN = "within"
    OUTSIDE = "outside"
    EXPECTED = "expected-outside"
    INFO = "not judged"
    LEDGER = "ledger only"
    SKIPPED = "skipped"
    CRASHED = "crashed"


class Regression(StrEnum):
    """What is said of one number beside that of a stored run of this version; empty where none is stored."""

    KEPT = "kept"
    LOST = "lost"


Row = dict[str, Any]
"""A verdict as plain values, by the names of `Verdict`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """One row of the table: what was measured on which run, and what is to be thought of it.

    Attributes:
        case, variant, engine, profile, metric: which number of which run.
        value: the number, in `unit`; NaN if there is none.
        expected: what the case claims; NaN if it claims nothing (then 0 is meant, if there is a limit).
        limit: largest distance from that which physics and method allow; NaN where nothing is judged.
        tier: how the truth is known.
        verdict: the word.
        why: reason of the limit, known property of the engine, or what was claimed by whom.
        command: what reproduces the row.
        settings: of the engine, in words.
        compared: part of the horizon over which it was measured.
        band: largest distance from `expected` that is no regression, ten times what a stored run
            of this version gave; NaN where none is stored.
        regression: "kept" or "lost" by that band; empty without one.
        known: what the number is known to, of a part of an error; NaN where nothing is said. One
            below it is none.
        where: of what the number is, by how much in its own unit, and when, where its metric can say so.
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
    compared: float = 1.0
    band: float = math.nan
    regression: str = ""
    known: float = math.nan
    where: str = ""

    def row(self) -> Row:
        """As plain values."""
        return asdict(self) | {"verdict": self.verdict.value, "regression": str(self.regression)}


COLUMNS = {name: float if kind == "float" else str for name, kind in Verdict.__annotations__.items()}
"""What a table of verdicts holds."""


def limit_for(limits: Sequence[Limit], metric: str, engine: str, profile: str) -> Limit | None:
    """The most precise limit of a run, of equals the last; with the property shown in any metric."""

    def precise(wanted: str) -> Limit | None:
        covering = [x for x in limits if x.metric == wanted and x.covers(engine, profile)]
        return max(reversed(covering), key=lambda x: (x.engine != "*") + (x.profile != "*"), default=None)

    found, known = precise(metric), precise("*")
    if found is None or known is None or found.known or metric in IDENTITIES:
        return found
    return replace(found, known=known.known, covers_none=known.covers_none)


def deviation(value: float, claim: Claim | None) -> float:
    """Distance of a number from what is claimed of it, or from 0."""
    return abs(value - (0.0 if claim is None else claim.expected))


def explained(limit: Limit, stored: float | None, factor: float = FACTOR) -> tuple[float, float] | None:
    """How far a known property takes an engine, at least and at most; None where nobody has measured it.

    Args:
        limit: with the property.
        stored: deviation of a stored run with the same parameters and settings; None where there is none.
        factor: between the two, either way.
    """
    if limit.known_least > 0.0:
        return limit.known_least, limit.known_size
    if stored is not None:
        return stored / factor, stored * factor
    return (0.0, limit.known_size) if math.isfinite(limit.known_size) else None


def judge(
    value: float, limit: Limit | None, claim: Claim | None, stored: float | None = None, factor: float = FACTOR
) -> tuple[Word, str]:
    """The word and the reason for one number.

    A claim without a limit must come out exactly. What is not finite is outside, even where
    nothing is judged; so is what is no more expected-outside: whatever took it away may
    be in what measures it.

    Args:
        value: the number.
        limit: what is allowed; None for nothing, or where nothing is judged.
        claim: what must come out; None for 0.
        stored: deviation of a stored run with the same parameters and settings; None where there is none.
        factor: how many times it a known property may take the run, either way.
    """
    if not math.isfinite(value):
        return Word.OUTSIDE, "The value is not finite."
    if limit is None and claim is None:
        return Word.INFO, ""
    allowed = 0.0 if limit is None else limit.value
    said = "" if claim is None else f"{claim.expected:g} claimed: {claim.source}. "
    why = "" if limit is None else limit.why
    off = deviation(value, claim)
    known = limit is not None and limit.known != ""
    sizes = explained(limit, stored, factor) if limit is not None and known else None
    if off <= allowed and (sizes is None or sizes[0] <= allowed):
        return Word.WITHIN, (said + why).strip()
    if limit is None or not known:
        return Word.OUTSIDE, (said + why).strip()
    if sizes is None:
        return Word.INFO, f"{UNMEASURED}{limit.known}"
    least, most = sizes
    if least <= off <= most:
        return Word.EXPECTED, limit.known
    return Word.OUTSIDE, f"{said}A known property explains {least:.3g} to {most:.3g}: {limit.known}"


def as_stored(value: float, shown: Limit | None, stored: float | None, factor: float = FACTOR) -> tuple[Word, str]:
    """The word for a number that nothing limits: that of its size, where a property is shown in any metric.

    Args:
        value: the number, finite.
        shown: limit with the property; None where an engine has none that is.
        stored: the number of a stored run with the same parameters and settings; None where there is none.
        factor: as for `judge`.
    """
    if shown is None or stored is None or not stored > FACTOR * NOUGHT:
        return Word.INFO, ""
    return judge(value, replace(shown, value=NOUGHT, known_least=0.0), None, stored, factor)


def band(stored: float | None, limit: Limit | None, claim: Claim | None = None) -> float:
    """Largest deviation that is no regression; NaN without a stored run, 0 for what must come out exactly.

    What nobody judges has one too: it is seen to move, if no one can say that it is wrong.
    """
    if stored is None or not math.isfinite(stored):
        return math.nan
    exact = claim is not None if limit is None else limit.value == 0.0
    size = 1.0 if claim is None else max(1.0, abs(claim.expected))
    return BAND * stored if exact else max(BAND * stored, ROUNDING * size)


def regression(value: float, most: float, stored: float | None, factor: float) -> str:
    """What is said of a deviation beside a stored one; nothing without.

    Args:
        value: the deviation.
        most: its band, NaN without a stored run.
        stored: the deviation of the stored run.
        factor: below FACTOR it must be the stored one again, but for this.
    """
    if stored is None or math.isnan(most):
        return ""
    moved = factor < FACTOR and abs(value - stored) > (factor - 1.0) * stored + NOUGHT
    return Regression.LOST if moved or not value <= most else Regression.KEPT


def exit_code(words: Iterable[str], regressions: Iterable[str] = ()) -> int:
    """0 if nothing is outside or crashed (what is expected-outside does not count) and nothing is lost, else 1."""
    return int(any(word in (Word.OUTSIDE, Word.CRASHED) for word in words) or Regression.LOST in set(regressions))


def by(rows: Iterable[Row], key: str) -> dict[str, list[Row]]:
    """Rows by the value of one column."""
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault(row[key], []).append(row)
    return found
