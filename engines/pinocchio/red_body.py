"""The red body in Pinocchio: two planar bodies, each on two prismatic joints and a hinge (spec 2.5, 4.3)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from crossbody.cases import Case
from crossbody.cases.arrays import Floats
from crossbody.engines import _red_body
from crossbody.engines._red_body import ROWS, RedBody
from crossbody.engines.pinocchio._rows import PinRows
from crossbody.engines.pinocchio._scene import Scene

GROUND, BOX, SLAB = 0, 3, 6
"""Joints that carry something."""
PAIRS = ((GROUND, SLAB), (GROUND, SLAB), (SLAB, BOX), (SLAB, BOX), (GROUND, BOX))
"""For each row what pushes, and what is pushed."""
_FOLLOWED = {"law": "resolved", "impulse": "sequential", "impulse_simultaneous": "simultaneous"}


def build(case: Case, algebra: str) -> Scene:
    """The model in the case's own coordinates, x and y and the angle about z of each body, and its five rows."""
    own = _red_body.red_body(case)
    model = pin.Model()
    model.gravity.linear = np.array([0.0, -own.p["gravity"], 0.0])
    box, inertia, slab, slab_inertia = own.masses
    _add(model, "box", box, inertia)
    _add(model, "slab", slab, slab_inertia)
    rows = PinRows(
        model, jacobian=own.jacobian, heights=own.heights, drift=own.drift, law=case.law, algebra=algebra
    )  # fmt: skip
    carried = [model.inertias[joint] for joint in (BOX, SLAB)]
    masses = np.array([number for body in carried for number in (body.mass, body.inertia[2, 2])])
    return Scene(
        rows=rows, points=_points(model, own), observe=own.observe, sizes=(own.depth, own.speed),
        audit={"masses": masses},
    )  # fmt: skip


def followed(case: Case, profile: str) -> Case | None:
    """The case whose equations the profile integrates; None for time stepping."""
    rule = _FOLLOWED.get(profile)
    return None if rule is None or rule == case.collisions else _red_body.under(case, rule)


def _add(model: Any, name: str, mass: float, inertia: float) -> None:
    """A body that moves in the plane; the other two moments of inertia never act."""
    joint = GROUND
    for kind, axis in ((pin.JointModelPX(), "x"), (pin.JointModelPY(), "y"), (pin.JointModelRZ(), "angle")):
        joint = model.addJoint(joint, kind, pin.SE3.Identity(), f"{name} {axis}")
    model.appendBodyToJoint(joint, pin.Inertia(mass, np.zeros(3), inertia * np.eye(3)), pin.SE3.Identity())


def _points(model: Any, own: RedBody) -> Callable[[Floats], list[Any]]:
    """Every row as a point contact without friction, its third axis the direction in which the row pushes."""
    data = model.createData()

    def points(q: Floats) -> list[Any]:
        pin.forwardKinematics(model, data, q)
        return [_point(model, data, own, q, row) for row in range(ROWS)]

    return points


def _point(model: Any, data: Any, own: RedBody, q: Floats, row: int) -> Any:
    normal, place = (np.append(x, 0.0) for x in (own.normal(q, row), own.point(q, row)))
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), normal).matrix()
    world, joints = pin.SE3(turn, place), PAIRS[row]
    ends = [x for joint in joints for x in (joint, data.oMi[joint].inverse() * world)]
    point = pin.PointContactConstraintModel(model, *ends)
    point.setFriction(0.0)
    return pin.ConstraintModel(point)
