"""Time steps that resolve a law."""

from __future__ import annotations

import math

import numpy as np

from crossbody.cases import Law


def resolving_step(law: Law, depth: float = 0.0, steps: int = 20) -> float:
    """A time step with that many steps in half a period of the fastest row, s (spec 4.2). inf without a law.

    Args:
        law: constants of every row; the fast ones count too.
        depth: penetration at which the cubic part is linearised, m: w^2 = a0 + 3 a2 d^2. a1 bounds the step as well.
        steps: in half a period.
    """
    stiffness = np.maximum(law.a0 + 3 * law.a2 * depth**2, law.b0)
    rate = float(np.max(np.maximum(np.sqrt(stiffness), np.maximum(law.a1, law.b1)), initial=0.0))
    return math.pi / rate / steps if rate > 0 else math.inf
