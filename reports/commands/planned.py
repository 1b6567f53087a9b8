"""What `run --dry-run` prints: every case and engine that would be run, with its settings."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from crossbody import engines
from crossbody.cases import Case, CaseUnsupported, Value
from crossbody.cases.errors import several
from crossbody.cases.files.case import PARAMETERS
from crossbody.reports import layout, voice
from crossbody.reports.judging.reach import BUDGET
from crossbody.reports.judging.stored import words
from crossbody.reports.pages import results
from crossbody.reports.runs import choice, output

Named = Mapping[str, str]
AGAIN = "not run again where it is the witness of the truth"
RUBS = "if its motion comes to a contact with friction"
"""When the rows of a file's contacts are run: the motion tells, which a plan does not follow."""


def checked(
    wanted: Sequence[str], rtol: float | None, settings: Sequence[str],
    out: Path, against: Path | None, others: Sequence[Path],
) -> tuple[tuple[choice.Pick, ...], dict[str, Value]]:  # fmt: skip
    """Check all that can be before anything is run; the engines asked for, and their settings."""
    choice.check_tolerance(rtol)
    picks, asked = choice.picks(wanted), choice.parse_settings(settings, "--set-engine")
    choice.check_asked(asked, picks)
    output.check(out, "run")
    results.check(against, others)
    return picks, asked


def check_settings(
    cases: Sequence[Case], picks: Sequence[choice.Pick], asked: Mapping[str, Value], rtol: float | None
) -> None:
    """Check the settings of engines, if any are asked for, as these would be prepared: before the first case is run."""
    for case in cases if asked else ():
        _planned(case, picks, asked, rtol, BUDGET)


def tell(
    names: Sequence[str], wanted: Sequence[str], variant: str | None, pairs: Sequence[str], rtol: float | None,
    settings: Sequence[str], out: Path, against: Path | None, others: Sequence[Path], limit: float, budget: float,
) -> int:  # fmt: skip
    """Print what `run` would do with the same words; the exit code."""
    cases = choice.load_cases(names, variant, choice.parse_settings(pairs), limit)
    picks, asked = checked(wanted, rtol, settings, out, against, others)
    each = [(case, condition) for one in cases for case, condition in _conditions(one)]
    found = [(case, condition, _planned(case, picks, asked, rtol, budget)) for case, condition in each]
    if voice.as_json():
        voice.result(json.dumps([_plain_plan(*one) for one in found], default=str))
        return 0
    firsts: dict[tuple[str, str], tuple[str, Named, Named]] = {}  # of each case: label, parameters and engines
    for case, condition, known in found:
        counts = f"{several(len(case.v0), 'velocity', 'velocities')}, {several(len(case.contacts), 'row')}"
        click.echo(layout.told(f"{case.label}{condition and f', {condition}'}: {counts}, {case.t_end:g} s"))
        mine = {
            f"{engine}:{profile}": told if isinstance(told, str) else words(told) for engine, profile, told in known
        }
        bounded = {f"{pick.engine}:{pick.profile}" for pick in picks if choice.bounded(case, pick)}
        mine |= {who: f"{mine[who]}; {AGAIN}" for who in bounded & {choice.CVODE} if "skipped" not in mine[who]}
        label, parameters, runs = firsts.get((case.name, condition), ("", {}, {}))
        for line in (_parameter_line(_parameters(case), parameters, label), *_engine_lines(mine, runs, label)):
            click.echo(layout.told(f"  {line}".rstrip()))
        firsts.setdefault((case.name, condition), (case.label, _parameters(case), mine))
    return 0


def _parameters(case: Case) -> Named:
    """Return the parameters of a case as they are shown; of a file those that differ from what it says itself."""
    usual = {key: one.default for key, one in PARAMETERS.items()} if case.file else {}
    return {key: _plain(value) for key, value in case.parameters.items() if usual.get(key) != value}


def _parameter_line(mine: Named, first: Named, label: str) -> str:
    """Return the parameters that are not those of the first variant."""
    own = ", ".join(f"{name} {value}" for name, value in mine.items() if first.get(name) != value)
    if not label:
        return f"parameters: {own}" if own else "no parameters, or all at their defaults"
    return f"parameters: {own}; all others as for {label}" if own else f"parameters as for {label}"


def _engine_lines(mine: Named, first: Named, label: str) -> list[str]:
    """Return a line for every engine that is not run as for the first variant, and one for the others."""
    lines = [f"{who}  {told}" for who, told in mine.items() if first.get(who) != told]
    if len(lines) == len(mine):
        return lines
    return [*lines, f"{'all other engines' if lines else 'all engines'} as for {label}"]


def _conditions(case: Case) -> list[tuple[Case, str]]:
    """Return what is run of a case, and when: of a file also with the friction of its contacts."""
    if not case.file:
        return [(case, "")]
    from crossbody.cases.files.case import rubbing

    rubs = rubbing(case)
    return [(case, "")] + ([] if rubs is None else [(rubs, RUBS)])


def _plain_plan(
    case: Case, condition: str, known: Sequence[tuple[str, str, Mapping[str, Any] | str]]
) -> dict[str, Any]:
    """Return what would be run of one case, as plain values; an engine that would not run has a reason instead."""
    engine_rows = [
        {"engine": engine, "profile": profile}
        | ({"skipped": told} if isinstance(told, str) else {"settings": _finite(told)})
        for engine, profile, told in known
    ]
    return {
        "case": case.name, "variant": case.variant, "if": condition,
        "velocities": len(case.v0), "rows": len(case.contacts), "t_end": case.t_end,
        "parameters": _finite(case.parameters), "engines": engine_rows,
    }  # fmt: skip


def _finite(values: Mapping[str, Any]) -> dict[str, Any]:
    return {name: voice.finite(value) for name, value in values.items()}


def _planned(
    case: Case, picks: Sequence[choice.Pick], asked: Mapping[str, Value], rtol: float | None, budget: float
) -> list[tuple[str, str, Mapping[str, Any] | str]]:
    """Return each engine and profile with its settings, or with why it would not run."""
    given = dict(asked) | ({} if rtol is None else {"rtol": rtol})
    own = [choice.of_case(pick, case) for pick in picks]
    offers = [(pick, choice.offered(case, pick)) for pick in own if asked and not pick.skipped]
    able = [(pick.engine, pick.profile, offered) for pick, offered in offers if offered is not None]
    choice.check_known(asked, able)  # first: a name that nobody knows is told without preparing anybody's run
    return [(pick.engine, pick.profile, _settings(case, pick, given, budget)) for pick in own]


def _plain(value: Value) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value) or '""'


def _settings(case: Case, pick: choice.Pick, asked: Mapping[str, Value], budget: float) -> Mapping[str, Any] | str:
    """What an engine would be run with, or why it would not be."""
    if pick.skipped:
        return f"skipped: {pick.skipped}"
    try:
        engine, own = engines.load(pick.engine), choice.with_bound(case, pick, choice.of_pick(asked, pick), budget)
        offered = engine.offered(case, pick.profile) if own else {}
        return engine.planned(case, pick.profile, **{key: value for key, value in own.items() if key in offered})
    except CaseUnsupported as error:
        return f"skipped: {error}"
