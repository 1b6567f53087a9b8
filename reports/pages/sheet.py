"""Stacked plots over one time axis, as plain dictionaries: plotly's own objects would take most of a page's time."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any

import numpy as np

from crossbody.cases._arrays import Floats
from crossbody.reports.pages.styles import TRUTH, label, style
from crossbody.reports.pages.thin import keep
from crossbody.reports.runs.store import Trace

FINE = 2e-5
"""Distance of samples over the horizon below which times are written in double precision."""
EVENTS = 40
"""Events around which all samples stay: the first of them where there are very many."""
HEAD, ROW, GAP = 130, 170, 45
"""Height of a figure besides its plots, of a plot with the gap above it, and of that gap, pixels."""


class Sheet:
    """Plots one below another, with the lines of every engine.

    Args:
        rows: title of every plot's y axis, with its unit.
        title: of the figure.
        points: samples a line, besides those around events.
    """

    def __init__(self, rows: Sequence[str], title: str, points: int) -> None:
        self.points = points
        self.data: list[dict[str, Any]] = []
        height = HEAD + ROW * len(rows)
        self.layout: dict[str, Any] = {"title": {"text": title}, "height": height, "showlegend": False}
        pitch = 1.0 / len(rows)
        share = pitch * (1.0 - GAP / ROW)
        for i, name in enumerate(rows):
            top = 1.0 - i * pitch
            low = max(top - share, 0.0) if i + 1 < len(rows) else 0.0
            self.layout |= _axes(number(i + 1), name, [low, top], last=i + 1 == len(rows))

    def logarithmic(self, *rows: int) -> None:
        """Make the y axes of these plots (from 1 on) logarithmic."""
        for row in rows:
            self.layout[f"yaxis{number(row)}"] |= {"type": "log", "nticks": 5}

    def line(self, trace: Trace, i: int, row: int, y: Floats, t: Floats | None = None, **more: Any) -> None:
        """One line of one engine into plot `row`, thinned; what is not finite is a gap."""
        t = trace.run.t if t is None else t
        if not len(t) or not np.isfinite(y).any():
            return
        at = keep(t, y, np.unique([e.t for e in trace.run.events])[:EVENTS], self.points)
        look = style(trace, i)
        self.data.append(
            {
                "type": "scatter", "x": coded(_times(t[at])), "y": coded(y[at].astype(np.float32)),
                "name": plain(label(trace)), "meta": label(trace), "mode": "lines", "xaxis": f"x{number(row)}",
                "yaxis": f"y{number(row)}", "line": {key: look[key] for key in ("color", "dash", "width")} | more,
                "opacity": 0.65 if label(trace) == TRUTH else 1.0,
            }
        )  # fmt: skip

    def done(self) -> dict[str, Any]:
        """The figure."""
        return {"data": self.data, "layout": self.layout}


def number(row: int) -> str:
    """How plotly numbers its axes: the first one is not numbered."""
    return "" if row == 1 else str(row)


def plain(text: str) -> str:
    """A text in which plotly finds no tags."""
    return text.replace("<", "&lt;")


def coded(array: Floats) -> dict[str, str]:
    """An array as plotly reads it from base64 ("typed array specification")."""
    return {"dtype": f"f{array.itemsize}", "bdata": base64.b64encode(np.ascontiguousarray(array).tobytes()).decode()}


def _axes(n: str, name: str, domain: list[float], *, last: bool) -> dict[str, Any]:
    x: dict[str, Any] = {"anchor": f"y{n}", "domain": [0.0, 1.0], "showticklabels": last}
    if n:
        x["matches"] = "x"
    if last:
        x["title"] = {"text": "time [s]"}
    title = {"text": plain(name).replace("\n", "<br>"), "standoff": 4, "font": {"size": 12}}
    return {
        f"xaxis{n}": x,
        f"yaxis{n}": {"anchor": f"x{n}", "domain": domain, "title": title, "exponentformat": "power"},
    }


def _times(t: Floats) -> Floats:
    """Times in single precision where nobody can see it."""
    apart = np.diff(t)
    smallest = np.min(apart[apart > 0.0], initial=np.inf)
    return t.astype(np.float32) if smallest > FINE * abs(t[-1]) else t
