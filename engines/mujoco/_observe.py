"""Gaps and energies as MuJoCo computes them, of states that were recorded."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from crossbody.cases._arrays import Floats
from crossbody.engines._log import Observe


def of_equalities(model: Any) -> Observe:
    """Read the residuals of the equality rows, m or rad, and kinetic and potential energy, J, from the model.

    The states are put into an `MjData` of its own, so that a run can go on.
    """
    data = mujoco.MjData(model)

    def observe(q: Floats, v: Floats) -> tuple[Floats, Floats]:
        gaps, energy = [], np.empty((len(q), 2))
        for i in range(len(q)):
            data.qpos[:], data.qvel[:] = q[i], v[i]
            mujoco.mj_fwdPosition(model, data)
            mujoco.mj_fwdVelocity(model, data)
            mujoco.mj_energyPos(model, data)
            mujoco.mj_energyVel(model, data)
            gaps.append(data.efc_pos[: data.ne].copy())
            energy[i] = data.energy[1], data.energy[0]
        return np.array(gaps), energy

    return observe


def mass_matrix(model: Any, data: Any) -> Floats:
    """Return the dense M (nv, nv) at the state that was looked at last."""
    full: Floats = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    return full
