"""The pages of a run, read again: every number in their tables is looked up in verdicts and run times.

Nothing is asked of what makes the pages: words, heads and sums stand here once more, and cells are those of the HTML.
"""

from __future__ import annotations

import html
import math
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from crossbody.cases.errors import OwnFault
from crossbody.reports.judging.verdict import Row
from crossbody.reports.pages.results import Times
from crossbody.reports.runs.files import file_name, listed

REFERENCE = "reference:compiled"
WORDS = ("crashed", "outside", "expected-outside", "within")
"""Words of what is judged, the worst first."""
DIGITS = {1: 0.51, 2: 0.051, 3: 0.0051}
"""Part of a number by which so many digits may be another one."""
NUMBERS = ("value", "expected", "limit", "known")
EXACT = 1e-12
"""Part of a sum that its order changes."""
UNITS = {"s": 1.0, "ms": 1e-3}
_TABLE = re.compile(r'<table[^>]*data-csv="([^"]*)"[^>]*>(.*?)</table>', re.DOTALL)
_LINE = re.compile(r"<tr([^>]*)>(.*?)</tr>", re.DOTALL)
_CELL = re.compile(r"<t[dh]\b([^>]*)>(.*?)</t[dh]>", re.DOTALL)
_TILE = re.compile(r'<li class="[^"]*"><strong>(\d+)</strong> ([^<]*)</li>')
_DATA = re.compile(r'data-(v|name|engine)="([^"]*)"')
_SKETCHED = re.compile(r'<small class="sketched">.*?</small>')
_TAGS = re.compile(r"<[^>]*>")
_PLACE = re.compile(r" \(([^()]* by [^()]* at [^()]*)\)$")
_OFF = re.compile(r"by (\S+ \S.*?) at ")
_CHIPS = re.compile(r'<p class="counts">(.*?)</p>', re.DOTALL)
_NUMBER = re.compile(r"(?:< )?(-?(?:\d[\d.]*(?:e[+-]\d+)?|inf))$")


@dataclass(frozen=True, slots=True)
class Cell:
    """One cell: its attributes and what it encloses."""

    about: str
    inner: str

    @property
    def text(self) -> str:
        """What is shown."""
        return " ".join(html.unescape(_TAGS.sub("", _SKETCHED.sub("", self.inner))).split())

    @property
    def value(self) -> str:
        """What it is sorted by; empty without."""
        return self._data("v")

    @property
    def name(self) -> str:
        """What is in its column; empty without."""
        return self._data("name")

    def _data(self, name: str) -> str:
        return html.unescape(dict(_DATA.findall(self.about)).get(name, ""))


Lines = list[tuple[str, list[Cell]]]
"""Engine and cells of every line; an engine is empty where none is named."""
Run = tuple[str, str]


def check(out: Path, rows: Sequence[Row], times: Times) -> None:
    """Hold the pages of a folder against what they show.

    Args:
        out: the folder.
        rows: verdicts of all runs.
        times: of all runs, s.

    Raises:
        OwnFault: naming the page and the number that is another one.
    """
    rows = [row | {name: _finite(row[name]) for name in NUMBERS} for row in rows]
    runs = by_run(rows)
    labels = list(dict.fromkeys(label for label, _ in runs))
    pages = {f"case-{file_name(label)}.html": label for label in labels}
    for name in sorted(listed(out)):
        index = name.startswith("index") and name.endswith(".html")
        if not index and name not in pages:
            continue
        text = (out / name).read_text(encoding="utf-8")
        tables = dict(_TABLE.findall(text))
        if index:
            differing = [*_of_matrix(tables, runs, times), *_of_engines(tables, runs, times)]
            differing += [*_of_tiles(text, rows), *_of_known(tables, rows)]
        else:
            mine = {who: found for (label, who), found in runs.items() if label == pages[name]}
            differing = [
                *_of_verdicts(tables, mine),
                *_of_chips(text, mine),
                *_of_glance(tables, mine, times, pages[name]),
            ]
            differing += _of_times(tables, pages[name], times)
        if differing:
            raise OwnFault(f"{name} does not show what was judged: {differing[0]}.")


def by_run(rows: Sequence[Row]) -> dict[Run, list[Row]]:
    """Return the rows of every run, by case and engine, in their order."""
    runs: dict[Run, list[Row]] = {}
    for row in rows:
        who = f"{row['engine']}:{row['profile']}"
        runs.setdefault((f"{row['case']}:{row['variant']}", who), []).append(row)
    return runs


def _finite(value: float) -> float:
    """Return a number as JSON has it, where infinite is none."""
    return value if math.isfinite(value) else math.nan


def _lines(table: str) -> Lines:
    """Return the lines of a table, its heads among them."""
    return [
        (dict(_DATA.findall(attributes)).get("engine", ""), [Cell(*found) for found in _CELL.findall(line)])
        for attributes, line in _LINE.findall(table)
    ]


def _named(tables: Mapping[str, str], end: str) -> Lines:
    """Return the lines of the table whose name ends so; none where there is no such table."""
    return next((_lines(body) for title, body in tables.items() if title.endswith(end)), [])


def counted(rows: Sequence[Row]) -> tuple[str, int, int]:
    """Return the worst word of the rows of a run, how many have it, and of how many.

    What is not outside, beside a number beyond its limit that is not judged, is not judged; then that is counted.
    """
    words = Counter(row["verdict"] for row in rows)
    total = sum(words[word] for word in WORDS)
    word = next((word for word in WORDS if words[word]), "skipped" if words["skipped"] else "not judged")
    loose = sum(map(beyond, rows))
    return ("not judged", loose, total) if word in WORDS[2:] and loose else (word, words[word], total)


def beyond(row: Row) -> bool:
    """Whether a number that is not judged is farther from what is expected than its limit."""
    return row["verdict"] == "not judged" and row["limit"] > 0.0 and 1.0 < times_out(row) < math.inf


def times_out(row: Row) -> float:
    """Return how many times its limit a number is from what is expected; infinite where that is no number."""
    off = abs(row["value"] - (0.0 if math.isnan(row["expected"]) else row["expected"]))
    if off == 0.0:
        return 0.0
    return float(off / row["limit"]) if row["limit"] > 0.0 and math.isfinite(off) else math.inf


def _of_matrix(tables: Mapping[str, str], runs: Mapping[Run, Sequence[Row]], times: Times) -> Iterator[str]:
    """Yield cells of cases and engines that are others."""
    lines = _named(tables, "-matrix")
    heads = [cell.name for cell in lines[1][1]]
    ran = {who for (_, who), rows in runs.items() if any(row["verdict"] != "skipped" for row in rows)}
    if set(heads) != (ran or {who for _, who in runs}):
        yield f"its engines, {', '.join(heads)}"
    for _, (first, *cells) in lines[2:]:
        label = next((one for one, _ in runs if first.text.startswith(f"{one} ") or first.text == one), "")
        if len(cells) != len(heads):
            yield f"{label} has {len(cells)} cells"
        for who, cell in zip(heads, cells, strict=False):
            if not _is_run(cell.value, runs.get((label, who)), times.get((label, who), (None, None))[0]):
                yield f"{who} on {label} is {cell.value!r}"
        yield from _of_worst(first.text.removeprefix(label).strip(), label, runs)


def _is_run(said: str, rows: Sequence[Row] | None, wall: float | None) -> bool:
    """Whether a cell says worst word, how many have it, error of position and run time."""
    if rows is None:
        return not said
    word, count, total = counted(rows)
    wanted = "" if not total else f"{total}" if word == "within" else f"{count} of {total}"
    wanted = f"{count} beyond" if word == "not judged" and total else wanted
    error = next((row["value"] for row in rows if row["metric"] == "position"), math.nan)
    more = said.removeprefix(f"{word} {wanted}".rstrip()).split(" · ")
    left = [text.strip() for text in more if text.strip()]
    if not math.isnan(error) and not (left and _says(left.pop(0), error, 1)):
        return False
    if wall and not (left and _lasts(left.pop(0), wall)):
        return False
    return said.startswith(f"{word} {wanted}".rstrip()) and not left


def _says(text: str, value: float, digits: int) -> bool:
    """Whether a text is a number in so many digits; a dash is none."""
    found = _NUMBER.match(text)
    if found is None or math.isnan(value):
        return text == "-" and math.isnan(value)
    return _near(float(found[1]), value, DIGITS[digits])


def _lasts(text: str, wall: float) -> bool:
    """Whether a text is a time, s, in three digits and its unit."""
    number, _, unit = text.partition(" ")
    return unit in UNITS and _says(number, wall / UNITS[unit], 3)


def _near(found: float, wanted: float, part: float) -> bool:
    return found == wanted or abs(found - wanted) <= part * abs(wanted)


def _of_worst(said: str, label: str, runs: Mapping[Run, Sequence[Row]]) -> Iterator[str]:
    """Yield whether the number beside a case is none of its worst word."""
    if not said:
        return
    found = _PLACE.search(said)
    place = found[1] if found else ""
    who, _, rest = said.removesuffix(f" ({place})").rpartition(": ")
    metric, _, number = rest.rpartition(" ")
    mine = [row for (one, _), rows in runs.items() if one == label for row in rows]
    ranks = (*WORDS[:2], "not judged", *WORDS[2:])
    least = min(ranks.index(row["verdict"]) for row in mine if _is_told(row))
    for row in mine:
        named = f"{row['engine']}:{row['profile']}".removesuffix(":") == who and row["metric"] == metric
        right = not place or row.get("where") == place
        if named and right and ranks.index(row["verdict"]) == least and _says(number, row["value"] + 0.0, 2):
            return
    yield f"{said!r} is not the worst of {label}"


def _is_told(row: Row) -> bool:
    """Whether a number can be the worst of a case: it is judged, or beyond its limit, and is off."""
    off = times_out(row)
    return (
        (row["verdict"] in WORDS[:2] or math.isfinite(off)) and off > 0.0 and (row["verdict"] in WORDS or beyond(row))
    )


def _of_engines(tables: Mapping[str, str], runs: Mapping[Run, Sequence[Row]], times: Times) -> Iterator[str]:
    """Yield numbers of engines over all cases that are others."""
    for who, cells in _by_heads(_named(tables, "-Engines")):
        mine = {label: rows for (label, one), rows in runs.items() if one in (who, f"{who}:")}
        found = [counted(rows) for rows in mine.values()]
        words = Counter(word for word, _, total in found if total or word != "not judged")
        errors = [row["value"] for rows in mine.values() for row in rows if row["metric"] == "position"]
        errors = [value for value in errors if math.isfinite(value)]
        walls = [(times.get((label, who), (0.0,))[0], times.get((label, REFERENCE), (0.0,))[0]) for label in mine]
        ratios = [mine_ / theirs for mine_, theirs in walls if mine_ and theirs]
        wanted = {
            "Cases trusted": words["within"], "Cases outside": words["outside"], "Cases not run": words["skipped"],
            "Cases expected-outside": words["expected-outside"],
            "Cases beyond a limit, not judged": words["not judged"],
            "Error, median": _of(median, errors), "Error, worst": _of(max, errors),
            "Run time over the reference's, median": _of(median, ratios),
        }  # fmt: skip
        for head, value in wanted.items():
            if head in cells and not _is_number(cells[head].value, value):
                yield f"{head!r} of {who} is {cells[head].value}, not {value:.6g}"


def _of(kind: Callable[[Sequence[float]], float], values: Sequence[float]) -> float:
    return float(kind(values)) if values else math.nan


def _is_number(said: str, wanted: float) -> bool:
    """Whether a value is a number, to what the order of a sum makes of it; nothing is none."""
    return math.isnan(wanted) if said == "" else _near(float(said), wanted, EXACT)


def _by_heads(lines: Lines) -> Iterator[tuple[str, dict[str, Cell]]]:
    """Yield the first text of every line, and its cells by their heads."""
    heads = [cell.text for cell in lines[0][1]] if lines else []
    for _, cells in lines[1:]:
        yield cells[0].text, dict(zip(heads, cells, strict=True))


def _of_tiles(text: str, rows: Sequence[Row]) -> Iterator[str]:
    """Yield counts of cases, engines and verdicts that are others."""
    wanted = {word: sum(row["verdict"] == word for row in rows) for word in (*WORDS, "skipped")}
    wanted["case"] = wanted["cases"] = len({(row["case"], row["variant"]) for row in rows})
    profiles = {(row["engine"], row["profile"]) for row in rows if row["engine"] != "truth"}
    wanted["engine profile"] = wanted["engine profiles"] = len(profiles)
    wanted["beyond a limit, not judged"] = sum(map(beyond, rows))
    audits = [row for row in rows if (row["metric"], row["verdict"]) == ("audit", "outside")]
    wanted["failed parity audits"] = wanted["failed parity audit"] = len(audits)
    for count, name in _TILE.findall(text):
        if wanted.get(name) != int(count):
            yield f"{count} {name}, not {wanted.get(name)}"


def _of_known(tables: Mapping[str, str], rows: Sequence[Row]) -> Iterator[str]:
    """Yield numbers of what is expected-outside that are others."""
    for who, cells in _by_heads(_named(tables, "-Expected-outside")):
        why = cells["Known properties"].text
        mine = [
            row for row in rows
            if row["verdict"] == "expected-outside" and f"{row['engine']}:{row['profile']}" == who
            and " ".join(row["why"].split())[1:] == why[1:]
        ]  # fmt: skip
        far = [share for share in map(times_out, mine) if math.isfinite(share)]
        wanted = {
            "Cases": float(len({(row["case"], row["variant"]) for row in mine})), "Rows": float(len(mine)),
            "Farthest [limits]": max(far, default=math.inf),
        }  # fmt: skip
        for head, value in wanted.items():
            if not _is_number(cells[head].value, value):
                yield f"{head!r} of {who} is {cells[head].value}, not {value:.6g}"


def _of_verdicts(tables: Mapping[str, str], runs: Mapping[str, Sequence[Row]]) -> Iterator[str]:
    """Yield rows of a case that are not in its table as they are."""
    lines = _named(tables, "-verdicts")
    found = Counter(
        (word.value, who, metric.text, *(one.value for one in numbers), times.value, where.text)
        for who, (word, _, metric, *numbers, _, times, where) in ((who, cells[:9]) for who, cells in lines[1:])
    )
    wanted = Counter(
        (row["verdict"], who, row["metric"], *(_text(row[name]) for name in ("value", "expected", "limit")),
         _multiple(row), " ".join((row.get("where") or "").split()))
        for who, rows in runs.items() for row in rows
    )  # fmt: skip
    for row in [*(wanted - found), *(found - wanted)]:
        yield f"{' '.join(row)} {'is not there' if row in wanted else 'is no row'}"


def _multiple(row: Row) -> str:
    """How many times its limit a number is that is beyond it, in two digits; nothing where that is no number."""
    times = times_out(row)
    off = row["verdict"] in WORDS[:3] or beyond(row)
    return f"{times:.2g}" if off and math.isfinite(times) else ""


def _of_chips(text: str, runs: Mapping[str, Sequence[Row]]) -> Iterator[str]:
    """Yield words of verdicts whose count is another one, or that are not counted."""
    rows = [row for mine in runs.values() for row in mine]
    wanted = Counter("beyond, not judged" if beyond(row) else row["verdict"] for row in rows)
    said = html.unescape(_TAGS.sub("", _CHIPS.findall(text)[0]))
    found = Counter({word.strip(): int(count) for count, word in re.findall(r"(\d+) ([^\d\n]+)", said)})
    for word in [*(wanted - found), *(found - wanted)]:
        yield f"{found[word]} {word}, not {wanted[word]}"


def _text(value: float) -> str:
    return "" if math.isnan(value) else f"{value}"


def _of_glance(tables: Mapping[str, str], runs: Mapping[str, Sequence[Row]], times: Times, label: str) -> Iterator[str]:
    """Yield cells at a glance that are none of their metric and engine."""
    lines = _named(tables, "-glance")
    heads = [cell.name for cell in lines[1][1]] if lines else []
    found = {who: {row["metric"]: row for row in rows} for who, rows in runs.items()}
    for _, (first, *cells) in lines[2:]:
        metric = first.text.rsplit(" [", 1)[0]  # and its unit
        if len(cells) != len(heads):
            yield f"{metric} has {len(cells)} cells"
        for who, cell in zip(heads, cells, strict=False):
            wall = times.get((label, who), (0.0,))[0] if who != "truth:" else 0.0  # it is no engine's
            row, said = found.get(who, {}).get(metric), cell.value
            if metric.startswith("all judged"):
                right = _is_run(said, runs.get(who), None)
            elif metric.startswith("run time"):
                right = _lasts(" ".join(said.split()[:2]), wall) if said else not wall
            else:
                right = not said if row is None else _is_value(said, row)
            if not right:
                yield f"{metric} of {who} is {said!r} at a glance"


def _is_value(said: str, row: Row) -> bool:
    """Whether a cell says the verdict of a row and its number, or what that is known to where it is below."""
    value = row["known"] if abs(row["value"]) < row["known"] else row["value"]
    off = _OFF.search(row.get("where") or "") if row["unit"] == "1" else None
    number = said.removeprefix(row["verdict"]).strip().removesuffix(f" {off[1]}" if off else "")
    return said.startswith(row["verdict"]) and _says(number, value + 0.0, 2)


def _of_times(tables: Mapping[str, str], label: str, times: Times) -> Iterator[str]:
    """Yield run times that are others."""
    for who, cells in _by_heads(_named(tables, "-Runs")):
        wall = next((wall for (one, run), (wall, _) in times.items() if one == label and run.rstrip(":") == who), 0.0)
        if "Run time [ms]" in cells and not _is_number(cells["Run time [ms]"].value, 1e3 * wall if wall else math.nan):
            yield f"the run time of {who}"
