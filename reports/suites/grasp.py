"""A soft grasp with any gains, compliances and delays of its touch sensors: stable loops and unstable ones."""

from __future__ import annotations

from crossbody.reports.suites._axis import Linear, Log
from crossbody.reports.suites._contract import Family, Suite

SUITE = Suite(
    families=(
        Family(
            case="soft_contact", variant="axis", finishes=False, second=20,
            axes={
                "kstar": Linear(0.0, 60.0), "ks": Log(1e1, 1e3), "kp": Log(1e3, 1e5), "cp": Log(1.0, 1e2),
                "block_mass": Log(1e-2, 1e1), "bt": Log(1e-1, 1e2), "offset": Linear(-0.008, 0.008),
            },
        ),
    ),
    runs=16,
)  # fmt: skip
