"""The linear law in MuJoCo's direct format, without the regularisation.

aref = -B h' - K d h with the impedance d = dmin = dmax at its largest, solref = (-K dmax^2, -B dmax).
"""

from __future__ import annotations

from typing import Any

MAX_IMPEDANCE = 0.9999  # MuJoCo clamps d there; it leaves R = (1 - d)/d diagA, a bias of 1e-4 in lam
IMPEDANCE = (MAX_IMPEDANCE, MAX_IMPEDANCE, 1e-3, 0.5, 1.0)
"""The solimp that goes with it: the same impedance at every depth."""
REMAINING = 1e-7
"""Factor on R. With PGS on one row the error of lam falls with it: 2e-8, 2e-11, 6e-13 at 1e-4, 1e-7, 1e-9."""


def solref_of(a0: float, a1: float) -> tuple[float, float]:
    """Return the solref that gives aref = -a1 h' - a0 h; both negative or zero, or MuJoCo replaces them."""
    return -MAX_IMPEDANCE * a0, -MAX_IMPEDANCE * a1


def without_regularisation(model: Any) -> None:
    """Scale what R is made from: inverse weights of bodies (contacts), joints (joint rows) and tendons."""
    model.body_invweight0[:] *= REMAINING
    model.dof_invweight0[:] *= REMAINING
    model.tendon_invweight0[:] *= REMAINING
