"""Steps of torque on the delta robot: servos of any gain pulled out of place, towards its singular pose too."""

from __future__ import annotations

from crossbody.reports.suites._axis import Linear, Log
from crossbody.reports.suites._contract import TIGHT, Family, Suite

# Servos move within a step or two here, and the energy account is a quadrature beside the motion, which sets the steps.
SUITE = Suite(
    families=(
        Family(
            case="delta_impulse", variant="servos", fixed={"t_end": 0.5}, second=20, finishes=False,
            axes={"kp": Log(1.0, 1e4), "kd": Log(1e-3, 1e2), "x": Linear(-0.1, 0.1), "z": Linear(0.45, 0.7)},
        ),
        Family(
            case="delta_singularity", variant="light", fixed={"t_end": 2.0, "start": 1.0}, second=20, finishes=False,
            ladder=TIGHT,
            axes={"kp": Log(1.0, 1e4), "kd": Log(1e-2, 1e2), "ramp": Log(1e-4, 1.0), "offset": Linear(-0.2, 0.2)},
        ),
        Family(
            case="delta_tracking", variant="circle", fixed={"t_end": 0.3}, finishes=False,
            axes={"radius": Linear(0.01, 0.15), "frequency": Log(0.1, 20.0), "limit": Log(1e-2, 1e2)},
        ),
    ),
    runs=12,
)  # fmt: skip
