"""Limits on the metrics of a replayed log: whose they are, and what they say of each number."""

from __future__ import annotations

import math
from collections.abc import Sequence

from crossbody.cases import InvalidValue, Limit, UnknownName
from crossbody.hw import Comparison
from crossbody.hw.replaying.comparison import Row
from crossbody.reports.judging.verdict import Word, judge, limit_for

HELD = "held_out_worse"
WORSE = Limit(
    metric=HELD, value=5.0,
    why="A fit that is worse than its start on held-out windows matches the fitted ones by chance, or compensates a "
    "defect of the model by its parameters; the scatter of estimates costs a few percent at most.",
)  # fmt: skip
WHOLE = 100.0  # what a share in percent would be at best
FAILED = "A run that ends early predicts nothing after its end."


def parse(pairs: Sequence[str]) -> tuple[Limit, ...]:
    """Limits from NAME=VALUE.

    Raises:
        InvalidValue: for a text that is no such pair, or a value that is not at least 0 and finite.
    """
    return tuple(_parsed(pair) for pair in pairs)


def _parsed(pair: str) -> Limit:
    name, _, text = pair.partition("=")
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not name.strip() or not 0.0 <= value < math.inf:
        raise InvalidValue(
            f"--limit {pair!r} is not NAME=VALUE with a value of at least 0, for example --limit fit=90."
        )
    if at_best(name.strip()) and value > WHOLE:
        raise InvalidValue(f"--limit {pair!r}: a share is at most {WHOLE:g} %.")
    return Limit(metric=name.strip(), value=value, why="Asked for by --limit.")


def at_best(metric: str) -> float:
    """What a metric would be at best: 100 % for shares, else 0."""
    return WHOLE if metric.split("_")[0] == "fit" or "_inside" in metric else 0.0


def check(limits: Sequence[Limit], found: Comparison, more: Sequence[str] = ()) -> None:
    """Raise UnknownName for a limit on a metric that no replay of this log has."""
    rows = found.rows()
    known = {row.metric for row in rows} | {label(row) for row in rows} | set(more)
    for limit in limits:
        if rows and limit.metric not in known:
            raise UnknownName(f"metric of a replay on {found.model}", limit.metric, known)


def label(row: Row) -> str:
    """Metric and channel in one word."""
    return f"{row.metric}_{row.channel}" if row.channel else row.metric


def judged(row: Row, limits: Sequence[Limit]) -> tuple[Word, str, float, float]:
    """Word, reason, what it would be at best, and how far it may be from that, of one number.

    A limit on one channel (`rmse_th1`) speaks before one on all of them (`rmse`). Of a share a
    limit names the least that is within, of any other metric the largest size.
    """
    if row.metric == "windows_failed" and row.value > 0.0:
        return Word.OUTSIDE, FAILED, 0.0, 0.0
    limit = limit_for(limits, label(row), row.engine, row.profile) or limit_for(
        limits, row.metric, row.engine, row.profile
    )
    return against(row.value, limit)


def against(value: float, limit: Limit | None) -> tuple[Word, str, float, float]:
    """The same of a number and its limit; without one nothing is judged."""
    if limit is None:
        return Word.INFO, "", math.nan, math.nan
    best = at_best(limit.metric)
    allowed = WHOLE - limit.value if best else limit.value
    off = Limit(metric=limit.metric, value=allowed, why=limit.why, known=limit.known, known_size=limit.known_size)
    word, why = judge(value - best, off, None)
    return word, why, best, allowed
