"""What a run of the soft contact tells, by the names of its coordinates and contacts."""

from __future__ import annotations

from functools import partial

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.between import multipliers
from crossbody.cases.case import Case, CaseMetric
from crossbody.cases.contacts import contacts
from crossbody.cases.mechanisms.delta import pose
from crossbody.cases.parameters import of_numbers
from crossbody.cases.trajectory import Trajectory

SIDES = ("left", "right")


def touch(side: str, run: Trajectory, case: Case) -> float | None:
    """Return when a finger first touches, s; None if it does not."""
    index = case.contacts.index(side)
    return min((c.touch for c in contacts(run) if c.row == index), default=None)


def imbalance(lam: Floats, case: Case) -> Floats:
    """Return lam_L - lam_R (n,) of multipliers (n, nc), N."""
    left, right = (lam[:, case.contacts.index(side)] for side in SIDES)
    return left - right


def _coordinate(case: Case, name: str) -> int:
    return [c.name for c in case.coordinates].index(name)


def block(run: Trajectory, case: Case) -> tuple[Floats, Floats]:
    """Return position (n,), m, and velocity (n,), m/s, of the block along the fingers."""
    k = _coordinate(case, "block")
    return run.q[:, k], run.v[:, k]


def flange(run: Trajectory, case: Case) -> Floats:
    """Return the position of the flange along the fingers (n,), m."""
    if case.variant == "axis":
        return run.q[:, _coordinate(case, "flange")]
    return pose.flanges(of_numbers(case.parameters), run.q[:, :9])[:, 0]


def invariant(run: Trajectory, case: Case) -> Floats:
    """Return x_ref + k (mb b' + bt (b - b0)) + k (y_R - y_L)/ks of every sample (n,), m.

    Of q and v as the reference's mechanisms carry them: the error is the rate of its integral,
    x_ref = error + flange.
    """
    p = {name: case.number(name) for name in ("block_mass", "bt", "ks", "pad_mass")}
    k = 0.01 * case.number("kstar")
    b, rate = block(run, case)
    pads = [run.v[:, _coordinate(case, f"{side} pad")] for side in SIDES]
    felt = p["ks"] * p["pad_mass"] * np.sum(pads, axis=0)
    if case.variant == "axis":
        error = run.v[:, _coordinate(case, "integral of the error")]
        felt += run.v[:, _coordinate(case, "right sensor")] - run.v[:, _coordinate(case, "left sensor")]
    else:
        error = run.v[:, _coordinate(case, "integral of the error x")]
        felt += run.v[:, _coordinate(case, "difference of the sensors")]
    kept: Floats = error + flange(run, case) + k * (p["block_mass"] * rate + p["bt"] * (b - b[0]) + felt / p["ks"])
    return kept


def _contact_imbalance(run: Trajectory, case: Case) -> float:
    """Max |lam_L - lam_R| over the run, between its samples too; NaN where lam is not known."""
    lam = multipliers(run)
    return float(np.max(np.abs(imbalance(run.lam if lam is None else lam, case))))


def _drift(run: Trajectory, case: Case) -> float:
    kept = invariant(run, case)
    return float(np.max(np.abs(kept - kept[0])))


METRICS = {
    "block_end": CaseMetric(
        doc="where the block stands at the end, along the fingers",
        unit="m", number=lambda run, case: float(block(run, case)[0][-1]),
    ),
    "contact_imbalance": CaseMetric(
        doc="largest difference of the contact forces on both sides of the block", unit="N", number=_contact_imbalance
    ),
    "end_imbalance": CaseMetric(
        doc="difference of the contact forces at the end: 0 where the block is centred",
        unit="N", number=lambda run, case: abs(float(imbalance(run.lam, case)[-1])),
    ),
    "flange_end": CaseMetric(
        doc="where the flange stands at the end, along the fingers: who moved, robot or block",
        unit="m", number=lambda run, case: float(flange(run, case)[-1]),
    ),
    "tactile_invariant": CaseMetric(
        doc="drift of x_ref + k (mb b' + bt (b - b0)) + k (y_R - y_L)/ks, which the tactile loop keeps",
        unit="m", number=_drift,
    ),
    **{
        f"touch_{side}": CaseMetric(
            doc=f"instant at which the {side} finger first touches the block", unit="s", number=partial(touch, side)
        )
        for side in SIDES
    },
}  # fmt: skip
