"""What the command `run` does: run, judge, write, show."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from time import perf_counter

import click

from crossbody.cases import Case, InvalidValue
from crossbody.cases.errors import OwnFault
from crossbody.engines.equations import answering, equations_of, has_equations
from crossbody.reference.compiling import count
from crossbody.reports import layout, voice
from crossbody.reports.commands import planned, repeated
from crossbody.reports.commands.run_shown import counted, show, show_code, show_time, show_unselected
from crossbody.reports.commands.shared import identity, key, where
from crossbody.reports.judging import known
from crossbody.reports.judging.audit import SEED
from crossbody.reports.judging.reach import BUDGET
from crossbody.reports.judging.truth_row import start_below
from crossbody.reports.judging.verdict import Row, Word, exit_code
from crossbody.reports.measuring.truth import TRUTH
from crossbody.reports.pages import results
from crossbody.reports.runs import files, jobs, output, store, study, watch
from crossbody.reports.runs.origin import blamed
from crossbody.reports.runs.parts import Parts
from crossbody.reports.runs.provenance import provenance
from crossbody.reports.runs.watch import LIMIT
from crossbody.reports.voice import progress

CHANGED = 10
"""Verdicts that are named of those that have changed since another run."""


def run(
    cases: Sequence[Case], sources: Sequence[str], names: Sequence[str], wanted: Sequence[str], pairs: Sequence[str],
    out: Path, rtol: float | None, settings: Sequence[str], command: str,
    against: Path | None = None, others: Sequence[Path] = (), limit: float = LIMIT,
    strict: bool = False, at_once: int = 1, budget: float = BUDGET,
) -> int:  # fmt: skip
    """Run, judge, write and show; the exit code.

    `cases` are those of `names`, with the parameters of `pairs`, `sources` the name or file of
    each; `against` is the folder of an earlier run, which may be `out` itself; `others` those of
    studies beside this one; `limit` is the time that an engine may take for one case, s; `strict`
    makes a number wrong that left its regression band; `at_once` is how many cases are run at
    once, in processes of their own; `budget` is how long the tightest run of a scene may take, s.
    """
    picks, asked = planned.checked(wanted, rtol, settings, out, against, others)
    planned.check_settings(cases, picks, asked, rtol)
    for sentence in dict.fromkeys(f"{case.name}: {finding}" for case in cases for finding in findings(case)):
        click.echo(voice.folded(f"note: {sentence}"), err=True)
    known.once = watch.alone()
    told = provenance(command, rtol=rtol, seed=SEED)
    clock, compiled = [perf_counter()], count.seconds
    decides = identity("run", cases, names, picks=picks, rtol=rtol, settings=asked, budget=budget)
    with Parts(out, command, decides) as parts:

        def do(i: int, tell: Callable[[str], None] = lambda _: None) -> int:
            with answering(cases[i]):
                result = jobs.run_case(cases[i], picks, rtol, tell, asked, limit=limit, budget=budget)
            with parts.put(key(i, cases[i])) as made:
                again = repeated.repeat(cases[i], sources[i], pairs, rtol, budget, result.case.t_end)
                rows = study.write_case(made, result, again)
                repeated.check(rows, cases[i], result, rtol, asked, budget)
            if below := start_below(result.case, result.truth):
                voice.note(f"{cases[i].label}: {below}")
            if len(cases) > 1:
                voice.note(f"{cases[i].label}: {counted(rows)}")
            return 0

        lost = _beside(cases, parts, do, at_once)
        with progress(len(cases) * (len(picks) + 1)) as tell:
            for i in _missing(cases, parts):
                do(i, tell)
        clock.append(perf_counter())
        with output.folder(out, "run") as made:
            rows = study.assemble(made, [parts.part(key(i, case)) for i, case in enumerate(cases)], told)
            _check_any(rows)  # before an earlier report is replaced
            # Pages take longer than all but the engines: what they show is printed before them, and lost by nothing.
            with blamed(made):
                times, rests = results.times_of(made)
            untold = _tell(rows, times, made, controlled=any(case.control is not None for case in cases))
            if rests and not (voice.quiet() or voice.as_json()):
                print(layout.told(rests))
            clock.append(perf_counter())
            from crossbody.reports.pages import (
                read_again,
                site,
            )  # after the verdicts: templates take longer to import than to fill

            site.write(made, against=against, others=others)
            since = [] if against is None else changed(results.verdicts_of(made), results.verdicts_of(against), against)
    read_again.check(out, rows, times)
    if untold is not None:
        raise untold
    if not voice.silent():
        for line in since:
            click.echo(layout.told(line))
        show_unselected(wanted)
        show_time([*clock, perf_counter()], times, count.seconds - compiled)
    lost_numbers = (row["regression"] for row in rows) if strict else ()
    code = max(lost, exit_code((row["verdict"] for row in rows), lost_numbers))
    if not voice.silent():
        show_code(rows, code)
    where(out)
    return code


def changed(now: Sequence[Row], before: Sequence[Row], name: Path) -> list[str]:
    """Say how many verdicts and values have changed since a run of that name, and which verdicts first."""
    from crossbody.reports.pages.index_page import changes  # with templates

    found = changes(now, before, str(name))
    words = next((table.rows for table in found.tables if table.title == "Verdicts that changed"), ())
    told = [
        f"changed: {row['who']} on {row['label']}: {row['metric']} was {row['verdict_before']}, is {row['verdict']}"
        for row in words
    ]
    more = [f"changed: {len(told) - CHANGED} more; the index lists all"] if len(told) > CHANGED else []
    return [found.text, *told[:CHANGED], *more]


def _check_any(rows: Sequence[Row]) -> None:
    """Check that some engine has run: where none has, nothing is within.

    Raises:
        InvalidValue: with why.
    """
    own = [row for row in rows if row["engine"] != TRUTH]
    if all(row["verdict"] == Word.SKIPPED for row in own) and exit_code(row["verdict"] for row in rows) == 0:
        why = " ".join(dict.fromkeys(row["why"] for row in own))
        raise InvalidValue(f"None of the selected engines can run any of the selected cases. {why}".strip())


def _tell(rows: Sequence[Row], times: results.Times, made: Path, controlled: bool) -> OSError | OwnFault | None:
    """Print the verdicts of a folder; what keeps them from being printed."""
    try:
        if voice.as_json():
            voice.result(voice.plain_rows_as_json(rows))
            return None
        show(rows, times)
        if controlled and not voice.quiet():
            show_controllers(made)
    except (OSError, OwnFault) as error:
        return error
    return None


def _missing(cases: Sequence[Case], parts: Parts) -> list[int]:
    """Cases whose part is not there."""
    return [i for i, case in enumerate(cases) if not parts.has(key(i, case))]


def _beside(cases: Sequence[Case], parts: Parts, do: Callable[[int], int], at_once: int) -> int:
    """Run the missing cases in processes beside this one; 1 if a run in one of them had to be ended, else 0.

    The largest come first, so that no process is left alone with one at the end.
    """
    missing = sorted(_missing(cases, parts), key=lambda i: -len(cases[i].q0) - len(cases[i].contacts))
    if min(at_once, len(missing)) < 2:
        return 0
    parts.begin()  # for all of them
    with progress(len(missing), 0) as tell:

        def told(k: int) -> None:
            parts.keep()
            tell(cases[missing[k]].label)

        return min(watch.beside([partial(do, i) for i in missing], at_once, told), 1)


def findings(case: Case) -> tuple[str, ...]:
    """Return sentences on what is strange in a case, and in the equations of a scene with loops."""
    if case.scene is None or not case.scene.loops:
        return case.findings
    if not has_equations(case):
        return case.findings
    return (*case.findings, *equations_of(case).findings)


def show_controllers(out: Path) -> None:
    """Print how much of each run's time was spent in a controller of the user's own."""
    told = [store.peek(out / "traces" / name) for name in files.listed(out, "traces")]
    for one in told:
        about = one["about"]
        if one.get("control_s") and about["engine"] != TRUTH:
            run = f"{about['case']}:{about['variant']} {about['engine']}:{about['profile']}"
            part = one["control_s"] / one["wall_s"]
            print(f"controller: {run} {1e3 * one['control_s']:.3g} ms, {part:.0%} of the run")
