"""What `crossbody replay` and `crossbody identify` do: read, run, write tables and pages, show metrics."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import click
import pandas as pd

from crossbody import hw
from crossbody.cases import CaseUnsupported
from crossbody.cases.errors import several
from crossbody.hw import Comparison, Fit, Log
from crossbody.reports import layout, voice
from crossbody.reports.commands.shared import check_answers, identity, print_rows, where
from crossbody.reports.figures.section import records
from crossbody.reports.judging.verdict import Word, exit_code
from crossbody.reports.layout import unit_text
from crossbody.reports.pages import site as page
from crossbody.reports.replay import comparison, kept
from crossbody.reports.replay import comparison as replay
from crossbody.reports.runs import choice, output, study, watch
from crossbody.reports.runs.choice import DEFAULT_ENGINES
from crossbody.reports.runs.parts import Parts
from crossbody.reports.runs.provenance import provenance
from crossbody.reports.sections import identify as identified
from crossbody.reports.sections import replay as section

GRACE = 2.0
"""Times the limit on an identification after which its process is ended: it stops itself between runs."""
HEADS = {"change": "change [%]"}
SPARED = (
    "kept_low",
    "kept_high",
    "first_half",
    "second_half",
    "freedom",
    "std",
    "start",
    "identifiable",
    "fitted_before",
    "unit",
)
"""Columns that go first where a table is too wide."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ask:
    """What both commands are given about a log.

    Attributes:
        path, columns, part, repair: as for `hw.read`.
        memory: that reading may take over the file's own size, MB.
        model: name of the model.
        pairs: K=V, parameters of the model.
        restart, horizon: s; None for the usual.
        delay: of the measured coordinates beyond what the map says, s.
        limits: NAME=VALUE, on metrics of the replay.
    """

    path: Path
    columns: str | None
    part: int | None
    repair: Sequence[str]
    model: str
    pairs: Sequence[str]
    restart: float | None
    horizon: float | None
    delay: float
    memory: int = 1000
    limits: Sequence[str] = ()

    def log(self) -> Log:
        """The log."""
        room = self.memory * 1_000_000
        return hw.read(self.path, self.columns, part=self.part, repair=self.repair, memory=room)


def _ended(model: str, engine: str) -> bool:
    """Whether an engine's process was ended, by what was reported of it."""
    return any(label.startswith((f"{model} on {engine}:", f"{model} on {engine},")) for label in watch.all_lost())


def run_replay(ask: Ask, kind: str, wanted: Sequence[str], out: Path, command: str, limit: float = watch.LIMIT) -> int:
    """Replay a log, "forward" or "closed_loop", on engines or all usual ones, and write the report."""
    hw.models.load(ask.model)
    output.check(out, "replay")
    given = comparison.parse(ask.limits)
    engines = [engine for engine in wanted or DEFAULT_ENGINES if not _ended(ask.model, engine)]
    if not engines:
        raise CaseUnsupported(f"None of the requested engines returned: {'; '.join(watch.all_lost())}.")
    log = ask.log()
    check_answers("replay")
    with Parts(out, command, _identity(ask, log, kind, wanted)) as parts, voice.progress(len(engines)) as bar:

        def tell(text: str) -> None:
            bar(text)
            watch.limited(text, limit)

        found = hw.replay(
            log, ask.model, kind=kind, wanted=engines, parameters=choice.parse_settings(ask.pairs),
            restart=ask.restart, horizon=ask.horizon, delay=ask.delay, tell=tell, keep=kept.keeper(parts),
        )  # fmt: skip
        watch.unlimited()
        comparison.check(given, found)
        rows = replay.verdicts(found, command, given)
        _write(out, found, rows, provenance(command, log=replay.log_about(found)), {}, "replay")
    metrics = _metrics(found, rows)
    if not voice.told_as_json({"metrics": metrics, "findings": replay.findings(found)}):
        if not voice.quiet():
            _say(found, metrics)
        _say_outside(rows)
        where(out)
    return exit_code(rows["verdict"])


def _identity(ask: Ask, log: Log, kind: str, wanted: Sequence[str]) -> dict[str, Any]:
    """What decides what a replay predicts: the log's numbers, the model and its source, engines, windows."""
    return identity(
        f"replay {kind}", (), (), log=asdict(log.provenance), model=ask.model,
        source=kept.source(hw.models.load(ask.model)), pairs=ask.pairs,
        windows=(ask.restart, ask.horizon, ask.delay), wanted=wanted,
    )  # fmt: skip


def run_identify(
    ask: Ask, free: Sequence[str], hold: int, starts: str, stride: int, budget: float,
    out: Path, command: str, limit: float = watch.LIMIT,
) -> int:  # fmt: skip
    """Identify parameters, replay the log with them, and write the report.

    "delay" is free too, as that of the measured coordinates; every hold-th window is held out of
    the fit. The search ends at its budget, s; at the limit it is stopped, with its process if need
    be.
    """
    model = hw.models.load(ask.model)
    output.check(out, "identify")
    asked = comparison.parse(ask.limits)
    log, given = ask.log(), choice.parse_settings(ask.pairs)
    check_answers("replay")
    label = f"{ask.model} identified from {ask.path}"
    if why := watch.lost(label):
        raise CaseUnsupported(f"{label}: {why}")
    watch.resumable("Nothing was replaced; the same command starts from the beginning.")
    watch.limited(label, GRACE * (1.0 + limit))
    fit = hw.identify(
        log, model, free, parameters=given, restart=ask.restart, horizon=ask.horizon,
        starts=starts, hold=hold, stride=stride, delay=ask.delay, budget=budget, time_limit=limit,
    )  # fmt: skip
    found = hw.replay(
        log, model, wanted=(model.engine,), parameters=fit.parameters, restart=ask.restart,
        horizon=ask.horizon, delay=ask.delay + fit.delay,
    )  # fmt: skip
    watch.unlimited()
    tables = {"identify": estimates(fit), "held_out": held_out(fit)}
    units = [row.unit for row in found.rows() if row.metric == "rmse"]
    tables["held_out"]["unit"] = identified.one_unit(units)
    told = {
        "sensitivities": fit.sensitivities, "covariance": fit.covariance, "warnings": list(fit.warnings),
        "fitted": list(fit.fitted), "held": list(fit.held), "message": fit.message, "outcome": fit.outcome,
    }  # fmt: skip
    comparison.check(asked, found, (comparison.HELD,))
    rows = replay.verdicts(found, command, asked, fit)
    tables["held_out"]["verdict"] = _held_verdicts(fit, rows)
    drawn = {
        "identify-profile": replay.profile(fit), "identify-correlation": replay.correlation(fit),
        "identify-residuals": replay.left_by_fit(fit, found),
        "identify-autocorrelation": replay.correlations_of_fit(fit, found),
    }  # fmt: skip
    _write(out, found, rows, provenance(command, log=replay.log_about(found), fit=told), tables | drawn, "identify")
    more = {"warnings": pd.DataFrame({"text": list(fit.warnings)}), "metrics": _metrics(found, rows)}
    if not voice.told_as_json(tables | more):
        if not voice.quiet():
            told_first = identified.summary(tables["identify"], tables["held_out"], len(fit.fitted), len(fit.held))
            click.echo(layout.told(told_first) + "\n")
            _say_log(found)
            click.echo()
            for shown in tables.values():
                print_rows(shown, 6, heads=HEADS, left_out=SPARED)
                click.echo()
            click.echo(
                f"{layout.told(f'Derivatives: {fit.sensitivities}')}\n{layout.told(f'Intervals: {fit.covariance}')}"
            )
        for warning in fit.warnings:
            click.echo(layout.told(f"warning: {warning}"))
        _say_outside(rows)
        where(out)
    return exit_code(rows["verdict"]) if fit.success else 1


def estimates(fit: Fit) -> pd.DataFrame:
    """One row an identified parameter."""
    halves = {one.name: one.values for one in fit.agreement}
    return pd.DataFrame(
        {
            "name": e.name, "value": e.value, "low": e.low, "high": e.high, "unit": e.unit, "start": e.start,
            "identifiable": e.identifiable, "std": e.std, "freedom": e.freedom, "kept_low": e.kept_low,
            "kept_high": e.kept_high, "first_half": halves.get(e.name, (math.nan, math.nan))[0],
            "second_half": halves.get(e.name, (math.nan, math.nan))[1],
        } for e in fit.estimates
    )  # fmt: skip


def held_out(fit: Fit) -> pd.DataFrame:
    """One row a kind of error: at the start and with the estimates, fitted windows and others."""
    return pd.DataFrame(
        {
            "error": name, "fitted_before": fit.before[name][0], "fitted_after": fit.after[name][0],
            "held_before": fit.before[name][1], "held_after": fit.after[name][1],
            "change": 100.0 * (fit.after[name][1] / fit.before[name][1] - 1.0),
        } for name in fit.before
    )  # fmt: skip


def _held_verdicts(fit: Fit, rows: pd.DataFrame) -> list[str]:
    """What is said of every row of `held_out`: the rmse alone is judged."""
    word = rows.loc[rows["metric"] == comparison.HELD, "verdict"]
    return [word.iloc[0] if name == "rmse" and len(word) else Word.INFO.value for name in fit.before]


def _metrics(found: Comparison, rows: pd.DataFrame) -> pd.DataFrame:
    """Every metric with its channel, and what the verdicts say of it."""
    columns = ["who", "metric", "channel", "value", "unit", "expected", "limit", "verdict"]
    said = rows.drop_duplicates(["engine", "profile", "metric"]).set_index(["engine", "profile", "metric"])
    told = [
        {"who": f"{r.engine}:{r.profile}", "metric": r.metric, "channel": r.channel, "value": r.value, "unit": r.unit}
        | said.loc[(r.engine, r.profile, comparison.label(r)), ["expected", "limit", "verdict"]].to_dict()
        for r in found.rows()
    ]  # fmt: skip
    return pd.DataFrame(told, columns=columns)


def _say_outside(rows: pd.DataFrame) -> None:
    """One line a number that is outside its limit."""
    for row in rows[rows["verdict"] == Word.OUTSIDE].to_dict(orient="records"):
        bound = f"valid: {layout.valid(row['expected'], row['limit'])}"
        who, value = f"{row['engine']}:{row['profile']}", f"{row['value']:.4g}{unit_text(row['unit'])}"
        click.echo(layout.told(f"outside: {who} {row['metric']} is {value}, {bound}. {row['why']}"))


def _say_log(found: Comparison) -> None:
    """Say which log it was, and what of it is odd or not used, and why."""
    source = f"{replay.tier(found.log)}: {found.log.provenance.file}"
    click.echo(layout.told(f"{source} on {found.model}, {several(len(found.windows), 'window')}"))
    for one in replay.findings(found).to_dict(orient="records"):
        if one["what"] != "repair":
            place = f"{one['channel']}, row {one['row']}: " if one["channel"] else ""
            click.echo(layout.told(f"note: {place}{one['text']}"))
    if (part := found.log.provenance.part) is not None:
        click.echo(layout.told(f"note: Run {part} of the file alone is used (--part); the others are not."))


def _say(found: Comparison, metrics: pd.DataFrame) -> None:
    told = metrics.assign(valid=list(map(layout.valid, metrics["expected"], metrics["limit"])))
    click.echo(layout.told(section.summary(told)) + "\n")
    _say_log(found)
    speed = metrics[metrics["metric"] == "speed"]
    metrics = metrics[metrics["metric"] != "speed"]
    units = metrics["unit"].map(lambda unit: unit_text(unit, " [{}]"))
    name = (metrics["metric"] + " " + metrics["channel"]).str.strip() + units
    wide = metrics.assign(metric=name).pivot(index="metric", columns="who", values="value").loc[name.unique()]
    whose: dict[tuple[str, ...], list[str]] = {}
    for who in wide.columns:
        whose.setdefault(tuple(f"{value:.4g}" for value in wide[who]), []).append(who)
    cells = {", ".join(whom) if len(whose) > 1 else "all": list(column) for column, whom in whose.items()}
    click.echo(layout.split(list(wide.index), cells, layout.columns()))
    times = ", ".join(f"{who} {value:.3g}" for who, value in zip(speed["who"], speed["value"], strict=True))
    click.echo(layout.told(f"Speed, in times of real time: {times}"))
    for (engine, profile), why in found.skipped.items():
        click.echo(layout.told(f"skipped {engine}:{profile}: {why}"))


def _write(
    out: Path,
    found: Comparison,
    rows: pd.DataFrame,
    told: Mapping[str, Any],
    more: Mapping[str, pd.DataFrame],
    name: str,
) -> None:
    with output.folder(out, name) as made:
        study.write(made, [], records(rows), told)
        tables = {
            "replay": _metrics(found, rows), "findings": replay.findings(found),
            "residuals": replay.residuals(found), "correlations": replay.correlations(found), **more,
        }  # fmt: skip
        for stem, shown in tables.items():
            study.write_table(made / stem, shown, told)
        replay.save_motions(made / "traces", found)
        page.write(made)
