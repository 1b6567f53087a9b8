"""Robots of three packages: read, or refused for a reason that is known, and with the physics of other readers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from places import ROBOTS
from published import (
    MJCF,
    STATES,
    URDF,
    close,
    dynamics_of,
    moves_as_in_mujoco,
    rows_as_in_pinocchio,
    stands_as_in_mujoco,
)

from crossbody.cases import SceneError
from crossbody.cases.files.case import check_runnable
from crossbody.cases.files.reading import model_of, scene_of
from crossbody.cases.scene import Scene
from crossbody.reference.tree.table import tabulate

REFUSED = {
    "dm_control/fish": "medium",
    "dm_control/lqr": "no joint",
    "dm_control/quadruped": "height field",
    "dm_control/swimmer": "medium",
    "gymnasium/swimmer": "medium",
    "alex_description/alex_psyonic_hands": "'index_q1', which does not exist",
    "hector_description/quadrotor_base": "no joint",
    "iris_description/iris_simple": "no joint",
    "ur_description/ur3": "no joint",
}
"""What a scene does not have, and the word by which the refusal says so."""
PUBLISHED = sorted(path for path in ROBOTS.glob("*/*.xml"))
NOTHING = [pytest.param("", marks=pytest.mark.skip(reason="The packages of the extra `robots` are not installed."))]


def read(name: str, path: Path) -> tuple[Any, Scene] | None:
    """Return the model and the scene of a file less its friction; None where it is refused as it should be."""
    try:
        model = model_of(path, "friction")
        scene = scene_of(path, model)
        check_runnable(scene)
        tabulate(scene)
    except SceneError as error:
        if REFUSED.get(name, "none of these words") not in str(error):
            raise
        return None
    assert name not in REFUSED, f"{name} is read now"
    return model, scene


EVERY = {**{f"shared/{path.stem}": path for path in PUBLISHED}, **MJCF, **URDF}


@pytest.mark.parametrize("name", list(EVERY) or NOTHING)
def test_a_published_file_has_the_frames_of_mujoco_and_the_rows_of_pinocchio(name: str) -> None:
    found = read(name, EVERY[name])
    if found is None:
        return
    stands_as_in_mujoco(*found)
    rows_as_in_pinocchio(*found)


@pytest.mark.parametrize("name", list(MJCF) or NOTHING)
def test_a_published_file_has_the_dynamics_of_mujoco(name: str) -> None:
    found = read(name, MJCF[name])
    if found is None:
        return
    moves_as_in_mujoco(*found)


@pytest.mark.parametrize("name", list(URDF) or NOTHING)
def test_a_published_urdf_has_the_dynamics_of_pinocchio(name: str) -> None:
    """M and the bias by Pinocchio's own reader; damping is no part of its dynamics."""
    found = read(name, URDF[name])
    if found is None:
        return
    scene = found[1]
    theirs = pin.buildModelFromUrdf(str(URDF[name]))
    data, rng, ours = theirs.createData(), np.random.default_rng(7), dynamics_of(scene)
    places = [theirs.joints[theirs.getJointId(joint.name)] for joint in scene.joints]
    order = [place.idx_v for place in places]
    assert sorted(order) == list(range(theirs.nv)), "the same joints"
    for _ in range(STATES):
        q, v = rng.normal(size=scene.nv), rng.normal(size=scene.nv) * 2.0
        r, w = pin.neutral(theirs), np.zeros(theirs.nv)
        for place, x in zip(places, q, strict=True):
            r[place.idx_q : place.idx_q + place.nq] = [x] if place.nq == 1 else [np.cos(x), np.sin(x)]
        w[order] = v
        M, f = ours(q, v, np.zeros(len(scene.inputs)))
        damped = np.array([joint.damping[0] for joint in scene.joints]) * v
        full = pin.crba(theirs, data, r)
        full = np.triu(full) + np.triu(full, 1).T
        assert close(M, full[np.ix_(order, order)] + np.diag([joint.armature for joint in scene.joints]))
        assert close(f + damped, -pin.nonLinearEffects(theirs, data, r, w)[order])
