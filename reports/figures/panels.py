"""Plots in rows and columns, as the plain values that plotly reads."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from crossbody.reports.figures.section import Figure
from crossbody.reports.figures.styles import coded, number, plain

ACROSS = 0.09  # between two columns, part of the width


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
