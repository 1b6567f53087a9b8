"""What the command `run` prints: a sentence, a table that fits the terminal, and every row that is wrong."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise

import click

from crossbody import engines
from crossbody.reports import layout, voice
from crossbody.reports.commands import printed
from crossbody.reports.judging.parts import PARTS, part_of
from crossbody.reports.judging.told import EngineRun, beyond, runs_of, sentence
from crossbody.reports.judging.verdict import NOT_MEASURED, Regression, Row, Word
from crossbody.reports.layout import NO_BREAK, unit_text
from crossbody.reports.measuring.truth import TRUTH
from crossbody.reports.pages.results import Times
from crossbody.reports.runs.choice import DEFAULT_ENGINES

MANY = 4  # cases that are named of those that an engine could not run
SHOWN = {"position": "position", **{part: part_of("position", part) for part in PARTS}}
"""Errors in the table by their heads: the parts of the worst error of position add up to it."""
RELATIVE = (
    "Errors of position and their parts are relative to how far each coordinate moves, turns to a radian; touches are "
    "laid on the truth's first where that brings motions nearer."
)
EXPECTED = Word.EXPECTED.replace("-", "-\n")
"""Head of the numbers that are outside as far as a known property explains, in two lines."""
COUNTED: dict[str, Callable[[Row], bool]] = {
    "within": lambda row: row["verdict"] == Word.WITHIN,
    EXPECTED: lambda row: row["verdict"] == Word.EXPECTED,
    "beyond": beyond,
    "outside": lambda row: row["verdict"] == Word.OUTSIDE,
}
"""Rows that are counted in the table by the heads of their columns."""
COLOURS = {"within": "green", EXPECTED: "yellow", "beyond": "yellow", "outside": "red"}
EMPTY = {"-", "0", ""}  # cells that say nothing
LEFT_OUT = ("in all [s]", "importer", "within", "step", "model", EXPECTED, "beyond", "time [ms]")
"""Columns that go, in this order, where the table is too wide."""


def counted(rows: Sequence[Row]) -> str:
    """Return how many rows have each verdict, and how many that are not judged are beyond a limit."""
    loose = sum(map(beyond, rows))
    more = {Word.INFO: f" ({loose} beyond a limit)"} if loose else {}
    found = Counter(row["verdict"] for row in rows).most_common()
    return ", ".join(f"{count} {word}{more.get(word, '')}" for word, count in found)


def show(rows: Sequence[Row], times: Times) -> None:
    """Print who is off and by how much, a line a run, every row that is wrong, and what could not run.

    Raises:
        OwnFault: if that is not what the rows say; it is printed all the same.
    """
    runs = runs_of(rows)
    said = "\n".join(layout.told(line, 2) for line in sentence(runs).splitlines())
    above = [said, table(runs, times, layout.columns()), layout.told(counted(rows))]
    lines = wrong(runs)
    lines += [_lost(run, row) for run in runs for row in run.rows if row["regression"] == Regression.LOST]
    texts = [*above, *map(layout.told, [*lines, *([] if voice.quiet() else [*_unmeasured(runs), *_absent(runs)])])]
    for i, text in enumerate(texts):
        if i >= len(above) or not voice.quiet():
            click.echo(text + "\n" * (i < len(above) - 1))
        if i == 1 and not voice.quiet() and _relative(runs):
            click.echo(layout.told(RELATIVE) + "\n")
    printed.check(texts, rows, times, layout.columns())


def show_code(rows: Sequence[Row], code: int) -> None:
    """Print how many numbers are off that the exit code does not count, if there are any."""
    known, loose = sum(row["verdict"] == Word.EXPECTED for row in rows), sum(map(beyond, rows))
    told = [
        f"{count} {what}" for count, what in ((known, Word.EXPECTED), (loose, "beyond a limit but not judged")) if count
    ]
    if code == 0 and told:
        click.echo(layout.told(f"Exit code 0: nothing is outside. Not counted: {', '.join(told)}."))


def _relative(runs: Sequence[EngineRun]) -> bool:
    """Return whether the table has errors of position."""
    return any(row["metric"] in SHOWN.values() and row["value"] == row["value"] for run in runs for row in run.rows)


def show_unselected(wanted: Sequence[str]) -> None:
    """Print, where no engine was asked for by name, which others there are."""
    others = [name for name in engines.names() if name not in DEFAULT_ENGINES]
    if others and not wanted:
        click.echo(layout.told(f"Not selected: {', '.join(others)}; -e NAME runs one, if it is installed."))


def show_time(clock: Sequence[float], times: Times, compiling: float = 0.0) -> None:
    """Print where the time of the command went.

    Times of cases at once, or of an earlier attempt, are no parts of this time.

    Args:
        clock: when runs, verdicts and pages began, and all ended, s.
        times: of the engines.
        compiling: time that went into compiling, which is part of that of the runs, s.

    Raises:
        OwnFault: if its parts are not those of the runs; it is printed all the same.
    """
    spent = {"compiling": compiling}
    for (_, who), (_, whole) in times.items():
        spent[who.partition(":")[0]] = spent.get(who.partition(":")[0], 0.0) + (whole or 0.0)
    runs, verdicts, pages = (later - earlier for earlier, later in pairwise(clock))
    parts = [
        f"{who} {seconds:.1f}" for who, seconds in sorted(spent.items(), key=lambda one: -one[1]) if seconds >= 0.05
    ]
    rest = runs - sum(spent.values())
    told = f" ({', '.join([*parts, f'truths {rest:.1f}'])})" if parts and rest >= 0.0 else ""
    total = clock[-1] - clock[0]
    text = f"Time: {total:.1f} s: runs {runs:.1f}{told}, verdicts {verdicts:.1f}, pages {pages:.1f}"
    click.echo(layout.told(text))
    printed.check_times(text, times)


def table(runs: Sequence[EngineRun], times: Times, width: int) -> str:
    """Lay out a line a run below the name of its case; columns that say nothing or do not fit are out."""
    runs = [run for run in runs if (run.label, run.who) in times or not run.skipped]
    columns = {name: [_error(run, metric) for run in runs] for name, metric in SHOWN.items()}
    walls = [times.get((run.label, run.who), (None, None)) for run in runs]
    columns["time [ms]"] = [_number(None if wall is None else 1e3 * wall) for wall, _ in walls]
    columns["in all [s]"] = [_number(whole) for _, whole in walls]
    for name, counts in COUNTED.items():
        columns[name] = [str(sum(map(counts, run.rows))) for run in runs]
    columns = {name: cells for name, cells in columns.items() if name == "outside" or set(cells) - EMPTY}
    return layout.laid_out(
        [run.who.removesuffix(":") for run in runs], columns, width, above=[run.label for run in runs],
        left_out=LEFT_OUT, colours=COLOURS,
    )  # fmt: skip


def _error(run: EngineRun, metric: str) -> str:
    """A number in two digits, or below what it is known to."""
    row: Mapping[str, float] = next((row for row in run.rows if row["metric"] == metric), {})
    below, number = layout.bounded(row.get("value"), row.get("known"))
    return "-" if number != number else f"{below}{number:.1e}"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.0f}" if value >= 1e3 else f"{value:.3g}"


def wrong(runs: Sequence[EngineRun]) -> list[str]:
    """Say what is wrong: a sentence for each run that did not finish, a line a number, and each reason once."""
    found: dict[str, list[str]] = {}
    for run in (run for run in runs if run.failed is None):
        for row in run.wrong:
            found.setdefault(row["why"], []).append(_wrong(run, row))
    lines = [_unfinished(run, run.failed) for run in runs if run.failed]
    for why, (first, *rest) in found.items():
        lines += [first, *rest, f"The reason of these {len(rest) + 1}: {why}"] if rest else [f"{first}. {why}"]
    return lines


def _unfinished(run: EngineRun, row: Row) -> str:
    rest = len(run.wrong) - 1
    more = f" and the {rest} numbers that this makes wrong" if rest else ""
    do = f"The report has its motion up to there{more}; a shorter --t-end judges it up to there."
    return f"{row['verdict']}: {run.label} {run.who} did not finish. {row['why']} {do}"


def _wrong(run: EngineRun, row: Row) -> str:
    number = ""
    statement = run.who.startswith(TRUTH) and math.isnan(row["value"])  # of a case: no number is missing
    if row["verdict"] == Word.OUTSIDE and not statement:
        size = f"{row['value']:.4g}{unit_text(row['unit'])}".replace(" ", NO_BREAK)
        number = " has no number" if math.isnan(row["value"]) else f" {size}"
        number += "" if math.isnan(row["limit"]) else f", limit{NO_BREAK}{row['limit']:.4g}"
    place = f" ({row['where']})" if row.get("where") else ""
    return f"{row['verdict']}: {run.label} {run.who} {row['metric']}{number}{place}"


def _lost(run: EngineRun, row: Row) -> str:
    if math.isnan(row["band"]):
        return f"worse than the stored run: {run.label} {row['metric']}. {row['why']}"
    off = abs(row["value"] - (0.0 if math.isnan(row["expected"]) else row["expected"]))
    value = f"{off:.4g}{unit_text(row['unit'])} from the claimed number, band {row['band']:.3g}"
    what = "worse than" if not off <= row["band"] else "not the number that this version of the engine gave in"
    return f"{what} the stored run: {run.label} {run.who} {row['metric']} {value}"


def _unmeasured(runs: Sequence[EngineRun]) -> list[str]:
    """One line a reason for which the table has no number of a part of an error."""
    parts = {metric: head for head, metric in SHOWN.items() if head in PARTS}
    found: dict[str, dict[str, list[str]]] = {}
    for run in runs:
        for row in (row for row in run.rows if row["metric"] in parts and not math.isfinite(row["value"])):
            if row["why"].startswith(NOT_MEASURED):
                those = found.setdefault(row["why"].removeprefix(NOT_MEASURED), {})
                those.setdefault(f"{run.who} on {run.label}", []).append(parts[row["metric"]])
    return [f"not measured: {_some(mine)}. {why}" for why, mine in found.items()]


def _some(mine: Mapping[str, Sequence[str]]) -> str:
    named = [f"{' and '.join(heads)} of {who}" for who, heads in mine.items()]
    return "; ".join(named[:MANY]) + (f"; and {len(named) - MANY} more" if len(named) > MANY else "")


def _absent(runs: Sequence[EngineRun]) -> list[str]:
    """One line a reason for which engines could not run."""
    found: dict[str, list[EngineRun]] = {}
    for run in (run for run in runs if run.skipped):
        found.setdefault(run.rows[0]["why"], []).append(run)
    return [
        f"skipped: {', '.join(dict.fromkeys(run.who for run in mine))} on {_places(mine)}. {why}"
        for why, mine in found.items()
    ]


def _places(runs: Sequence[EngineRun]) -> str:
    labels = list(dict.fromkeys(run.label for run in runs))
    return ", ".join(labels) if len(labels) <= MANY else f"{len(labels)} cases"
