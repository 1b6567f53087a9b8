"""Balls on a line in Pinocchio: a prismatic joint each, its position the displacement of the ball."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from crossbody.cases import Case
from crossbody.engines._cradle import in_real_time, sliders
from crossbody.engines.pinocchio._cradle import add_ball, scene
from crossbody.engines.pinocchio._scene import Scene


def build(case: Case, algebra: str) -> Scene:
    """The model and the gaps of neighbours."""
    chain = sliders(case)
    model = pin.Model()
    model.gravity.linear = np.zeros(3)
    for i, mass in enumerate(chain.masses):
        place = np.array([i * chain.spacing, 0.0, 0.0])
        add_ball(model, pin.JointModelPX(), place, pin.Inertia.FromSphere(mass, chain.radius))
    return scene(case, chain, model, algebra)


def followed(case: Case, profile: str) -> Case | None:
    """The case whose equations the profile integrates; None for the other profiles."""
    return in_real_time(case, "level") if profile == "law" else None
