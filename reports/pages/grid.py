"""Engines across, cases or metrics down: the table that shows at one look what can be trusted."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from crossbody.reports import metrics
from crossbody.reports.judging.parts import LARGEST, PARTS, part_of
from crossbody.reports.judging.told import FINISHED, WRONG, beyond, distance, lacking, runs_of, share, telling
from crossbody.reports.judging.verdict import Row, Word, by
from crossbody.reports.layout import bounded, unit_text
from crossbody.reports.measuring.truth import TRUTH
from crossbody.reports.pages.html import BEYOND, number
from crossbody.reports.replay.meanings import meaning

WORST = (Word.CRASHED.value, Word.OUTSIDE.value, Word.EXPECTED.value, Word.WITHIN.value)
"""Judged verdicts, the worst first."""
RANKED = (*WORST[:2], Word.INFO.value, *WORST[2:])
"""Words of runs, the worst first: one that is not judged is beyond some limit for a known cause."""
FARTHEST, NEAREST = 12, 6
"""Decades that are told apart beyond a limit, and within it."""
SHARES = (*(part_of("position", part) for part in PARTS), f"{LARGEST} {part_of('position', 'model')}")
"""Parts of the worst error of position, and what no step brings it below: they stand in the table of a case although
nothing judges them."""
KEY = (
    "finished",
    "audit",
    "position",
    *SHARES,
    "velocity",
    "event_times",
    "lam_impulse",
    "energy_drift",
    "energy_integrator",
)
"""Metrics that stand first in the table of a case."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """One engine in one line.

    Attributes:
        title: all that is known, in words.
        word: verdict, "plain" for a number that is not judged; empty where there is nothing.
        text, small: shown, and below it.
        page, anchor: where it leads: the verdicts of a page, "engine" or "engine~metric".
        heat: decades beyond a limit, 0 to FARTHEST, or from a millionth of it up; -1 where there is none.
        told: shown instead of the text, where that is no number.
    """

    title: str
    word: str = ""
    text: str = ""
    small: str = ""
    page: str = ""
    anchor: str = ""
    heat: int = -1
    told: str = ""

    @property
    def look(self) -> str:
        """What decides its sign and colour: the verdict, but of what is beyond a limit that nothing is judged by."""
        return BEYOND if self.word == Word.INFO and self.heat >= 0 else self.word


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """One line: its name, what stands beside it, the page that it leads to, a cell for every engine, and a sketch.

    The sketch is a line of points in a box of 100 by 20, as SVG writes them, of what `sketched` says. The title says
    what the line means.
    """

    text: str
    cells: Sequence[Cell]
    small: str = ""
    page: str = ""
    sketch: str = ""
    sketched: str = ""
    title: str = ""


def heads(engines: Sequence[str]) -> list[dict[str, Any]]:
    """Engines over their profiles."""
    groups: dict[str, list[str]] = {}
    for who in engines:
        engine, _, profile = who.partition(":")
        groups.setdefault(engine, []).append(profile)
    return [{"engine": engine, "profiles": profiles} for engine, profiles in groups.items()]


def names(rows: Iterable[Row]) -> list[str]:
    """Engines with their profiles, in the order of their rows, profiles of one engine side by side."""
    found = dict.fromkeys(row["who"] for row in rows)
    order = list(dict.fromkeys(who.partition(":")[0] for who in found))
    return sorted(found, key=lambda who: order.index(who.partition(":")[0]))


def worst(rows: Sequence[Row]) -> tuple[str, str]:
    """The worst word of some rows, and how many of how many judged have it.

    What is not outside, beside numbers beyond their limits that are not judged, is not judged itself.
    """
    counts = Counter(row["verdict"] for row in rows)
    total = sum(counts[word] for word in WORST)
    word = next((word for word in WORST if counts[word]), Word.SKIPPED.value if counts["skipped"] else Word.INFO.value)
    if not total:
        return word, ""
    if word not in WRONG and (loose := sum(map(beyond, rows))):
        return Word.INFO.value, f"{loose} beyond"
    return word, str(total) if word == Word.WITHIN.value else f"{counts[word]} of {total}"


def verdict(rows: Sequence[Row]) -> str:
    """The worst word of all runs and how many have it; nothing where nothing was run."""
    told = [worst(run.rows) for run in runs_of(rows)]
    words = Counter(word for word, text in told if text)
    found = next((word for word in RANKED if words[word]), "")
    if not found:
        return Word.INFO.value if any(word == Word.INFO for word, _ in told) else ""
    return "all within" if found == Word.WITHIN else f"{words[found]} {found}"


def whole(label: str, page: str, who: str, rows: Sequence[Row], wall: float | None) -> Cell:
    """The cell of one engine on one case: worst verdict, error of position and run time."""
    if not rows:
        return Cell(title=f"{who} was not selected for {label}.", told="not selected")
    word, text = worst(rows)
    error = next((row["value"] for row in rows if row["metric"] == "position"), None)
    parts = ["" if error is None or error != error else f"{error:.0e}", duration(wall)]
    said = "; ".join(dict.fromkeys(row["why"] for row in rows if row["verdict"] == word and row["why"]))
    title = f"{who} on {label}: {text} {word}. {said[:300]}".strip()
    small = " · ".join(part for part in parts if part)
    heat = max((heat_of(row) for row in rows if row["verdict"] == word), default=-1)
    told = "not run" if word == Word.SKIPPED else f"{text}, {word}" if word == Word.INFO and heat >= 0 else ""
    return Cell(title=title, word=word, text=text, small=small, page=page, anchor=who, heat=heat, told=told)


def held(row: Row) -> bool:
    """Whether a number can be set beside a limit: it is judged, or beyond one for a known cause."""
    return row["verdict"] in WORST or beyond(row)


def heat_of(row: Row) -> int:
    """How many decades a number is beyond its limit, as a step of its colour; within, beyond a millionth of it."""
    times = share(row)
    known = row["verdict"] in (Word.WITHIN, *WRONG) or times < math.inf
    if not held(row) or not known or (row["verdict"] != Word.WITHIN and not row["limit"]):
        return -1  # nothing is a number of times what must be exact, and what has no number is none
    decades = math.log10(times) if 0.0 < times < math.inf else -math.inf if times == 0.0 else math.inf
    if row["verdict"] == Word.WITHIN:
        return int(min(max(decades + NEAREST, 0.0), NEAREST))
    return int(min(max(decades, 0.0), FARTHEST))


def of_case(rows: Sequence[Row], page: str, label: str, walls: Mapping[str, float]) -> list[Line]:
    """Lines of one case: all together, what it costs (s), every metric judged for some engine, or all."""
    mine = by(rows, "who")
    engines = ran(rows)
    least = min((wall for wall in walls.values() if wall), default=0.0)
    together = [whole(label, page, who, mine[who], None) for who in engines]
    costs = [_none(who) if not walls.get(who) else _cost(walls[who], least) for who in engines]
    return [
        Line(text="all judged", small="error of position" if "position" in by(rows, "metric") else "", cells=together),
        Line(text="run time", small="relative to the fastest", cells=costs),
        *_metrics(rows, mine, engines, page),
    ]


def ran(rows: Sequence[Row]) -> list[str]:
    """Return the engines that have a number in some row, those first that are off; all where none has."""
    order, mine = names(rows), by(rows, "who")
    rank = {who: _rank(mine[who]) for who in order}
    group = {who: who.partition(":")[0] for who in order}
    first = {engine: min(rank[who] for who in order if group[who] == engine) for engine in group.values()}
    order.sort(key=lambda who: (group[who] == TRUTH, first[group[who]]))
    shown = [who for who in order if any(row["verdict"] != Word.SKIPPED for row in mine[who])] or order
    places = {engine: k for k, engine in enumerate(dict.fromkeys(group[who] for who in shown))}
    return sorted(shown, key=lambda who: (places[group[who]], rank[who]))


def _rank(rows: Sequence[Row]) -> int:
    """Return how bad the worst word of some rows is, 0 the worst."""
    word = worst(rows)[0]
    return RANKED.index(word) if word in RANKED else len(RANKED)


def _none(who: str) -> Cell:
    """The cell of an engine that has no such number; nothing for the truth, which others are held against."""
    return Cell(title="no such number", told="" if who == f"{TRUTH}:" else "none")


def _cost(wall: float, least: float) -> Cell:
    times = wall / least
    return Cell(title="", word="plain", text=duration(wall), small=f"{times:.{0 if times > 10.0 else 1}f} times")


def _metrics(rows: Sequence[Row], mine: Mapping[str, Sequence[Row]], engines: Sequence[str], page: str) -> list[Line]:
    judged = list(filter(held, rows))
    first = {metric: min(map(_urgent, those)) for metric, those in by(judged, "metric").items()}
    if "position" in first:
        first |= dict.fromkeys(SHARES, first["position"])
    judged += [row for row in rows if judged and row["metric"] in SHARES]
    units = {row["metric"]: unit_text(row["unit"], "[{}]") for row in judged or rows}
    key = [name for name in KEY if name in units]
    order = sorted(units, key=lambda name: (first.get(name, ()), key.index(name) if name in key else len(key)))
    values = {who: {row["metric"]: row for row in mine[who]} for who in engines}
    return [
        Line(
            text=name,
            small=units[name],
            title=_meaning(name),
            cells=[_value(values[who][name], page) if name in values[who] else _none(who) for who in engines],
        )
        for name in order
    ]


def _meaning(metric: str) -> str:
    """Say what a metric measures; nothing of those that a case brings along, and of parts of errors."""
    return metrics.summary(metric) if metric in metrics.names() else meaning(metric)


def _urgent(row: Row) -> tuple[Any, ...]:
    """Sort runs that did not finish first, then what is beyond its limit; of each what tells most."""
    failed = row["metric"] == FINISHED and row["verdict"] in WRONG
    return not failed, not share(row) > 1.0, *telling(row)


def _value(row: Row, page: str) -> Cell:
    limit = row["limit"]
    allowed = f", limit {number(limit)}" if limit is not None and limit == limit else ""
    below, value = bounded(row["value"], row["known"])
    place = f" ({row['where']})" if row.get("where") else ""
    unit = unit_text(row["unit"])
    title = f"{row['who']}, {row['metric']}: {below}{number(value)}{unit}{allowed}{place}. {row['why']}"
    anchor = f"{row['who']}~{row['metric']}"
    text = below + short(value)
    told = lacking(row) if text == "-" else ""
    small = distance(row) if row["metric"] in KEY else ""
    return Cell(
        title=title, word=row["verdict"], text=text, small=small, page=page, anchor=anchor, heat=heat_of(row), told=told
    )


def short(value: float | None) -> str:
    """A number in two or three digits."""
    if value is None or value != value:
        return "-"
    value += 0.0  # no -0
    return f"{value:.1e}" if value and not 1e-3 <= abs(value) < 1e4 else f"{value:.3g}"


def duration(wall: float | None) -> str:
    """A run time in three digits and its unit."""
    if not wall:
        return ""
    return f"{wall:.3g} s" if wall >= 1.0 else f"{1e3 * wall:.3g} ms"
