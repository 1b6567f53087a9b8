"""The command that repeats a row: said, and read again as the command line reads it."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from crossbody.cases import Case, Value, installed
from crossbody.cases.errors import OwnFault
from crossbody.cases.loading import build, module, resolve
from crossbody.reports.judging.reach import BUDGET
from crossbody.reports.judging.run_verdicts import Entry
from crossbody.reports.judging.verdict import Row
from crossbody.reports.measuring.truth import TRUTH
from crossbody.reports.runs.choice import Pick, of_pick, parse_settings
from crossbody.reports.runs.jobs import CaseResult


def repeat(case: Case, source: str, pairs: Sequence[str], rtol: float | None, budget: float, t_end: float) -> str:
    """Return the command that reproduces the rows of one case, but for an engine and its settings.

    Args:
        case: as it was asked for.
        source: name or file by which it is loaded.
        pairs: its parameters, as they were given.
        rtol: tolerance of all engines.
        budget: of the tightest run of its truth, s.
        t_end: to which it was followed, s.
    """
    words = ["crossbody", "run", source, "--variant", case.variant]
    if t_end != case.t_end:
        pairs = [*(pair for pair in pairs if "t_end" not in parse_settings([pair])), f"t_end={t_end!r}"]
    words += [word for pair in pairs for word in ("--set", pair)]
    words += ["--rtol", f"{rtol!r}"] if rtol is not None else []
    words += ["--budget", f"{budget!r}"] if budget != BUDGET else []
    return shlex.join(words + installed.options())


def check(
    rows: Sequence[Row], case: Case, result: CaseResult, rtol: float | None, settings: Mapping[str, Value],
    budget: float,
) -> None:  # fmt: skip
    """Read the command of every row again, and hold it against what was run.

    Args:
        rows: of one case.
        case: as it was asked for.
        result: its runs.
        rtol: tolerance of all engines.
        settings: of engines, as they were asked for.
        budget: of the tightest run of its truth, s.

    Raises:
        OwnFault: naming the first command that would run something else, and what of it.
    """
    entries = {(one.engine, one.profile): one for one in result.entries}
    for command, engine, profile in dict.fromkeys((row["command"], row["engine"], row["profile"]) for row in rows):
        entry = None if engine == TRUTH else entries[engine, profile]
        differing = [*_of_case(given := _read(command), case, result.case.t_end), *_of_engine(given, entry, settings)]
        differing += [name for name, value in (("rtol", rtol), ("budget", budget)) if given[name] != value]
        if differing:
            raise OwnFault(f"{command} would run another {differing[0]}.")


def _read(command: str) -> Mapping[str, Any]:
    """Return what the options and words of a command mean to the command line."""
    from crossbody.reports import cli  # which has imported this module

    program, name, *words = shlex.split(command)
    if (program, name) != ("crossbody", cli.run.name):
        raise OwnFault(f"{command} is no command that runs a case.")
    return cli.run.make_context(name, words).params


def _of_case(given: Mapping[str, Any], case: Case, t_end: float) -> Iterator[str]:
    """Yield what differs of a case that was followed to t_end, s."""
    (source,), variant, defined = given["names"], given["variant"], module(given["names"][0])
    elsewhere = case.file and Path(source).resolve() != Path(case.file).resolve()
    if elsewhere or variant != case.variant or variant not in defined.VARIANTS:
        yield "case"
        return
    pairs = parse_settings(given["pairs"])
    wanted = {**case.parameters, **({} if t_end == case.t_end else {"t_end": t_end})}
    if resolve(case.label, defined.PARAMETERS, defined.VARIANTS[variant], pairs) != wanted:
        again = build(source, variant, pairs)  # which may have settled what is left open
        wanted["t_end"] = t_end
        found = {**again.parameters, "t_end": again.t_end}
        yield from (name for name in {**wanted, **found} if found.get(name) != wanted.get(name))


def _of_engine(given: Mapping[str, Any], entry: Entry | None, settings: Mapping[str, Value]) -> Iterator[str]:
    """Yield what differs of an engine and its settings; `entry` is None for the truth."""
    asked = parse_settings(given["settings"], "--set-engine")
    if entry is None:
        yield from [*given["wanted"], *asked]
        return
    if given["wanted"] != (f"{entry.engine}:{entry.profile}",):
        yield "engine"
    mine, pick = dict(asked), Pick(engine=entry.engine, profile=entry.profile)
    wanted = {name: value for name, value in of_pick(settings, pick).items() if name in entry.settings}
    yield from (name for name in {**mine, **wanted} if entry.run is not None and mine.get(name) != wanted.get(name))
