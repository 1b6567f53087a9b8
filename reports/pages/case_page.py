"""The page of one case: what is off, the motion, every number and why, plots over one clock, runs, provenance."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from crossbody.cases import Tier
from crossbody.reports import sections
from crossbody.reports.figures.section import Kind, Section, Table, columns
from crossbody.reports.figures.styles import called, label, style
from crossbody.reports.judging.told import (
    NEXT,
    beyond,
    farthest,
    known_until,
    lacking,
    runs_of,
    sentence,
    share,
    telling,
)
from crossbody.reports.judging.verdict import Row, Word
from crossbody.reports.layout import valid
from crossbody.reports.pages import figures, grid
from crossbody.reports.pages.errors import farthest_off
from crossbody.reports.pages.friction import friction, hysteresis
from crossbody.reports.pages.html import BEYOND, Link, Page
from crossbody.reports.pages.playback import playback
from crossbody.reports.pages.precision import precision
from crossbody.reports.pages.results import CaseFiles, Results, at_rest
from crossbody.reports.runs.origin import BROKEN, blamed
from crossbody.reports.runs.store import Trace

NAMED = 6
"""Numbers that a reason names."""
PLOTTED = 800_000  # room for all plots of a page, bytes; the samples of each line follow from it
RUNS = columns(
    called="Engine", outcome="Outcome", wall_ms=("Run time [ms]", Kind.NUMBER), steps=("Steps", Kind.NUMBER),
    events=("Transitions", Kind.NUMBER), control_ms=("In the controller [ms]", Kind.NUMBER),
    samples=("Samples stored", Kind.NUMBER),
    settings=("Settings", Kind.LONG),
)  # fmt: skip
AUDIT = columns(
    who="Engine", quantity="Quantity", verdict=("Same", Kind.VERDICT), difference=("Difference", Kind.NUMBER),
    tolerance=("Allowed", Kind.NUMBER), reference="Reference", value="Engine's",
)  # fmt: skip
AUDIT_TEXT = (
    "Before motions are compared, every engine must have the same physics: the mass matrix M, the bias forces, the "
    "Jacobian H of the gaps and the contact forces lam are evaluated at the same random states."
)
PLAINLY = {
    Tier.A: "the exact solution, a formula",
    Tier.B: "published digits of the solution",
    Tier.C: "a solution on which two independent integrators agree",
    Tier.D: "what the motion itself must keep, since no solution is known",
}
"""What each kind of truth is, to a reader who has not read of them."""
WHOLE = 100.0  # what a share, in per cent, is at best
PARAMETERS = columns(name="Parameter", value=("Value", Kind.NUMBER), unit="Unit")


def case_page(found: Results, case: CaseFiles, share: float = 1.0) -> Page:
    """All sections of one case, with a share of the usual room; its motions are forgotten with the page."""
    traces, rows = case.traces(), found.rows.get(case.label, [])
    moving = _moving(found.out, traces, share)
    about, sources = _about(case.about)
    said = sentence(runs_of(rows)).replace(f" on {case.label}", "") if rows else ""
    return Page(
        name=case.page, title=case.label, lead=NEXT.join(filter(None, [said, at_rest([case])])),
        about=f"{about}{_compared(traces, rows)}", sources=sources,
        opening=sum(one.template == "playback.html" for one in moving),
        word=grid.verdict(rows),
        engines=[{"name": label(trace), "shown": called(trace), **style(trace)} for trace in traces],
        beside=_beside(found, case),
        sections=[
            *moving, _glance(found, case), _verdicts(found, case),
            *_plots(traces, rows, share),
            *hysteresis(traces, share, figures.limits_of(rows)), *friction(traces, share),
            *precision(found.out, case.label, rows, _walls(found, case)), *studied(found.out, case.about),
            _runs(traces, case.about), *_audit(found, case), provenance(found.told),
        ],
    )  # fmt: skip


def _moving(out: Path, traces: Sequence[Trace], share: float) -> list[Section]:
    """The playback; where motions are not as they were written, and cannot be drawn, the other sections stand alone."""
    try:
        with blamed(out):
            return playback(traces, share)
    except BROKEN as error:
        told = f"This motion cannot be drawn: {type(error).__name__}: {error}."
        return [Section(name="playback", title="Playback", text=told)]


def _beside(found: Results, case: CaseFiles) -> tuple[Link | None, Link | None]:
    """The pages of the cases before and after one."""
    pages = [None, *(Link(page=one.page, title=one.label) for one in found.cases), None]
    at = next(i for i, one in enumerate(pages) if one is not None and one.page == case.page)
    return pages[at - 1], pages[at + 1]


def _about(about: Mapping[str, Any]) -> tuple[str, str]:
    """What is compared with what, in plain words, and where that is from."""
    if not about:
        return "No motion of this case is stored.", ""
    tier, title = about.get("tier", ""), about["title"].rstrip(".")
    said = f"{title[:1].upper()}{title[1:]}."
    if not tier:
        return said, ""
    known = tier if figures.of_log(about) else PLAINLY[Tier(tier)]
    sources = tier if figures.of_log(about) else f"Truth {tier[:1]}: {tier[2:]}"
    return f"{said} Compared with {known}.", f"{sources} ({about['source'].rstrip('.')})."


def _compared(traces: Sequence[Trace], rows: Sequence[Row]) -> str:
    """Up to when motions are compared, where that is not to their end."""
    until, why = known_until(rows, _end(traces))
    if not until < _end(traces):
        return ""
    return f" Compared up to {until:.3g} s, as far as the truth is known{f' ({why})' if why else ''}."


def _end(traces: Sequence[Trace]) -> float:
    return float(traces[0].run.t[-1]) if traces else 0.0


def _walls(found: Results, case: CaseFiles) -> dict[str, float]:
    """Run times of the engines, s."""
    return {who: wall for (label, who), wall in found.walls.items() if label == case.label and who != "truth:"}


def _glance(found: Results, case: CaseFiles) -> Section:
    """Which engine can be trusted here, and at what cost."""
    rows = found.rows.get(case.label, [])
    return Section(
        name="glance", title="At a glance", template="matrix.html",
        context={
            "corner": "Metric", "heads": grid.heads(grid.ran(rows)), "wide": True, "filtered": False,
            "pages": (), "lines": grid.of_case(rows, case.page, case.label, _walls(found, case)),
            "says": "Click a cell for its limit, the reason and the command that repeats it.",
        },
    )  # fmt: skip


def studied(out: Path, about: Mapping[str, Any]) -> list[Section]:
    """What studies in the same folder drew of this case."""
    mine = [name for name in sections.names(out) if about.get("case") in getattr(sections.load(name), "CASES", ())]
    return [replace(section, tables=()) for name in mine for section in sections.shown(name, out)]


def _verdicts(found: Results, case: CaseFiles) -> Section:
    rows = sorted(found.rows.get(case.label, []), key=_far)
    return Section(
        name="verdicts", title="Verdicts", template="verdicts.html",
        context={
            "rows": [
                row | {"beyond": beyond(row), "lacking": lacking(row), "times": _times(row), "share": _share(row)}
                for row in rows
            ],
            "counts": _counted(rows), "causes": _causes(rows), "off": any(_off(row) for row in rows),
            "truths": _truths(case.about), "judged": any(row["verdict"] != Word.INFO for row in rows),
            "missing": case.missing, "engines": list(dict.fromkeys(row["who"] for row in rows)),
        },
    )  # fmt: skip


def _counted(rows: Sequence[Row]) -> dict[str, int]:
    """How many rows have each word, the worst first; what is beyond a limit and not judged has one of its own."""
    counts = Counter(BEYOND if beyond(row) else row["verdict"] for row in rows)
    order = [*grid.WORST[:-1], BEYOND, Word.WITHIN.value]
    return {word: counts[word] for word in [*order, *(word for word, _ in counts.most_common())] if counts[word]}


def _off(row: Row) -> bool:
    """Whether a number is beyond its limit, judged or not, or a run has crashed."""
    return row["verdict"] in grid.WORST[:-1] or beyond(row)


def _times(row: Row) -> str:
    """How many times its limit a number is, where it is beyond it."""
    times = math.inf if _share(row) else share(row)
    return f"{times:.2g}" if _off(row) and math.isfinite(times) else ""


def _share(row: Row) -> str:
    """What is valid of a share of the whole, whose limit is no size; nothing of other numbers."""
    return valid(row["expected"], row["limit"]) if row["unit"] == "%" and row["expected"] == WHOLE else ""


def _causes(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Why numbers are off, each reason once for each engine: with its word, and its numbers, the farthest out first."""
    found: dict[tuple[str, str, str], list[Row]] = {}
    for row in filter(_off, rows):
        found.setdefault((row["who"], BEYOND if beyond(row) else row["verdict"], row["why"]), []).append(row)
    causes = []
    for (who, word, why), those in found.items():
        first, *rest = [one["metric"] for one in sorted(those, key=farthest)]
        names = [first, *rest] if len(rest) < NAMED else [first, *rest[: NAMED - 1], f"{len(rest) - NAMED + 1} more"]
        causes.append({"who": who.removesuffix(":"), "word": word, "why": why or "No reason is known.", "names": names})
    return causes


def _truths(about: Mapping[str, Any]) -> str:
    """What the letters of truths mean: those of a case, or that of a log."""
    tier = about.get("tier", "")
    return f"{tier[:1]}: {tier}" if figures.of_log(about) else ", ".join(Tier)


def _far(row: Row) -> tuple[Any, ...]:
    """The worst word first, and of one word what tells most."""
    return grid.RANKED.index(row["verdict"]) if grid.held(row) else len(grid.RANKED), *telling(row)


def _plots(traces: Sequence[Trace], rows: Sequence[Row], share: float) -> list[Section]:
    if not traces:
        return []
    points, limits = figures.points_for(traces, share * PLOTTED), figures.limits_of(rows)
    until, _ = known_until(rows, _end(traces))
    drawn = {name: figures.plots(name, traces, points, limits, until) for name in figures.FIGURES}
    tables = {"motion": farthest_off(traces)}
    return [
        Section(
            name=name, title=figures.FIGURES[name][0], text=figures.note(name, traces, limits), plots=plots,
            tables=tables.get(name, ()),
        ) for name, plots in drawn.items() if plots
    ]  # fmt: skip


def _runs(traces: Sequence[Trace], about: Mapping[str, Any]) -> Section:
    given = [{"name": k, "value": v, "unit": about["units"].get(k, "")} for k, v in about.get("parameters", {}).items()]
    tables = (
        Table(title="Runs", columns=RUNS, rows=[_run(trace) for trace in traces]),
        Table(title="Parameters", columns=PARAMETERS, rows=given, folded=True),
    )
    return Section(name="runs", title="Runs", tables=tables)


def _run(trace: Trace) -> dict[str, Any]:
    run = trace.run
    settings = trace.about.get("settings", {})
    return {
        "who": label(trace), "called": called(trace), "outcome": f"{run.outcome.value} {run.message}".strip(),
        "steps": run.steps, "events": len(run.events), "wall_ms": 1e3 * run.wall_s if run.wall_s else None,
        "control_ms": 1e3 * run.control_s if run.control_s else None, "samples": len(run.t),
        "settings": ", ".join(
            f"{k} = {v:.6g}" if isinstance(v, float) else f"{k} = {v}" for k, v in settings.items() if k != "samples"
        ),
    }  # fmt: skip


def _audit(found: Results, case: CaseFiles) -> list[Section]:
    """What reached the engines; nothing where a log is what they are compared with."""
    if figures.of_log(case.about):
        return []
    said = {row["who"]: row["verdict"] for row in found.rows.get(case.label, ()) if row["metric"] == "audit"}
    told = [
        row | {"who": who, "verdict": "within" if row["same"] else said.get(who, "outside")}
        for row in found.audits.get(case.label, []) for who in (f"{row['engine']}:{row['profile']}",)
    ]  # fmt: skip
    told.sort(key=lambda row: row["same"])
    failed = [row["who"] for row in told if not row["same"]]
    whose = f" ({', '.join(dict.fromkeys(failed))})" if failed else ""
    text = (
        f"{AUDIT_TEXT} {len(failed)} of {len(told)} quantities differ{whose}."
        if told
        else f"{AUDIT_TEXT} Nothing was audited."
    )
    table = Table(title="Parity audit", columns=AUDIT, rows=told, folded=not failed)
    return [Section(name="audit", title="Parity audit", text=text, tables=(table,))]


def provenance(told: Mapping[str, Any]) -> Section:
    """What results depend on besides their numbers."""
    rows = [{"key": key, "value": text} for key, value in told.items() for key, text in _entries(key, value)]
    table = Table(title="Provenance", columns=columns(key="What", value=("Value", Kind.CODE)), rows=rows)
    return Section(name="provenance", title="Provenance", tables=(table,))


def _entries(key: str, value: Any) -> list[tuple[str, str]]:
    """Return the lines of an entry: names with their versions are one, all else of a mapping is a line each."""
    if isinstance(value, Mapping) and not all(isinstance(each, str) for each in value.values()):
        return [line for name, each in value.items() for line in _entries(f"{key}: {name}", each)]
    if isinstance(value, Mapping):
        return [(key, ", ".join(f"{name} {each}" for name, each in value.items()))] if value else []
    text = ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)
    return [(key, text)] if text and value is not None and value is not False else []
