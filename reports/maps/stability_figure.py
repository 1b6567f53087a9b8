"""The stability map as a figure: a line a scene, a dot where the ball came to the centre, a cross where it did not."""

from __future__ import annotations

import pandas as pd
import plotly.graph_objects as go

from crossbody.reports.figures.styles import COLOURS

ENDS = (("arrived", "in the centre", "circle", COLOURS[2]), ("lost", "not there at the end", "x", COLOURS[3]))
LINE = 17
"""Height of one scene, pixels."""


def stability(rows: pd.DataFrame) -> go.Figure:
    """When the ball arrived, or until when it ran.

    Args:
        rows: as `crossbody.reports.maps.stability.stability_map` gives them.
    """
    drawn = rows[rows["ended"].notna()].iloc[::-1]
    names = drawn["scene"].where(drawn["scene"] != "", "default")
    several = drawn["engine"].nunique() > 1
    labels = drawn["engine"] + ": " + names if several else names
    arrived = drawn["arrived"].astype(bool)
    figure = go.Figure()
    for key, name, symbol, colour in ENDS:
        shown = arrived if key == "arrived" else ~arrived
        when = drawn["arrival"] if key == "arrived" else drawn["ended"]
        figure.add_trace(
            go.Scatter(
                x=when[shown].astype(float), y=labels[shown], name=name, mode="markers",
                marker={"symbol": symbol, "size": 9, "color": colour},
                text="expected: " + drawn["expected"][shown], hoverinfo="x+y+text",
            )
        )  # fmt: skip
    figure.update_xaxes(title_text="arrival in the centre, or end of the run [s]")
    figure.update_yaxes(categoryorder="array", categoryarray=labels.tolist(), automargin=True)
    figure.update_layout(title_text="Stability map of the ball maze", height=180 + LINE * len(drawn))
    return figure
