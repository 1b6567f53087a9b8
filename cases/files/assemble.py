"""A start on the loops of a file, nearest to the one given."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.errors import SceneError

ROUNDS = 50
CLOSED = 1e-13  # m or rad: rounding of a gap
DEPENDENT = 1e-9  # singular value of the rows, over the largest, that counts as zero


def assembled(model: Any, q: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Return the nearest start with every loop closed: Newton's method, each step the least in the metric of M.

    Returns:
        Positions (nq,) and velocities (nv,) that keep the loops closed.

    Raises:
        SceneError: if none is found.
    """
    import mujoco

    data, found = mujoco.MjData(model), np.array(q)
    M = np.zeros((model.nv, model.nv))
    for _ in range(ROUNDS):
        data.qpos[:], data.qvel[:] = found, 0.0
        mujoco.mj_fwdPosition(model, data)
        if not data.ne:
            return found, v
        h, H = np.array(data.efc_pos[: data.ne]), np.array(data.efc_J).reshape(-1, model.nv)[: data.ne]
        mujoco.mj_fullM(model, data, M)
        root = np.linalg.cholesky(M)
        rows = np.linalg.solve(root, H.T).T
        off_h, off_v = np.linalg.lstsq(rows, np.column_stack([h, H @ v]), rcond=DEPENDENT)[0].T
        if np.abs(h).max(initial=0.0) <= CLOSED:
            return found, v - np.linalg.solve(root.T, off_v)
        mujoco.mj_integratePos(model, found, -np.linalg.solve(root.T, off_h), 1.0)
    raise SceneError(f"The start does not assemble: no positions that close the loops are found from q = {q.tolist()}.")
