"""What is read of a model at the state that was looked at last."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.scene import Scene
from crossbody.engines._contacts import Poses


def mass_matrix(model: Any, data: Any) -> Floats:
    """Return the dense M (nv, nv) at the state that was looked at last."""
    full: Floats = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    return full


def constraint_jacobian(model: Any, data: Any) -> Floats:
    """Return the dense rows (nefc, nv) that are active; MuJoCo's are sparse from 60 velocities on."""
    if not mujoco.mj_isSparse(model):
        return np.array(data.efc_J).reshape(-1, model.nv)
    full: Floats = np.zeros((data.nefc, model.nv))
    if data.nefc:
        mujoco.mju_sparse2dense(full, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind)
    return full


def numbers(scene: Scene) -> dict[str, int]:
    """Return MuJoCo's number of every body, and the world, whose name is empty; a file need not."""
    return {"": 0, **{body.name: i for i, body in enumerate(scene.bodies, start=1)}}


def pose_of(data: Any, bodies: Mapping[str, int]) -> Poses:
    """Return what gives the pose of a body by its name, where the kinematics were computed last."""
    return lambda body: (data.xmat[bodies[body]].reshape(3, 3), data.xpos[bodies[body]])
