"""Sizes of a motion on its rows: time steps that resolve a law, and how deep and how fast rows get."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from crossbody.cases import Law
from crossbody.cases.arrays import Floats


def resolving_step(law: Law, depth: float = 0.0, steps: int = 20) -> float:
    """A time step with that many steps in half a period of the fastest row, s. inf without a law.

    Args:
        law: constants of every row; the fast ones count too.
        depth: penetration at which the cubic part is linearised, m: w^2 = a0 + 3 a2 d^2. a1
            bounds the step as well.
        steps: in half a period.
    """
    stiffness = np.maximum(law.a0 + 3 * law.a2 * depth**2, law.b0)
    rate = float(np.max(np.maximum(np.sqrt(stiffness), np.maximum(law.a1, law.b1)), initial=0.0))
    return math.pi / rate / steps if rate > 0 else math.inf


def depths(constants: Floats, h: Floats, hd: Floats, hdd: Floats, opens: Any) -> tuple[Floats, Floats]:
    """Return how deep and how fast (nc,) rows get if what drives them at the start does so until they close.

    v^2/2 is |h'' h| and what moves and what is stored at the start; a0 d^2/2 + a2 d^4/4 holds it
    at the deepest.

    Args:
        constants: a0, a1, a2 (3, nc).
        h: gaps (nc,) at the start.
        hd: their rates.
        hdd: their accelerations with no row acting.
        opens: which rows can (nc,).
    """
    a0, _, a2 = constants
    stored = np.where((h < 0.0) | ~np.asarray(opens, dtype=bool), a0 * h**2 / 2 + a2 * h**4 / 4, 0.0)
    energy = 0.5 * hd * hd + np.abs(hdd * h) + stored
    with np.errstate(divide="ignore", invalid="ignore"):
        deep: Floats = np.nan_to_num(np.fmin(np.sqrt(2.0 * energy / a0), (4.0 * energy / a2) ** 0.25), posinf=0.0)
    return deep, np.sqrt(2.0 * energy)
