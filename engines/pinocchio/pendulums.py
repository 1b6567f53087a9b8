"""Pendulums in a row in Pinocchio: a revolute joint each, counter-clockwise seen with x to the right and z up."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from crossbody.cases import Case
from crossbody.engines._cradle import in_real_time, pendulums
from crossbody.engines.pinocchio._cradle import add_ball, scene
from crossbody.engines.pinocchio._scene import Scene


def build(case: Case, algebra: str) -> Scene:
    """The model and the gaps of neighbours: point masses, so that M = m L^2."""
    chain = pendulums(case)
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -chain.gravity])
    for i, mass in enumerate(chain.masses):
        place, hanging = np.array([i * chain.spacing, 0.0, 0.0]), np.array([0.0, 0.0, -chain.length])
        axis = pin.JointModelRevoluteUnaligned(np.array([0.0, -1.0, 0.0]))
        add_ball(model, axis, place, pin.Inertia(mass, hanging, np.zeros((3, 3))))
    return scene(case, chain, model, algebra)


def followed(case: Case, profile: str) -> Case | None:
    """The case whose equations the profile integrates; None for the other profiles."""
    return in_real_time(case, "level") if profile == "law" else None
