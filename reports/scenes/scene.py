"""A scene from data in space: its shapes, other bodies as the boxes of their inertia, and frames."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np

from crossbody.cases import SceneError
from crossbody.cases.arrays import Floats
from crossbody.cases.files.case import quaternions
from crossbody.cases.rotations import matrices, rates
from crossbody.cases.scene import WIDTHS, Body, Joint, Scene
from crossbody.cases.scene import Shape as SceneShape
from crossbody.cases.scene_contacts import Contact, contacts
from crossbody.cases.scene_plain import scene_from
from crossbody.engines.nearest import Places, across, lying, meet
from crossbody.reports.scenes import Parameters, Stage

Pose = tuple[Floats, Floats]  # origins (n, 3), m, and rotations (n, 3, 3) of one body
WATER = 1000.0  # kg/m^3
MOST = 500  # bodies that are drawn
SHORT = 1e-5
"""Over so long a time velocities are taken from places, s: its square and rounding over it are both small."""
AROUND = 24  # points of a drawn circle
FLAT = 5  # decimals to which planes are the same side of a hull
SIGNS = np.array(list(product((-1.0, 1.0), repeat=3)))
FACES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
"""Corners of each side of a box, seen from outside against the clock."""


def body_poses(scene: Scene, q: Floats) -> Mapping[str, Pose]:
    """Return the pose at positions q (n, nq) of every body by its name, and of the world by the empty one."""
    found: dict[str, Pose] = {"": (np.zeros((len(q), 3)), np.tile(np.eye(3), (len(q), 1, 1)))}
    joints: dict[str, list[tuple[Joint, Floats]]] = {}
    at = 0
    for joint in scene.joints:
        width = WIDTHS[joint.type][0]
        joints.setdefault(joint.body, []).append((joint, q[:, at : at + width]))
        at += width
    for body in scene.bodies:
        pose = placed(found[body.parent], body.position, body.orientation)
        for joint, part in joints.get(body.name, ()):
            pose = _moved(pose, joint, part)
        found[body.name] = pose
    return found


def placed(pose: Pose, position: Sequence[float], orientation: Sequence[float]) -> Pose:
    """Return the pose of what stands so in a frame."""
    origin, rotation = pose
    return origin + rotation @ np.asarray(position), rotation @ matrices(np.asarray(orientation))


def _moved(pose: Pose, joint: Joint, q: Floats) -> Pose:
    """Return a body's pose behind one of its joints."""
    origin, rotation = pose
    if joint.type == "free":
        return q[:, :3], matrices(q[:, 3:])
    axis, anchor = np.asarray(joint.axis), np.asarray(joint.anchor)
    if joint.type == "slide":
        return origin + (q - joint.reference) * (rotation @ axis), rotation
    half = 0.5 * (q - joint.reference)
    turn = matrices(q if joint.type == "ball" else np.concatenate([np.cos(half), np.sin(half) * axis], axis=1))
    turned = rotation @ turn
    return origin + rotation @ anchor - turned @ anchor, turned


def stage(p: Parameters) -> Stage:
    """Return what is drawn of every body: its shapes, but those inside its boxes, or the box of its inertia."""
    scene = _scene(p)
    if len(scene.bodies) > MOST:
        raise SceneError(f"it has {len(scene.bodies)} bodies; at most {MOST} can be drawn")
    index = {"": -1} | {body.name: i for i, body in enumerate(scene.bodies)}
    shown = {shape.body for shape in scene.shapes}
    boxes = [_inertia_box(body, i) for i, body in enumerate(scene.bodies) if body.name not in shown and body.mass]
    solids = [_solid(shape, index[shape.body]) for shape in scene.shapes]
    seen = [solid for solid, shape in zip(solids, scene.shapes, strict=True) if not _hidden(solid, shape, scene.shapes)]
    return Stage(
        solids=(*seen, *boxes),
        bones=tuple((index[body.parent], i) for i, body in enumerate(scene.bodies) if body.parent),
        frames=len(scene.bodies),
    )


def poses(q: Floats, p: Parameters) -> Floats:
    """Return origin and the first two axes of every body (n, bodies, 9)."""
    scene = _scene(p)
    found = body_poses(scene, q)
    rows = [np.concatenate([x, R[:, :, 0], R[:, :, 1]], axis=1) for x, R in (found[b.name] for b in scene.bodies)]
    return np.stack(rows, axis=1)


def arrows(q: Floats, lam: Floats, p: Parameters) -> Floats:
    """Return whole forces of contacts on their second shapes, of loops on their first points (n, arrows, 6)."""
    scene = _scene(p)
    found = list(_arrows(scene, q, np.nan_to_num(lam)))
    return np.stack(found, axis=1) if found else np.zeros((len(q), 0, 6))


def _arrows(scene: Scene, q: Floats, lam: Floats) -> Iterator[Floats]:
    bodies = body_poses(scene, q)
    row = 0
    for loop in scene.loops:
        if loop.in_space:
            at, _ = placed(bodies[loop.first], loop.first_position, (1.0, 0.0, 0.0, 0.0))
            yield np.concatenate([at, lam[:, row : row + 3]], axis=1)
        row += loop.width
    row += sum(int(np.isfinite(part.range).sum()) for part in scene.bounded)
    met = contacts(scene)
    rub = row + sum(contact.places for contact in met)
    for contact in met:
        _, normals, points = meeting(contact, bodies)
        pushing = lam[:, row : row + contact.places]
        force = pushing[:, :, None] * np.nan_to_num(normals)
        row += contact.places
        if contact.friction > 0.0:
            at, by = _turns(contact, bodies)
            ways = np.nan_to_num(across(contact.first.type, at[:, None], by[:, None], normals))
            rubbing = lam[:, rub : rub + 2 * contact.places].reshape(-1, contact.places, 2)
            force += (rubbing[..., None] * ways).sum(axis=2)
            rub += 2 * contact.places
        if contact.second.type == "hull":
            yield _resultant(force, points, pushing)
            continue
        for place in range(contact.places):
            yield np.concatenate([points[:, place], force[:, place]], axis=1)


def _resultant(force: Floats, points: Floats, pushing: Floats) -> Floats:
    """Return the sum of forces (n, 6), where that of the parallel ones acts: a hull has hundreds of corners."""
    total = pushing.sum(axis=1, keepdims=True)
    share = np.divide(pushing, total, out=np.zeros_like(pushing), where=total != 0.0)
    return np.concatenate([np.einsum("nk,nki->ni", share, points), force.sum(axis=1)], axis=1)


def _turns(contact: Contact, bodies: Mapping[str, Pose]) -> tuple[Floats, Floats]:
    """Return the rotations (n, 3, 3) of both shapes."""
    at, by = (
        bodies[shape.body][1] @ matrices(np.asarray(shape.orientation)) for shape in (contact.first, contact.second)
    )
    return at, by


def meeting(contact: Contact, bodies: Mapping[str, Pose]) -> Places:
    """Return where two shapes would meet (n, places), by the poses of the bodies at n instants."""
    shapes = (contact.first, contact.second)
    stand = [placed(bodies[shape.body], shape.position, shape.orientation) for shape in shapes]
    at, by = ((rotation, origin) for origin, rotation in stand)
    kinds, sizes = (shapes[0].type, shapes[1].type), (shapes[0].extents, shapes[1].extents)
    return meet(kinds, sizes, at, by, lying(kinds, sizes, at, by, np.full(len(at[1]), contact.parallel)))


def slip(scene: Scene, contact: Contact, place: int, q: Floats, v: Floats) -> Floats:
    """Return the velocity of the second shape over a plane along the plane's x and y (n, 2), m/s.

    Where they meet, at one place of the contact, is kept as a point of the second body, and of the
    plane's; both go along the velocities by SHORT.
    """
    owners = [shape.body for shape in (contact.first, contact.second)]
    now, turns = body_poses(scene, q), matrices(np.asarray(contact.first.orientation))
    at = meeting(contact, now)[2][:, place]
    inside = [np.einsum("nij,ni->nj", now[body][1], at - now[body][0]) for body in owners]
    rate = rates(q, v, quaternions(scene))
    ends = [body_poses(scene, q + side * SHORT * rate) for side in (-1.0, 1.0)]
    moved = [
        [poses[body][0] + np.einsum("nij,nj->ni", poses[body][1], x) for body, x in zip(owners, inside, strict=True)]
        for poses in ends
    ]
    apart = (moved[1][1] - moved[1][0] - moved[0][1] + moved[0][0]) / (2.0 * SHORT)
    found: Floats = np.einsum("ni,nij->nj", apart, (now[owners[0]][1] @ turns)[:, :, :2])
    return found


def _scene(p: Parameters) -> Scene:
    return scene_from(p["scene"])


def _solid(shape: SceneShape, body: int) -> dict[str, Any]:
    """Return points that a sphere of some radius is swept over, and the faces that have edges."""
    size, turn = np.asarray(shape.size), matrices(np.asarray(shape.orientation))
    points, radius = np.zeros((1, 3)), 0.0
    faces: tuple[tuple[int, ...], ...] = ()
    if shape.type == "plane":
        return {"body": body, "plane": [*shape.position, *turn[:, 0], *turn[:, 1]]}
    if shape.type == "sphere":
        radius = size[0]
    elif shape.type == "capsule":
        points, radius = size[1] * np.array([(0.0, 0.0, -1.0), (0.0, 0.0, 1.0)]), size[0]
    elif shape.type == "cylinder":
        rings = [np.column_stack([_circle(size[0]), np.full(AROUND, z)]) for z in (-size[1], size[1])]
        points, faces = np.concatenate(rings), (tuple(range(AROUND))[::-1], tuple(range(AROUND, 2 * AROUND)))
    elif shape.type == "box":
        points, faces = SIGNS * size, FACES
    elif shape.type == "hull":
        points, faces = shape.extents, _sides(shape.extents)
    else:
        points = _ball() * size
    drawn = _drawn(np.asarray(shape.position) + points @ turn.T, body, radius, faces)
    marks = [
        np.concatenate([np.asarray(shape.position) + at @ turn.T, out @ turn.T], axis=1) for at, out in _marks(shape)
    ]
    return drawn | {"marks": [np.round(line, 4).tolist() for line in marks]} if marks else drawn


def _marks(shape: SceneShape) -> Iterator[tuple[Floats, Floats]]:
    """Yield lines on a round shape, by which a turn about its axes is seen: their points, and the normals there."""
    size = np.asarray(shape.size)
    if shape.type == "sphere":  # a meridian and the equator
        angle = np.linspace(0.0, 2.0 * np.pi, 17)
        c, s, zero = np.cos(angle), np.sin(angle), np.zeros_like(angle)
        yield from ((size[0] * line, line) for line in (np.column_stack([s, zero, c]), np.column_stack([c, s, zero])))
    elif shape.type == "cylinder":  # a radius of each cap
        for z in (-1.0, 1.0):
            out = np.tile([0.0, 0.0, z], (2, 1))
            yield np.array([[0.0, 0.0, z * size[1]], [size[0], 0.0, z * size[1]]]), out
    elif shape.type == "capsule":  # a line along it
        out = np.tile([1.0, 0.0, 0.0], (2, 1))
        yield np.array([[size[0], 0.0, -size[1]], [size[0], 0.0, size[1]]]), out


def _hidden(solid: Mapping[str, Any], shape: SceneShape, shapes: Sequence[SceneShape]) -> bool:
    """Whether a shape is inside a box of its body, such as the ball by which a block touches at one place."""
    if shape.type == "plane":
        return False
    return any(
        np.all(np.abs((solid["points"] - np.array(box.position)) @ matrices(np.asarray(box.orientation)))
               + solid["radius"] <= np.asarray(box.size) + 10.0**-FLAT)
        for box in shapes if box.type == "box" and box.body == shape.body and box is not shape
    )  # fmt: skip


def _sides(corners: Floats) -> tuple[tuple[int, ...], ...]:
    """Return the corners of each side of a hull, seen from outside against the clock."""
    from scipy.spatial import ConvexHull  # a third of a second, which only hulls need

    hull = ConvexHull(corners)
    sides: dict[tuple[float, ...], set[int]] = {}
    for triangle, plane in zip(hull.simplices, np.round(hull.equations, FLAT), strict=True):
        sides.setdefault(tuple(plane), set()).update(triangle.tolist())
    return tuple(_around(corners, sorted(side), np.array(plane[:3])) for plane, side in sides.items())


def _around(corners: Floats, side: Sequence[int], normal: Floats) -> tuple[int, ...]:
    """Return the corners of a flat side in the order of their angles about its normal."""
    off = corners[list(side)] - corners[list(side)].mean(axis=0)
    angles = np.arctan2(off @ np.cross(normal, off[0]), off @ off[0])
    return tuple(side[k] for k in np.argsort(angles))


def _inertia_box(body: Body, index: int) -> dict[str, Any]:
    """Return the box of equal density that has a body's mass and inertia; of a mass point, a ball of water."""
    if not any(body.inertia):
        return _drawn(np.array([body.com]), index, (body.mass / (WATER * 4.0 / 3.0 * np.pi)) ** (1.0 / 3.0), ())
    xx, yy, zz, xy, xz, yz = body.inertia
    moments, axes = np.linalg.eigh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    sides = np.sqrt(np.maximum(1.5 * (moments.sum() - 2.0 * moments) / body.mass, 0.0))
    return _drawn(np.asarray(body.com) + (SIGNS * sides) @ axes.T, index, 0.0, FACES if np.linalg.det(axes) > 0 else
                  tuple(face[::-1] for face in FACES))  # fmt: skip


def _drawn(points: Floats, body: int, radius: float, faces: Any) -> dict[str, Any]:
    return {"body": body, "points": np.round(points, 6).tolist(), "radius": float(radius), "faces": faces}


def _circle(radius: float) -> Floats:
    angle = np.linspace(0.0, 2.0 * np.pi, AROUND, endpoint=False)
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def _ball() -> Floats:
    """Return points of the unit sphere: circles around all three axes."""
    rings = [
        np.column_stack([_circle(np.sqrt(1.0 - z * z)), np.full(AROUND, z)])
        for z in np.sin(np.arange(-5, 6) * np.pi / 10.0)
    ]
    return np.concatenate(rings)
