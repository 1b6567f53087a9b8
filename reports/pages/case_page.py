"""The page of one case: verdicts first, then playback, plots over one clock, runs, audit, provenance."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from crossbody.reports.pages import figures
from crossbody.reports.pages.figures import label, style, suits
from crossbody.reports.pages.html import Page
from crossbody.reports.pages.playback import playback
from crossbody.reports.pages.results import CaseFiles, Results
from crossbody.reports.pages.section import Kind, Plot, Section, Table, columns
from crossbody.reports.runs.store import Trace

PLOTTED = 700_000
"""Room for all plots of a page, bytes; the samples of each line follow from it."""
RUNS = columns(
    who="Engine", outcome="Outcome", steps=("Steps [1]", Kind.NUMBER), events=("Transitions [1]", Kind.NUMBER),
    wall_ms=("Run time [ms]", Kind.NUMBER), samples=("Samples stored [1]", Kind.NUMBER),
    settings=("Settings", Kind.LONG),
)  # fmt: skip
AUDIT = columns(
    who="Engine", quantity="Quantity", reference="Reference", value="Engine's",
    difference=("Difference [1]", Kind.NUMBER), tolerance=("Allowed [1]", Kind.NUMBER),
    verdict=("Same", Kind.VERDICT),
)  # fmt: skip
AUDIT_TEXT = (
    "The same physics must reach every engine before anything is compared. M, bias, H and lam are evaluated at the "
    "same random states."
)
PARAMETERS = columns(name="Parameter", value=("Value", Kind.NUMBER), unit="Unit")


def case_page(found: Results, case: CaseFiles) -> Page:
    """All sections of one case; its motions are read here and forgotten with the page."""
    traces = case.traces()
    return Page(
        name=case.page, title=case.label, lead=_lead(case.about), engines=_engines(traces),
        sections=[
            _verdicts(found, case), *playback(traces), *_plots(traces), _runs(traces, case.about), _audit(found, case),
            provenance(found),
        ],
    )  # fmt: skip


def _lead(about: Mapping[str, Any]) -> str:
    if not about:
        return "No motion of this case is stored."
    truth = f" Truth: {about['tier']} ({about['source']})." if about.get("tier") else ""
    title = about["title"].rstrip(".")
    return f"{title[:1].upper()}{title[1:]}.{truth}"


def _engines(traces: Sequence[Trace]) -> list[Mapping[str, Any]]:
    return [{"name": label(trace), **style(trace, i)} for i, trace in enumerate(traces)]


def _verdicts(found: Results, case: CaseFiles) -> Section:
    rows = found.rows.get(case.label, [])
    return Section(
        name="verdicts", title="Verdicts", template="verdicts.html",
        context={
            "rows": rows, "counts": dict(Counter(row["verdict"] for row in rows).most_common()),
            "missing": case.missing, "engines": list(dict.fromkeys(row["who"] for row in rows)),
        },
    )  # fmt: skip


def _plots(traces: Sequence[Trace]) -> list[Section]:
    if not traces:
        return []
    points = figures.points_for(traces, PLOTTED)
    return [
        Section(
            name=name, title=title, text=figures.note(name, traces),
            plots=(Plot(name=f"plot-{name}", figure=draw(traces, points), time=True),),
        ) for name, (title, draw) in figures.FIGURES.items() if suits(name, traces)
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
        "who": label(trace), "outcome": f"{run.outcome.value} {run.message}".strip(), "steps": run.steps,
        "events": len(run.events), "wall_ms": 1e3 * run.wall_s if run.wall_s else None, "samples": len(run.t),
        "settings": ", ".join(f"{k} = {v}" for k, v in settings.items() if k != "samples"),
    }  # fmt: skip


def _audit(found: Results, case: CaseFiles) -> Section:
    told = [
        row | {"who": f"{row['engine']}:{row['profile']}", "verdict": "within" if row["same"] else "outside"}
        for row in found.audits.get(case.label, [])
    ]
    failed = sum(not row["same"] for row in told)
    text = f"{AUDIT_TEXT} {failed} of {len(told)} quantities differ." if told else f"{AUDIT_TEXT} None was audited."
    table = Table(title="Parity audit", columns=AUDIT, rows=told, folded=not failed)
    return Section(name="audit", title="Parity audit", text=text, tables=(table,))


def provenance(found: Results) -> Section:
    """What the results depend on besides their numbers."""
    rows = [{"key": key, "value": _words(value)} for key, value in found.told.items()]
    table = Table(title="Provenance", columns=columns(key="What", value=("Value", Kind.CODE)), rows=rows)
    return Section(name="provenance", title="Provenance", tables=(table,))


def _words(value: Any) -> str:
    return ", ".join(f"{k} {v}" for k, v in value.items()) if isinstance(value, Mapping) else str(value)
