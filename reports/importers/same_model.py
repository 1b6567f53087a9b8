"""Whether two compiled models are the same in what an audit does not look at."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from crossbody.cases import SceneError
from crossbody.cases.arrays import Floats
from crossbody.cases.files.reading import read

KEPT = (
    "geom_type", "geom_contype", "geom_conaffinity", "geom_condim", "geom_priority", "geom_friction",
    "geom_solref", "geom_solimp", "geom_solmix", "geom_margin", "geom_gap", "geom_fluid",
    "geom_group", "site_type", "site_size", "pair_friction", "pair_solref", "pair_solimp",
    "pair_margin", "pair_gap", "pair_dim", "exclude_signature", "jnt_solref", "jnt_solimp",
    "jnt_actfrcrange", "jnt_actgravcomp", "body_gravcomp", "jnt_margin", "dof_solref", "dof_solimp",
    "dof_frictionloss", "eq_type", "eq_solref", "eq_solimp", "tendon_range", "tendon_stiffness",
    "tendon_damping", "tendon_frictionloss", "tendon_armature", "actuator_gear", "actuator_gainprm",
    "actuator_biasprm", "actuator_dynprm", "actuator_ctrlrange", "actuator_forcerange",
    "actuator_gaintype", "actuator_biastype", "actuator_dyntype", "key_qpos", "key_qvel", "key_ctrl",
)  # fmt: skip
"""Of the compiled model: what the rewriting must not touch."""
STATES, LIKE = 3, 1e-7
"""States at which places are compared, and how far they may be apart, m; meshes have single precision."""
SPHERE, BOX, ROUND = 2, 6, (0, 3, 5)
"""Types of shapes: those in ROUND (plane, capsule, cylinder) are the same however turned about their axis."""


def check_model(path: Path, half: Path) -> None:
    """Check what the audit does not look at: shapes, contacts, actuators, tendons, keyframes."""
    before, after = read(path)[0], read(half)[0]
    for name in KEPT:
        old, new = np.asarray(getattr(before, name)), np.asarray(getattr(after, name))
        if old.shape != new.shape or not np.allclose(old, new, rtol=1e-9, atol=1e-12, equal_nan=True):
            raise SceneError(f"{path} cannot be rewritten: {name} of its compiled model would differ.")
    for (what, old), (_, new) in zip(_placed(before), _placed(after), strict=True):
        if not _same(old, new):
            raise SceneError(f"{path} cannot be rewritten: {what} would differ.")


def _placed(model: Any) -> Iterator[tuple[str, Floats]]:
    """Yield where shapes, sites, cameras and lights are, and what sensors say, at fixed states."""
    import mujoco

    data, rng = mujoco.MjData(model), np.random.default_rng(0)
    for _ in range(STATES):
        mujoco.mj_resetData(model, data)
        mujoco.mj_integratePos(model, data.qpos, rng.uniform(-1.0, 1.0, model.nv), 1.0)
        data.qvel[:] = rng.uniform(-1.0, 1.0, model.nv)
        mujoco.mj_forward(model, data)
        for what, kinds, p, R in (
            ("where shapes are", model.geom_type, data.geom_xpos, data.geom_xmat),
            ("where sites are", model.site_type, data.site_xpos, data.site_xmat),
            ("where cameras are", np.full(model.ncam, BOX), data.cam_xpos, data.cam_xmat),
        ):
            turns = R.reshape(-1, 3, 3).copy()
            turns[kinds == SPHERE] = 0.0
            turns[np.isin(kinds, ROUND), :, :2] = 0.0  # however they are turned about their axis
            yield what, np.column_stack([kinds, p, turns.reshape(-1, 9)])
        yield "where lights are", np.column_stack([data.light_xpos, data.light_xdir])
        yield "what sensors say", np.column_stack([np.arange(model.nsensordata), data.sensordata])
        yield "how many contacts there are", np.array([[data.ncon]], dtype=float)


def _same(old: Floats, new: Floats) -> bool:
    """Return whether every row has its like: the order may be another."""
    if old.shape != new.shape:
        return False
    if not old.size:
        return True
    off = np.abs(old[:, None] - new[None]).max(axis=2) / (1.0 + np.abs(old).max())
    return bool((off.min(axis=0) < LIKE).all() and (off.min(axis=1) < LIKE).all())
