"""Figures of a replay and of an identification, as plain values: measured, predicted, and what is left."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from crossbody.cases.arrays import Floats
from crossbody.reports.figures.section import Figure
from crossbody.reports.figures.styles import COLOURS, coded, level, look, number, plain, single

GREY = "#888888"
SIGNED = [[0.0, COLOURS[0]], [0.5, "#f4f4f4"], [1.0, COLOURS[3]]]
"""Colours from -1 over 0 to 1."""
NONE: Mapping[str, float] = {}
SIGMAS = 2.0  # half of the noise band, standard deviations


def motion(rows: pd.DataFrame, noise: dict[str, float], held: Sequence[int] = ()) -> Figure:
    """What was measured, and what every engine predicts in its band of noise, a plot a channel.

    Windows that were held out of a fit are shaded; values of rows are measured minus predicted.
    """
    channels = _channels(rows)
    data: list[dict[str, Any]] = []
    for place, (channel, _) in enumerate(channels, start=1):
        for i, (who, line) in enumerate(rows[rows["channel"] == channel].groupby("who", sort=False), start=1):
            t, seen, left = _broken(line)
            if i == 1:
                data += [*_band(t, seen - left, noise.get(channel, np.nan), place), _line(t, seen, "measured", place)]
                data[-1]["line"] = {"color": GREY, "width": 4}
            data.append(_line(t, seen - left, str(who), place, engine=True))
    title, axes = f"Measured and predicted{_noises(channels, noise)}", [f"{name}\n[{unit}]" for name, unit in channels]
    return _figure(title, data, axes, "time [s]", _shades(rows, held, len(channels)))


def residual(
    rows: pd.DataFrame, noise: dict[str, float], held: Sequence[int] = (), limits: Mapping[str, float] = NONE
) -> Figure:
    """Measured minus predicted over time beside the noise's band, a plot a channel, a line an engine.

    Limits are the largest that is within, by channel.
    """
    channels = _channels(rows)
    data, shapes = [], list(_shades(rows, held, len(channels)))
    for place, (channel, _) in enumerate(channels, start=1):
        for who, line in rows[rows["channel"] == channel].groupby("who", sort=False):
            t, _, left = _broken(line)
            data.append(_line(t, left, str(who), place, engine=True))
        half = SIGMAS * noise.get(channel, np.nan)
        edge = {"line": {"width": 1.5, "color": GREY}}
        shapes += [_rectangle(place, y=(-half, half)) | edge] if np.isfinite(half) else []
        shapes += [level(f"y{number(place)}", side * limits[channel], "limit") for side in (-1, 1) if channel in limits]
    return _figure(
        f"Measured minus predicted{_noises(channels, noise)}",
        data,
        [f"{name}\n[{unit}]" for name, unit in channels],
        "time [s]",
        shapes,
    )


def correlation(rows: pd.DataFrame) -> Figure:
    """Autocorrelation of the residuals and their correlation with the inputs, beside the 99 % band.

    Lags are in s, where the rows say how long they are.
    """
    lags, below = ("lag_s", "lag [s]") if "lag_s" in rows else ("lag", "lag [averages of residuals]")
    kinds = list(dict.fromkeys(zip(rows["channel"], rows["input"], strict=True)))
    data, shapes = [], []
    for place, (channel, given) in enumerate(kinds, start=1):
        chosen = rows[(rows["channel"] == channel) & (rows["input"] == given)]
        for who, line in chosen.groupby("who", sort=False):
            lag, value = line[lags].to_numpy(float), line["value"].to_numpy(float)
            data.append(
                _line(lag, value, str(who), place, engine=True) | {"mode": "lines+markers", "marker": {"size": 4}}
            )
        band = float(chosen["band"].iloc[0])
        shapes.append(_rectangle(place, y=(-band, band)))
    names = [f"{channel} with\n{given or 'itself'}" for channel, given in kinds]
    made = _figure("Correlation of the residuals; 99 % band in grey", data, names, below, shapes)
    made["layout"]["meta"] = "ends"  # where the page names lines
    return made


def profile(rows: pd.DataFrame, estimates: pd.DataFrame) -> Figure:
    """How the sum of squares rises about every estimate, in % of that there, 95 % intervals in grey.

    Dashed is how far a parabola through its values rises at the ends of an interval: where the line meets it elsewhere,
    the interval is another one.
    """
    names = list(dict.fromkeys(rows["name"]))
    known = estimates.set_index("name")
    data, shapes = [], []
    for place, name in enumerate(names, start=1):
        line = rows[rows["name"] == name]
        values, rise = line["value"].to_numpy(float), 100.0 * (line["cost"].to_numpy(float) - 1.0)
        data.append(_line(values, rise, name, place) | {"mode": "lines+markers", "showlegend": False})
        low, high = float(known["low"][name]), float(known["high"][name])
        shapes.append(_rectangle(place, x=(low, high)))
        away, half = (values - 0.5 * (low + high)) ** 2, 0.5 * (high - low)
        if np.isfinite(half) and np.any(away > 0.0):
            shapes.append(level(f"y{number(place)}", float(away @ rise / (away @ away)) * half**2, "95 %"))
    layout = _figure("Rise of the sum of squares about each estimate; 95 % interval in grey, dashed: the rise of a "
                     "parabola at its ends", data, ["sum of squares\n[% more]"] * len(names), "", shapes)  # fmt: skip
    for place, name in enumerate(names, start=1):
        axis = layout["layout"][f"xaxis{number(place)}"]
        axis |= {"title": {"text": f"{plain(name)} [{known['unit'][name]}]"}, "exponentformat": "power"}
        axis.pop("matches", None)
    return layout


def together(rows: pd.DataFrame) -> Figure:
    """Correlations of the estimates, as a map of squares."""
    names = list(dict.fromkeys(rows["name"]))
    wide = rows.pivot(index="name", columns="other", values="value").loc[names, names].to_numpy(float)
    labels = [plain(name) for name in names]
    heat = {
        "type": "heatmap", "x": labels, "y": labels, "zmin": -1.0, "zmax": 1.0, "colorscale": SIGNED,
        "xgap": 1, "ygap": 1, "z": [[None if np.isnan(x) else x for x in row] for row in wide.tolist()],
        "text": [["" if np.isnan(x) else f"{x:+.2f}" for x in row] for row in wide],
        "texttemplate": "%{text}", "colorbar": {"title": {"text": "correlation"}},
        "hovertemplate": "%{x} and %{y}: %{z:.4f}<extra></extra>",
    }  # fmt: skip
    return {
        "data": [heat],
        "layout": {
            "title": {"text": "Correlation of the estimates"}, "height": 180 + 60 * len(names),
            "xaxis": {"type": "category", "constrain": "domain"},
            "yaxis": {"type": "category", "autorange": "reversed",
                      "automargin": True, "scaleanchor": "x", "constrain": "domain"},
        },
    }  # fmt: skip


def _noises(channels: Sequence[tuple[str, str]], noise: Mapping[str, float]) -> str:
    """How wide the grey bands are: one that is narrower than a line is not seen."""
    halves = [(name, SIGMAS * noise.get(name, np.nan), unit) for name, unit in channels]
    told = [f"{plain(name)} ±{half:.2g} {unit}" for name, half, unit in halves if np.isfinite(half)]
    return f". Grey: noise of the measurement, {SIGMAS:g} standard deviations: {', '.join(told)}" if told else ""


def _channels(rows: pd.DataFrame) -> list[tuple[str, str]]:
    return list(dict.fromkeys(zip(rows["channel"], rows["unit"], strict=True)))


def _broken(line: pd.DataFrame) -> tuple[Floats, Floats, Floats]:
    """Times, measured values and residuals of one line, with a gap between windows."""
    ends = np.flatnonzero(np.diff(line["window"].to_numpy())) + 1
    columns = (line[key].to_numpy(float) for key in ("t", "measured", "value"))
    t, seen, left = (np.insert(column, ends, np.nan) for column in columns)
    return t, seen, left


def _line(x: Floats, y: Floats, name: str, place: int, engine: bool = False) -> dict[str, Any]:
    """One line; its name stands in the legend once."""
    drawn = ({key: look(name)[key] for key in ("color", "dash")} if engine else {"color": COLOURS[0]}) | {"width": 1.5}
    axis = number(place)
    return {
        "type": "scatter", "mode": "lines", "x": coded(x), "y": coded(single(y)),
        "name": plain(name), "legendgroup": plain(name), "showlegend": place == 1, "line": drawn,
        "xaxis": f"x{axis}", "yaxis": f"y{axis}",
    } | ({"meta": name} if engine else {})  # fmt: skip


def _band(t: Floats, y: Floats, noise: float, place: int) -> Iterator[dict[str, Any]]:
    """Where samples lie whose prediction is right: a filled outline a window."""
    if not np.isfinite(noise):
        return
    half = SIGMAS * noise
    cuts = np.flatnonzero(np.isnan(t))
    parts = [np.delete(part, np.flatnonzero(np.isnan(t[part]))) for part in np.split(np.arange(len(t)), cuts)]
    around = [(np.r_[t[at], t[at][::-1], np.nan], np.r_[y[at] + half, y[at][::-1] - half, np.nan]) for at in parts]
    x, edge = (np.concatenate(one) for one in zip(*around, strict=True))
    line = _line(x, edge, f"within {SIGMAS:g} deviations of the noise", place)
    yield line | {"line": {"width": 0}, "fill": "toself", "fillcolor": "rgba(136,136,136,0.35)", "hoverinfo": "skip"}


def _shades(rows: pd.DataFrame, held: Sequence[int], plots: int) -> Iterator[dict[str, Any]]:
    """Windows that were held out, in every plot."""
    spans = rows[rows["window"].isin(list(held))].groupby("window")["t"].agg(["min", "max"])
    for k, (start, end) in enumerate(spans.itertuples(index=False)):
        for place in range(1, plots + 1):
            name = {"text": "held out", "textposition": "top left", "font": {"size": 10, "color": GREY}}
            shade = _rectangle(place, x=(float(start), float(end))) | {"fillcolor": "#E69F00", "opacity": 0.12}
            yield shade | ({"label": name} if k == 0 and place == 1 else {})


def _rectangle(
    place: int, x: tuple[float, float] | None = None, y: tuple[float, float] | None = None
) -> dict[str, Any]:
    """A grey stretch of one plot between two values of x, or of y."""
    n = number(place)
    ends = {"xref": f"x{n}" if x else f"x{n} domain", "yref": f"y{n}" if y else f"y{n} domain"}
    (x0, x1), (y0, y1) = x or (0.0, 1.0), y or (0.0, 1.0)
    return {
        "type": "rect", "layer": "below", "line": {"width": 0}, "fillcolor": GREY, "opacity": 0.25,
        "x0": x0, "x1": x1, "y0": y0, "y1": y1,
    } | ends  # fmt: skip


def _figure(title: str, data: list[dict[str, Any]], rows: Sequence[str], below: str, shapes: Any) -> dict[str, Any]:
    """Plots one below another, over the same x if that has one title."""
    layout: dict[str, Any] = {
        "title": {"text": title}, "height": 130 + (170 if below else 220) * len(rows), "shapes": list(shapes),
        "legend": {"orientation": "h", "y": 1.0, "yanchor": "bottom"},
    }  # fmt: skip
    tall = 1.0 / (len(rows) + (0.22 if below else 0.4) * (len(rows) - 1))
    for i, row in enumerate(rows):
        n, top = number(i + 1), 1.0 - i * (1.0 - tall) / max(len(rows) - 1, 1)
        text = plain(row).replace("\n", "<br>")
        layout[f"yaxis{n}"] = {"anchor": f"x{n}", "title": {"text": text, "standoff": 14}, "exponentformat": "power",
                               "domain": [max(top - tall, 0.0), top]}  # fmt: skip
        layout[f"xaxis{n}"] = {"anchor": f"y{n}"} | ({"matches": "x"} if n else {})
    if below:
        layout[f"xaxis{number(len(rows))}"]["title"] = {"text": below}
    return {"data": data, "layout": layout}
