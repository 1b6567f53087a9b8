"""Multipliers of a run against the truth's and what they may be: every function is a metric."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Case, Trajectory
from crossbody.cases.contacts import CLOSED
from crossbody.reports.measuring.alignment import aligned
from crossbody.reports.measuring.friction import directed, rubbing
from crossbody.reports.measuring.impulse import away, before_stops, cumulative, told, true_impulse, with_collisions
from crossbody.reports.measuring.placed import largest, of_rows
from crossbody.reports.measuring.scale import idle
from crossbody.reports.measuring.truth import Truth, before

UNITS: dict[str, str] = {}
NEEDS = dict.fromkeys(("complementarity", "lam_error", "lam_impulse", "lam_impulse_path"), "lam")


def complementarity(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """How far the multipliers pull, or act where nothing touches, over the largest.

    Max of -lam and of |lam| where they are open, of rows that touch, over max |lam|; NaN where lam is not known. Rows
    of friction push either way. Samples are left out at which friction of a slip may have any direction. Recomputed
    from lam, gap and mode, never an engine's own flag.
    """
    rows = case.law.touches
    if not rows.any():
        return None
    if told(run) is None:
        return math.nan
    lam, rubs = run.lam[:, rows], rubbing(run, case)
    known = np.ones(len(run.t), dtype=bool) if rubs is None else directed(run, rubs)
    scale = float(np.max(np.abs(lam), initial=0.0))
    acting = np.where(_open(truth, run)[:, rows], np.abs(lam), 0.0)
    wrong = np.maximum(np.maximum(-lam, 0.0), acting)
    wrong[~known] = 0.0
    return largest(wrong, run.t, of_rows(case, "N", "N m", rows), scale or 1.0)


def _open(truth: Truth, run: Trajectory) -> NDArray[np.bool_]:
    """Samples and rows (n, nc) where nothing touches: by mode; without modes, above all contacts of the truth."""
    if (run.mode >= 0).all():
        return ~np.isin(run.mode, CLOSED)
    touching = np.isin(truth.trajectory.mode, CLOSED)
    reach = float(np.max(truth.trajectory.gap[touching], initial=0.0))
    return run.gap > 1.01 * reach + 1e-9 * float(np.max(np.abs(run.gap), initial=0.0))


def lam_error(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Multipliers of rows that are always active against the truth's, point by point, over the largest.

    Max |lam - lam_truth| over max |lam_truth|, or what `idle` rows are measured by. None where a row can
    open, NaN where lam is not known. Where an instant stands twice lam jumps: its two sides are compared
    each with its own.
    """
    if case.law.unilateral.any():
        return None
    if np.isnan(run.lam).any():
        return math.nan
    inside, exact = aligned(truth, run, case)
    scale = float(np.max(np.abs(exact.lam), initial=0.0))
    scale = max(scale, idle(truth.trajectory)) if scale else 0.0
    off = np.abs(run.lam[inside] - exact.lam)
    return largest(off, run.t[inside], of_rows(case, "N", "N m"), scale) if scale else None


def lam_impulse(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Total impulse of the multipliers against the truth's, over the truth's.

    Max over rows of |INT lam dt - INT lam_truth dt| / max over rows of |INT lam_truth dt|; NaN where lam is
    unknown. Rows that carry nothing are measured by what is `idle`. Both integrals take the same samples by
    the same rule, so that the error of the rule cancels. Collisions that take no time have no lam and do not
    count: beside them a compliant truth has samples too few for its own integral.
    """
    inside, exact = aligned(truth, run, case)
    if not inside.any():
        return None
    if np.isnan(run.lam).any():
        return math.nan
    run, exact = before_stops(run, exact)
    mine, theirs = cumulative(run)[inside][-1], cumulative(exact)[-1]
    scale = float(np.max(np.abs(theirs), initial=0.0))
    least = idle(truth.trajectory) * case.t_end
    off, end = np.abs(mine - theirs)[None], run.t[inside][-1:]
    return largest(off, end, of_rows(case, "N s", "N m s"), max(scale, least)) if scale else None


def lam_impulse_path(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Cumulative impulse of the multipliers against the truth's, over the total impulse.

    Max over t and rows of |INT_0^t lam - INT_0^t lam_truth| / total impulse, collisions that take no time
    included. Releases are matched too, as lam jumps there: a sample on the wrong side would count for half
    its step. At the instant at which a slip stops its friction may have any direction: the sample before counts
    there. Instants of collisions that take no time are left out, as in `velocity`. NaN where lam is not
    known; None where nothing presses, or where rows depend on each other and multipliers are one choice of
    many; N s where only the run's does. Nothing is compared behind where slips are too slow to tell their friction.
    """
    run = before(run, truth.firm) if truth.firm < math.inf else run
    inside, exact = aligned(truth, run, case, releases=True)
    if not inside.any() or truth.trajectory.counts.get("redundant", 0):
        return None
    if np.isnan(run.lam).any():
        return math.nan
    run, exact = before_stops(run, exact)
    theirs = true_impulse(run, exact, truth.trajectory)
    scale = float(np.max(np.abs(theirs), initial=0.0))
    smooth = away(exact, [event.t for event in truth.trajectory.events if event.impulse], case.t_end)
    smooth &= away(run, [event.t for event in run.events if event.impulse], case.t_end)[inside]
    off = np.abs(with_collisions(run, run.events)[inside] - theirs)[smooth]
    scale = max(scale, idle(truth.trajectory) * case.t_end) if scale else 0.0
    found = largest(off, run.t[inside][smooth], of_rows(case, "N s", "N m s"), scale or 1.0)
    return found if scale else found or None
