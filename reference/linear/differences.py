"""Differences, for functions that do not take complex numbers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from crossbody.reference.kinds import Floats


def differences(function: Callable[[Floats], Floats], x: Floats, step: float) -> Floats:
    """Derivative (m, n) of a function of x (n,) by central differences of fourth order."""
    columns = []
    for e in step * np.eye(len(x)):
        near, far = function(x + e) - function(x - e), function(x + 2.0 * e) - function(x - 2.0 * e)
        columns.append((8.0 * near - far) / (12.0 * step))
    return np.stack(columns, axis=-1)
