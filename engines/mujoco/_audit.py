"""The physics as it reached the compiled model, in the case's coordinates, for the parity audit (spec 5.3)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import mujoco
import numpy as np

from crossbody.cases import Case, Mode
from crossbody.cases.arrays import Floats
from crossbody.cases.files.warned import captured
from crossbody.engines.mujoco._direct import law_of
from crossbody.engines.mujoco._globals import hooked
from crossbody.engines.mujoco._observe import mass_matrix
from crossbody.engines.mujoco._scene import Scene


def audit(case: Case, scene: Scene, matched: bool) -> Mapping[str, Any]:
    """Numbers read back from the model, and functions that evaluate it at a state.

    M(q) (nv, nv), bias(q, v) (nv,), H(q) (nc, nv), lam(q, v) (nc,) N; every row that can be on is on. The functions
    work on the run's own data, which every run resets.
    """
    model, data = scene.model, scene.data
    look = _looker(scene)

    def M(q: Floats) -> Floats:
        look(q, np.zeros(model.nv))
        return mass_matrix(model, data)

    def bias(q: Floats, v: Floats) -> Floats:
        look(q, v)
        return np.array(data.qfrc_bias - data.qfrc_passive)

    def H(q: Floats) -> Floats:
        look(q, np.zeros(model.nv))
        return np.array(data.efc_J).reshape(-1, model.nv)[: scene.nc]

    def lam(q: Floats, v: Floats) -> Floats:
        look(q, v)
        return np.atleast_1d(np.array(scene.lam()))

    found: dict[str, Any] = {
        "masses": model.body_mass[1:].copy(),
        "gravity": float(np.linalg.norm(model.opt.gravity)),
        "constants": _constants(case, model, matched),
        "q0": case.q0,
        "v0": case.v0,
        "M": M,
        "bias": bias,
        "lam": lam,
    }
    return found | ({"H": H} if matched else {})


def _constants(case: Case, model: Any, matched: bool) -> dict[str, Any]:
    rows = [model.eq_solref[i] for i in range(model.neq) if model.eq_active0[i]] + list(model.pair_solref)
    if not matched:
        return {"solref": np.array(rows[0] if rows else model.geom_solref[0])}
    a0, a1 = np.array([law_of(r) for r in rows[: len(case.law.a0)]]).T
    return {"a0": a0, "a1": a1, "a2": case.law.a2}


def _looker(scene: Scene) -> Callable[[Floats, Floats], None]:
    def look(q: Floats, v: Floats) -> None:
        scene.start()
        scene.data.qpos[:] = q
        scene.data.qvel[:] = v
        if scene.arm is not None:
            scene.arm((int(Mode.CONTACT),) * scene.nc)
        with captured(), hooked(scene.hook):
            mujoco.mj_forward(scene.model, scene.data)

    return look
