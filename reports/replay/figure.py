"""Figures of a replay: what the model leaves over, and whether that is noise."""

from __future__ import annotations

import pandas as pd
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from crossbody.reports.figures.styles import COLOURS, DASHES


def _look(i: int) -> dict[str, object]:
    return {"color": COLOURS[i % len(COLOURS)], "dash": DASHES[i % len(DASHES)], "width": 1.5}


def residual(rows: pd.DataFrame) -> go.Figure:
    """Measured less predicted over the recorded time, a plot a channel, a line an engine."""
    channels = list(dict.fromkeys(zip(rows["channel"], rows["unit"], strict=True)))
    figure = make_subplots(rows=len(channels), cols=1, shared_xaxes=True, vertical_spacing=0.05)
    for place, (channel, unit) in enumerate(channels, start=1):
        for i, (who, line) in enumerate(rows[rows["channel"] == channel].groupby("who", sort=False)):
            figure.add_trace(
                go.Scatter(x=line["t"], y=line["value"], name=str(who), legendgroup=str(who), mode="lines",
                           line=_look(i), showlegend=place == 1), row=place, col=1,
            )  # fmt: skip
        figure.update_yaxes(title_text=f"{channel}<br>[{unit}]", exponentformat="power", row=place, col=1)
    figure.update_xaxes(title_text="time [s]", row=len(channels), col=1)
    figure.update_layout(title_text="Measured less predicted", height=130 + 170 * len(channels))
    return figure


def correlation(rows: pd.DataFrame) -> go.Figure:
    """Autocorrelation of the residuals and their correlation with the inputs, beside the 99 % band."""
    kinds = list(dict.fromkeys(zip(rows["channel"], rows["input"], strict=True)))
    names = [f"{channel} with {given or 'itself'}" for channel, given in kinds]
    figure = make_subplots(rows=len(kinds), cols=1, vertical_spacing=0.3 / len(kinds), subplot_titles=names)
    for place, (channel, given) in enumerate(kinds, start=1):
        chosen = rows[(rows["channel"] == channel) & (rows["input"] == given)]
        for i, (who, line) in enumerate(chosen.groupby("who", sort=False)):
            figure.add_trace(
                go.Scatter(x=line["lag"], y=line["value"], name=str(who), legendgroup=str(who), mode="lines+markers",
                           line=_look(i), showlegend=place == 1), row=place, col=1,
            )  # fmt: skip
        band = float(chosen["band"].iloc[0])
        figure.add_hrect(y0=-band, y1=band, fillcolor="#888888", opacity=0.25, line_width=0, row=place, col=1)
        figure.update_yaxes(range=[-1.05, 1.05], row=place, col=1)
    figure.update_xaxes(title_text="lag [averages of residuals]", row=len(kinds), col=1)
    figure.update_layout(title_text="Correlation of the residuals; 99 % band in grey", height=130 + 150 * len(kinds))
    return figure
