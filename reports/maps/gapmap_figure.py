"""The gap map as a figure: energy created and distance to the ideal pattern over s, one column a number of balls."""

from __future__ import annotations

import pandas as pd
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from crossbody.reports.figures.styles import COLOURS, DASHES
from crossbody.reports.maps.gapmap import PATTERN

ROWS = {"energy_created": "energy created / energy in", PATTERN: "pattern distance / speed in"}


def gap_map(rows: pd.DataFrame) -> go.Figure:
    """Two plots a number of balls; a run that failed is a cross on the axis.

    Args:
        rows: as `crossbody.reports.maps.gapmap.gap_map` gives them.
    """
    drawn = rows[rows["s"].notna()]
    counts = list(dict.fromkeys(drawn["n"])) or [0]
    figure = make_subplots(
        rows=len(ROWS), cols=len(counts), shared_xaxes=True, column_titles=[f"{n} balls" for n in counts],
        vertical_spacing=0.08, horizontal_spacing=0.09,
    )  # fmt: skip
    styles: dict[str, int] = {}
    for (n, engine, profile, machine), group in drawn.groupby(["n", "engine", "profile", "machine"], sort=False):
        name = f"{engine}:{profile}, {machine}"
        first = name not in styles
        style = styles.setdefault(name, len(styles))
        for i, column in enumerate(ROWS, start=1):
            for trace in _traces(group, column, name, style, first and i == 1):
                figure.add_trace(trace, row=i, col=counts.index(n) + 1)
    for i, title in enumerate(ROWS.values(), start=1):
        figure.update_yaxes(title_text=title, row=i, col=1)
    figure.update_xaxes(title_text="s = gap sqrt(a0) / v", row=len(ROWS))
    figure.update_layout(title_text="Gap map: energy created, and distance to the ideal pattern", height=760)
    return figure


def _traces(group: pd.DataFrame, column: str, name: str, style: int, legend: bool) -> list[go.Scatter]:
    values = pd.to_numeric(group[column])
    line = {"color": COLOURS[style % len(COLOURS)], "dash": DASHES[style % len(DASHES)], "width": 1.8}
    found = [
        go.Scatter(
            x=group["s"].astype(float), y=values, name=name, legendgroup=name, showlegend=legend, mode="lines",
            line=line,
        )
    ]  # fmt: skip
    failed = group[group["outcome"] != "finished"]
    if len(failed):
        found.append(
            go.Scatter(
                x=failed["s"].astype(float), y=[0.0] * len(failed), name=f"{name}: failed", legendgroup=name,
                showlegend=legend, mode="markers", marker={"symbol": "x", "size": 8, "color": line["color"]},
                text=failed["why"].astype(str), hoverinfo="text",
            )
        )  # fmt: skip
    return found
