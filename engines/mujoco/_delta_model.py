"""The delta robot compiled by MuJoCo, with the loops' law as they come or matched (spec 3.8 and 4.2)."""

from __future__ import annotations

from typing import Any

import mujoco

from crossbody.cases import Law
from crossbody.engines._delta.mjcf import mjcf
from crossbody.engines.mujoco._direct import MAX_IMPEDANCE, direct_solref, without_regularisation
from crossbody.reference.delta import Robot

_MATCHED = 'integrator="RK4" jacobian="dense" solver="Newton" iterations="3" tolerance="0"'
FLAGS = int(mujoco.mjtDisableBit.mjDSBL_AUTORESET | mujoco.mjtDisableBit.mjDSBL_ISLAND)


def compiled(robot: Robot, law: Law | None = None) -> Any:
    """The model; its coordinates are those of the tree, see `engines._delta.chart`.

    Args:
        robot: geometry, masses, gravity; friction is left to forces on absolute angles.
        law: a0 and a1 of the six rows, made exact; None leaves MuJoCo's own softness of an equality.

    Raises:
        ValueError: MuJoCo's own, for a model that it refuses.
    """
    model = mujoco.MjModel.from_xml_string(text(robot, law))
    if law is not None:
        model.opt.disableflags |= FLAGS
        without_regularisation(model)
    return model


def text(robot: Robot, law: Law | None) -> str:
    """The model as MJCF, see `compiled`; `FLAGS` and the regularisation are still to be set where there is a law."""
    if law is None:
        return mjcf(robot)
    stiffness, damping = direct_solref(law, 0)
    d = MAX_IMPEDANCE
    solve = f'solref="{stiffness!r} {damping!r}" solimp="{d} {d} 0.001 0.5 1"'
    return mjcf(robot, option=_MATCHED, solve=solve)
