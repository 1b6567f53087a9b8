"""One step of the pair of order 3(2) by Bogacki and Shampine, for sampled control.

Between two ticks the motion is far smoother than the ticks are apart, so a high-order step spends its stages in vain:
this one needs four right-hand sides a tick, the last at the step's end.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.algebra import copy
from crossbody.reference.core.dop853 import derivative, keep_velocity, watch_multipliers
from crossbody.reference.core.layout import Model, Work
from crossbody.reference.kinds import Array, Floats

STAGES = 4
LAST = np.int64(STAGES - 1)
_A = np.array([[0.0, 0.0, 0.0], [1 / 2, 0.0, 0.0], [0.0, 3 / 4, 0.0], [2 / 9, 1 / 3, 4 / 9]])
C = np.array([0.0, 1 / 2, 3 / 4, 1.0])
B = np.array([*_A[3], 0.0])
_E = np.array([-5 / 72, 1 / 12, 1 / 9, -1 / 8])


@compiled
def _advance(y: Array, k: Floats, stage: int, h: float, out: Array) -> None:
    """Out = y + h sum_j A[stage, j] k[j]."""
    for i in range(len(y)):
        out[i] = y[i] + h * (_A[stage, 0] * k[0, i] + _A[stage, 1] * k[1, i] + _A[stage, 2] * k[2, i])


@compiled
def _error(s: Any, w: Work, h: float) -> float:
    """Root mean square of the embedded estimate in units of the tolerance; NaN where a stage was NaN."""
    total = 0.0
    k = w.k
    size = s.nq + s.n
    for i in range(size):
        e = h * (_E[0] * k[0, i] + _E[1] * k[1, i] + _E[2] * k[2, i] + _E[3] * k[3, i])
        e /= w.atol[i] + s.rtol * max(abs(w.y[i]), abs(w.y1[i]))
        total += e * e
    return float(np.sqrt(total / size))


@compiled
def step(K: Any, s: Any, m: Model, w: Work, h: float) -> float:
    """From y and k[0] to y1 and k[3] = f(y1); the error in units of the tolerance, -1 if a stage is ill posed."""
    for stage in range(1, STAGES):
        _advance(w.y, w.k, stage, h, w.ys)
        if derivative(K, s, m, w, s.t + C[stage] * h, w.ys, stage) != 0:
            return -1.0
        watch_multipliers(s, m, w, stage)
        keep_velocity(s, w, stage)
    copy(w.ys, w.y1)
    if s.ledger:
        _advance(w.z, w.kz, STAGES - 1, h, w.z1)
    return _error(s, w, h)
