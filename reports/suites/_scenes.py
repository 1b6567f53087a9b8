"""From what is drawn to parameters, where several suites share the way."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from crossbody.reports.suites._contract import Drawn


def numbers(drawn: Drawn, *names: str) -> list[float]:
    """The drawn values of these names."""
    return [float(drawn[name]) for name in names]


def damped(drawn: Drawn, _rng: np.random.Generator) -> Drawn:
    """A damping ratio zeta becomes a1 = 2 zeta sqrt(a0)."""
    found: dict[str, Any] = dict(drawn)
    found["a1"] = 2.0 * float(found.pop("zeta")) * math.sqrt(float(found["a0"]))
    return found


def uneven(drawn: Drawn, rng: np.random.Generator) -> Drawn:
    """Masses even in their logarithm between 1/sqrt(ratio) and sqrt(ratio), the two ends among them; who strikes."""
    found: dict[str, Any] = dict(drawn)
    n, decades = int(found["n"]), math.log10(float(found.pop("ratio")))
    masses = 10.0 ** (decades * (rng.permutation(np.concatenate([[0.0, 1.0], rng.random(n - 2)])) - 0.5))
    return found | {"masses": ",".join(f"{m:.6g}" for m in masses), "lifted": int(rng.integers(1, n))}


def lifted(drawn: Drawn, rng: np.random.Generator) -> Drawn:
    """Any number of the balls strikes the others."""
    return {**drawn, "lifted": int(rng.integers(1, int(drawn["n"])))}


def direction(length: float, rng: np.random.Generator) -> list[float]:
    """A vector (3,) of this length in any direction, even on the sphere."""
    v = rng.normal(size=3)
    found: list[float] = (length * v / np.linalg.norm(v)).tolist()
    return found
