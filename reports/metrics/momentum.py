"""Momentum that appeared or got lost on the line of a cradle's sliders, over the momentum that came in."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.reports.metrics._cradle import row

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth

UNIT = "1"
CLAIMED = False


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max |sum m v - sum m v(0)| / sum m v(0); None for another mechanism: strings and floors take momentum up."""
    if case.mechanism != "sliders":
        return None
    momentum = run.v @ row(case).masses
    return float(np.max(np.abs(momentum - momentum[0])) / abs(momentum[0]))
