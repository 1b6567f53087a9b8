"""Which runs are within all limits, which are off, by how much and by which part of their error: one sentence."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from crossbody.reports.judging.parts import PARTS, part_of
from crossbody.reports.judging.verdict import Row, Word
from crossbody.reports.measuring.truth import TRUTH

WRONG = (Word.CRASHED, Word.OUTSIDE)
NAMED = 3
"""Runs that the sentence names."""


@dataclass(frozen=True, slots=True)
class EngineRun:
    """Rows of one engine on one case.

    Attributes:
        label: case:variant.
        who: engine:profile.
        rows: its verdicts.
    """

    label: str
    who: str
    rows: Sequence[Row]

    @property
    def wrong(self) -> list[Row]:
        """Rows that are outside or crashed, the farthest out first."""
        return sorted((row for row in self.rows if row["verdict"] in WRONG), key=share, reverse=True)

    @property
    def skipped(self) -> bool:
        """Whether it did not run."""
        return all(row["verdict"] == Word.SKIPPED for row in self.rows)


def runs_of(rows: Iterable[Row]) -> list[EngineRun]:
    """Rows by case and engine, in their order."""
    found: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        found.setdefault((f"{row['case']}:{row['variant']}", f"{row['engine']}:{row['profile']}"), []).append(row)
    return [EngineRun(label, who, mine) for (label, who), mine in found.items()]


def share(row: Row) -> float:
    """How many times its limit a number is; infinite where there is no number, or it may be none but that claimed."""
    value, expected, limit = (math.nan if row[name] is None else row[name] for name in ("value", "expected", "limit"))
    off = abs(value - (0.0 if math.isnan(expected) else expected))
    if off == 0.0:
        return 0.0
    return off / limit if limit > 0.0 and math.isfinite(off) else math.inf


def sentence(runs: Sequence[EngineRun]) -> str:
    """Say how many runs are within all limits, which have known deviations, and which are off and why."""
    ran = [run for run in runs if not run.who.startswith(TRUTH) and not run.skipped]
    off = sorted((run for run in runs if run.wrong), key=lambda run: -share(run.wrong[0]))
    right = [run for run in ran if not run.wrong]
    known = [run.who for run in right if any(row["verdict"] == Word.EXPECTED for row in run.rows)]
    text = f"{len(right) - len(known)} of {len(ran)} runs are within all limits"
    text += f", {len(known)} deviate as is known of them ({', '.join(dict.fromkeys(known))})." if known else "."
    if off:
        more = f"; and {len(off) - NAMED} more" if len(off) > NAMED else ""
        text += f" Off: {'; '.join(_off(run) for run in off[:NAMED])}{more}."
    return text


def _off(run: EngineRun) -> str:
    """The farthest number of a run, in a few words."""
    row, times = run.wrong[0], share(run.wrong[0])
    size = f"{row['value']:.2g}, {times:.2g} times its limit" if math.isfinite(times) else row["verdict"]
    return f"{run.who.removesuffix(':')} on {run.label} ({row['metric']} {size}{_blamed(run, row['metric'])})"


def _blamed(run: EngineRun, metric: str) -> str:
    """The largest part of an error, where its parts are told."""
    values = {row["metric"]: abs(row["value"]) for row in run.rows if row["value"] is not None}
    parts = {part: size for part in PARTS if math.isfinite(size := values.get(part_of(metric, part), math.nan))}
    return f", mostly its {max(parts, key=lambda part: parts[part])}" if parts else ""
