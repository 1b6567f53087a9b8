"""Force over depth of one contact: a spring is a line, what is lost in a contact is the area of the loop."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from crossbody.cases import Mode
from crossbody.reports.figures.section import Plot, Section
from crossbody.reports.figures.styles import coded, label, plain, style
from crossbody.reports.pages.figures import robust
from crossbody.reports.runs.store import Trace
from crossbody.reports.runs.thin import keep

MOST = 1500  # points of one engine's line
TEXT = (
    "Force over penetration depth of the contact with the largest load. A spring gives a "
    "line; damping opens it to a loop whose area is the energy lost. A force below zero pulls."
)


def hysteresis(traces: Sequence[Trace], share: float = 1.0) -> list[Section]:
    """The section, with a share of the usual points.

    Nothing where no contact that opens and closes carries anything.
    """
    if (k := _busiest(traces)) is None:
        return []
    lines = [line for i, trace in enumerate(traces) if (line := _line(trace, i, k, int(share * MOST)))]
    name = traces[0].about["contacts"][k]
    ends, far = robust(traces, k)
    title = f"Force over depth, contact {plain(name)}{far and f'. Off scale: {far}'}"
    layout = {
        "title": {"text": title}, "height": 420, "showlegend": False,
        "xaxis": {"title": {"text": "depth [m]"}, "exponentformat": "power"},
        "yaxis": {"title": {"text": "lam [N]"}, "exponentformat": "power"} | ({"range": list(ends)} if ends else {}),
    }  # fmt: skip
    plots = (Plot(name="plot-hysteresis", figure={"data": lines, "layout": layout}),)
    return [Section(name="hysteresis", title="Force over depth", text=TEXT, plots=plots)] if lines else []


def _busiest(traces: Sequence[Trace]) -> int | None:
    """The contact with the largest force in the first motion that has any, of those that open and close."""
    for trace in traces:
        lam = np.abs(np.nan_to_num(trace.run.lam))
        lam = np.where((trace.run.mode == Mode.BILATERAL).all(axis=0), 0.0, lam)
        if lam.size and lam.max() > 0.0:
            return int(np.argmax(lam.max(axis=0)))
    return None


def _line(trace: Trace, i: int, k: int, most: int) -> dict[str, object]:
    """Force over depth of one engine while its contact carries, broken where it does not; or empty."""
    depth, lam = -trace.run.gap[:, k], trace.run.lam[:, k]
    carries = np.isfinite(lam) & (lam != 0.0) & np.isfinite(depth)
    if not carries.any():
        return {}
    near = carries | np.insert(carries[:-1], 0, False)  # the first sample that does not carry ends a line
    x, y = (np.where(carries, values, np.nan)[near] for values in (depth, lam))
    at = np.union1d(keep(np.arange(len(y), dtype=np.float64), y, np.zeros(0), most), np.flatnonzero(np.isnan(y)))
    look = style(trace, i)
    return {
        "type": "scatter", "mode": "lines", "x": coded(x[at].astype(np.float32)),
        "y": coded(y[at].astype(np.float32)), "name": plain(label(trace)), "meta": label(trace),
        "line": {key: look[key] for key in ("color", "dash", "width")},
    }  # fmt: skip
