"""What `run --dry-run` prints: every case and engine that would be run, with its settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import click

from crossbody import engines
from crossbody.cases import Case, CaseUnsupported, Value
from crossbody.reports import layout
from crossbody.reports.judging.stored import words
from crossbody.reports.runs import choice


def tell(
    names: Sequence[str], wanted: Sequence[str], variant: str | None, pairs: Sequence[str], settings: Sequence[str]
) -> int:
    """Print what `run` would do with the same words; the exit code."""
    cases = choice.load_cases(names, variant, choice.parse_settings(pairs))
    picks, asked = choice.picks(wanted), choice.parse_settings(settings, "--set-engine")
    choice.check_asked(asked, picks)
    for case in cases:
        parameters = ", ".join(f"{name} {_plain(value)}" for name, value in case.parameters.items())
        click.echo(f"{case.label}: {len(case.v0)} velocities, {len(case.contacts)} rows, {case.t_end:g} s")
        click.echo(layout.told(f"  parameters: {parameters}") if parameters else "  no parameters")
        known: list[tuple[str, str, Mapping[str, Any]]] = []
        for pick in (choice.of_case(one, case) for one in picks):
            told = _settings(case, pick, asked)
            if not isinstance(told, str):
                known.append((pick.engine, pick.profile, told))
            line = f"  {pick.engine}:{pick.profile}  {told if isinstance(told, str) else words(told)}"
            click.echo(layout.told(line.rstrip()))
        choice.check_known(asked, known)
    return 0


def _plain(value: Value) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value) or '""'


def _settings(case: Case, pick: choice.Pick, asked: Mapping[str, Value]) -> Mapping[str, Any] | str:
    """What an engine would be run with, or why it would not be."""
    if pick.skipped:
        return f"skipped: {pick.skipped}"
    try:
        engine, own = engines.load(pick.engine), choice.of_pick(asked, pick)
        told = engine.planned(case, pick.profile)
        own = {key: value for key, value in own.items() if key in told}
        return engine.planned(case, pick.profile, **own) if own else told
    except CaseUnsupported as error:
        return f"skipped: {error}"
