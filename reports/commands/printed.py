"""What `run` has printed, read again: every cell, count and line is looked up in the rows by what stands beside it.

Nothing is asked of what lays the table out: heads, metrics and words stand here once more.
"""

from __future__ import annotations

import math
import re
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

import click

from crossbody.cases.errors import OwnFault
from crossbody.reports.judging.verdict import Row
from crossbody.reports.pages.read_again import Run, beyond, by_run
from crossbody.reports.pages.results import Times

ERRORS = {
    "position": "position", "importer": "position (importer)", "model": "position (model)",
    "step": "position (step)",
}  # fmt: skip
EXPECTED = "expected-"
"""The first line of the head of what is expected-outside."""
COUNTS = {"within": ("within",), EXPECTED: ("expected-outside",), "outside": ("outside",), "beyond": ()}
"""Words that the heads of columns count; of those beyond a limit none."""
TIMES = {"time [ms]": (0, 1e3), "in all [s]": (1, 1.0)}
"""Which time of a run stands below a head, and how many of its unit a second is."""
DIGITS = {"errors": 0.051, "times": 0.0051, "numbers": 0.00051}
"""Part of a number by which two, three and four digits may be another one."""
STAGES, TENTH = ("runs", "verdicts", "pages"), 0.0501
"""Stages of the command, whose times are said to a tenth of a second, and by how much that may be off, s."""
WIDEST = 12
"""Columns that a cell takes at most."""
WRONG = ("outside", "crashed")
_SENTENCE = re.compile(r"(\d+) of (\d+) runs (?:is|are) within all limits")
_SPENT = re.compile(r"(Time:|[\w.-]+) (\d+\.\d)(?![\d.])")
_COUNT = re.compile(r"(\d+) ([a-z -]+?)(?: \((\d+) beyond a limit\))?(?:, |$)")


def check(printed: Sequence[str], rows: Sequence[Row], times: Times, width: int) -> None:
    """Hold what was printed against rows and times.

    Args:
        printed: the sentence, the table, the counts, and each line below; not all of it if little is to be said.
        rows: verdicts of all runs.
        times: of all runs.
        width: columns that there are for the table.

    Raises:
        OwnFault: naming what is another one.
    """
    runs = by_run(rows)
    plain = [" ".join(click.unstyle(text).split()) for text in printed]
    table = click.unstyle(printed[1]).splitlines() or [""]
    differing = [*_of_sentence(plain[0], runs), *_of_table(table, runs, times, width)]
    differing += [*_of_counts(plain[2], rows), *_of_lines(plain[3:], runs)]
    if differing:
        raise OwnFault(f"What was printed is not what was judged: {differing[0]}.")


def check_times(text: str, times: Times) -> None:
    """Hold the line of where the time went against the times of runs: of each engine the sum, and all add up.

    Raises:
        OwnFault: naming what does not.
    """
    said = {name: float(number) for name, number in _SPENT.findall(" ".join(click.unstyle(text).split()))}
    within = {name: seconds for name, seconds in said.items() if name not in ("Time:", *STAGES)}
    whole: defaultdict[str, float] = defaultdict(float)
    for (_, who), (_, seconds) in times.items():
        whole[who.partition(":")[0]] += seconds or 0.0
    sums = [said["Time:"] - sum(said[name] for name in STAGES)]
    sums += [said["runs"] - sum(within.values())] if within else []
    off = [abs(one) / (1 + len(STAGES) + len(whole)) for one in sums]  # what is less than half of a tenth is not said
    if within or sum(whole.values()) < said["runs"] - TENTH:  # else cases ran at once
        off += [abs(seconds - within.get(name, 0.0)) for name, seconds in whole.items()]
    if max(off) > TENTH:
        raise OwnFault(f"The times that were printed are not those of the runs: {text!r}.")


def counted(rows: Sequence[Row]) -> dict[str, int]:
    """Return how many rows stand below each head of a count."""
    found = {head: sum(row["verdict"] in words for row in rows) for head, words in COUNTS.items()}
    return found | {"beyond": sum(map(beyond, rows))}


def kinds(runs: Mapping[Run, Sequence[Row]]) -> Counter[str]:
    """Count runs of engines: those of which something was judged, and of them those that are within all limits."""
    found = Counter[str]()
    for (_, who), rows in runs.items():
        counts = counted(rows)
        off = counts[EXPECTED] + counts["beyond"] + sum(row["verdict"] in WRONG for row in rows)
        held = any(row["verdict"] == "within" and row["metric"] != "finished" for row in rows)
        if not who.startswith("truth:"):
            found.update({"judged": int(off > 0 or held), "within": int(off == 0 and held)})
    return found


def _of_sentence(text: str, runs: Mapping[Run, Sequence[Row]]) -> Iterator[str]:
    """Yield what differs of how many runs are within."""
    found, said = kinds(runs), _SENTENCE.match(text)
    if said is None:
        said_of_one = (int(text.startswith("The run is ")), int(text.startswith("The run is within")))
        if said_of_one != (found["judged"], found["within"]) and found["judged"]:
            yield f"{found['within']} of {found['judged']} runs are within, not as in {text[:60]!r}"
    elif (int(said[1]), int(said[2])) != (found["within"], found["judged"]):
        yield f"{found['within']} of {found['judged']} runs are within, not {said[1]} of {said[2]}"


def _of_counts(text: str, rows: Sequence[Row]) -> Iterator[str]:
    """Yield what differs of how many rows have each verdict."""
    said = {word: int(count) for count, word, _ in _COUNT.findall(text)}
    loose = [int(more) for *_, more in _COUNT.findall(text) if more]
    if said != dict(Counter(row["verdict"] for row in rows)) or sum(loose) != sum(map(beyond, rows)):
        yield f"its counts, {text!r}"


def _of_lines(lines: Sequence[str], runs: Mapping[Run, Sequence[Row]]) -> Iterator[str]:
    """Yield rows that are wrong without a line that says so, with their number and limit."""
    for (label, who), rows in runs.items():
        wrong = [row for row in rows if row["verdict"] in WRONG]
        if failed := [row for row in wrong if row["metric"] == "finished"]:
            wrong = failed
        for row in wrong:
            begun = f"{row['verdict']}: {label} {who} {'did not finish' if failed else row['metric']}"
            mine = [line[len(begun) :] for line in lines if re.match(rf"{re.escape(begun)}(?:[ .]|$)", line)]
            if not any(failed or row["verdict"] == "crashed" or _says(more.split(), row) for more in mine):
                yield f"{begun} is not told"


def _says(words: Sequence[str], row: Row) -> bool:
    """Whether words begin with a number, and name its limit."""
    numbers = [float(word) for word in (one.strip(".,") for one in words[:1]) if _is_number(word)]
    known = math.isnan(row["value"]) or (bool(numbers) and _near(numbers[0], row["value"], DIGITS["numbers"]))
    limits = [float(b.strip(".,")) for a, b in pairwise(words) if a == "limit" and _is_number(b.strip(".,"))]
    return known and (math.isnan(row["limit"]) or any(_near(one, row["limit"], DIGITS["numbers"]) for one in limits))


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _near(found: float, wanted: float, part: float) -> bool:
    largest = sys.float_info.max  # what two digits may round up to infinity
    return found == wanted or abs(max(min(found, largest), -largest) - wanted) <= part * abs(wanted)


def _of_table(lines: Sequence[str], runs: Mapping[Run, Sequence[Row]], times: Times, width: int) -> Iterator[str]:
    """Yield what differs of the cells, and columns and runs that are not there."""
    places = {head: place for head in (*ERRORS, *TIMES, *COUNTS) if (place := _end(lines[0], head))}
    shown = {run: rows for run, rows in runs.items() if run in times or {row["verdict"] for row in rows} != {"skipped"}}
    second = len(lines) > 1 and lines[1].strip() == "outside"  # of a head
    own = [line for line in lines[1 + second :] if line.startswith("  ")]
    if len(own) != len(shown):
        yield f"{len(shown)} runs are {len(own)} lines"
    missing = [head for head in (*ERRORS, *TIMES, *COUNTS) if head not in places]
    fits = max(map(len, lines)) + sum(2 + max(len(head), WIDEST) for head in missing) <= width
    for line, ((label, who), rows) in zip(own, shown.items(), strict=False):
        if not (who.rstrip(":")).startswith(line.split()[0].rstrip("…")):
            yield f"{label} {who} stands as {line.split()[0]}"
        ends = sorted(places.values())
        for head, end in places.items():
            begin = max([one for one in ends if one < end], default=len(line) - len(line.lstrip()))
            cell = (line[begin:end] if begin in ends else line[:end].split("  ")[-1]).strip()
            if not _is(head, cell, wanted := _wanted(head, rows, times.get((label, who)))):
                yield f"{head} of {label} {who} is {cell!r}, not {wanted:.6g}"
        for head in missing if fits else ():
            wanted = _wanted(head, rows, times.get((label, who)))
            if not math.isnan(wanted) and (wanted or head in ERRORS):
                yield f"{head} of {label} {who}, {wanted:.6g}, is not there"


def _end(heads: str, head: str) -> int | None:
    """Return where a head ends."""
    found = re.search(rf"(?:^|  ){re.escape(head)}(?:  |$)", heads)
    return heads.index(head, found.start()) + len(head) if found else None


def _wanted(head: str, rows: Sequence[Row], time: tuple[float, float | None] | None) -> float:
    """Return the number below a head; NaN where there is none."""
    if head in COUNTS:
        return float(counted(rows)[head])
    if head in TIMES:
        place, unit = TIMES[head]
        value = None if time is None else time[place]
        return math.nan if value is None else unit * value
    row = next((row for row in rows if row["metric"] == ERRORS[head]), None)
    if row is None:
        return math.nan
    return float(row["known"]) if abs(row["value"]) < row["known"] else float(row["value"])


def _is(head: str, cell: str, wanted: float) -> bool:
    """Whether a cell says a number in the digits of its column; none is a dash."""
    if math.isnan(wanted) or cell == "-":
        return math.isnan(wanted) and cell == "-"
    part = 0.0 if head in COUNTS else DIGITS["errors"] if head in ERRORS else DIGITS["times"]
    text = cell.removeprefix("< ")
    return _is_number(text) and _near(float(text), wanted, part)
