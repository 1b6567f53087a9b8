"""The Bode figure of the soft contact: what a hand that moves the fingers feels, with and without tactile feedback."""

from __future__ import annotations

import pandas as pd
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from crossbody.reports.analysis.bode import OUTPUTS, UNITS
from crossbody.reports.figures.styles import COLOURS, DASHES


def bode(rows: pd.DataFrame) -> go.Figure:
    """Magnitude over phase, one column an output, one line a gain.

    Args:
        rows: as `crossbody.reports.analysis.bode.table` gives them.
    """
    figure = make_subplots(
        rows=2, cols=len(OUTPUTS), shared_xaxes=True, vertical_spacing=0.06,
        column_titles=[f"finger velocity to {name}" for name in OUTPUTS],
    )  # fmt: skip
    for i, (kstar, lines) in enumerate(rows.groupby("kstar", sort=True)):
        style = {"color": COLOURS[i % len(COLOURS)], "dash": DASHES[i % len(DASHES)], "width": 1.8}
        for column, output in enumerate(OUTPUTS, start=1):
            line = lines[lines["output"] == output]
            for row, value in enumerate(("magnitude", "phase"), start=1):
                figure.add_trace(
                    go.Scatter(
                        x=line["omega"], y=line[value], name=f"k* = {kstar:g} cm/(s N)", legendgroup=str(kstar),
                        showlegend=row == column == 1, mode="lines", line=style,
                    ), row=row, col=column,
                )  # fmt: skip
    for column, output in enumerate(OUTPUTS, start=1):
        figure.update_yaxes(
            type="log", exponentformat="power", title_text=f"magnitude [{UNITS[output]}]", row=1, col=column
        )
        figure.update_yaxes(title_text="phase [deg]", row=2, col=column)
        figure.update_xaxes(title_text="frequency [rad/s]", row=2, col=column)
    figure.update_xaxes(type="log", exponentformat="power")
    figure.update_layout(title_text="Block held by two soft fingers, linearised in the grasp", height=620)
    return figure
