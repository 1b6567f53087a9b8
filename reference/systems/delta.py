"""The delta robot as the mechanism of a case, see `crossbody.reference.delta`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from crossbody.reference.delta import scene
from crossbody.reference.delta.kernels.robot import KERNELS, PARAMETERS
from crossbody.reference.kinds import Floats

if TYPE_CHECKING:
    from crossbody.cases import Law
    from crossbody.reference import System

__all__ = ["KERNELS", "PARAMETERS", "build", "check_start", "listed"]


def build(parameters: Mapping[str, Any], law: Law) -> System:
    """The mechanism of a case, see `crossbody.reference.delta.scene`."""
    return scene.build(parameters, law)


def check_start(parameters: Mapping[str, Any], q0: Floats, v0: Floats) -> None:
    """Raise SceneError for a start that does not close the loops, and InvalidValue for a path that cannot be followed.

    It offers a start that does.
    """
    scene.check_start(parameters, q0, v0)
    scene.program_of(parameters)


def listed(p: Floats) -> dict[str, Any]:
    """What the parity audit lists, from the parameter array: what moves as one, arm by arm, kg, and gravity."""
    return {"masses": np.tile([p[4], p[5] + p[6] / 3], 3), "gravity": float(p[8])}
