"""The index: which engine is to be trusted for which case, and at what cost; and what has changed."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from crossbody.cases import Trajectory, installed
from crossbody.reports.figures.section import Kind, Section, Table, columns
from crossbody.reports.figures.styles import look
from crossbody.reports.judging.told import NEXT, WRONG, beyond, runs_of, sentence, share, telling
from crossbody.reports.judging.verdict import Row, Word, by
from crossbody.reports.layout import unit_text
from crossbody.reports.measuring.truth import TRUTH
from crossbody.reports.pages import grid
from crossbody.reports.pages.case_page import provenance
from crossbody.reports.pages.html import BEYOND, Page
from crossbody.reports.pages.precision import overview
from crossbody.reports.pages.results import CaseFiles, Results, at_rest
from crossbody.reports.pages.summary import deviations, engines
from crossbody.reports.runs.store import load
from crossbody.reports.runs.thin import keep

KEY = ("case", "variant", "engine", "profile", "metric")
MOVED = 0.1  # share of its limit by which a value must move to be listed
WORDS = columns(
    label="Case", who="Engine", metric="Metric", verdict_before=("Before", Kind.VERDICT),
    verdict=("Now", Kind.VERDICT), value_before=("Value before", Kind.NUMBER),
    value=("Value now", Kind.NUMBER), limit=("Limit", Kind.NUMBER), unit="Unit",
)  # fmt: skip
VALUES = columns(
    label="Case", who="Engine", metric="Metric", value_before=("Before", Kind.NUMBER),
    value=("Now", Kind.NUMBER), limit_before=("Limit before", Kind.NUMBER), limit=("Limit now", Kind.NUMBER),
    unit="Unit", moved=("Moved by, of the limit", Kind.NUMBER),
)  # fmt: skip
SHOWN = 100  # cases on one page of the index
TITLED = 2  # cases that the title names
SKETCHED = 80  # points of a sketch of a motion


def changes(now: Sequence[Row], before: Sequence[Row], name: str) -> Section:
    """The section that says what changed in verdicts, with `label` and `who`, since a run of that name."""
    known, here = _by_key(before), _by_key(now)
    kept = [
        row | {"unit": unit_text(row["unit"], "{}")}
        | {f"{field}_before": known[key][field] for field in ("verdict", "value", "limit")}
        for key, row in here.items() if key in known
    ]  # fmt: skip
    bounds = sum(_other(row["limit"], row["limit_before"]) for row in kept)
    labels = {row["label"] for row in now}
    gone = [key for key in known.keys() - here if known[key]["label"] in labels]
    left = {row["label"] for row in before} - labels
    words = [row for row in kept if row["verdict"] != row["verdict_before"]]
    moved = moves(row for row in kept if row["verdict"] == row["verdict_before"])
    text = (
        f"Against {name}: {len(words)} of {len(kept)} verdicts changed, {len(moved)} values "
        f"moved by more than {MOVED:.0%} of the narrower of both limits, limits changed: {bounds}, "
        f"{len(here.keys() - known)} rows are new, {len(gone)} are gone."
    )
    told = [f"{len(left)} cases of it were not run now."] if left else []
    text = " ".join([text, *told, *_settings(now, before)])
    tables = (
        Table(title="Verdicts that changed", columns=WORDS, rows=words),
        Table(title="Values that moved", columns=VALUES, rows=moved),
    )
    return Section(name="changes", title="What changed", text=text, tables=[t for t in tables if t.rows])


def _other(one: float | None, other: float | None) -> bool:
    """Whether limits differ; none is one, too."""
    return one != other and not (one is None or other is None or (one != one and other != other))


def _settings(now: Sequence[Row], before: Sequence[Row]) -> list[str]:
    """Say which settings of engines are others than before."""
    known, found = {(row["label"], row["who"]): row["settings"] for row in before}, dict[str, None]()
    for row in now:
        was, own = known.get((row["label"], row["who"]), "").split(), row["settings"].split()
        changed = [(one, next((old for old in was if old.split("=")[0] == one.split("=")[0]), "")) for one in own]
        told = [f"{new} instead of {old.partition('=')[2]}" for new, old in changed if old and new != old]
        if told:
            found[f"{row['who']} ran with {', '.join(told)}."] = None
    return list(found)


def _by_key(rows: Sequence[Row]) -> dict[tuple[str, ...], Row]:
    return {tuple(row[name] for name in KEY): row for row in rows}


def moves(rows: Iterator[Row]) -> list[dict[str, Any]]:
    """Rows whose value moved by more than `MOVED` of the narrower of its limits, the largest first."""
    found = [row | {"moved": _share(row)} for row in rows]
    return sorted((row for row in found if row["moved"] > MOVED), key=lambda row: -row["moved"])


def _share(row: Row) -> float:
    """By how much of its narrower limit a value moved; infinite where that is 0, nothing without numbers."""
    value, before = row["value"], row["value_before"]
    limits = [one for one in (row["limit"], row.get("limit_before")) if one is not None and one == one]
    if value is None or before is None or not limits:
        return 0.0
    limit = min(limits)
    apart = abs(value - before)
    return apart / limit if limit else math.inf if apart else 0.0


def index_pages(found: Results) -> list[Page]:
    """The index, in as many pages as its cases need."""
    cut = [found.cases[i : i + SHOWN] for i in range(0, len(found.cases), SHOWN)] or [()]
    names = ["index", *(f"index-{i}" for i in range(2, len(cut) + 1))]
    return [
        Page(
            name=name,
            title=_title(found) if i == 0 else f"Cases {i * SHOWN + 1} to {i * SHOWN + len(cases)}",
            lead=_lead(found),
            word=grid.verdict(found.verdicts),
            engines=[{"name": who, "shown": who, **look(who)} for who in found.engines],
            sections=_sections(found, cases, names, i),
        ) for i, (name, cases) in enumerate(zip(names, cut, strict=True))
    ]  # fmt: skip


def _lead(found: Results) -> str:
    """What the verdicts come to, and where nothing moves."""
    told = [sentence(runs_of(found.verdicts)), at_rest(found.cases)] if found.verdicts else []
    return NEXT.join(filter(None, told))


def _title(found: Results) -> str:
    """The cases, few of them by name."""
    named = list(dict.fromkeys(case.label for case in found.cases))
    if len(named) > 1:
        named = list(dict.fromkeys(label.partition(":")[0] for label in named))
    if not named:
        return "crossbody"
    more = f" and {len(named) - TITLED} more" if len(named) > TITLED else ""
    return f"{', '.join(named[:TITLED])}{more}"


def _sections(found: Results, cases: Sequence[CaseFiles], names: Sequence[str], i: int) -> list[Section]:
    shown = [_matrix(found, cases, names, i)] if cases else []
    if i:
        return shown
    first = [replace(engines(found), template="tiles.html", context=_tiles(found))] if cases else []
    changed = [] if found.base is None else [changes(found.verdicts, found.base, found.base_name)]
    known = deviations(found.verdicts)
    return [*overview(found), *changed, *shown, *first, *known, provenance(found.told)]


def _matrix(found: Results, cases: Sequence[CaseFiles], names: Sequence[str], i: int) -> Section:
    every = [row for rows in found.rows.values() for row in rows]
    shown = grid.ran(every)
    return Section(
        name="matrix", title="Cases", template="matrix.html",
        context={
            "corner": "Case", "heads": grid.heads(shown),
            "lines": [_line(found, case, shown) for case in cases], "pages": names, "here": i,
            "cases": len(found.cases), "wide": False, "filtered": len(cases) > 5,
            "says": "Each cell shows how many of its judged rows have its worst verdict, and below, the relative error "
            "of position and the run time." + _absent(grid.names(every), shown),
        },
    )  # fmt: skip


def _absent(asked: Sequence[str], shown: Sequence[str]) -> str:
    """Say which engines have no column, since they ran on no case; nothing if there are none."""
    gone = [who.removesuffix(":") for who in asked if who not in shown]
    return f" Run on no case: {', '.join(gone)}." if gone else ""


def _line(found: Results, case: CaseFiles, shown: Sequence[str]) -> grid.Line:
    mine = by(found.rows.get(case.label, ()), "who")
    cells = [
        grid.whole(case.label, case.page, who, mine.get(who, ()), found.walls.get((case.label, who))) for who in shown
    ]
    return grid.Line(text=case.label, page=case.page, cells=cells, small=_worst(found, case), **_sketch(case))


def _worst(found: Results, case: CaseFiles) -> str:
    """The number of the worst word that tells most, in a few words; one without a limit only if it is wrong."""
    held = [row for row in found.rows.get(case.label, ()) if grid.held(row) and share(row) > 0.0]
    known = [row for row in held if row["verdict"] in WRONG or math.isfinite(share(row))]
    row = min(known, key=lambda row: (grid.RANKED.index(row["verdict"]), *telling(row)), default=None)
    if row is None:
        return ""
    far = row["value"] is not None and row["value"] > 1.0  # many times what hardly moves is no size that one knows
    more = f" ({row['where']})" if far and row.get("where") else ""
    return f"{row['who'].removesuffix(':')}: {row['metric']} {grid.short(row['value'])}{more}"


def _sketch(case: CaseFiles) -> dict[str, str]:
    """The first coordinate of the truth over time, of a motion that is there, and its name."""
    if not case.paths or case.about.get("engine") != TRUTH or not (points := sketched(run := load(case.paths[0]).run)):
        return {}
    name = next((one["name"] for one in case.about.get("coordinates", ())), "")
    return {"sketch": points, "sketched": f"{name} from {run.t[0]:g} to {run.t[-1]:g} s".strip()}


def sketched(run: Trajectory) -> str:
    """Return the points of a first coordinate over time, in a box of 100 by 20; nothing where it is not known."""
    if len(run.t) < 2 or not run.q.shape[1] or not np.isfinite(run.q[:, 0]).all():
        return ""
    at = keep(run.t, run.q[:, 0], np.zeros(0), SKETCHED)
    t, q = run.t[at], run.q[at, 0]
    low, high = float(q.min()), float(q.max())
    x = 100.0 * (t - t[0]) / max(t[-1] - t[0], 1e-300)
    y = 19.0 - 18.0 * (q - low) / (high - low) if high > low else np.full(len(q), 10.0)
    return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))


def _tiles(found: Results) -> dict[str, Any]:
    """Counts of all verdicts, and sentences of warning."""
    counts = Counter(row["verdict"] for row in found.verdicts)
    words = {word: counts[word] for word in (*reversed(grid.WORST), Word.SKIPPED.value)}
    loose = sum(map(beyond, found.verdicts))
    profiles = len({row["who"] for row in found.verdicts if row["engine"] != TRUTH})
    failed = sum(row["metric"] == "audit" and row["verdict"] == Word.OUTSIDE for row in found.verdicts)
    named = ((len(found.cases), "case"), (profiles, "engine profile"))
    tiles = [
        *({"value": n, "title": name if n == 1 else f"{name}s", "word": ""} for n, name in named),
        *({"value": n, "title": word, "word": word} for word, n in words.items()),
    ]
    if loose:
        tiles.append({"value": loose, "title": "beyond a limit, not judged", "word": BEYOND})
    if failed:
        tiles.append({"value": failed, "title": "failed parity audits", "word": Word.OUTSIDE.value})
    return {"tiles": tiles, "warnings": [text for text in (_version(found),) if text]}


def _version(found: Results) -> str:
    """Says if another version made the results."""
    by = str(found.told.get("versions", {}).get("crossbody", "an unknown version"))
    try:
        mine = installed.version("crossbody")
    except ModuleNotFoundError:
        return ""
    return "" if by == mine else f"These results were computed by crossbody {by}, the pages by {mine}."
