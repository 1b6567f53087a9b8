"""What has no friction here says so before it runs: shapes, kinds of friction, engines, solvers and linear models."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from friction_scenes import box_on_floor, pair, sphere_on_floor

from crossbody import cases, engines
from crossbody.cases import Outcome, SceneError
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, Loop, Pair, Scene, Shape
from crossbody.reference import ensemble, linear, recheck, simulate
from crossbody.reference.tree.system import system

SIZES = {
    "sphere": (0.1, 0, 0), "capsule": (0.1, 0.2, 0), "cylinder": (0.1, 0.2, 0), "box": (0.1, 0.1, 0.1),
    "ellipsoid": (0.1, 0.2, 0.3),
}  # fmt: skip
BALL = Body(name="ball", mass=1.0, inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0))


def two(first: str, second: str, **change: Any) -> Scene:
    """Return a fixed shape and one on a free body that may touch, with friction."""
    sizes = SIZES | {"plane": (0.0, 0.0, 0.0)}
    return Scene(
        bodies=(BALL,), joints=(Joint(name="free", body="ball", type="free"),),
        shapes=(Shape(name="a", type=first, size=sizes[first]),
                Shape(name="b", body="ball", type=second, size=sizes[second], position=(0.0, 0.0, 1.0))),
        pairs=(replace(pair("a", "b", 0.5), **change),),
    )  # fmt: skip


@pytest.mark.parametrize(("first", "second"), [("box", "box"), ("capsule", "cylinder"), ("capsule", "box")])
def test_pairs_of_shapes_without_rows_are_refused(first: str, second: str) -> None:
    with pytest.raises(
        SceneError, match=r"(?s)'a:b' of a \w+ and a \w+ has no rows: their gap is not implemented\. Valid are"
    ):
        case_of(two(first, second))


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"dimension": 4, "friction": (0.5, 0.5, 0.1, 0.0, 0.0)}, "dimension=4"),
        ({"dimension": 6, "friction": (0.5, 0.5, 0.1, 0.1, 0.1)}, "dimension=6"),
        ({"friction": (0.5, 0.4, 0.0, 0.0, 0.0)}, "differs by direction"),
        ({"friction": (-0.5, -0.5, 0.0, 0.0, 0.0)}, "at least 0"),
        ({"friction": (np.inf, np.inf, 0.0, 0.0, 0.0)}, "must be finite"),
        ({"friction": (np.nan, np.nan, 0.0, 0.0, 0.0)}, "must be 5 numbers"),
    ],
)
def test_friction_of_another_kind_is_refused(change: dict[str, Any], told: str) -> None:
    with pytest.raises(SceneError, match=told):
        case_of(two("plane", "sphere", **change))


@pytest.mark.parametrize("dimension", [2, 5, 0])
def test_dimensions_that_are_none_are_refused(dimension: int) -> None:
    with pytest.raises(SceneError, match="dimension"):
        two("plane", "sphere", dimension=dimension)


def test_friction_that_is_not_asked_for_is_refused_in_a_scene() -> None:
    with pytest.raises(SceneError, match=r"Scene\.friction is False"):
        case_of(two("plane", "sphere").replace(friction=False))


def joint(**given: Any) -> Scene:
    """Return a sphere on a floor beside a body on a joint of its own."""
    scene = sphere_on_floor(0.5, 0.1)
    return scene.replace(
        bodies=(*scene.bodies, Body(name="arm", mass=1.0, inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0))),
        joints=(*scene.joints, Joint(name="hinge", body="arm", type="hinge", **given)),
    )


RUBBING = (
    ("reference", "compiled"), ("reference", "cvode"), ("mujoco", "default"), ("mujoco", "as_is"),
    ("pinocchio", "admm"),
    ("drake", "matched"), ("drake", "default"), ("dart", "matched"), ("dart", "default"),
)  # fmt: skip
"""Those that have friction; of a scene and of a file one of MuJoCo's is refused, for another reason."""


@pytest.mark.parametrize("engine", engines.names())
def test_engines_without_friction_refuse_a_scene_and_a_file(engine: str, tmp_path: Path) -> None:
    try:
        profiles = engines.load(engine).profiles
    except cases.EngineUnavailable as error:
        pytest.skip(str(error))
    path = tmp_path / "ball.xml"
    path.write_text(
        '<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/><body name="ball" pos="0 0 1"><freejoint/>'
        '<geom type="sphere" size=".1"/></body></worldbody></mujoco>'
    )
    dry = tmp_path / "dry.xml"
    dry.write_text(path.read_text().replace("<freejoint/>", '<joint name="up" type="slide" frictionloss="1"/>'))
    found = (
        case_of(sphere_on_floor(0.5, 0.1)), cases.from_file(str(path), friction=1),
        case_of(joint(friction_loss=0.1).replace(pairs=())), cases.from_file(str(dry), friction=0),
        cases.load("dry_oscillator", "stops"),
    )  # fmt: skip
    for case, profile in product(found, profiles):
        if (engine, profile) in RUBBING:
            continue
        reason = engines.load(engine).why_not(case, profile)
        assert reason
        assert "riction" in reason or "pairs of shapes" in reason or "as_is" in reason
        with pytest.raises(cases.CaseUnsupported):
            engines.load(engine).prepare(case, profile)


@pytest.mark.parametrize("scene", [joint(), joint(friction_loss=0.1).replace(pairs=())])
def test_engines_that_step_contacts_alone_refuse_loops_beside_friction(scene: Scene) -> None:
    case = case_of(scene.replace(loops=(Loop(name="held", type="connect", first="arm"),)))
    assert engines.load("reference").why_not(case, "compiled") is None
    assert engines.load("reference").why_not(case, "cvode") is None
    assert engines.load("mujoco").why_not(case, "default") is None
    for engine, profile in (("pinocchio", "admm"), ("drake", "default"), ("dart", "default")):
        try:
            reason = engines.load(engine).why_not(case, profile)
        except cases.EngineUnavailable:
            continue
        assert reason is not None
        assert "'held' is always on" in reason or scene.dry


SCENE = sphere_on_floor(0.5, 0.1)
START = np.array([0.0, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0])
LINEAR: dict[str, Callable[[Any], Any]] = {
    "tangents": lambda made: linear.tangents(made, START[None]),
    "poses": lambda made: linear.poses(made, START[None], ()),
    "balanced": lambda made: linear.balanced(
        made, [0.0], START[None], np.zeros((1, 6)), np.zeros((1, 6)), unknown=linear.Unknown(rows=(0,))
    ),
    "filtered": lambda made: linear.filtered(
        made,
        [0.0, 1.0],
        np.zeros((2, 1)),
        unknown=linear.Unknown(rows=(0,)),
        measured=(0,),
        std_y=1.0,
        q0=START,
        std_force=1.0,
        time_force=1.0,
    ),
}


@pytest.mark.parametrize("name", LINEAR)
def test_derivatives_at_many_states_and_estimates_of_forces_are_refused(name: str) -> None:
    made = system(SCENE, case_of(SCENE).law)
    with pytest.raises((SceneError, cases.InvalidValue), match="friction"):
        LINEAR[name](made)


def test_a_file_whose_friction_is_not_known_ends_where_it_would_act(tmp_path: Path) -> None:
    path = tmp_path / "can.xml"
    path.write_text(
        '<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/><body name="can" pos="0 0 .11"><freejoint/>'
        '<geom name="can" type="cylinder" size=".1 .1" condim="6"/></body></worldbody></mujoco>'
    )
    run = engines.load("reference").prepare(cases.from_file(str(path), friction=1, t_end=0.2), "compiled").run()
    assert run.outcome is Outcome.INCONSISTENT
    assert (
        "torsional and rolling friction are not supported (dimension=6, condim in a file; 3, or without=rolling"
    ) in run.message
    assert "without=friction" in run.message


def test_an_ensemble_slides_as_single_runs_do_and_a_motion_is_rechecked() -> None:
    scene = box_on_floor(0.3)
    made, q0 = system(scene, case_of(scene).law), np.array([0.0, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0])
    starts = np.array([[speed, 0.0, 0.0, 0.0, 0.0, 0.0] for speed in (0.5, 1.0)])
    many = ensemble(made, np.array([q0, q0]), starts, 0.5, rtol=1e-8)
    for k, v0 in enumerate(starts):
        one = simulate(made, q0, v0, 0.5, rtol=1e-8)
        assert np.array_equal(many.q[k], one.q[-1])
        assert recheck(made, one, rtol=1e-8) == ()


def test_a_pair_of_no_friction_in_all_directions_has_no_tangential_rows() -> None:
    free = Pair(name="a:b", first="a", second="b", dimension=3)
    case = case_of(two("plane", "sphere").replace(pairs=(free,)))
    assert case.contacts == ("a:b",)
