"""One impact without gravity, damping ratio 0 to 10 and stiffness 1 to 1e12 1/s^2: end states in closed form."""

from __future__ import annotations

from crossbody.reports.suites._axis import Levels, Linear, Log
from crossbody.reports.suites._contract import Family, Suite
from crossbody.reports.suites._scenes import damped

_IMPACT = {"gravity": 0.0, "height": 0.0, "a2": 0.0, "t_end": 100.0}
_LAW = {"a0": Log(1.0, 1e12), "mass": Log(1e-6, 1e6), "speed": Log(1e-6, 1e3)}

SUITE = Suite(
    families=(
        Family(
            case="bouncing_ball", variant="linear", scene=damped, ends=True, fixed=_IMPACT,
            axes={**_LAW, "zeta": Linear(0.0, 10.0)},
        ),
        Family(
            case="bouncing_ball", variant="linear", scene=damped, ends=True, fixed=_IMPACT,
            axes={**_LAW, "zeta": Log(1e-8, 1.0)},
        ),
        Family(
            case="bouncing_ball", variant="linear", scene=damped, ends=True, fixed=_IMPACT,
            axes=_LAW, grid={"zeta": Levels((0.0, 1.0 - 1e-9, 1.0, 1.0 + 1e-9, 2.0))},
        ),
    ),
    runs=1400,
)  # fmt: skip
