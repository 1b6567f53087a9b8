"""Pictures of scenes: bodies stand where MuJoCo has them, and forces act where the reference's rows push."""

from __future__ import annotations

import json
from typing import Any

import mujoco
import numpy as np
import pytest
from random_scenes import random_scene, random_state
from scenes import compiled, rows_at
from scipy.spatial.transform import Rotation

from crossbody import cases
from crossbody.cases.files.case import case_of, quaternions
from crossbody.cases.rotations import rates
from crossbody.cases.scene import Body, Scene, Shape
from crossbody.cases.scene_contacts import contacts, rows_of
from crossbody.cases.scene_plain import plain, scene_from
from crossbody.engines import load
from crossbody.reference.tree import mechanism
from crossbody.reference.tree.table import tabulate
from crossbody.reports import scenes
from crossbody.reports.pages.playback import playback
from crossbody.reports.runs import study
from crossbody.reports.runs.store import Trace

SEEDS = range(25)
picture = scenes.load("scene")


def told(scene: Scene) -> dict[str, Any]:
    return {"scene": json.loads(json.dumps(plain(scene)))}


@pytest.mark.parametrize("seed", SEEDS)
def test_a_scene_comes_back_from_a_file(seed: int) -> None:
    """To the last digit, but for axes, which are brought to length 1 anew."""
    scene = random_scene(seed)
    back = scene_from(told(scene)["scene"])
    for one, other in zip(scene.joints, back.joints, strict=True):
        assert one.axis == pytest.approx(other.axis, rel=1e-15)
    axes = [joint.axis for joint in scene.joints]
    for joint, axis in zip(back.joints, axes, strict=True):
        object.__setattr__(joint, "axis", axis)
    assert back == scene


@pytest.mark.parametrize("seed", SEEDS)
def test_bodies_stand_where_mujoco_has_them(seed: int) -> None:
    scene = random_scene(seed)
    model = compiled(scene)
    data = mujoco.MjData(model)
    q = np.array([random_state(scene, np.random.default_rng(k))[0] for k in range(3)])
    found = picture.poses(q, told(scene)).reshape(3, -1, 3, 3)
    for state, poses in zip(q, found, strict=True):
        data.qpos[:] = state
        mujoco.mj_kinematics(model, data)
        for body, (origin, x, y) in zip(scene.bodies, poses, strict=True):
            place, turn = data.body(body.name).xpos, data.body(body.name).xmat.reshape(3, 3)
            assert np.abs(np.array([origin - place, x - turn[:, 0], y - turn[:, 1]])).max() < 1e-12


def jacobians(model: Any, data: Any, scene: Scene, contact: Any, at: Any) -> Any:
    """How the point moves with the second shape's body against the first's, by MuJoCo (3, nv)."""
    parts = []
    for shape in (contact.first, contact.second):
        J = np.zeros((3, model.nv))
        mujoco.mj_jac(model, data, J, None, at, model.body(shape.body).id if shape.body else 0)
        parts.append(J)
    return parts[1] - parts[0]


@pytest.mark.parametrize("seed", SEEDS)
def test_forces_act_where_the_rows_push(seed: int) -> None:
    """H = n J at the point that is drawn: a force of 1 N along the arrow is the row's own."""
    scene = random_scene(seed)
    met = contacts(scene)
    count = sum(contact.places for contact in met)
    if not count:
        pytest.skip("no shapes of this scene meet")
    q, v, u = random_state(scene, np.random.default_rng(seed))
    scene = scene.replace(loops=())  # whose forces stand before those of the contacts
    rows = len(rows_of(scene)[0])
    H = rows_at(scene, q, v, u)[0][rows - count :]
    model = compiled(scene)
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    drawn = picture.arrows(q[None], np.ones((1, rows)), told(scene))[0]
    owners, pushed, first = [], [], 0
    for contact in met:  # of all corners of a hull there is one arrow
        own, first = H[first : first + contact.places], first + contact.places
        pushed += [own.sum(axis=0) / contact.places] if contact.second.type == "hull" else [*own]
        owners += [contact] * (1 if contact.second.type == "hull" else contact.places)
    forces = np.array([6.0 if contact.second.type == "hull" else 1.0 for contact in owners])
    drawn[:, 3:] /= forces[:, None]
    for row, arrow, contact in zip(pushed, drawn, owners, strict=True):
        if not row.any():  # none, as its shapes lie
            continue
        J = jacobians(model, data, scene, contact, arrow[:3])
        assert abs(np.linalg.norm(arrow[3:]) - 1.0) < 1e-12
        assert np.abs(arrow[3:] @ J - row).max() <= 1e-9 * max(1.0, np.abs(J).max())


def test_rates_of_positions_are_those_of_the_tree() -> None:
    for seed in SEEDS:
        scene = random_scene(seed)
        q, v, _ = random_state(scene, np.random.default_rng(seed))
        wanted = np.zeros(scene.nq)
        mechanism.velocity(0.0, q, v, tabulate(scene).p, wanted)
        found = rates(q[None], v[None], quaternions(scene))[0]
        assert np.abs(found - wanted).max() <= 1e-12 * max(1.0, np.abs(wanted).max())


BALL = Scene(
    bodies=(Body(name="ball", mass=1.0, inertia=(0.1, 0.1, 0.1, 0.0, 0.0, 0.0)),),
    shapes=(Shape(name="floor", type="plane"), Shape(name="ball", body="ball", size=(0.1, 0.1, 0.1))),
)


def reach(shape: Shape, n: Any) -> float:
    """How far a shape about its origin extends along n, in its own axes (its support function)."""
    a, b, _ = shape.size
    across = float(np.hypot(n[0], n[1]))
    return {
        "sphere": a, "capsule": a + b * abs(n[2]), "cylinder": a * across + b * abs(n[2]),
        "box": float(np.abs(n) @ shape.size), "ellipsoid": float(np.linalg.norm(n * shape.size)),
        "hull": float((np.reshape(shape.corners, (-1, 3)) @ n).max(initial=-1.0)),
    }[shape.type]  # fmt: skip


WEDGE = ((0.3, 0.2, 0.0), (-0.3, 0.2, 0.0), (-0.3, -0.2, 0.0), (0.3, -0.2, 0.0), (0.3, 0.0, 0.1), (-0.3, 0.0, 0.1))
"""Five sides of a hull, three of them with four corners."""


@pytest.mark.parametrize("kind", ["sphere", "capsule", "cylinder", "box", "ellipsoid", "hull"])
def test_a_solid_reaches_as_far_as_its_shape(kind: str) -> None:
    """Along the axes of the shape to the last digit that is drawn, along others but for the corners of a circle."""
    rng = np.random.default_rng(5)
    turn = Rotation.random(rng=rng)
    x, y, z, w = turn.as_quat()
    place = rng.normal(size=3)
    shape = Shape(
        name="s",
        body="ball",
        type=kind,
        size=(0.3, 0.2, 0.1),
        position=tuple(place),
        orientation=(w, x, y, z),
        corners=WEDGE if kind == "hull" else (),
    )
    (solid,) = picture.stage(told(BALL.replace(shapes=(shape,)))).solids
    for n, exact in [
        *((way, 1e-3) for way in (*np.eye(3), *-np.eye(3))),
        *((way, 2e-2) for way in rng.normal(size=(20, 3))),
    ]:
        n = n / np.linalg.norm(n)
        found = ((np.array(solid["points"]) - place) @ turn.apply(n)).max() + solid["radius"]
        assert (1.0 - exact) * reach(shape, n) - 1e-5 < found < reach(shape, n) + 1e-5


@pytest.mark.parametrize("kind", ["cylinder", "box", "hull"])
def test_faces_of_a_solid_are_seen_from_outside(kind: str) -> None:
    shape = Shape(name="s", body="ball", type=kind, size=(0.3, 0.2, 0.1), corners=WEDGE if kind == "hull" else ())
    (solid,) = picture.stage(told(BALL.replace(shapes=(shape,)))).solids
    corners = np.array(solid["points"])
    assert len(solid["faces"]) == {"cylinder": 2, "box": 6, "hull": 5}[kind]
    for face in solid["faces"]:  # against the clock
        x, y, z = corners[list(face[:3])]
        assert np.cross(y - x, z - y) @ (corners[list(face)].mean(axis=0) - corners.mean(axis=0)) > 0.0
        assert kind != "hull" or (np.cross(y - x, z - y) @ (corners - x).T < 1e-9).all()  # no corner is beyond a side


def test_a_body_without_a_shape_is_the_box_of_its_inertia() -> None:
    """A homogeneous box of sides 2a, 2b, 2c has m (b^2 + c^2)/3 about its first axis."""
    a, b, c, m = 0.1, 0.2, 0.4, 3.0
    moments = m / 3.0 * np.array([b * b + c * c, a * a + c * c, a * a + b * b])
    scene = Scene(bodies=(Body(name="box", mass=m, com=(1.0, 0.0, 0.0), inertia=(*moments, 0.0, 0.0, 0.0)),))
    (solid,) = picture.stage(told(scene)).solids
    corners = np.array(solid["points"]) - (1.0, 0.0, 0.0)
    assert np.allclose(np.abs(corners), (a, b, c), atol=1e-6)
    for face in solid["faces"]:  # seen from outside against the clock
        x, y, z = corners[list(face[:3])]
        assert np.cross(y - x, z - y) @ corners[list(face)].mean(axis=0) > 0.0


def test_a_run_of_a_scene_has_its_playback() -> None:
    scene = random_scene(3).replace(loops=())
    case = case_of(scene, q0=random_state(scene, np.random.default_rng(0))[0], t_end=0.01)
    run = load("reference").prepare(case, "compiled").run()
    trace = Trace(about=study._about(case, "reference", "compiled"), run=run)
    (section,) = playback([trace])
    assert section.context["scene"]["stage"]["frames"] == len(scene.bodies)
    many = BALL.replace(bodies=tuple(Body(name=f"body {i}") for i in range(600)), shapes=())
    trace.about["scene"].update(told(many)["scene"])
    (section,) = playback([trace])
    assert "600 bodies" in section.text
    trace.about["scene"].update(bodies=[{"name": "a", "parent": "b"}])
    (section,) = playback([trace])
    assert "cannot be drawn" in section.text


@pytest.mark.parametrize("seed", range(4))
def test_no_body_is_drawn_as_nothing(seed: int) -> None:
    """A mass point has no inertia that would give it a size."""
    draw = np.random.default_rng(seed)
    mass, com = float(10.0 ** draw.uniform(-3.0, 3.0)), tuple(draw.normal(size=3).tolist())
    body = Body(name="b", mass=mass, com=com, inertia=(0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    (solid,) = picture.stage(told(Scene(bodies=(body,)))).solids
    assert 1000.0 * 4.0 / 3.0 * np.pi * solid["radius"] ** 3 == pytest.approx(mass)
    np.testing.assert_allclose(solid["points"], [com], atol=1e-6)


@pytest.mark.parametrize("seed", range(10))
def test_what_a_box_of_its_body_holds_is_not_drawn_and_all_else_is(seed: int) -> None:
    draw = np.random.default_rng(seed)
    turn = tuple(Rotation.random(rng=draw).as_quat())
    box = Shape(name="box", body="ball", type="box", size=tuple(draw.uniform(0.2, 0.4, 3)),
                position=tuple(draw.normal(size=3)), orientation=turn)  # fmt: skip
    ways = np.array([box.orientation[k] for k in (1, 2, 3, 0)])
    held, out = (
        Shape(name=name, body="ball", size=(0.05, 0.0, 0.0), position=tuple(
            np.array(box.position) + Rotation.from_quat(ways).apply((np.array(box.size) - 0.05) * (1.0, -1.0, 1.0) * by)
        )) for name, by in (("held", draw.uniform(0.0, 1.0)), ("out", draw.uniform(1.01, 2.0)))
    )  # fmt: skip
    seen = picture.stage(told(BALL.replace(shapes=(box, held, out)))).solids
    assert [(len(solid["points"]), solid["radius"]) for solid in seen] == [(8, 0.0), (1, 0.05)]


@pytest.mark.parametrize(
    ("name", "variant", "body"),
    [*(("sliding_block", variant, "block") for variant in ("stops", "turns", "flat")),
     ("block_on_belt", "", "block"), ("held_weight", "", "weight"), ("held_weight", "sprung", "weight")],
)  # fmt: skip
def test_a_block_is_drawn_as_a_block(name: str, variant: str, body: str) -> None:
    """A ball by which it touches at one place is what engines compute, and not what a reader looks for."""
    case = cases.load(name, variant or cases.variants(name)[0])
    solids = picture.stage({"scene": study._about(case, "truth", "")["scene"]}).solids
    number = [one.name for one in case.scene.bodies].index(body)
    (solid,) = [one for one in solids if one["body"] == number and "plane" not in one]
    assert len(solid["points"]) == 8
