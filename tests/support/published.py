"""Robot files of packages that publish some, and the law that our dynamics of a file are MuJoCo's.

All the files are there with `pip install '.[robots]'`; without it, those of the packages that are installed.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, distribution
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from crossbody.cases.scene import Scene
from crossbody.reference.tree import mechanism
from crossbody.reference.tree.table import tabulate

SAME = 1e-10
"""Of the largest entry: what two programs may make of the same numbers."""
STATES = 100


def _inside(package: str, *parts: str) -> Path:
    """Return a folder of a package, which is not imported; one that does not exist where it is not installed."""
    spec = find_spec(package)
    places = list(spec.submodule_search_locations or ()) if spec is not None else []
    return Path(places[0], *parts) if places else Path("/nowhere")


def _urdf() -> Path:
    try:
        files = distribution("example-robot-data").locate_file("cmeel.prefix/share/example-robot-data/robots")
    except PackageNotFoundError:
        return Path("/nowhere")
    return Path(str(files))


MJCF = {
    f"{package}/{path.stem}": path
    for package, folder in (
        ("gymnasium", _inside("gymnasium", "envs", "mujoco", "assets")),
        ("dm_control", _inside("dm_control", "suite")),
    )
    for path in sorted(folder.glob("*.xml"))
}
URDF = {f"{path.parent.parent.name}/{path.stem}": path for path in sorted(_urdf().glob("**/*.urdf"))}


def dynamics_of(scene: Scene) -> Callable[[Any, Any, Any], tuple[Any, Any]]:
    """Return what gives M and the forces at q, v and inputs u."""
    table = tabulate(scene)
    w = np.zeros(table.scratch)

    def ours(q: Any, v: Any, u: Any) -> tuple[Any, Any]:
        M, f = np.zeros((scene.nv, scene.nv)), np.zeros(scene.nv)
        mechanism.dynamics(0.0, q, v, u, table.p, M, f, w)
        return M, f

    return ours


def close(mine: Any, theirs: Any) -> bool:
    return bool(np.abs(mine - theirs).max() <= SAME * np.abs(theirs).max())


def moves_as_in_mujoco(model: Any, scene: Scene) -> None:
    """Assert that M and the forces without constraints are those of MuJoCo at random states."""
    data, rng, ours = mujoco.MjData(model), np.random.default_rng(7), dynamics_of(scene)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    full = np.zeros((model.nv, model.nv))
    for _ in range(STATES):
        q = np.array(model.qpos0)
        mujoco.mj_integratePos(model, q, rng.normal(size=model.nv), 1.0)
        v, u = rng.normal(size=model.nv) * 2.0, rng.normal(size=model.nu) * 20.0
        act = rng.uniform(-0.3, 0.3, model.na)
        data.qpos[:], data.qvel[:], data.ctrl[:], data.act[:] = q, v, u, act
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, full)
        M, f = ours(q, v, np.concatenate([u, np.column_stack([np.zeros(model.na), act]).ravel()]))
        assert close(M, full)
        assert close(f, data.qfrc_passive + data.qfrc_actuator - data.qfrc_bias)
