"""The physics as it reached Pinocchio's model, for the parity audit (docs/explanation/verdicts.md)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin

from crossbody.cases import Case, Mode
from crossbody.engines.pinocchio._rows import PinRows, mass_matrix


def audit(case: Case, rows: PinRows, constants: Mapping[str, Any]) -> Mapping[str, Any]:
    """Numbers read back from the model, and M(q), bias(q, v), H(q) and lam(q, v) of all rows together.

    lam has no bound: it is what the law of a row just entered asks for, negative where the row would pull.
    """
    model, data = rows.model, rows.data

    on = tuple(int(Mode.COLLISION if fast else Mode.CONTACT) for fast in rows.fast)
    return {
        "masses": np.array([inertia.mass for inertia in model.inertias[1:]]),
        "gravity": float(np.linalg.norm(model.gravity.linear)),
        "constants": constants,
        "q0": case.q0,
        "v0": case.v0,
        "M": lambda q: mass_matrix(model, data, q),
        "bias": lambda q, v: np.array(pin.nonLinearEffects(model, data, q, v)),
        "H": rows.jacobian,
        "lam": lambda q, v: rows.accelerate(q, v, on)[1],
    }
