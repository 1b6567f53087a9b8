"""The HTML page of a study: templates and contexts, plotly.js beside it, no request to any network."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
import plotly.graph_objects as go
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from crossbody.cases import OutputError
from crossbody.reports import figures
from crossbody.reports.output import MARKER, replace_text
from crossbody.reports.store import Trace, load
from crossbody.reports.study import read_json

PAGE = "index.html"
SCRIPT = "plotly.min.js"


def write(out: Path) -> Path:
    """Make the page of a folder that holds a study.

    Raises:
        OutputError: if the folder does not hold one, or cannot be written.
    """
    if not (out / MARKER).is_file():
        raise OutputError(f"{out} was not written by crossbody; name the folder of an earlier run.")
    text = render(out)
    try:
        replace_text(out / SCRIPT, get_plotlyjs())
        replace_text(out / PAGE, text)
    except OSError as error:
        raise OutputError(f"The page in {out} cannot be written: {error.strerror}.") from None
    return out / PAGE


def render(out: Path) -> str:
    """The page as text."""
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent / "templates"),
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    environment.filters |= {"number": number, "slug": slug}
    verdicts = pd.DataFrame(read_json(out / "verdicts.json")["rows"])
    audit = pd.DataFrame(read_json(out / "audit.json")["rows"])
    return environment.get_template("page.html").render(
        verdicts=_records(verdicts),
        counts=verdicts["verdict"].value_counts().to_dict() if len(verdicts) else {},
        audit=_records(audit),
        cases=_cases([load(path) for path in sorted((out / "traces").glob("*.parquet"))]),
        bench=_bench(out),
        gapmap=_gap_map(out),
        stability=_stability(out),
        bode=_bode(out),
        provenance=read_json(out / "provenance.json"),
        script=SCRIPT,
    )


def _bench(out: Path) -> dict[str, Any]:
    """Context of the work-precision section; empty where nothing was timed."""
    if not (out / "bench.json").is_file():
        return {}
    from crossbody.reports.bench_figure import work_precision

    table = read_json(out / "bench.json")
    rows = pd.DataFrame(table["rows"])
    orders = read_json(out / "orders.json")["rows"]
    return {"rows": _records(rows), "orders": orders, "plot": plot("work-precision", work_precision(rows))}


def _gap_map(out: Path) -> dict[str, Any]:
    """Context of the gap map; empty where there is none."""
    if not (out / "gapmap.json").is_file():
        return {}
    from crossbody.reports.gapmap import summary
    from crossbody.reports.gapmap_figure import gap_map

    rows = pd.DataFrame(read_json(out / "gapmap.json")["rows"])
    return {"rows": _records(summary(rows)), "plot": plot("gap-map", gap_map(rows))}


def _stability(out: Path) -> dict[str, Any]:
    """Context of the stability map; empty where there is none."""
    if not (out / "stability.json").is_file():
        return {}
    from crossbody.reports.stability_figure import stability

    rows = pd.DataFrame(read_json(out / "stability.json")["rows"])
    return {"rows": _records(rows), "plot": plot("stability-map", stability(rows))}


def _bode(out: Path) -> dict[str, Any]:
    """Context of the frequency responses; empty where there are none."""
    if not (out / "bode.json").is_file():
        return {}
    from crossbody.reports.bode import growths
    from crossbody.reports.bode_figure import bode

    rows, poles = (pd.DataFrame(read_json(out / f"{name}.json")["rows"]) for name in ("bode", "poles"))
    return {"growth": _records(growths(poles)), "plot": plot("bode-soft-contact", bode(rows))}


def _records(rows: pd.DataFrame) -> list[dict[str, Any]]:
    return [{str(k): v for k, v in record.items()} for record in rows.to_dict(orient="records")]


def _cases(traces: Iterable[Trace]) -> list[dict[str, Any]]:
    """One context a case: its truth first, then the runs, and a figure of each kind."""
    grouped: dict[tuple[str, str], list[Trace]] = {}
    for trace in traces:
        grouped.setdefault((trace.about["case"], trace.about["variant"]), []).append(trace)
    return [_case(f"{name}:{variant}", group) for (name, variant), group in grouped.items()]


def _case(label: str, traces: Sequence[Trace]) -> dict[str, Any]:
    about = traces[0].about
    return {
        "label": label,
        "title": about["title"],
        "tier": about.get("tier", ""),
        "source": about.get("source", ""),
        "parameters": [(k, v, about["units"].get(k, "")) for k, v in about["parameters"].items()],
        "runs": [_run(trace) for trace in traces[1:]],
        "plots": [plot(f"{slug(label)}-{name}", draw(traces)) for name, draw in figures.FIGURES.items()],
    }


def _run(trace: Trace) -> dict[str, Any]:
    run = trace.run
    return {
        "label": figures.label(trace), "outcome": run.outcome.value, "message": run.message, "steps": run.steps,
        "samples": len(run.t), "events": len(run.events), "wall_ms": 1e3 * run.wall_s,
        "settings": ", ".join(f"{k} = {v}" for k, v in trace.about["settings"].items() if k != "samples"),
    }  # fmt: skip


def plot(name: str, figure: go.Figure) -> dict[str, Any]:
    """One figure as a script-safe JSON text with its title and height."""
    title, height = figure.layout.title.text, figure.layout.height
    figure.update_layout(title_text="", template=None, margin={"l": 80, "r": 20, "t": 30, "b": 55})
    text = figure.to_json(engine="json").replace("<", "\\u003c")
    return {"id": name, "title": title, "height": height, "json": Markup(text)}


def slug(text: str) -> str:
    """A text as an id."""
    return "".join(c if c.isalnum() else "-" for c in text)


def number(value: Any) -> str:
    """A number for a table: four digits, a dash where there is none."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "-"
    return f"{value:.4g}" if isinstance(value, (int, float)) and not isinstance(value, bool) else str(value)
