"""A ball above a floor in Pinocchio: a prismatic joint along the vertical, its position the height of the ball."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from crossbody.cases import Case
from crossbody.cases.arrays import Floats
from crossbody.engines import _ball_scale
from crossbody.engines.pinocchio._rows import PinRows
from crossbody.engines.pinocchio._scene import Scene


def build(case: Case, algebra: str) -> Scene:
    """The model, its one row h = q, and that row as a point of the ball on the floor."""
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -case.number("gravity")])
    joint = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "height")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(case.number("mass"), 0.05), pin.SE3.Identity())
    one, zero = np.ones((1, 1)), np.zeros(1)
    rows = PinRows(
        model, jacobian=lambda q: one, heights=lambda q: q, drift=lambda q, v: zero, law=case.law, algebra=algebra
    )
    return Scene(rows=rows, points=[_point(model, joint, case)], observe=_observer(rows), sizes=_ball_scale.sizes(case))


def _point(model: Any, joint: int, case: Case) -> Any:
    """Normal alone: a contact without friction, or an anchor whose tangential rows the joint keeps anyway."""
    kind = pin.PointContactConstraintModel if case.law.unilateral[0] else pin.PointAnchorConstraintModel
    point = kind(model, 0, pin.SE3.Identity(), joint, pin.SE3.Identity())
    if case.law.unilateral[0]:
        point.setFriction(0.0)
    return pin.ConstraintModel(point)


def _observer(rows: PinRows) -> Any:
    mass, gravity = float(rows.model.inertias[1].mass), -float(rows.model.gravity.linear[2])

    def observe(q: Floats, v: Floats) -> tuple[Floats, Floats]:
        return q, np.column_stack((0.5 * mass * v[:, 0] ** 2, mass * gravity * q[:, 0]))

    return observe
