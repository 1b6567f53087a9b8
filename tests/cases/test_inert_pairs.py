"""Pairs of a plane and a shape whose gap no joint changes: they have no rows, in any engine."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from crossbody import cases, engines
from crossbody.cases.scene import UPRIGHT, Body, Joint, Pair, Scene, Shape
from crossbody.cases.scene_contacts import contacts, inert
from crossbody.engines.nearest import meet
from crossbody.reports.scenes.scene import body_poses, placed

INERTIA = (0.1, 0.1, 0.1, 0.0, 0.0, 0.0)
ALONG = (("slide", (1.0, 0.0, 0.0)), ("slide", (0.0, 1.0, 0.0)), ("hinge", (0.0, 0.0, 1.0)))
ACROSS = (("slide", (0.0, 0.0, 1.0)), ("hinge", (1.0, 0.0, 0.0)), ("slide", (0.8, 0.0, 0.6)))


def quaternion(turn: Rotation) -> tuple[float, ...]:
    return tuple(np.roll(turn.as_quat(), 1).tolist())


def scene(seed: int) -> Scene:
    """A cylinder on a chain of two bodies over a tilted plane, which carries the chain in half of the scenes."""
    rng = np.random.default_rng(seed)
    tilt = Rotation.random(rng=rng)
    kinds = [ALONG[rng.integers(3)] for _ in range(3)]
    if rng.random() < 0.5:
        kinds[rng.integers(3)] = ACROSS[rng.integers(3)]
    carrier = str(rng.choice(["", "table"]))
    bodies = (
        Body(name="table", orientation=quaternion(tilt) if carrier else UPRIGHT, mass=5.0, inertia=INERTIA),
        Body(name="one", parent=carrier, orientation=UPRIGHT if carrier else quaternion(tilt), mass=1.0,
             inertia=INERTIA),
        Body(name="two", parent="one", position=tuple(0.1 * rng.normal(size=3)), mass=1.0, inertia=INERTIA),
    )  # fmt: skip
    lift = (Joint(name="lift", body="table", type="hinge", axis=(0.0, 1.0, 0.0)),) if carrier else ()
    joints = tuple(
        Joint(name=f"joint {k}", body="one" if k < 2 else "two", type=kind, axis=axis, anchor=tuple(rng.normal(size=3)))
        for k, (kind, axis) in enumerate(kinds)
    )
    shapes = (
        Shape(name="plane", body=carrier, type="plane", size=(1.0, 1.0, 1.0),
              orientation=UPRIGHT if carrier else quaternion(tilt)),
        Shape(name="can", body="two", type="cylinder", size=(0.2, 0.1, 0.0),
              orientation=quaternion(Rotation.random(rng=rng))),
    )  # fmt: skip
    return Scene(
        bodies=bodies, joints=(*lift, *joints), shapes=shapes, pairs=(Pair(name="pair", first="can", second="plane"),)
    )


@pytest.mark.parametrize("seed", range(30))
def test_a_pair_is_inert_where_its_gaps_are_the_same_in_every_pose(seed: int) -> None:
    made = scene(seed)
    q = np.random.default_rng(seed).normal(size=(12, made.nq))
    bodies = body_poses(made, q)
    can, plane = made.shapes[1], made.shapes[0]
    (p, R), (x, X) = (placed(bodies[one.body], one.position, one.orientation) for one in (plane, can))
    sizes = (np.array(plane.size), np.array(can.size))
    gaps = meet(("plane", "cylinder"), sizes, (R, p), (X, x), np.zeros(12, dtype=bool))[0]
    same = bool(np.ptp(gaps, axis=0).max() < 1e-9)
    assert (len(inert(made)) == 1) == same
    assert (len(contacts(made)) == 0) == same


@pytest.mark.parametrize(
    "who", ["reference:compiled", "reference:cvode", "reference:ida", "mujoco:matched", "pinocchio:law"]
)
def test_a_puck_below_its_table_moves_on(who: str) -> None:
    """It starts in the table: with a row that moves nothing its multiplier would be 0/0."""
    puck = Body(name="puck", mass=1.0, inertia=INERTIA)
    ways = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0)}
    joints = tuple(Joint(name=name, body="puck", type="slide", axis=axis) for name, axis in ways.items())
    shapes = (Shape(name="floor", type="plane", size=(1.0, 1.0, 1.0)),
              Shape(name="disc", body="puck", type="cylinder", size=(0.1, 0.02, 0.0)))  # fmt: skip
    made = Scene(bodies=(puck,), joints=joints, shapes=shapes, pairs=(Pair(name="pair", first="floor", second="disc"),))
    engine, profile = who.split(":")
    run = engines.load(engine).prepare(cases.from_scene(made, v0=[1.0, -0.5], t_end=0.5), profile).run()
    assert run.outcome.ok, run.message
    assert run.q[-1] == pytest.approx([0.5, -0.25], abs=1e-9)


STANDING = {
    "a puck in its table": """<geom name="floor" type="plane" size="1 1 1"/>
        <body><joint type="slide" axis="1 0 0"/><geom type="cylinder" size="0.1 0.02" mass="1" condim="1"/></body>""",
    "a capsule in a box": """<geom name="block" type="box" size="1 1 0.1" condim="1"/>
        <body pos="0 0 0.2"><joint type="slide" axis="0 0 1"/>
        <geom type="capsule" size="0.15 0.1" euler="90 0 0" mass="1" condim="1"/></body>""",
}
"""Shapes that touch from the start and whose pairs have no rows."""


@pytest.mark.parametrize("name", STANDING)
def test_a_file_as_it_stands_has_contacts_that_the_scene_has_not(name: str, tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    path.write_text(f"<mujoco><worldbody>{STANDING[name]}</worldbody></mujoco>")
    case = cases.from_file(str(path), t_end=0.05)
    run = engines.load("mujoco").prepare(case, "as_is").run()
    assert run.outcome.ok
    assert not run.gap.size
