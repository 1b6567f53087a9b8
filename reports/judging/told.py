"""Which runs are within all limits, which are off, how much and by which part of the error: one sentence."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from crossbody.reports.judging.parts import PARTS, SPLIT, part_of
from crossbody.reports.judging.remedies import remedy
from crossbody.reports.judging.truth_row import TOUCHING
from crossbody.reports.judging.verdict import IDENTITIES, LACKS, UNMEASURED, Row, Word
from crossbody.reports.layout import unit_text, valid
from crossbody.reports.measuring.truth import TRUTH

WRONG = (Word.CRASHED, Word.OUTSIDE)
SHORT = re.compile(r"(?:Followed|Known up) to (.*? s)(?: of .*? s)?: (.*?)\.(?: |$)")
"""What a truth's row says of a horizon shorter than was asked for, or a motion known in part."""
FINISHED = "finished"  # the row that says whether a run came to its end
_CLAUSE = re.compile(r"[:;.](?:\s|$)")
"""What ends the first statement of a reason; a comma does not, which stands in lists."""
_WHERE = re.compile(r"\bby (\S+) (\S.*?) at ")
"""How far a coordinate is off, and its unit, as a number of position says it."""
NAMED = 3  # runs that the sentence names
NEXT = "\n- "  # begins each line of a sentence but the first
QUANTITIES = frozenset(
    {
        "position", "angle_error", "velocity", "lam_error", "lam_impulse", "lam_impulse_path", "collision_impulse",
        "friction_impulse", "friction_work", "contact_work", "energy_drift", "energy_integrator", "energy_law",
        "event_times", "mode_times", "slip_times", "stick_times",
    }
)  # fmt: skip
"""Metrics of motion, force, energy and events: they tell more than identities of records, laws and counts."""


@dataclass(frozen=True, slots=True)
class EngineRun:
    """Rows of one engine on one case.

    Attributes:
        label: case:variant.
        who: engine:profile.
        rows: its verdicts.
    """

    label: str
    who: str
    rows: Sequence[Row]

    @property
    def wrong(self) -> list[Row]:
        """Rows that are outside or crashed, the farthest out first."""
        return sorted((row for row in self.rows if row["verdict"] in WRONG), key=farthest)

    @property
    def first(self) -> Row:
        """The number that is named of what is wrong: the farthest out; a quantity before one that there is not."""
        measured = (row for row in self.wrong if row["metric"] in QUANTITIES and math.isfinite(share(row)))
        worst = self.wrong[0]
        return worst if math.isfinite(share(worst)) else min(measured, key=telling, default=worst)

    @property
    def failed(self) -> Row | None:
        """The row that says why it ended early, if it did: its other numbers follow from that."""
        return next((row for row in self.wrong if row["metric"] == FINISHED), None)

    @property
    def judged(self) -> bool:
        """Whether any number of it was held to a limit, beside that it finished."""
        said = (Word.WITHIN, Word.EXPECTED)
        held = any(row["verdict"] in said and row["metric"] != FINISHED for row in self.rows)
        return held or bool(self.wrong) or self.unbounded is not None

    @property
    def deviates(self) -> Row | None:
        """The number beyond its limit within bounds that are known of the engine: of position if there is one."""
        return min((row for row in self.rows if row["verdict"] == Word.EXPECTED), key=telling, default=None)

    @property
    def unbounded(self) -> Row | None:
        """The number beyond its limit that may be so, unknown how far: of position if there is one."""
        return min(filter(beyond, self.rows), key=telling, default=None)

    @property
    def skipped(self) -> bool:
        """Whether it did not run."""
        return all(row["verdict"] == Word.SKIPPED for row in self.rows)


Deviating = Sequence[tuple[EngineRun, Row]]
"""Runs, each with the number that is named of it."""


def runs_of(rows: Iterable[Row]) -> list[EngineRun]:
    """Rows by case and engine, in their order."""
    found: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        found.setdefault((f"{row['case']}:{row['variant']}", f"{row['engine']}:{row['profile']}"), []).append(row)
    return [EngineRun(label, who, mine) for (label, who), mine in found.items()]


def beyond(row: Row) -> bool:
    """Whether a number is beyond its limit for a known cause, but not judged: nobody knows how far it may be."""
    return row["verdict"] == Word.INFO and (row["limit"] or 0.0) > 0.0 and 1.0 < share(row) < math.inf


def share(row: Row) -> float:
    """How many times its limit a number is; infinite where there is no number, or it may be none but that claimed."""
    value, expected, limit = (math.nan if row[name] is None else row[name] for name in ("value", "expected", "limit"))
    off = abs(value - (0.0 if math.isnan(expected) else expected))
    if off == 0.0:
        return 0.0
    return off / limit if limit > 0.0 and math.isfinite(off) else math.inf


def distance(row: Row) -> str:
    """Say how far a number that is a ratio is off in the unit of its signal; nothing where no place is known."""
    said = _WHERE.search(row.get("where") or "") if row["unit"] == "1" else None
    return f"{said[1]} {said[2]}" if said else ""


def lacking(row: Row) -> str:
    """Say in few words why a row has no number."""
    if row["verdict"] == Word.SKIPPED:
        return "not run"
    if row["verdict"] == Word.INFO and not row["why"].startswith(LACKS):
        return "not measured"
    return "no such event" if row["metric"].endswith("_times") else "no number"


def farthest(row: Row) -> tuple[bool, bool, float]:
    """Sort what has no number first, then by multiples of limits, and last what must be exact, such as counts."""
    times = share(row)
    return math.isfinite(row["value"] or 0.0), not math.isfinite(times), -times


def telling(row: Row) -> tuple[Any, ...]:
    """Sort what tells most of a run first: position, other quantities, all else; of each what is farthest out."""
    return row["metric"] != "position", row["metric"] not in QUANTITIES, *farthest(row)


def sentence(runs: Sequence[EngineRun]) -> str:
    """Say how many runs are within all limits, expected-outside, beyond a limit and outside; then a line a run why.

    The lines behind the first begin with a dash.
    """
    all_ran = [run for run in runs if not run.who.startswith(TRUTH) and not run.skipped]
    ran = [run for run in all_ran if run.judged]
    if not all_ran and not any(run.wrong for run in runs):
        return f"Nothing is judged, since no engine has run.{_known_until(runs)}"
    if all_ran and not ran and not any(run.wrong for run in runs):  # a truth may be outside by itself
        return "Nothing is judged, since no number has a limit."
    off = sorted((run for run in runs if run.wrong), key=lambda run: (run.failed is None, farthest(run.wrong[0])))
    right = [run for run in ran if not run.wrong]
    loose = sorted(((run, row) for run in right if (row := run.unbounded)), key=lambda one: -share(one[1]))
    known = [(run, row) for run in right if not run.unbounded and (row := run.deviates)]
    count = _counted(len(ran), known, loose, sum(not run.who.startswith(TRUTH) for run in off))
    lines = [count + _known_until(runs)]
    for said, of_truth in (("Outside", False), ("In doubt", True)):
        lines += _listed(said, [_off(run, run.first) for run in off if run.who.startswith(TRUTH) == of_truth])
    remedies = [remedy(run.who, run.rows, row["metric"]) for run, row in loose]
    told = (f"{one}. {does}" if does else one for one, does in zip(_caused(loose), remedies, strict=True))
    lines += _listed("Beyond, not judged", list(told))
    lines += _listed("Expected-outside, the largest", _caused(_largest(known)) if known else [])
    lines += _listed(
        "Mind", [row["why"].removesuffix(".") for one in runs for row in one.rows if row["metric"] == TOUCHING]
    )
    lines += _listed("Without a limit", [f"{run.who} on {run.label}" for run in all_ran if not run.judged])
    return NEXT.join(lines)


def _counted(ran: int, known: Deviating, loose: Deviating, off: int) -> str:
    """How many of the runs are within all limits, expected-outside, beyond a limit and outside."""
    whom = ", ".join(dict.fromkeys(run.who for run, _ in known))
    counts = {
        "within all limits": ran - len(known) - len(loose) - off,
        f"{Word.EXPECTED} ({'; '.join([whom, *_up_to(known)])})": len(known),
        f"beyond a limit and not judged ({'; '.join(_up_to(loose))})": len(loose),
        "outside": off,
    }
    if ran == 1:
        return f"The run is {next(said for said, count in counts.items() if count)}."
    (head, first), *rest = counts.items()
    more = "".join(f", {count} {_are(count)} {said}" for said, count in rest if count)
    return f"{first} of {ran} runs {_are(first)} {head}{more}."


def _are(count: int) -> str:
    return "is" if count == 1 else "are"


def _up_to(some: Deviating) -> list[str]:
    """Say which number that runs are named for is how many times its limit, at most; nothing where none has one."""
    found = max(((share(row), row["metric"]) for _, row in some if math.isfinite(share(row))), default=None)
    return [f"{found[1]} up to {in_times(found[0])} its limit"] if found else []


def _listed(head: str, texts: Sequence[str]) -> list[str]:
    """One line for each of the first texts, and one for how many more there are."""
    return [f"{head}: {text}." for text in _first(texts)]


def _largest(known: Deviating) -> list[tuple[EngineRun, Row]]:
    """Return the number that tells most; of positions the largest of each unit, as no metre is part of a radian."""
    first = min(known, key=lambda one: telling(one[1]))
    found: dict[str, tuple[float, tuple[EngineRun, Row]]] = {}
    for one in known:
        said = _WHERE.search(one[1].get("where") or "") if one[1]["metric"] == first[1]["metric"] else None
        if said and float(said[1]) > found.get(said[2], (-1.0,))[0]:
            found[said[2]] = float(said[1]), one
    return [one for _, one in found.values()] or [first]


def _known_until(runs: Sequence[EngineRun]) -> str:
    """Say which cases are compared in part only, since the truth is known no further; nothing if none is."""
    short = [f"{run.label}, {_part(row)}" for run in runs for row in run.rows if is_short(row)]
    return f" Compared up to the time to which the truth is known: {'; '.join(_first(short))}." if short else ""


def is_short(row: Row) -> bool:
    """Whether a row says that a truth is not known to the end of its horizon."""
    return bool(row["metric"] == TRUTH and row["compared"] < 1.0)


def known_until(rows: Iterable[Row], end: float) -> tuple[float, str]:
    """Up to when the truth of a case is known, s, and why no further.

    Args:
        rows: of the case.
        end: its horizon, s, which is what is returned where the truth is known to its end.
    """
    found = [(end * row["compared"], _short(row)[1]) for row in rows if is_short(row)]
    return min(found, default=(end, ""))


def _part(row: Row) -> str:
    until, why = _short(row)
    part = f"{row['compared']:.2g} of the horizon"
    return f"{until}, {part} ({why})" if why else part


def _short(row: Row) -> tuple[str, str]:
    """Up to when a truth is known, and why no further; nothing where its row does not say."""
    said = SHORT.search(row["why"])
    return (said[1], said[2]) if said else ("", "")


def in_times(factor: float) -> str:
    """Say a factor in two digits: "16,000 times"."""
    plain = 10.0 <= factor < 1e7
    return f"{float(f'{factor:.2g}'):,.0f} times" if plain else f"{factor:.2g} times"


def _first(texts: Sequence[str]) -> list[str]:
    """The first texts, and how many more there are."""
    more = [f"and {len(texts) - NAMED} more"] if len(texts) > NAMED else []
    return [*texts[:NAMED], *more]


def _off(run: EngineRun, row: Row) -> str:
    """A number of a run that is off, in a few words."""
    if run.failed:
        return f"{run.who} on {run.label} (did not finish)"
    times = share(row)
    size = row["verdict"]
    if math.isfinite(times):
        number = row.get("where") or f"{row['value']:.2g}{unit_text(row.get('unit', ''))}"
        size = f"{number}, {in_times(times)} its limit"
    if row.get("unit") == "%" and math.isfinite(times):  # a share of the whole is no multiple of what it may lack
        size = f"{row['value']:.3g} %, where {valid(row['expected'], row['limit'])} % is valid"
    if times <= 1.0 and run.who.startswith(TRUTH):  # where its sources stand is not what is off
        return f"{row['metric']} on {run.label} ({_CLAUSE.split(row['why'])[0]})"
    return f"{run.who.removesuffix(':')} on {run.label} ({row['metric']} {size}{_blamed(run, row['metric'])})"


def _caused(some: Deviating) -> list[str]:
    """Numbers beyond their limits; behind the first of those with one cause its first statement."""
    causes = [_CLAUSE.split(row["why"].removeprefix(UNMEASURED))[0] for _, row in some]
    return [
        _off(run, row) + (f": {cause[:1].upper()}{cause[1:]}" if cause and cause != before else "")
        for (run, row), cause, before in zip(some, causes, ["", *causes], strict=False)
    ]


def _blamed(run: EngineRun, metric: str) -> str:
    """The part that is more than half of an error; of a number without parts, that of an error beside it."""
    if part := _most(run, metric):
        return f", mostly its {part}"
    beyond_too = {row["metric"] for row in run.rows if row["verdict"] in (*WRONG, Word.EXPECTED) or beyond(row)}
    if metric in (*SPLIT, *IDENTITIES, "audit"):
        return ""  # parts of motions say nothing of what an engine was given
    found = ((name, _most(run, name)) for name in SPLIT if name in beyond_too)
    return next((f"; its error of {name}: mostly the {part}" for name, part in found if part), "")


def _most(run: EngineRun, metric: str) -> str:
    values = {row["metric"]: abs(row["value"]) for row in run.rows if row["value"] is not None}
    most = [part for part in PARTS if values.get(part_of(metric, part), 0.0) > 0.5 * values.get(metric, math.nan)]
    return " and ".join(most)
