"""Gaps and energies as MuJoCo computes them, of states that were recorded."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.scene import Scene
from crossbody.engines._contacts import Poses
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


def numbers(scene: Scene) -> dict[str, int]:
    """Return MuJoCo's number of every body, and of the world, whose name is empty; a file need not name them."""
    return {"": 0, **{body.name: i for i, body in enumerate(scene.bodies, start=1)}}


def pose_of(data: Any, bodies: Mapping[str, int]) -> Poses:
    """Return what gives the pose of a body by its name, where the kinematics were computed last."""
    return lambda body: (data.xmat[bodies[body]].reshape(3, 3), data.xpos[bodies[body]])
