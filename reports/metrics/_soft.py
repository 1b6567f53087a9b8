"""Signals of the soft contact, by the names of its coordinates and contacts; None for another case."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.reports.metrics._contacts import contacts

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory

SIDES = ("left", "right")


def is_soft(case: Case) -> bool:
    """Whether two fingers of this case touch a block."""
    return set(SIDES) <= set(case.contacts) and any(c.name == "block" for c in case.coordinates)


def touch(run: Trajectory, case: Case, side: str) -> float | None:
    """When a finger first touches, s."""
    if not is_soft(case):
        return None
    row = case.contacts.index(side)
    return min((c.touch for c in contacts(run) if c.row == row), default=None)


def imbalance(lam: Floats, case: Case) -> Floats | None:
    """lam_L - lam_R of multipliers (n, nc), N, at every sample (n,)."""
    if not is_soft(case):
        return None
    left, right = (lam[:, case.contacts.index(side)] for side in SIDES)
    difference: Floats = left - right
    return difference


def _place(case: Case, name: str) -> int:
    return [c.name for c in case.coordinates].index(name)


def block(run: Trajectory, case: Case) -> tuple[Floats, Floats]:
    """Position (n,), m, and velocity (n,), m/s, of the block along the fingers."""
    k = _place(case, "block")
    return run.q[:, k], run.v[:, k]


def flange(run: Trajectory, case: Case) -> Floats:
    """Position of the flange along the fingers (n,), m."""
    if case.variant == "axis":
        return run.q[:, _place(case, "flange")]
    from crossbody.reference.delta import flanges, scene

    return flanges(scene.robot_of(case.parameters), run.q[:, :9])[:, 0]


def invariant(run: Trajectory, case: Case) -> Floats:
    """x_ref + k (mb b' + bt (b - b0)) + k (y_R - y_L)/ks of every sample (n,), m.

    Of q and v as the reference's mechanisms carry them: the error is the rate of its integral, x_ref = error + flange.
    """
    p = {name: case.number(name) for name in ("block_mass", "bt", "ks", "pad_mass")}
    k = 0.01 * case.number("kstar")
    b, rate = block(run, case)
    pads = [run.v[:, _place(case, f"{side} pad")] for side in SIDES]
    felt = p["ks"] * p["pad_mass"] * np.sum(pads, axis=0)
    if case.variant == "axis":
        error = run.v[:, _place(case, "integral of the error")]
        felt += run.v[:, _place(case, "right sensor")] - run.v[:, _place(case, "left sensor")]
    else:
        error = run.v[:, _place(case, "integral of the error x")]
        felt += run.v[:, _place(case, "difference of the sensors")]
    kept: Floats = error + flange(run, case) + k * (p["block_mass"] * rate + p["bt"] * (b - b[0]) + felt / p["ks"])
    return kept
