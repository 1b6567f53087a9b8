"""Gaps between shapes as the engines see them: smallest distances, along normals that tell how they change."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from crossbody.cases._arrays import Floats
from crossbody.cases.scene import Body, Pair, Scene, Shape
from crossbody.cases.scene_contacts import PLACES
from crossbody.engines._contacts import Contacts, Pose, _placed
from crossbody.reports.scenes._meetings import meeting

TURN, DRAWS, POINTS = 1e-6, 40, 4000
GRID = 0.03
"""Between points of a surface, m."""


def drawn(rng: np.random.Generator, types: tuple[str, str]) -> tuple[Contacts, dict[str, Pose]]:
    """Two shapes on two bodies, so near that they often overlap."""
    names = ("one", "two")
    shapes = tuple(
        Shape(name=name, body=name, type=kind, size=tuple(rng.uniform(0.1, 0.4, 3)),
              position=tuple(0.05 * rng.normal(size=3)), orientation=tuple(Rotation.random(rng=rng).as_quat()))
        for name, kind in zip(names, types, strict=True)
    )  # fmt: skip
    poses = {name: (Rotation.random(rng=rng).as_matrix(), 0.1 * rng.normal(size=3)) for name in names}
    bodies = tuple(Body(name=name, mass=1.0, inertia=(0.1, 0.1, 0.1, 0.0, 0.0, 0.0)) for name in names)
    pair = Pair(name="pair", first="one", second="two", margin=0.01)
    return Contacts(Scene(bodies=bodies, shapes=shapes, pairs=(pair,))), poses


def moved(along: Floats, pose: Pose, step: float) -> Pose:
    return pose[0], pose[1] + step * along


def turned(along: Floats, about: Floats, pose: Pose, step: float) -> Pose:
    R = Rotation.from_rotvec(step * along).as_matrix()
    return R @ pose[0], about + R @ (pose[1] - about)


def rate(met: Contacts, poses: dict[str, Pose], k: int, body: str, change: Callable[[Pose, float], Pose]) -> float:
    """Rate of gap k while a body moves."""
    gaps = [met.touches((poses | {body: change(poses[body], step)}).__getitem__)[k].gap for step in (TURN, -TURN)]
    return (gaps[0] - gaps[1]) / (2.0 * TURN)


@pytest.mark.parametrize("types", PLACES, ids=":".join)
def test_a_gap_changes_along_its_normal_and_by_no_turn_about_its_point(types: tuple[str, str]) -> None:
    """What a force at the point along the normal asks for: its power is that of the gap's rate."""
    rng = np.random.default_rng(0)
    for _ in range(DRAWS):
        met, poses = drawn(rng, types)
        for k, touch in enumerate(met.touches(poses.__getitem__)):
            if not touch.normal.any():  # capsules that cross have one row, and one that is none
                assert types == ("capsule", "capsule")
                assert k == 1
                continue
            assert abs(np.linalg.norm(touch.normal) - 1.0) < 1e-12
            for body, sign in ((touch.first, -1.0), (touch.second, 1.0)):
                along = rng.normal(size=3)
                shifted = rate(met, poses, k, body, partial(moved, along))
                assert shifted == pytest.approx(sign * (touch.normal @ along), abs=1e-6)
                assert abs(rate(met, poses, k, body, partial(turned, along, touch.point))) < 1e-6


def surface(rng: np.random.Generator, shape: Shape) -> Floats:
    """Points of the surface of a box or cylinder in its axes, or of the axis of a capsule."""
    size, x = np.array(shape.size), rng.uniform(-1.0, 1.0, (POINTS, 3))
    if shape.type == "sphere":
        return np.zeros((1, 3))
    if shape.type == "capsule":
        return np.linspace(-size[1], size[1], 400)[:, None] * np.array([0.0, 0.0, 1.0])
    if shape.type == "box":
        side = rng.integers(3, size=POINTS)
        x[np.arange(POINTS), side] = np.sign(x[np.arange(POINTS), side])
        return size * x
    radius = np.where(rng.random(POINTS) < 0.5, 1.0, np.sqrt(rng.random(POINTS)))
    x[radius < 1.0, 2] = np.sign(x[radius < 1.0, 2])
    around = rng.uniform(0.0, 2.0 * np.pi, POINTS)
    return np.column_stack([size[0] * radius * np.cos(around), size[0] * radius * np.sin(around), size[1] * x[:, 2]])


def inside(shape: Shape, x: Floats) -> bool:
    size = np.array(shape.size)
    if shape.type == "box":
        return bool((np.abs(x) < size).all())
    return bool(shape.type == "cylinder" and np.hypot(x[0], x[1]) < size[0] and abs(x[2]) < size[1])


@pytest.mark.parametrize("types", [types for types in PLACES if "plane" not in types], ids=":".join)
def test_no_point_of_a_surface_is_nearer(types: tuple[str, str]) -> None:
    """A gap is the smallest distance of two surfaces, the largest part of that below zero: sampled, to their grid."""
    rng, within = np.random.default_rng(1), 0
    for _ in range(DRAWS):
        met, poses = drawn(rng, types)
        contact, touch = met.all[0], min(met.touches(poses.__getitem__), key=lambda touch: touch.gap)
        one, two = contact.first, contact.second
        (ours, x), (theirs, y) = (_placed(shape, met.shapes[shape.name][1], poses[shape.body]) for shape in (one, two))
        mine, other = surface(rng, one) @ ours.T + x, surface(rng, two) @ theirs.T + y
        apart = float(np.linalg.norm(mine[:, None, :] - other[None, :, :], axis=2).min())
        deep = inside(two, theirs.T @ (x - y))
        rounded = one.size[0] + (two.size[0] if two.type in ("sphere", "capsule") else 0.0)
        found = touch.gap + contact.pair.margin + rounded  # of a centre or axis
        assert -1e-9 < apart - abs(found) < GRID
        assert (found < 0.0) == deep
        within += deep
    assert within > 3 or two.type in ("sphere", "capsule")


@pytest.mark.parametrize("types", PLACES, ids=":".join)
def test_forces_are_drawn_where_an_engine_finds_the_contact(types: tuple[str, str]) -> None:
    """At its point, or of a sphere at its own surface; along its normal, unless the sphere's centre is inside."""
    rng = np.random.default_rng(2)
    for _ in range(DRAWS):
        met, poses = drawn(rng, types)
        contact = met.all[0]
        pair = (contact.first, contact.second)
        turned_at = [_placed(shape, met.shapes[shape.name][1], poses[shape.body]) for shape in pair]
        placed = [(shape, (p[None], R[None])) for shape, (R, p) in zip(pair, turned_at, strict=True)]
        for k, touch in enumerate(met.touches(poses.__getitem__)):
            gap = touch.gap + contact.pair.margin
            if (contact.first.type == "sphere" and gap < -contact.first.size[0]) or not touch.normal.any():
                continue
            at, normal = meeting(placed[0], placed[1], k)
            assert normal[0] == pytest.approx(touch.normal, abs=1e-9)
            off = -gap * touch.normal if contact.first.type == "sphere" else np.zeros(3)
            assert at[0] == pytest.approx(touch.point + off, abs=1e-9)
