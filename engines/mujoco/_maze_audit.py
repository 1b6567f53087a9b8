"""The maze as it reached the compiled model, in the case's coordinates, for the parity audit (spec 5.3)."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from crossbody.cases import Case
from crossbody.cases.arrays import Floats
from crossbody.cases.files.warned import captured
from crossbody.engines.mujoco._observe import mass_matrix


def audit(case: Case, model: Any) -> dict[str, Any]:
    """Return M, and bias without the controller's torque; the contacts' constants are MuJoCo's own."""
    data = mujoco.MjData(model)

    def look(q: Floats, v: Floats) -> None:
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = q, v
        with captured():
            mujoco.mj_forward(model, data)

    def M(q: Floats) -> Floats:
        look(q, np.zeros(4))
        return mass_matrix(model, data)

    def bias(q: Floats, v: Floats) -> Floats:
        look(q, v)
        return np.array(data.qfrc_bias - data.qfrc_passive - data.qfrc_applied)

    driven = "The controller's torque is in it, by a hook that belongs to a run."
    hidden = {
        "H": "Contacts are pairs of shapes, with frames of their own.",
        "lam": "Rows depend on where the ball is: no state has all of them on at once.",
        **({"bias": driven} if case.parameters["controller"] != "off" else {}),
    }
    shown = {"M": M, "bias": bias}
    return {
        "masses": np.diag(M(case.q0)).copy(), "gravity": float(np.linalg.norm(model.opt.gravity)), "q0": case.q0,
        "v0": case.v0, "constants": {"solref": model.geom_solref[0].copy()}, "hidden": hidden,
        **{name: function for name, function in shown.items() if name not in hidden},
    }  # fmt: skip
