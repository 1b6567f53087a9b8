"""What is drawn of the shapes of a scene from data: how far each reaches in any direction, and the boxes of inertia."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.scene import Body, Joint, Scene, Shape
from crossbody.cases.scene_plain import plain
from crossbody.reports import scenes
from crossbody.reports.pages.made_up_traces import Said

A, B, C = 0.3, 0.2, 0.1
"""Sizes of shapes, m."""
AT, TURN = (0.7, -0.4, 0.25), (0.8, 0.36, 0.48, 0.0)
"""Where they stand on their body, m, and a quaternion."""
WAYS, ROUND = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, -0.6, -0.8), (-0.48, 0.64, 0.6)), 0.02
"""Directions; and by which part what is drawn of round shapes by straight lines is too small."""
MASS = 3.0


REACH: dict[str, Callable[[Floats], float]] = {
    "sphere": lambda _: A,
    "capsule": lambda n: A + B * abs(n[2]),
    "cylinder": lambda n: A * math.hypot(n[0], n[1]) + B * abs(n[2]),
    "box": lambda n: A * abs(n[0]) + B * abs(n[1]) + C * abs(n[2]),
    "ellipsoid": lambda n: math.sqrt((A * n[0]) ** 2 + (B * n[1]) ** 2 + (C * n[2]) ** 2),
}
"""How far each kind of shape reaches from its middle along a direction in its axes, m; hulls import more than runs."""


def _turned() -> Floats:
    """Return the axes of a shape in those of its body."""
    w, x, y, z = TURN
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])  # fmt: skip


def _stage(*bodies: Body, shapes: tuple[Shape, ...] = ()) -> scenes.Stage:
    joints = tuple(Joint(name=body.name, body=body.name, type="free") for body in bodies if not body.parent)
    return scenes.load("scene").stage({"scene": plain(Scene(bodies=bodies, joints=joints, shapes=shapes))})  # type: ignore[dict-item]


def solids() -> Iterator[Said]:
    """Yield how far shapes reach, whose they are, and which line joins a body to that it hangs on."""
    even, R = (1.0, 1.0, 1.0, 0.0, 0.0, 0.0), _turned()
    bodies = (Body(name="one", mass=1.0, inertia=even), Body(name="two", parent="one", mass=1.0, inertia=even))
    for kind, reach in REACH.items():
        shape = Shape(name="s", body="two", type=kind, size=(A, B, C), position=AT, orientation=TURN)
        stage = _stage(*bodies, shapes=(shape,))
        solid = next(one for one in stage.solids if one["body"] == 1)
        for way in WAYS:
            n = np.array(way)
            found = float(((np.array(solid["points"]) - AT) @ R @ n).max()) + solid["radius"]
            loss = max(reach(n) - found, 0.0) / reach(n) if kind in ("cylinder", "ellipsoid") else 0.0
            yield f"how far a {kind} reaches along {way}", found, reach(n) * (1.0 - min(loss, ROUND))
        for mark in np.concatenate(solid["marks"]) if "marks" in solid else ():
            at, n = R.T @ (mark[:3] - AT), R.T @ mark[3:]
            yield f"a mark on a {kind}", round(float(at @ n), 3), round(REACH[kind](n), 3)
        yield "lines between bodies", np.array(stage.bones), [[0, 1]]
        yield "bodies", stage.frames, 2.0


def boxes() -> Iterator[Said]:
    """Yield the corners of boxes of inertia, and the radius of what has mass alone: a ball of water."""
    R = _turned()
    moments = MASS / 3.0 * np.array([B * B + C * C, A * A + C * C, A * A + B * B])
    own = R @ np.diag(moments) @ R.T
    inertia: Any = tuple(float(own[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
    (box,) = _stage(Body(name="box", mass=MASS, com=AT, inertia=inertia)).solids
    corners = (np.array(box["points"]) - AT) @ R
    yield "half sides of a box of inertia", np.abs(corners).round(5), np.tile([A, B, C], (8, 1))
    for face in box["faces"]:
        x, y, z = corners[list(face[:3])]
        yield "a side from outside", float(np.cross(y - x, z - y) @ corners[list(face)].mean(axis=0) > 0.0), 1.0
    (point,) = _stage(Body(name="point", mass=MASS, com=AT, inertia=(0.0,) * 6)).solids
    yield "a mass point", 1000.0 * 4.0 / 3.0 * math.pi * point["radius"] ** 3, MASS
    yield "where a mass point is", np.array(point["points"]).ravel(), AT


KINDS = {"shapes in space": solids, "boxes of inertia": boxes}
