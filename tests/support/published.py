"""Robot files of packages that publish some, and the laws that our dynamics, frames and rows of a file are others'.

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
from scenes import rows_at

from crossbody.cases.scene import Loop, Scene
from crossbody.cases.scene_contacts import contacts, rows_of
from crossbody.engines._scene import Forces
from crossbody.engines.pinocchio._coordinates import Coordinates
from crossbody.engines.pinocchio._model import Gaps, spans, tree
from crossbody.reference.tree import mechanism, quantities
from crossbody.reference.tree.table import tabulate

SAME = 1e-10
"""Of the largest entry: what two programs may make of the same numbers."""
STATES = 100
DECIDED = 1e-9, 1e-6
"""A row that turns by the second where coordinates move by the first is decided by rounding: shapes whose axes or
centres meet have no normal, and where two places are as near either may be taken."""
SEEN = 0.9
"""Least part of a file's rows, over all states, that are not."""


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


def close(mine: Any, theirs: Any, least: float = 0.0) -> bool:
    """Whether numbers are the same, by the largest of them, or by a least size."""
    return bool(np.abs(mine - theirs).max(initial=0.0) <= SAME * np.abs(theirs).max(initial=least))


def placed(model: Any, rng: Any) -> Any:
    """Return positions at random, in MuJoCo's coordinates."""
    q = np.array(model.qpos0)
    mujoco.mj_integratePos(model, q, rng.normal(size=model.nv), 1.0)
    return q


def stands_as_in_mujoco(model: Any, scene: Scene) -> None:
    """Assert that every body's frame is MuJoCo's: origin and ends of its axes, as gaps to the world's origin."""
    probes = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
    loops = [
        Loop(name=f"{body.name}.{k}", type="connect", first=body.name, first_position=probe)
        for body in scene.bodies for k, probe in enumerate(probes)
    ]  # fmt: skip
    probed = scene.replace(loops=tuple(loops), tendons=(), pairs=(), shapes=(), actuators=())
    data, rng = mujoco.MjData(model), np.random.default_rng(7)
    for _ in range(STATES):
        data.qpos[:] = q = placed(model, rng)
        mujoco.mj_kinematics(model, data)
        axes = data.xmat[1:].reshape(-1, 3, 3).transpose(0, 2, 1)
        h = rows_at(probed, q, np.zeros(scene.nv), np.zeros(0))[1][: 3 * len(loops)].reshape(-1, 4, 3)
        assert close(h, data.xpos[1:, None] + np.concatenate([np.zeros((len(axes), 1, 3)), axes], axis=1))


def rows_as_in_pinocchio(model: Any, scene: Scene) -> None:
    """Assert that h and H of all rows are those of Pinocchio's kinematics, and that H' v is the rate of H v.

    The engine has its rows written apart; H' v is differenced by complex steps.
    """
    scene = _with_directions(model, scene)
    to, carried, forces = Coordinates(scene), tree(scene), Forces(scene)
    forces.spans = spans(scene, *carried, to)
    theirs, table, rng = Gaps(scene, forces, carried, to), tabulate(scene), np.random.default_rng(7)
    count, seen, rated, step, u = len(rows_of(scene)[0]), 0, 0, 1e-30, np.zeros(len(scene.inputs))
    meets = _meets(scene, count)
    h, qd = np.zeros((2, count), dtype=complex), np.zeros(scene.nq)
    for _ in range(STATES if count else 0):
        q, v = placed(model, rng), rng.normal(size=scene.nv) * 2.0
        (H, gaps, Hdv), moved = rows_at(scene, q, v, u), q.copy()
        mujoco.mj_integratePos(model, moved, rng.normal(size=scene.nv), DECIDED[0])
        turned = np.abs(rows_at(scene, moved, v, u)[0] - H).max(axis=1)
        sure = turned <= DECIDED[1] * np.maximum(1.0, np.abs(H).max(axis=1))
        sure &= np.abs(gaps - meets) > DECIDED[0]
        seen += int(sure.sum())
        r = to.theirs(q)
        gap, rows = theirs.gradient_of(r, slice(None))
        assert close(gaps, gap, 1.0)
        assert close(H[sure], to.velocities(r, rows)[sure], 1.0)
        mechanism.velocity(0.0, q, v, table.p, qd)
        quantities.row_kernels(True)["gaps"](0.0, q + 1j * step * qd, v.astype(complex), table.p.astype(complex), *h)
        size = np.maximum(1.0, np.abs(H).max(axis=1)) * np.abs(v).max() ** 2
        off = np.abs(h[1].imag / step - Hdv)
        known = sure & np.isfinite(off)  # a row of two middles that meet has no direction
        rated += known.sum()
        assert (off[known] <= SAME * np.maximum(size, np.abs(Hdv))[known]).all()
    assert not count or min(seen, rated) / count >= SEEN * STATES


def _with_directions(model: Any, scene: Scene) -> Scene:
    """Return the scene less pairs that are a part of one link at the place of another: they never have a normal."""
    count, still = len(rows_of(scene)[0]), np.zeros(scene.nv)
    gaps = rows_at(scene, placed(model, np.random.default_rng(8)), still, np.zeros(len(scene.inputs)))[1]
    met = [contact.pair.name for contact in contacts(scene) for _ in range(contact.places)]
    near = np.abs(gaps - _meets(scene, count)) <= DECIDED[0]
    none = {name for name, one in zip(met, near[count - len(met) :], strict=True) if one}
    return scene.replace(pairs=tuple(pair for pair in scene.pairs if pair.name not in none))


def _meets(scene: Scene, count: int) -> Any:
    """Return of every row the gap (count,) at which centres or axes meet, or a centre a face; -inf of others."""
    found = [
        -sum(one.size[0] for one in (contact.first, contact.second) if one.type in ("sphere", "capsule"))
        - contact.pair.margin if contact.first.type != "plane" else -np.inf
        for contact in contacts(scene) for _ in range(contact.places)
    ]  # fmt: skip
    return np.concatenate([np.full(count - len(found), -np.inf), found])


def moves_as_in_mujoco(model: Any, scene: Scene) -> None:
    """Assert that M and the forces without constraints are those of MuJoCo at random states."""
    data, rng, ours = mujoco.MjData(model), np.random.default_rng(7), dynamics_of(scene)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    full = np.zeros((model.nv, model.nv))
    for _ in range(STATES):
        q, v, u = placed(model, rng), rng.normal(size=model.nv) * 2.0, rng.normal(size=model.nu) * 20.0
        act = rng.uniform(-0.3, 0.3, model.na)
        data.qpos[:], data.qvel[:], data.ctrl[:], data.act[:] = q, v, u, act
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, full)
        M, f = ours(q, v, np.concatenate([u, np.column_stack([np.zeros(model.na), act]).ravel()]))
        assert close(M, full)
        assert close(f, data.qfrc_passive + data.qfrc_actuator - data.qfrc_bias)
