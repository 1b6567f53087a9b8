"""Newton's cradle in Pinocchio: a joint a ball, its rows by their Jacobian, or as frictionless points (spec 4.3)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from crossbody.cases import Case
from crossbody.cases.arrays import Floats
from crossbody.engines._cradle import Chain, one_set
from crossbody.engines.pinocchio._rows import PinRows
from crossbody.engines.pinocchio._scene import Scene


def scene(case: Case, chain: Chain, model: Any, algebra: str) -> Scene:
    """The rows of a chain on its model."""
    law = one_set(case.law)
    rows = PinRows(
        model, jacobian=chain.jacobian, heights=chain.heights, drift=chain.drift, law=law, algebra=algebra
    )  # fmt: skip
    return Scene(rows=rows, points=_points(rows), observe=chain.observe, sizes=chain.sizes(law))


def add_ball(model: Any, joint: Any, place: Floats, inertia: Any) -> None:
    """One more ball on a joint of its own, which stands at `place` in the world."""
    index = model.addJoint(0, joint, pin.SE3(np.eye(3), place), f"ball {model.njoints - 1}")
    model.appendBodyToJoint(index, inertia, pin.SE3.Identity())


def _points(rows: PinRows) -> Callable[[Floats], list[Any]]:
    """Every pair as a point contact without friction, its normal along the line of centres."""
    model, data = rows.model, rows.data

    def points(q: Floats) -> list[Any]:
        pin.forwardKinematics(model, data, q)
        # The centre of a ball is its body's centre of mass.
        centres = [data.oMi[i].act(model.inertias[i].lever) for i in range(1, model.njoints)]
        return [_point(model, data, i + 1, centres[i], centres[i + 1]) for i in range(len(centres) - 1)]

    return points


def _point(model: Any, data: Any, left: int, a: Floats, b: Floats) -> Any:
    """The contact of two balls halfway between their centres a and b."""
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), (b - a) / np.linalg.norm(b - a)).matrix()
    world = pin.SE3(turn, 0.5 * (a + b))
    places = [data.oMi[i].inverse() * world for i in (left, left + 1)]
    point = pin.PointContactConstraintModel(model, left, places[0], left + 1, places[1])
    point.setFriction(0.0)
    return pin.ConstraintModel(point)
