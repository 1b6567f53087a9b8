"""The maze as it reached the compiled models, in the case's coordinates, for the parity audit (spec 5.3)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import mujoco
import numpy as np

from crossbody.cases import Case
from crossbody.cases.arrays import Floats
from crossbody.cases.files.warned import captured
from crossbody.engines._maze.machine import MazeMachine
from crossbody.engines._maze.rows import SLIP_BELOW
from crossbody.engines.mujoco._direct import law_of
from crossbody.engines.mujoco._globals import hooked
from crossbody.engines.mujoco._maze_charts import Charts
from crossbody.engines.mujoco._maze_model import PHI, RHO, THETA, X, Y
from crossbody.engines.mujoco._observe import mass_matrix

FLYING = [THETA, X, Y, PHI]
"""The case's coordinates among the model's."""


def matched(case: Case, charts: Charts) -> dict[str, Any]:
    """M and bias of the ball that flies, with the torque of the controller's mode at the start; the law of the rows.

    H is not shown: the chain's rows are exact on their faces, and the audit's states lie elsewhere.
    """
    model = charts.model
    start = MazeMachine(charts.maze, charts.probe).untouched(tuple(case.q0.tolist()))

    def look(q: Floats, v: Floats) -> None:
        with captured(), hooked(charts.stage):
            charts.arm(start, tuple(q.tolist()), tuple(v.tolist()))

    a0, a1 = law_of(model.jnt_solref[RHO])
    normal = len(case.law.a0[:SLIP_BELOW])
    constants = {"a0": np.full(normal, a0), "a1": np.full(normal, a1)}
    if charts.maze.rows.rolling:
        slip = law_of(model.eq_solref[0])
        constants = {name: np.append(constants[name], [slip[k]] * 2) for k, name in enumerate(("a0", "a1"))}
    found = _shown(case, model, charts.data, FLYING, look)
    return {**found, "constants": {**constants, "a2": np.zeros(len(case.law.a2))}}


def segments(case: Case, model: Any, data: Any) -> dict[str, Any]:
    """M, and bias without the controller's torque; the contacts' constants are MuJoCo's own."""

    def look(q: Floats, v: Floats) -> None:
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = q, v
        with captured():
            mujoco.mj_forward(model, data)

    found = _shown(case, model, data, range(4), look)
    if case.parameters["controller"] != "off":
        del found["bias"]
        found["hidden"]["bias"] = "The controller's torque is in it, by a hook that belongs to a run."
    return {**found, "constants": {"solref": model.geom_solref[0].copy()}}


def _shown(
    case: Case, model: Any, data: Any, own: Sequence[int], look: Callable[[Floats, Floats], None]
) -> dict[str, Any]:
    rows = list(own)

    def M(q: Floats) -> Floats:
        look(q, np.zeros(4))
        return mass_matrix(model, data)[np.ix_(rows, rows)]

    def bias(q: Floats, v: Floats) -> Floats:
        look(q, v)
        return np.array(data.qfrc_bias - data.qfrc_passive - data.qfrc_applied)[rows]

    at_rest = M(case.q0)
    return {
        "masses": np.diag(at_rest).copy(),
        "gravity": float(np.linalg.norm(model.opt.gravity)),
        "q0": case.q0,
        "v0": case.v0,
        "M": M,
        "bias": bias,
        "hidden": {
            "H": "The chain's rows are exact on their faces, and the audit's states lie elsewhere.",
            "lam": "Rows depend on where the ball is: no state has all of them on at once.",
        },
    }
