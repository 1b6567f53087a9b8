"""Runs of one case against its truth: one tidy table."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import pandas as pd

from crossbody.cases import Case, InvalidValue, Trajectory
from crossbody.cases._arguments import instance, shown
from crossbody.cases._arrays import Floats
from crossbody.reports import metrics
from crossbody.reports.judging.audit import AuditRow
from crossbody.reports.judging.truth import Truth, truth_of
from crossbody.reports.judging.verdict import Verdict, Word, judge, limit_for

if TYPE_CHECKING:
    from crossbody.engines import Run


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One run of an engine, or the sentence that says why there is none.

    Attributes:
        engine, profile: who ran.
        settings: what was really used.
        run: the motion; None if it was skipped.
        skipped: why, in one sentence.
        audit: what reached the engine beside the reference.
        refined: the same engine with a much finer step or tolerance, to tell model from discretisation.
        stepped: ends of the run's own steps, s, where `run` was asked for other instants; None where they are its own.
        own: truth of the equations that the engine really integrates; None where they are the case's own.
    """

    engine: str
    profile: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    run: Trajectory | None = None
    skipped: str = ""
    audit: tuple[AuditRow, ...] = ()
    refined: Trajectory | None = None
    stepped: Floats | None = None
    own: Truth | None = None


def compare(
    case: Case, runs: Sequence[Entry | Run], truth: Truth | None = None, command: str = "crossbody run"
) -> pd.DataFrame:
    """Judge runs of one case.

    Args:
        case: with its claims and limits.
        runs: entries, or prepared runs of engines, which are run here.
        truth: what they are judged against; the best that the case has, if not given.
        command: what reproduces the table, for its rows.

    Returns:
        One row per run and metric, columns as in `Verdict`.
    """
    instance("case", case, Case, "a Case, as crossbody.cases.load returns it")
    if truth is not None:
        instance("truth", truth, Truth, "a Truth, as crossbody.reports.truth_of returns it")
    instance("command", command, str, "a text")
    if not isinstance(runs, Sequence):
        raise InvalidValue(f"runs is {shown(runs)}; it must be a list of prepared runs.")
    for run in runs:
        if not isinstance(run, Entry) and not callable(getattr(run, "run", None)):
            raise InvalidValue(f"runs holds {shown(run)}; each must be what an engine's prepare returns, or an Entry.")
    truth = truth_of(case) if truth is None else truth
    rows = [row for run in runs for row in verdicts(case, _entry(run), truth, command)]
    return table(rows)


def table(rows: Iterable[Verdict]) -> pd.DataFrame:
    """Verdicts as a tidy table; the columns are there even without a row."""
    return pd.DataFrame([row.row() for row in rows], columns=list(Verdict.__dataclass_fields__))


def _entry(run: Entry | Run) -> Entry:
    if isinstance(run, Entry):
        return run
    return Entry(engine=run.engine, profile=run.profile, settings=run.settings, run=run.run())


def _words(settings: Mapping[str, Any]) -> str:
    return " ".join(f"{k}={v:g}" if isinstance(v, float) else f"{k}={v}" for k, v in settings.items())


class _Judge:
    """Fills in what all rows of one run share."""

    def __init__(self, case: Case, entry: Entry, truth: Truth, command: str) -> None:
        self.case, self.entry, self.truth = case, entry, truth
        self.claims = {claim.metric: claim for claim in case.claims}
        self.command = f"{command} --engine {entry.engine}:{entry.profile}"

    def row(self, metric: str, value: float, unit: str, verdict: Word, why: str, **more: Any) -> Verdict:
        return Verdict(
            case=self.case.name, variant=self.case.variant, engine=self.entry.engine, profile=self.entry.profile,
            metric=metric, value=value, unit=unit, verdict=verdict, why=why, command=self.command,
            settings=_words(self.entry.settings), **({"tier": self.truth.tier.value} | more),
        )  # fmt: skip

    def judged(self, metric: str, value: float, unit: str) -> Verdict:
        claim = self.claims.get(metric)
        limit = limit_for(self.case.limits, metric, self.entry.engine, self.entry.profile)
        word, why = judge(value, limit, claim)
        return self.row(
            metric, value, unit, word, why,
            expected=math.nan if claim is None else claim.expected,
            limit=limit.value if limit else math.nan if claim is None else 0.0,
            tier=self.truth.tier.value if claim is None else claim.tier.value,
        )  # fmt: skip

    def part(self, metric: str, value: float, unit: str, against: Truth) -> Verdict:
        """One part of an error, judged where the case limits that part, against its own truth."""
        limit = limit_for(self.case.limits, metric, self.entry.engine, self.entry.profile)
        word, why = judge(value, limit, None)
        return self.row(
            metric, value, unit, word, why or against.source,
            limit=limit.value if limit else math.nan, tier=against.tier.value,
        )  # fmt: skip

    def missing(self, metric: str, unit: str) -> Verdict:
        """A claimed number that the run does not have, for example the fifth exit of a ball that left twice."""
        claim = self.claims[metric]
        limit = limit_for(self.case.limits, metric, self.entry.engine, self.entry.profile)
        known = "" if limit is None else limit.known
        word = Word.EXPECTED if known else Word.OUTSIDE
        why = known or f"The run has no such number; {claim.expected:g} claimed: {claim.source}."
        return self.row(metric, math.nan, unit, word, why, expected=claim.expected, tier=claim.tier.value)


def verdicts(case: Case, entry: Entry, truth: Truth, command: str) -> list[Verdict]:
    """Every row of one run."""
    judge_ = _Judge(case, entry, truth, command)
    if entry.run is None:
        return [judge_.row("run", math.nan, "", Word.SKIPPED, entry.skipped)]
    rows = [_outcome(judge_, entry.run)]
    if entry.audit:
        rows.append(_audit(judge_))
        if rows[-1].verdict == Word.OUTSIDE:
            return rows
    return [*rows, *_measured(judge_, entry.run, truth), *_split(judge_)]


def _outcome(judge_: _Judge, run: Trajectory) -> Verdict:
    """Whether the run reached its horizon: a run that did not is outside, with the advice."""
    if run.outcome.ok:
        return judge_.row("finished", 1.0, "1", Word.WITHIN, "", expected=1.0, limit=0.0)
    told = "" if run.outcome.advice in run.message else run.outcome.advice
    why = " ".join(text for text in (f"{run.outcome.value}:", run.message, told) if text)
    return judge_.row("finished", 0.0, "1", Word.OUTSIDE, why, expected=1.0, limit=0.0)


def _audit(judge_: _Judge) -> Verdict:
    """A failed audit is a result, not a comparison: unless it is a known property, no metric follows it."""
    failed = [row for row in judge_.entry.audit if not row.ok]
    shown = [row.difference for row in judge_.entry.audit if not math.isnan(row.difference)]
    limit = limit_for(judge_.case.limits, "audit", judge_.entry.engine, judge_.entry.profile)
    if not failed:
        word, why = Word.WITHIN, "the same physics as the reference"
    elif limit is not None and limit.known:
        word, why = Word.EXPECTED, limit.known
    else:
        word, why = Word.OUTSIDE, "Not compared: " + ", ".join(row.quantity for row in failed) + " differ."
    worst = max(failed, key=lambda row: row.difference) if failed else None
    value = worst.difference if worst else max(shown, default=0.0)
    tolerance = worst.tolerance if worst else judge_.entry.audit[0].tolerance
    return judge_.row("audit", value, "1", word, why, limit=tolerance, tier="")


def _measured(judge_: _Judge, run: Trajectory, truth: Truth) -> Iterable[Verdict]:
    for name in metrics.names():
        metric = metrics.load(name)
        limited = limit_for(judge_.case.limits, name, judge_.entry.engine, judge_.entry.profile)
        if metric.CLAIMED and name not in judge_.claims and limited is None:
            continue
        value = metric.measure(truth, run, judge_.case)
        if value is not None:
            yield judge_.judged(name, value, metric.UNIT)
        elif name in judge_.claims:
            yield judge_.missing(name, metric.UNIT)


def _split(judge_: _Judge) -> Iterable[Verdict]:
    """Discretisation error apart from model error (refined against the truth).

    Discretisation is the run against the truth of the equations that the engine follows, or against its refined self.
    """
    from crossbody.cases import Tier
    from crossbody.reports.judging.truth import from_run

    entry = judge_.entry
    if entry.refined is None or entry.run is None:
        return
    sides = [("model", judge_.truth, entry.refined)]
    if entry.own is not None:
        sides.append(("discretisation", entry.own, entry.run))
    elif "dt" in entry.settings:  # a tolerance is refined to rounding: what is left is the model error alone
        sides.append(("discretisation", from_run(entry.refined, Tier.D, "the same engine refined"), entry.run))
    for name in ("position", "event_times"):
        metric = metrics.load(name)
        for label, against, run in sides:
            value = metric.measure(against, run, judge_.case)
            if value is not None:
                yield judge_.part(f"{name} ({label})", value, metric.UNIT, against)
