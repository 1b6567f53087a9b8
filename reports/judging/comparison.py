"""Runs of one case against its truth: one tidy table."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

from crossbody import engines
from crossbody.cases import Case, InvalidValue, UnknownName
from crossbody.cases.arguments import instance, shown
from crossbody.cases.defaults import limits_of
from crossbody.engines import Run
from crossbody.reports import metrics
from crossbody.reports.judging.judge_controls import blind
from crossbody.reports.judging.run_verdicts import LARGEST_PARTS, Entry, unguarded, verdicts
from crossbody.reports.judging.stored import judged_alike
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.judging.truth_row import of_truth, touching, truth_row
from crossbody.reports.judging.verdict import COLUMNS, Verdict, limit_for
from crossbody.reports.measuring.alignment import expect
from crossbody.reports.measuring.truth import Truth, shortened

if TYPE_CHECKING:
    import pandas as pd


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
        One row per run and metric, and one for the truth, columns as in `Verdict`.

    Raises:
        UnknownName: if a claim or limit names a metric that does not exist.
    """
    instance("case", case, Case, "a Case, as crossbody.cases.load returns it")
    if truth is not None:
        instance("truth", truth, Truth, "a Truth, as crossbody.reports.truth_of returns it")
    instance("command", command, str, "a text")
    if not isinstance(runs, Sequence):
        raise InvalidValue(f"runs is {shown(runs)}; it must be a list of prepared runs.")
    for run in runs:
        if not isinstance(run, (Entry, Run)):
            raise InvalidValue(f"runs holds {shown(run)}; each must be what an engine's prepare returns, or an Entry.")
    truth = truth_of(case) if truth is None else truth
    entries = [_entry(run) for run in runs]
    import pandas as pd

    rows = [row.row() for row in judged(case, entries, truth, command)]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def judged(
    case: Case, entries: Sequence[Entry], truth: Truth, command: str, begin: Callable[[str], str] = unguarded
) -> list[Verdict]:
    """Every row of one case: of every run, the truth's own, and a word on claims that judged nothing.

    `begin` is told what each metric is before it is measured, and returns why it is not to be; nothing if it is.
    """
    check_names(case)
    expect(truth, [entry.run for entry in entries if entry.run is not None], case)
    trusted = shortened(truth)
    begun = [entry.engine for entry in entries if entry.run is not None and len(entry.run.t) > 1]
    rows = [row for entry in entries for row in verdicts(case, entry, trusted, command, begin)]
    others = [entry.run for entry in entries if entry.run is not None and entry.engine != "reference"]
    return [
        *rows,
        *truth_row(case, truth, command),
        *touching(case, trusted, others, command),
        *_idle(case, rows, command),
        *blind(case, trusted, command, begun),
    ]


def judges_parts(case: Case, engine: str, profile: str) -> bool:
    """Whether a limit asks for a part of the error of an engine."""
    return any(limit_for(limits_of(case), name, engine, profile) is not None for name in LARGEST_PARTS)


def check_names(case: Case) -> None:
    """Say which names in claims and limits do not exist.

    Raises:
        UnknownName: for a metric or an engine that does not exist; the valid ones are listed.
        InvalidValue: for a limit that is negative or not a number, and for a metric with the name of another.
    """
    known = {*metrics.of(case), "audit", "*", *LARGEST_PARTS}
    for kind, named in (("claims", case.claims), ("limits", case.limits)):
        for name in (each.metric for each in named):
            if name not in known:
                raise UnknownName(f"metric (in {kind} of {case.label})", name, known)
    installed = {*engines.names(), *engines.REGISTRY.own()}
    for limit in case.limits:
        if limit.engine not in ("*", *installed):
            raise UnknownName(f"engine (in limits of {case.label})", limit.engine, installed)
        if not (limit.value >= 0.0 and limit.known_size >= limit.known_least >= 0.0):
            raise InvalidValue(f"{case.label}: the limit of {limit.metric} is {limit.value}; it must be at least 0.")


def _entry(run: Entry | Run) -> Entry:
    if isinstance(run, Entry):
        return run
    hidden = engines.load(run.engine).hidden_in(run.profile) if run.engine in engines.names() else {}
    return Entry(engine=run.engine, profile=run.profile, settings=run.settings, run=run.run(), hidden=hidden)


def _idle(case: Case, rows: Sequence[Verdict], command: str) -> Iterator[Verdict]:
    """A claim that judged no run, although some were compared."""
    seen = {row.metric for row in rows}
    if not any(row.metric == "position" for row in rows):
        return
    for claim in case.claims:
        if claim.metric not in seen:
            why = f"No run was judged by the claim: {claim.source}."
            yield of_truth(
                case, f"{claim.metric} (claim)", why, command, tier=claim.tier.value, expected=claim.expected
            )


def unlike_stored(case: Case, command: str) -> Iterator[Verdict]:
    """Yield a row of a case by name whose limits or claims are others than its stored runs were judged by."""
    if not judged_alike(case):
        why = "Limits or claims are not those of the stored runs; if the change is intended, run make bands."
        yield of_truth(case, "limits", why, command, tier="")
