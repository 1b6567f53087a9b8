"""Impulses of 1e-6 to 1e4 N s on the delta robot's flange, as pulses of any length and in no time."""

from __future__ import annotations

import numpy as np

from crossbody.reports.suites._axis import Levels, Log
from crossbody.reports.suites._contract import Drawn, Family, Suite
from crossbody.reports.suites._scenes import direction


def _anywhere(drawn: Drawn, rng: np.random.Generator) -> Drawn:
    """The impulse in any direction."""
    found = dict(drawn)
    jx, jy, jz = direction(float(found.pop("impulse")), rng)
    return found | {"jx": jx, "jy": jy, "jz": jz}


SUITE = Suite(
    families=(
        Family(
            case="delta_impulse", variant="light", scene=_anywhere, fixed={"t_end": 0.5, "start": 0.0}, second=20,
            axes={"impulse": Log(1e-6, 1e4), "length": Log(1e-6, 1e-1)}, finishes=False,
        ),
        Family(
            case="delta_impulse", variant="dirac", scene=_anywhere, fixed={"t_end": 0.5}, second=20,
            axes={"impulse": Log(1e-6, 1e4)}, grid={"z": Levels((0.5, 0.6, 0.7))}, finishes=False,
        ),
    ),
    runs=12,
)  # fmt: skip
