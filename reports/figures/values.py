"""How texts, arrays and axes are written for plotly."""

from __future__ import annotations

import base64

import numpy as np

from crossbody.cases.arrays import Floats


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
