"""Multipliers of a run against the truth's and what they may be: every function is a metric."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Case, Trajectory
from crossbody.cases.contacts import CLOSED
from crossbody.reports.measuring.alignment import aligned
from crossbody.reports.measuring.friction import directed, rubbing
from crossbody.reports.measuring.impulse import told
from crossbody.reports.measuring.placed import largest, of_rows
from crossbody.reports.measuring.scale import idle
from crossbody.reports.measuring.truth import Truth

UNITS: dict[str, str] = {}
NEEDS = dict.fromkeys(("complementarity", "lam_error"), "lam")


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
