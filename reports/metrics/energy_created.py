"""Energy behind the collisions of a cradle less the energy before, over the kinetic energy that came in."""

from __future__ import annotations

from typing import TYPE_CHECKING

from crossbody.reports.metrics._cradle import is_cradle, outgoing, row

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth

UNIT = "1"
CLAIMED = False


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """(E_out - E_in) / T_in, negative if lost; None for another mechanism, or where the collisions are not over."""
    at, speeds = outgoing(run, case) if is_cradle(case) else (0, None)
    if speeds is None:
        return None
    brought = 0.5 * float(row(case).masses @ row(case).v0 ** 2)
    return float(run.total_energy[at] - run.total_energy[0]) / brought
