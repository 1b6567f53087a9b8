"""Gaps between shapes as the engines see them: smallest distances, along normals that tell how they change."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from crossbody import cases
from crossbody.cases.arrays import Floats
from crossbody.cases.scene import Body, Joint, Pair, Scene, Shape
from crossbody.cases.scene_contacts import PLACES
from crossbody.engines._contacts import FAR, Contacts, drift
from crossbody.engines.equations import system_of
from crossbody.engines.nearest import Pose
from crossbody.reports.scenes.scene import meeting

TURN, DRAWS, POINTS = 1e-6, 40, 4000
GRID = 0.03
"""Between points of a surface, m."""


def drawn(rng: np.random.Generator, types: tuple[str, str]) -> tuple[Contacts, dict[str, Pose]]:
    """Two shapes on two bodies, so near that they often overlap."""
    names = ("one", "two")
    shapes = tuple(
        Shape(name=name, body=name, type=kind, size=tuple(rng.uniform(0.1, 0.4, 3)), corners=corners(rng, kind),
              position=tuple(0.05 * rng.normal(size=3)), orientation=tuple(Rotation.random(rng=rng).as_quat()))
        for name, kind in zip(names, types, strict=True)
    )  # fmt: skip
    poses = {name: (Rotation.random(rng=rng).as_matrix(), 0.1 * rng.normal(size=3)) for name in names}
    bodies = tuple(Body(name=name, mass=1.0, inertia=(0.1, 0.1, 0.1, 0.0, 0.0, 0.0)) for name in names)
    pair = Pair(name="pair", first="one", second="two", margin=0.01)
    return Contacts(Scene(bodies=bodies, shapes=shapes, pairs=(pair,))), poses


def corners(rng: np.random.Generator, kind: str) -> tuple[tuple[float, ...], ...]:
    """Of a hull four to nine of a sphere, no two hulls as many for sure."""
    points = rng.normal(size=(rng.integers(4, 10), 3)) if kind == "hull" else np.zeros((0, 3))
    return tuple(map(tuple, (0.3 * points / np.linalg.norm(points, axis=1, keepdims=True)).tolist()))


def moved(along: Floats, pose: Pose, step: float) -> Pose:
    return pose[0], pose[1] + step * along


def turned(along: Floats, about: Floats, pose: Pose, step: float) -> Pose:
    R = Rotation.from_rotvec(step * along).as_matrix()
    return R @ pose[0], about + R @ (pose[1] - about)


def rate(met: Contacts, poses: dict[str, Pose], k: int, body: str, change: Callable[[Pose, float], Pose]) -> float:
    """Rate of gap k while a body moves."""
    gaps = [met.touches((poses | {body: change(poses[body], step)}).__getitem__, [k]).gap for step in (TURN, -TURN)]
    return float(gaps[0][0] - gaps[1][0]) / (2.0 * TURN)


@pytest.mark.parametrize("types", PLACES, ids=":".join)
def test_a_gap_changes_along_its_normal_and_by_no_turn_about_its_point(types: tuple[str, str]) -> None:
    """What a force at the point along the normal asks for: its power is that of the gap's rate."""
    rng = np.random.default_rng(0)
    for _ in range(DRAWS):
        met, poses = drawn(rng, types)
        found = met.touches(poses.__getitem__)
        for k, (normal, point) in enumerate(zip(found.normal, found.point, strict=True)):
            if not normal.any():  # capsules that cross have one row, and one that is none
                assert types == ("capsule", "capsule")
                assert k == 1
                assert found.gap[k] == FAR
                continue
            assert abs(np.linalg.norm(normal) - 1.0) < 1e-12
            for number, sign in ((found.first[k], -1.0), (found.second[k], 1.0)):
                along, body = rng.normal(size=3), met.bodies[number]
                shifted = rate(met, poses, k, body, partial(moved, along))
                assert shifted == pytest.approx(sign * (normal @ along), abs=1e-6)
                assert abs(rate(met, poses, k, body, partial(turned, along, point))) < 1e-6


def placed(shape: Shape, pose: Pose) -> Pose:
    """Pose of a shape in the world by that of its body."""
    return pose[0] @ Rotation.from_quat(np.roll(shape.orientation, -1)).as_matrix(), pose[1] + pose[0] @ shape.position


def surface(rng: np.random.Generator, shape: Shape) -> Floats:
    """Points of the surface of a box, cylinder or ellipsoid in its axes, or of the axis of a capsule."""
    size, x = np.array(shape.size), rng.uniform(-1.0, 1.0, (POINTS, 3))
    if shape.type == "sphere":
        return np.zeros((1, 3))
    if shape.type == "hull":
        return rng.dirichlet(np.full(len(shape.corners), 0.05), POINTS) @ shape.corners
    if shape.type == "capsule":
        return np.linspace(-size[1], size[1], 400)[:, None] * np.array([0.0, 0.0, 1.0])
    if shape.type == "ellipsoid":
        return size * x / np.linalg.norm(x, axis=1, keepdims=True)
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
        contact, gap = met.all[0], float(met.touches(poses.__getitem__).gap.min())
        one, two = contact.first, contact.second
        (ours, x), (theirs, y) = (placed(shape, poses[shape.body]) for shape in (one, two))
        mine, other = surface(rng, one) @ ours.T + x, surface(rng, two) @ theirs.T + y
        apart = float(np.linalg.norm(mine[:, None, :] - other[None, :, :], axis=2).min())
        deep = inside(two, theirs.T @ (x - y))
        rounded = one.size[0] + (two.size[0] if two.type in ("sphere", "capsule") else 0.0)
        found = gap + contact.pair.margin + rounded  # of a centre or axis
        assert -1e-9 < apart - abs(found) < GRID
        assert (found < 0.0) == deep
        within += deep
    assert within > 3 or two.type in ("sphere", "capsule")


@pytest.mark.parametrize("types", [types for types in PLACES if "plane" in types], ids=":".join)
def test_no_point_of_a_surface_is_lower(types: tuple[str, str]) -> None:
    """The least gap over a plane is the height of the lowest point of the surface: sampled, to its grid."""
    rng = np.random.default_rng(3)
    for _ in range(DRAWS):
        met, poses = drawn(rng, types)
        contact, gap = met.all[0], float(met.touches(poses.__getitem__).gap.min())
        (floor, x), (theirs, y) = (placed(shape, poses[shape.body]) for shape in (contact.first, contact.second))
        heights = (surface(rng, contact.second) @ theirs.T + y - x) @ floor[:, 2]
        rounded = contact.second.size[0] if types[1] in ("sphere", "capsule") else 0.0
        assert -1e-9 < heights.min() - rounded - (gap + contact.pair.margin) < GRID


@pytest.mark.parametrize("types", PLACES, ids=":".join)
def test_instants_and_pairs_are_computed_at_once_as_one_by_one(types: tuple[str, str]) -> None:
    """Many pairs, of many instants, in every engine and in pictures: what one pair alone gives at one instant."""
    rng = np.random.default_rng(2)
    scenes = [drawn(rng, types) for _ in range(4)]
    shapes = [shape for met, _ in scenes for shape in (met.all[0].first, met.all[0].second)]
    renamed = [replace(shape, name=f"{i}", body=f"{i}") for i, shape in enumerate(shapes)]
    bodies = tuple(Body(name=one.body, mass=1.0, inertia=(0.1, 0.1, 0.1, 0.0, 0.0, 0.0)) for one in renamed)
    pairs = tuple(Pair(name=f"{k}", first=f"{2 * k}", second=f"{2 * k + 1}", margin=0.01) for k in range(4))
    all_of_them = Contacts(Scene(bodies=bodies, shapes=tuple(renamed), pairs=pairs))
    order = [poses[shape.body] for met, poses in scenes for shape in (met.all[0].first, met.all[0].second)]
    several = {f"{i}": tuple(np.stack([part, order[i - i % 2 + 1 - i % 2][j]]) for j, part in enumerate(pose))
               for i, pose in enumerate(order)}  # fmt: skip
    found = all_of_them.touches(several.__getitem__)
    for k, (met, poses) in enumerate(scenes):
        one = met.touches(poses.__getitem__)
        mine = [row for row, (contact, _) in enumerate(all_of_them.rows) if contact == k]
        for name in ("gap", "normal", "point"):
            np.testing.assert_allclose(getattr(found, name)[0][mine], getattr(one, name), atol=1e-15)
        swapped = {"one": poses["two"], "two": poses["one"]}
        turned_round = met.touches(swapped.__getitem__)
        np.testing.assert_allclose(found.gap[1][mine], turned_round.gap, atol=1e-15)
        drawn_at = meeting(met.all[0], {name: (p[None], R[None]) for name, (R, p) in poses.items()})
        there = np.isfinite(drawn_at[0][0])
        np.testing.assert_allclose(drawn_at[0][0][there] - met.all[0].pair.margin, one.gap[there], atol=1e-15)
        np.testing.assert_allclose(drawn_at[2][0][there], one.point[there], atol=1e-15)


@pytest.mark.parametrize("types", PLACES, ids=":".join)
def test_the_reference_finds_the_same_gaps_apart_and_inside_each_other(types: tuple[str, str]) -> None:
    """Its kernels choose faces, edges and ends by rules of their own."""
    rng = np.random.default_rng(5)
    for _ in range(DRAWS):
        met, poses = drawn(rng, types)
        scene = Scene(
            bodies=tuple(Body(name=name, mass=1.0, inertia=(0.1, 0.1, 0.1, 0.0, 0.0, 0.0)) for name in poses),
            joints=tuple(Joint(name=f"free {name}", body=name, type="free") for name in poses),
            shapes=(met.all[0].first, met.all[0].second), pairs=(met.all[0].pair,),
        )  # fmt: skip
        system = system_of(cases.from_scene(scene))
        turns = [np.roll(Rotation.from_matrix(R).as_quat(), 1) for R, _ in poses.values()]
        q = np.concatenate([part for turn, (_, x) in zip(turns, poses.values(), strict=True) for part in (x, turn)])
        theirs = met.touches(poses.__getitem__).gap
        there = theirs < FAR
        np.testing.assert_allclose(system.gap(q, np.zeros(12))[0][there], theirs[there], atol=1e-12)


@pytest.mark.parametrize("seed", range(20))
def test_the_slope_of_a_rate_is_that_of_the_side_on_which_one_is(seed: int) -> None:
    """Rates with a kink anywhere within the differences, or none."""
    rng = np.random.default_rng(seed)
    v = rng.normal(size=3)
    place = rng.uniform(-3e-3, 3e-3, 50) / np.abs(v).max()
    phase, bend = rng.uniform(0.0, 6.0, 50), rng.normal(size=50) * (rng.random(50) < 0.7)

    def rates(times: Floats) -> Floats:
        t = times[:, None]
        return np.sin(t + phase) + bend * np.where(place > 0.0, np.maximum(t - place, 0.0), np.minimum(t - place, 0.0))

    assert np.abs(drift(rates, v) - np.cos(phase)).max() <= 1e-9
