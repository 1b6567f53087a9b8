"""Scenes, and rows of scenes, that several tests ask for."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from crossbody.cases.scene import Actuator, Body, Joint, Pair, RowLaw, Scene, Shape
from crossbody.cases.scene_contacts import rows_of
from crossbody.engines.mujoco import _build as build
from crossbody.reference.tree import mechanism, quantities
from crossbody.reference.tree.table import tabulate

BALL = Scene(
    bodies=(Body(name="ball", mass=0.5, inertia=(1e-3, 1e-3, 1e-3, 0.0, 0.0, 0.0)),),
    joints=(Joint(name="x", body="ball", type="slide", axis=(1.0, 0.0, 0.0)),),
    shapes=(
        Shape(name="ball", body="ball", type="sphere", size=(0.1, 0.0, 0.0)),
        Shape(name="wall", type="plane", position=(0.3, 0.0, 0.0), orientation=(0.5**0.5, 0.0, -(0.5**0.5), 0.0)),
    ),
    pairs=(Pair(name="touch", first="wall", second="ball", law=RowLaw(a0=2e4, a1=40.0)),),
    actuators=(Actuator(name="push", joint="x"),),
)  # fmt: skip


def compiled(scene: Scene) -> Any:
    spec = build.spec_of(scene)
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    spec.option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    return build.compiled(spec, scene)


def rows_at(scene: Scene, q: Any, v: Any, u: Any) -> tuple[Any, Any, Any]:
    """Return H, h and H' v of all rows of a scene."""
    count, table = len(rows_of(scene)[0]), tabulate(scene)
    H, h, Hdv, w = np.zeros((count, scene.nv)), np.zeros(count), np.zeros(count), np.zeros(table.scratch)
    mechanism.dynamics(0.0, q, v, u, table.p, np.zeros((scene.nv, scene.nv)), np.zeros(scene.nv), w)
    quantities.row_kernels(True)["rows"](0.0, q, v, table.p, w, np.arange(count), count, H, h, Hdv)
    return H, h, Hdv
