"""How an engine looks in plots and tables; how plotly is given texts, arrays, axes, plots in a grid."""

from __future__ import annotations

import base64
import colorsys
import zlib
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crossbody.cases.arrays import Floats
from crossbody.reports.figures.section import Figure
from crossbody.reports.measuring.truth import TRUTH
from crossbody.reports.runs.store import Trace

# Okabe and Ito's colours: distinguished by colour-blind readers, on light and on dark.
COLOURS = ("#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9", "#8C6D00", "#7F7FFF", "#9B59D0")
DASHES = ("solid", "dash", "dot", "dashdot")
LOOKS = {
    "reference:compiled": "#0072B2", "mujoco:matched": "#E69F00", "pinocchio:law": "#009E73",
    "mujoco:default": "#D55E00", "pinocchio:admm": "#CC79A7", "reference:cvode": "#56B4E9",
    "pinocchio:impulse": "#8C6D00", "reference:ida": "#7F7FFF", "pinocchio:impulse_simultaneous": "#9B59D0",
    "mujoco:as_is": "#D81B60", "drake:matched": "#00A6A6", "drake:continuous": "#7CB518",
    "drake:default": "#4C8C2B", "dart:matched": "#A3A500", "dart:default": "#B5179E",
    "exudyn:matched": "#8D6E63", "exudyn:default": "#C08A5A", "pymunk:matched": "#E75480",
    "pymunk:default": "#5F7A8C",
}  # fmt: skip
"""Of the engines that come along: one has its colour on every page of every report; a dash goes with its place here."""
OTHERS = 360
"""Of how many colours, around the circle, that of any other engine is one."""
STROKES = {"solid": "none", "dash": "7 4", "dot": "2 3", "dashdot": "7 3 2 3"}
"""The same dashes as lengths, for what plotly does not draw."""
LEVEL = "#8a8a8a"
"""Of limits and zero lines: seen on light and on dark pages."""
LINE = {"color": LEVEL, "dash": "dash", "width": 1}
"""Where a limit, or a bound, is."""
ACROSS = 0.09  # between two columns, part of the width
APART, MOST, FEW = 0.72, 8, 3  # of labels of a logarithmic axis: decades between two, how many, and of a short one


def label(trace: Trace) -> str:
    """Engine and profile; "truth" for the truth."""
    return f"{trace.about['engine']}:{trace.about['profile']}" if trace.about["engine"] != TRUTH else TRUTH


def called(trace: Trace) -> str:
    """Return how a plot and a button call it: as its label, but a log that stands for the truth "measured"."""
    return str(trace.about.get("called", label(trace)))


def style(trace: Trace) -> dict[str, Any]:
    """Colour, dash and width of a trace; the truth is a broad grey line."""
    if label(trace) == TRUTH:
        return {"color": "#888888", "dash": "solid", "width": 4, "strokes": "none"}
    return look(label(trace))


def look(who: str) -> dict[str, Any]:
    """Colour, dash and width of an engine:profile, by its name alone, so that it looks the same everywhere."""
    place = place_of(who)
    dash = DASHES[(place + 2 * (place // len(COLOURS))) % len(DASHES)]  # like colours come with other dashes
    return {"color": LOOKS.get(who) or _hue(place), "dash": dash, "width": 1.8, "strokes": STROKES[dash]}


def place_of(who: str) -> int:
    """Return the place of an engine:profile among those that come along, or a number that its name makes."""
    return list(LOOKS).index(who) if who in LOOKS else zlib.crc32(who.encode()) % OTHERS


def _hue(place: int) -> str:
    """A colour of the circle that is seen on light and on dark."""
    parts = colorsys.hls_to_rgb(place / OTHERS, 0.5, 0.55)
    return "#" + "".join(f"{round(255 * part):02X}" for part in parts)


def number(row: int) -> str:
    """How plotly numbers its axes: the first one is not numbered."""
    return "" if row == 1 else str(row)


def plain(text: str) -> str:
    """A text in which plotly finds no tags."""
    return text.replace("<", "&lt;")


def single(values: Floats) -> NDArray[np.float32]:
    """Return values in single precision; what is larger than any plot shows is infinite, a gap."""
    with np.errstate(over="ignore"):
        return values.astype(np.float32)


def coded(array: Floats | NDArray[np.float32]) -> dict[str, str]:
    """An array as plotly reads it from base64 ("typed array specification")."""
    text = base64.b64encode(np.ascontiguousarray(array).tobytes()).decode()
    shape = {"shape": ",".join(map(str, array.shape))} if array.ndim > 1 else {}
    return {"dtype": f"f{array.itemsize}", "bdata": text} | shape


def level(axis: str, value: float, name: str) -> dict[str, Any]:
    """A line across the plot of a y axis, and what it is, which the page writes over all lines."""
    ends = {"xref": f"x{axis[1:]} domain", "yref": axis, "x0": 0.0, "x1": 1.0, "y0": value, "y1": value}
    line = {"color": LEVEL, "width": 1.2, "dash": "dash"}
    return {"type": "line", "layer": "above", "line": line, "name": name} | ends


def logarithmic(values: ArrayLike) -> dict[str, Any]:
    """A logarithmic axis over values: labelled at whole powers of ten, over less than two decades between them too.

    plotly labels whole powers alone where it is asked for at most one label in 0.7 decades, and every digit where it is
    asked for more than three in a decade.
    """
    seen = np.asarray(values, dtype=np.float64)
    seen = seen[np.isfinite(seen) & (seen > 0.0)]
    decades = float(np.ptp(np.log10(seen))) if len(seen) else 0.0
    most = int(min(decades / APART, MOST)) if decades >= 2.0 else FEW
    return {"type": "log", "nticks": most, "exponentformat": "power"}


class Panels:
    """Plots of one figure in rows and columns.

    Args:
        title: of the figure.
        height: of the figure, pixels.
        rows, cols: how many plots.
        gap: between two rows, part of the height.
        heads: title of every column, or of every plot, row by row.
        shared: whether the plots of a column share x; its last one then carries the ticks.
    """

    def __init__(
        self, title: str, height: int, *, rows: int = 1, cols: int = 1, gap: float = 0.06,
        heads: Sequence[str] = (), shared: bool = True,
    ) -> None:  # fmt: skip
        self.rows, self.cols, self.data = rows, cols, list[dict[str, Any]]()
        self.layout: dict[str, Any] = {"title": {"text": title}, "height": height, "annotations": []}
        width, tall = (1.0 - ACROSS * (cols - 1)) / cols, (1.0 - gap * (rows - 1)) / rows
        for k in range(rows * cols):
            row, column = divmod(k, cols)
            left, top, n = column * (width + ACROSS), 1.0 - row * (tall + gap), number(k + 1)
            self.layout[f"xaxis{n}"] = {"anchor": f"y{n}", "domain": [left, left + width]}
            self.layout[f"yaxis{n}"] = {"anchor": f"x{n}", "domain": [max(top - tall, 0.0), top]}
            if shared and rows > 1:
                self.layout[f"xaxis{n}"] |= {"matches": f"x{number(column + 1)}"} if row else {}
                self.layout[f"xaxis{n}"]["showticklabels"] = row == rows - 1
            if k < len(heads):
                place = {"x": left + 0.5 * width, "y": top, "xref": "paper", "yref": "paper", "yanchor": "bottom"}
                self.layout["annotations"].append({"text": plain(heads[k]), "showarrow": False} | place)

    def add(self, row: int = 1, col: int = 1, **trace: Any) -> None:
        """Draw a trace in a plot; arrays and columns of tables may be among its values."""
        n = number((row - 1) * self.cols + col)
        named = {"name": plain(trace["name"])} if "name" in trace else {}
        values = {"type": "scatter"} | {key: _value(value) for key, value in trace.items()}
        self.data.append(values | named | {"xaxis": f"x{n}", "yaxis": f"y{n}"})

    def axes(self, kind: str, row: int | None = None, col: int | None = None, title: str = "", **settings: Any) -> None:
        """Set up the axes "x" or "y" of all plots, or of those of one row or column."""
        titled = {"title": {"text": title}} if title else {}
        for k in range(self.rows * self.cols):
            here = divmod(k, self.cols)
            if row in (None, here[0] + 1) and col in (None, here[1] + 1):
                self.layout[f"{kind}axis{number(k + 1)}"] |= titled | settings

    def figure(self, **layout: Any) -> Figure:
        """Return data and layout."""
        return {"data": self.data, "layout": self.layout | layout}


def _value(value: Any) -> Any:
    """An array as plotly reads it; what holds texts as a list."""
    if isinstance(value, dict):
        return {key: _value(each) for key, each in value.items()}
    if not hasattr(value, "dtype") or not hasattr(value, "__len__"):
        return value
    array = np.asarray(value)
    return coded(array.astype(float)) if array.dtype.kind in "fiub" else [str(each) for each in array.tolist()]
