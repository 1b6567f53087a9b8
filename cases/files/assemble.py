"""A start on the loops of a file, nearest to the one given."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.cases._arrays import Floats
from crossbody.cases._errors import SceneError

ROUNDS = 50
CLOSED = 1e-13  # m or rad: rounding of a gap
DEPENDENT = 1e-9  # singular value of the rows, over the largest, that counts as zero


def assembled(model: Any, q: Floats) -> Floats:
    """Return positions (nq,) with every loop closed: Newton's method, each step the least in the metric of M.

    Raises:
        SceneError: if none is found.
    """
    import mujoco

    data, found = mujoco.MjData(model), np.array(q)
    M = np.zeros((model.nv, model.nv))
    for _ in range(ROUNDS):
        data.qpos[:], data.qvel[:] = found, 0.0
        mujoco.mj_fwdPosition(model, data)
        h, H = np.array(data.efc_pos[: data.ne]), np.array(data.efc_J).reshape(-1, model.nv)[: data.ne]
        if np.abs(h).max(initial=0.0) <= CLOSED:
            return found
        mujoco.mj_fullM(model, data, M)
        root = np.linalg.cholesky(M)
        least = np.linalg.lstsq(np.linalg.solve(root, H.T).T, h, rcond=DEPENDENT)[0]
        mujoco.mj_integratePos(model, found, -np.linalg.solve(root.T, least), 1.0)
    raise SceneError(f"The start does not assemble: no positions that close the loops are found from q = {q.tolist()}.")
