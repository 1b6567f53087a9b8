"""How an engine looks in plots, tables and pictures, and how plotly is told texts, arrays and axes."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.reports.measuring.truth import TRUTH
from crossbody.reports.runs.store import Trace

# Okabe and Ito's colours: told apart by colour-blind readers, on light and on dark.
COLOURS = ("#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9", "#8C6D00", "#7F7FFF", "#9B59D0")
DASHES = ("solid", "dash", "dot", "dashdot")
STROKES = {"solid": "none", "dash": "7 4", "dot": "2 3", "dashdot": "7 3 2 3"}
"""The same dashes as lengths, for what plotly does not draw."""
LEVEL = "#8a8a8a"
"""Of limits and zero lines: seen on light and on dark pages."""


def label(trace: Trace) -> str:
    """Engine and profile; "truth" for the truth."""
    return f"{trace.about['engine']}:{trace.about['profile']}" if trace.about["engine"] != TRUTH else TRUTH


def style(trace: Trace, i: int) -> dict[str, Any]:
    """Colour, dash and width of the trace at place i of a case; the truth is a broad grey line."""
    if label(trace) == TRUTH:
        return {"color": "#888888", "dash": "solid", "width": 4, "strokes": "none"}
    dash = DASHES[i % len(DASHES)]
    return {"color": COLOURS[i % len(COLOURS)], "dash": dash, "width": 1.8, "strokes": STROKES[dash]}


def number(row: int) -> str:
    """How plotly numbers its axes: the first one is not numbered."""
    return "" if row == 1 else str(row)


def plain(text: str) -> str:
    """A text in which plotly finds no tags."""
    return text.replace("<", "&lt;")


def coded(array: Floats) -> dict[str, str]:
    """An array as plotly reads it from base64 ("typed array specification")."""
    text = base64.b64encode(np.ascontiguousarray(array).tobytes()).decode()
    shape = {"shape": ",".join(map(str, array.shape))} if array.ndim > 1 else {}
    return {"dtype": f"f{array.itemsize}", "bdata": text} | shape
