"""Convex hulls: their corners over a plane in every engine, meshes of robot files, and what is wrong with a mesh."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial import ConvexHull

from crossbody import cases, engines
from crossbody.cases import Mode, Outcome
from crossbody.cases.rotations import matrices
from crossbody.cases.scene import Body, Joint, Pair, RowLaw, Scene, Shape

GRAVITY = 9.81
LAW = RowLaw(a0=1e4, a1=20.0)


def random_corners(rng: np.random.Generator, count: int = 12) -> tuple[tuple[float, ...], ...]:
    """The corners of the hull of random points; coordinates that a mesh can have, in single precision."""
    points = 0.1 * rng.normal(size=(count, 3)) + 0.05 * rng.normal(size=3)
    return tuple(tuple(map(float, np.float32(points[k]))) for k in ConvexHull(points).vertices)


def unit(rng: np.random.Generator) -> tuple[float, ...]:
    x = rng.normal(size=4)
    return tuple((x / np.linalg.norm(x)).tolist())


def dropped(seed: int, law: RowLaw = LAW) -> tuple[Scene, np.ndarray, np.ndarray]:
    """A hull with a pose of its own on a body whose inertia is a ball's, over a tilted plane; q and v at the start."""
    rng = np.random.default_rng(seed)
    hull = Shape(name="hull", body="body", type="hull", corners=random_corners(rng),
                 position=tuple(0.1 * rng.normal(size=3)),
                 orientation=unit(rng))  # fmt: skip
    floor = Shape(name="floor", type="plane", position=(0.0, 0.0, -0.2), orientation=(1.0, 0.05, -0.03, 0.2))
    scene = Scene(
        bodies=(Body(name="body", mass=1.3, inertia=(0.01, 0.01, 0.01, 0.0, 0.0, 0.0)),),
        joints=(Joint(name="joint", body="body", type="free"),), shapes=(floor, hull),
        pairs=(Pair(name="pair", first="floor", second="hull", margin=0.002, law=law),), gravity=(0.0, 0.0, -GRAVITY),
    )  # fmt: skip
    q = np.array([*rng.uniform(-1.0, 1.0, 2), 0.6, *unit(rng)])
    return scene, q, np.array([*rng.normal(size=2), 0.5 * rng.normal(), *(3.0 * rng.normal(size=3))])


def heights(scene: Scene, q: np.ndarray, v: np.ndarray, t: float) -> np.ndarray:
    """Gap of every corner in free flight: the angular velocity of a body whose inertia is a ball's stays as it is."""
    floor, hull = scene.shapes
    spin = np.linalg.norm(v[3:])
    turned = np.array([np.cos(0.5 * spin * t), *(np.sin(0.5 * spin * t) * v[3:] / spin)])
    R = matrices(q[3:]) @ matrices(turned)  # w in body axes
    place = q[:3] + v[:3] * t - 0.5 * GRAVITY * t * t * np.array([0.0, 0.0, 1.0])
    local = np.array(hull.position) + np.array(hull.corners) @ matrices(np.array(hull.orientation)).T
    normal = matrices(np.array(floor.orientation) / np.linalg.norm(floor.orientation))[:, 2]
    return (place + local @ R.T - floor.position) @ normal - scene.pairs[0].margin


def touch(scene: Scene, q: np.ndarray, v: np.ndarray) -> tuple[float, int]:
    """When a corner meets the plane first, and which."""
    times = np.linspace(0.0, 1.0, 2001)
    lowest = np.array([heights(scene, q, v, t).min() for t in times])
    a, b = next(pair for pair in pairwise(times) if lowest[times == pair[1]] < 0.0)
    found = float(brentq(lambda t: heights(scene, q, v, t).min(), a, b, xtol=1e-15))
    return found, int(heights(scene, q, v, found).argmin())


WITNESSES = [("reference", "compiled"), ("reference", "cvode"), ("mujoco", "matched"), ("pinocchio", "law")]


@pytest.mark.parametrize(("engine", "profile"), WITNESSES)
@pytest.mark.parametrize("seed", range(3))
def test_a_dropped_hull_touches_with_the_corner_and_at_the_instant_of_its_free_flight(
    seed: int, engine: str, profile: str
) -> None:
    scene, q, v = dropped(seed)
    t, corner = touch(scene, q, v)
    case = cases.from_scene(scene, q0=q, v0=v, t_end=t + 0.01)
    run = engines.load(engine).prepare(case, profile).run()
    assert run.outcome is Outcome.FINISHED, run.message
    first = next(event for event in run.events if event.after == Mode.CONTACT)
    assert (first.contact, first.t) == (corner, pytest.approx(t, abs=1e-9))
