"""A change of a robot file is a difference in a reader of it exactly where it changes the compiled model."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from places import ROBOTS
from robot_damage import damaged

from crossbody.engines.importers import mujoco as own
from crossbody.engines.importers.beside.robot import measured
from crossbody.reports.importers.audit import Audit, opened
from crossbody.reports.importers.compare import WRONG, rows

SEEDS = 40
SAID = (
    "body_pos", "body_quat", "body_mass", "jnt_pos", "jnt_axis", "qpos0", "dof_armature", "dof_damping",
    "dof_frictionloss", "jnt_stiffness", "actuator_gear", "actuator_gainprm", "actuator_biasprm", "key_qpos",
)  # fmt: skip
"""Arrays of the compiled model each of whose numbers is compared, wherever it stands."""
SEEN = 1e-6
"""A change of such a number that no rounding hides, of the larger of the two and 1."""


def moved(model: Any) -> list[bool]:
    """Return which bodies some joint moves: of those that stand, mass is of no effect."""
    return [bool(model.body_dofnum[model.body_weldid[i]]) for i in range(model.nbody)]


def changed(before: Any, after: Any) -> bool:
    """Return whether an array that is compared differs, by the compiled models alone."""
    if moved(before) != moved(after):
        return True
    for name in SAID:
        old, new = getattr(before, name), getattr(after, name)
        if old.shape != new.shape:
            return True
        if name == "body_quat":  # a quaternion and its negative are one orientation
            new = new * np.where((old * new).sum(axis=1) < 0.0, -1.0, 1.0)[:, None]
        off = np.abs(old - new) > SEEN * np.maximum(1.0, np.maximum(np.abs(old), np.abs(new)))
        if (off[moved(before)] if name == "body_mass" else off).any():
            return True
    return not np.allclose(before.opt.gravity, after.opt.gravity, rtol=0.0, atol=SEEN)


def same(before: Any, after: Any) -> bool:
    """Return whether two compiled models are the same in every array but what is drawn, and in all names."""
    skipped = ("name", "geom_rgba", "cam_", "light_", "tex", "mat_", "sensor_", "paths", "user")
    arrays = [name for name in dir(before) if name[0] != "_" and isinstance(getattr(before, name), np.ndarray)]
    return before.names == after.names and all(
        getattr(before, name).shape == getattr(after, name).shape
        and np.array_equal(getattr(before, name), getattr(after, name))
        for name in arrays if not name.startswith(skipped) and not name.endswith("_user")
    ) and np.array_equal(before.opt.gravity, after.opt.gravity) and before.opt.timestep == after.opt.timestep and (
        before.opt.disableflags == after.opt.disableflags)  # fmt: skip


def read(path: Path, audit: Audit) -> set[str]:
    """Return the quantities in which MuJoCo's reading of a file differs from what another said."""
    answer = measured(own.open_robot(str(path), urdf=False), audit.job) | {"told": []}
    told = rows("mujoco", answer, audit.wanted, audit.job["joints"])
    return {row.quantity for row in told if row.verdict == WRONG}


@pytest.mark.slow
@pytest.mark.parametrize("path", sorted(ROBOTS.glob("*/*.xml")), ids=lambda path: path.stem)
def test_a_change_of_the_model_is_a_difference_and_nothing_else_is(path: Path, tmp_path: Path) -> None:
    """40 changes a robot, each held to what the file said before: what MuJoCo compiles says which must be seen."""
    audit, model, text = opened(path), mujoco.MjModel.from_xml_path(str(path)), path.read_text()
    seen, kept = 0, 0
    for seed in range(SEEDS):
        file = tmp_path / f"{seed}.xml"
        file.write_text(damaged(text, seed))
        try:
            other = mujoco.MjModel.from_xml_path(str(file))
        except ValueError:
            continue
        off = read(file, audit)
        if changed(model, other):
            assert off, seed
            seen += 1
        elif same(model, other):
            assert not off, (seed, off)
            kept += 1
    assert min(seen, kept) >= 1
