"""From what is drawn to the parameters of a case, where these are not its axes."""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING, Any

from crossbody.cases import CrossbodyError
from crossbody.reports.suites.contract import Drawn

if TYPE_CHECKING:
    import numpy as np

GRAVITY = 9.81
RADIUS, LENGTH = 0.025, 0.25  # of the pendulums that pass each other, m


def numbers(drawn: Drawn, *names: str) -> list[float]:
    """The drawn values of these names."""
    return [float(drawn[name]) for name in names]


def damped(drawn: Drawn, _rng: np.random.Generator) -> Drawn:
    """A damping ratio zeta becomes a1 = 2 zeta sqrt(a0)."""
    found: dict[str, Any] = dict(drawn)
    found["a1"] = 2.0 * float(found.pop("zeta")) * math.sqrt(float(found["a0"]))
    return found


def uneven(drawn: Drawn, rng: np.random.Generator) -> Drawn:
    """Masses even in logarithm between 1/sqrt(ratio) and sqrt(ratio), both ends among them; who strikes."""
    import numpy as np

    found: dict[str, Any] = dict(drawn)
    n, decades = int(found["n"]), math.log10(float(found.pop("ratio")))
    masses = 10.0 ** (decades * (rng.permutation(np.concatenate([[0.0, 1.0], rng.random(n - 2)])) - 0.5))
    return found | {"masses": ",".join(f"{m:.6g}" for m in masses), "lifted": int(rng.integers(1, n))}


def lifted(drawn: Drawn, rng: np.random.Generator) -> Drawn:
    """Any number of the balls strikes the others."""
    return {**drawn, "lifted": int(rng.integers(1, int(drawn["n"])))}


def bouncing_on(drawn: Drawn, _rng: np.random.Generator) -> Drawn:
    """A horizon of so many flights of the first bounce."""
    bounces, height, a0 = numbers(drawn, "bounces", "height", "a0")
    flight = 2.0 * math.sqrt(2.0 * height / GRAVITY) + math.pi / math.sqrt(a0)
    return {"height": height, "a0": a0, "a1": 0.0, "gravity": GRAVITY, "t_end": bounces * flight}


def about_threshold(drawn: Drawn, _rng: np.random.Generator) -> Drawn:
    """A speed as a multiple of the threshold speed."""
    from crossbody.cases.closed_forms import threshold_speed

    a0, zeta, near = numbers(drawn, "a0", "zeta", "near")
    a1 = 2.0 * zeta * math.sqrt(a0)
    return {"a0": a0, "a1": a1, "speed": near * threshold_speed(a0, a1, GRAVITY)}


def passing(drawn: Drawn, _rng: np.random.Generator) -> Drawn:
    """The gap at rest for which the swing ends `off` metres before (positive) or behind the touch.

    Centres at rest stand D apart; the ball at the end of its swing stands (L sin A, L (1 - cos
    A)) from its own rest, and touches where (D - L sin A)^2 + L^2 (1 - cos A)^2 = 4 r^2.
    """
    swing, off = numbers(drawn, "swing", "off")
    across, up = LENGTH * math.sin(swing), LENGTH * (1.0 - math.cos(swing))
    apart = across + math.sqrt(4.0 * RADIUS**2 - up * up)
    return {"n": 2, "angle": -swing, "gap": apart - 2.0 * RADIUS + off}


def anywhere(drawn: Drawn, rng: np.random.Generator) -> Drawn:
    """The impulse in any direction, even on the sphere."""
    import numpy as np

    found = dict(drawn)
    v = rng.normal(size=3)
    jx, jy, jz = (float(found.pop("impulse")) * v / np.linalg.norm(v)).tolist()
    return found | {"jx": jx, "jy": jy, "jz": jz}


def at_the_edge(drawn: Drawn, _rng: np.random.Generator) -> Drawn:
    """From (0, 0, 0.5) towards the edge of the delta robot's workspace, less a part `off` of the way."""
    import numpy as np

    azimuth, elevation, off = numbers(drawn, "azimuth", "elevation", "off")
    level = np.cos(elevation)
    e = np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])
    start, low, high = np.array([0.0, 0.0, 0.5]), 0.0, 1.5
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _reachable(start + middle * e) else (low, middle)
    x, y, z = start + (1.0 - off) * low * e
    return {"x": float(x), "y": float(y), "z": float(z)}


def _reachable(z: np.ndarray[Any, Any]) -> bool:
    from crossbody.cases.mechanisms.delta.pose import pose

    try:
        pose(_robot(), z)
    except CrossbodyError:
        return False
    return True


@cache
def _robot() -> dict[str, Any]:
    from crossbody.cases.loading import module

    return {name: parameter.default for name, parameter in module("delta_free").PARAMETERS.items()}
