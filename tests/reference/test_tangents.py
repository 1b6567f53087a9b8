"""Tangential rows of every pair of shapes against the engines' own nearest points, and how these go on."""

from __future__ import annotations

import numpy as np
import pytest
from friction_scenes import pair
from friction_scenes import point as mass_point
from scipy.spatial.transform import Rotation

from crossbody.cases import Outcome
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, Scene, Shape
from crossbody.cases.scene_contacts import PLACES
from crossbody.engines._contacts import Contacts
from crossbody.engines.nearest import across
from crossbody.reference import simulate
from crossbody.reference.tree.system import system

NAMES = ("one", "two")
STEP = 1e-3  # s
FOURTH = np.array([0.0, 1.0, -8.0, 0.0, 8.0, -1.0, 0.0]) / 12.0
SIXTH = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) / 60.0
"""Slopes by values at -3 .. 3 steps."""
BENT = 1e-7
"""1/s of a slip, by which both slopes part where a nearest point comes to an edge in between."""
DRAWS = 40


def drawn(rng: np.random.Generator, types: tuple[str, str], *, own: bool = False) -> Scene:
    """Return two shapes on two free bodies, with friction; in the axes of these if they are their `own`."""
    far = 0.0 if own else 0.1
    corners = tuple(map(tuple, Rotation.random(6, rng=rng).apply([0.3, 0.0, 0.0]).tolist()))
    shapes = tuple(
        Shape(name=name, body=name, type=kind, size=tuple(rng.uniform(0.2, 0.5, 3)),
              corners=corners if kind == "hull" else (), position=tuple(far * rng.normal(size=3)),
              orientation=(1.0, 0.0, 0.0, 0.0) if own else tuple(Rotation.random(rng=rng).as_quat()))
        for name, kind in zip(NAMES, types, strict=True)
    )  # fmt: skip
    return Scene(
        bodies=tuple(Body(name=name, mass=1.0, inertia=(0.1, 0.2, 0.25, 0.0, 0.0, 0.0)) for name in NAMES),
        joints=tuple(Joint(name=f"free {name}", body=name, type="free") for name in NAMES),
        shapes=shapes, pairs=(pair(*NAMES, 0.5),),
    )  # fmt: skip


def slips(met: Contacts, x: np.ndarray, turns: Rotation, v: np.ndarray, *, lie: bool) -> np.ndarray:
    """Return slips (places, 2) of the material where shapes are nearest, of two solids on the first; NaN of none.

    Args:
        met: the contact.
        x: places of both bodies (2, 3).
        turns: of both.
        v: velocities (2, 6), the turning in the bodies' axes.
        lie: capsules along each other, or a cylinder on a cap.
    """
    poses = dict(zip(NAMES, zip(turns.as_matrix(), x, strict=True), strict=True))
    contact, found = met.all[0], met.touches(poses.__getitem__, None, {0: lie})
    (one, _), (two, _) = met.ends(poses.__getitem__, contact)
    beside = np.where(found.normal.any(axis=1), found.gap, 0.0) * (contact.first.type != "plane")
    slip = []
    for normal, point in zip(found.normal, found.point - beside[:, None] * found.normal, strict=True):
        first, second = v[:, :3] + np.cross(turns.apply(v[:, 3:]), point - x)
        there = np.nan if not normal.any() else 1.0
        slip.append(there * across(contact.first.type, one, two, normal) @ (second - first))
    return np.array(slip)


@pytest.mark.parametrize("types", PLACES, ids=":".join)
def test_slip_and_its_change_are_those_of_the_material_where_shapes_meet(types: tuple[str, str]) -> None:
    """At v' = 0 bodies go straight and turn steadily: the slope of the slip along that is H' v."""
    rng, count = np.random.default_rng(7), 0
    for _ in range(DRAWS):
        x, turns = rng.normal(size=(2, 3)), Rotation.random(2, rng=rng)
        count += agree(rng, drawn(rng, types), x, turns, lie=False)
    assert count > DRAWS // 2


@pytest.mark.parametrize("types", [("plane", "cylinder"), ("capsule", "capsule")], ids=":".join)
def test_so_they_are_where_shapes_lie_along_each_other(types: tuple[str, str]) -> None:
    rng, count = np.random.default_rng(8), 0
    for _ in range(DRAWS):
        x, turn = rng.normal(size=(2, 3)), Rotation.random(rng=rng)
        x[1] = x[0] + turn.apply([0.8, 0.3, 0.05])
        off = 1e-7 if "plane" in types else 1e-4
        turns = Rotation.concatenate([turn, turn * Rotation.from_rotvec(off * rng.normal(size=3))])
        count += agree(rng, drawn(rng, types, own=True), x, turns, lie=True)
    assert count > DRAWS


def agree(rng: np.random.Generator, scene: Scene, x: np.ndarray, turns: Rotation, *, lie: bool) -> int:
    """Check the tangential rows of a scene at a state, and return at how many places nothing bends."""
    made, met = system(scene, case_of(scene).law), Contacts(scene)
    count, v = 0, rng.normal(size=(2, 6))
    q = np.concatenate([np.r_[at, np.roll(turn, 1)] for at, turn in zip(x, turns.as_quat(), strict=True)])
    seen = np.array([
        slips(met, x + t * v[:, :3], turns * Rotation.from_rotvec(t * v[:, 3:]), v, lie=lie)
        for t in STEP * np.arange(-3, 4)
    ])  # fmt: skip
    roughly, slopes = (np.einsum("k,kij->ij", way, seen) / STEP for way in (FOURTH, SIXTH))
    follows, rate, (H, _, Hdv) = np.asarray(made.follows), made.gap(q, v.ravel())[1], made.constraint(q, v.ravel())
    assert np.isfinite(rate).all()
    for place in np.flatnonzero(np.abs(roughly - slopes).max(axis=1) < BENT * np.abs(slopes).max(axis=1)):
        rows = np.flatnonzero(follows == place)
        np.testing.assert_allclose(rate[rows], seen[3][place], atol=1e-12)
        np.testing.assert_allclose(H[rows] @ v.ravel(), seen[3][place], atol=1e-12)
        np.testing.assert_allclose(Hdv[rows], slopes[place], rtol=0.0, atol=1e-8 * np.abs(slopes[place]).max())
        count += 1
    return count


@pytest.mark.parametrize("solver", ["compiled", "cvode"])
@pytest.mark.parametrize("v", [[1.0, -1.0], [1.0, 0.5, -1.0], [0.0, 0.0, -1.0]])
def test_a_point_without_friction_slides_on(v: list[float], solver: str) -> None:
    """Rows of mu = 0 are tangential rows that bear nothing, not rows that hold while the contact presses."""
    made = mass_point(0.0, 0.0, space=len(v) == 3)
    run = simulate(made, [*np.zeros(len(v) - 1), 0.1], v, 0.3, solver=solver)
    assert run.outcome is Outcome.FINISHED
    assert run.events
    np.testing.assert_allclose(run.v[-1, :-1], v[:-1], atol=1e-12)
    np.testing.assert_allclose(run.lam[:, 1:], 0.0, atol=1e-300)
