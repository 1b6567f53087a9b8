"""Work-precision: error across, time up, one line an engine and profile."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd

from crossbody.reports.figures.section import Figure
from crossbody.reports.figures.styles import Panels, logarithmic, look

FLOOR = 1e-16  # least error that is drawn
LABEL = 11  # height of the name of a rung, pixels
CROSS = "a cross is a run that ended early or touches more or less often than the truth"
OWN = "open circles are an engine's own loop over the same steps, without Python"
MOST = 8
"""Names that fit side by side on a narrow screen; the distance of two is this part of the decades of all errors."""


def work_precision(rows: pd.DataFrame) -> Figure:
    """Log-log lines labelled with tolerance or step; a run without a finite error is a cross at the right edge."""
    cases = ", ".join(rows["case"].unique())
    own = "native_ms" in rows and np.isfinite(rows["native_ms"].astype(float)).any()
    panels = Panels("; ".join([f"Work against precision, {cases}", CROSS, *([OWN] if own else [])]), 560)
    error = rows["error"].astype(float)
    finite = error[np.isfinite(error) & (error > 0.0)]
    decades = np.ptp(np.log10(finite.clip(lower=FLOOR))) if len(finite) else 0.0
    apart = max(1.0, float(decades) / MOST)
    edge = 10.0 * float(finite.max()) if len(finite) else 1.0
    for (case, engine, profile), group in rows.groupby(["case", "engine", "profile"], sort=False):
        who = f"{engine}:{profile}"
        x = group["error"].astype(float)
        label = who if rows["case"].nunique() == 1 else f"{case} {who}"
        told = {"name": label, "legendgroup": label}
        reached = np.isfinite(x)
        if reached.any():
            _add(panels, group[reached], x[reached].clip(lower=FLOOR), told | _line(group[reached], look(who), apart))
        if own and np.isfinite(group[reached]["native_ms"].astype(float)).any():
            _alone(panels, group[reached], x[reached].clip(lower=FLOOR), label, look(who))
        if not reached.all():  # no line leads there: nobody knows how far off they are
            marks = {"mode": "markers", "marker": {"symbol": "x", "size": 8, "color": look(who)["color"]}}
            _add(
                panels,
                group[~reached],
                pd.Series(edge, group.index[~reached]),
                told | marks | {"showlegend": not reached.any()},
            )
    panels.axes("x", title="relative error of position and event times", **logarithmic(finite.clip(lower=FLOOR)))
    panels.axes("y", title="run time, median [ms]", **logarithmic(rows["median_ms"]))
    return panels.figure()


def _line(group: pd.DataFrame, style: dict[str, Any], apart: float) -> dict[str, Any]:
    """How the rungs that reach an error are drawn."""
    return {
        "mode": "lines+markers+text", "text": _labels(group["error"], group["median_ms"], group["setting"], apart),
        "textposition": "top center", "textfont": {"size": LABEL}, "marker": {"symbol": "circle", "size": 8},
        "line": {key: style[key] for key in ("color", "dash")},
    }  # fmt: skip


def _add(panels: Panels, group: pd.DataFrame, x: pd.Series, more: dict[str, Any]) -> None:
    panels.add(
        x=x, y=group["median_ms"], customdata=group["setting"],
        hovertemplate="%{customdata:.0e}: error %{x:.2g}, %{y:.3g} ms",
        error_y={"type": "data", "array": group["iqr_ms"] / 2, "thickness": 1}, **more,
    )  # fmt: skip


def _alone(panels: Panels, group: pd.DataFrame, x: pd.Series, label: str, style: dict[str, Any]) -> None:
    """Draw how long an engine's own loop takes at the same settings, thin and below its run."""
    panels.add(
        x=x, y=group["native_ms"].astype(float), customdata=group["setting"], name=f"{label}, its own loop",
        hovertemplate="%{customdata:.0e}: error %{x:.2g}, %{y:.3g} ms", legendgroup=label, showlegend=False,
        mode="lines+markers", line={"color": style["color"], "dash": "dot", "width": 1},
        marker={"symbol": "circle-open", "size": 8},
    )  # fmt: skip


def _labels(x: pd.Series, y: pd.Series, setting: pd.Series, least: float) -> list[str]:
    """Tolerance or step of the rungs that are so many decades apart from the last one that has a label."""
    found: list[str] = []
    last = (math.inf, math.inf)
    for here, s in zip(
        zip(np.log10(x.clip(lower=FLOOR)), np.log10(y.astype(float)), strict=True), setting.astype(float), strict=True
    ):
        apart = abs(here[0] - last[0]) > least or abs(here[1] - last[1]) > 0.5
        found.append(f"{s:.0e}".replace("e-0", "e-").replace("e+0", "e") if apart and np.isfinite(s) else "")
        last = here if apart else last
    return found
