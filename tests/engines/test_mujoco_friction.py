"""MuJoCo on scenes with friction: forces in the scene's frames, modes, creep and lateness by its own parameters."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from friction_scenes import G, box_on_floor, rubbed, sphere_on_floor, stack
from scipy.spatial.transform import Rotation

from crossbody import cases, engines
from crossbody.cases import Case, Mode, Trajectory
from crossbody.cases.files.case import case_of
from crossbody.cases.mechanisms.friction.creeps import Soft, creep
from crossbody.cases.scene import Body, Joint, Pair, Scene, Shape
from crossbody.engines.equations import system_of
from crossbody.reports.judging.comparison import judged
from crossbody.reports.judging.verdict import Word
from crossbody.reports.runs import choice, jobs

FILE = """<mujoco><option gravity="{gravity}" cone="{cone}" impratio="{impratio}" timestep="{dt}"/><worldbody>
  <geom name="floor" type="plane" size="5 5 1" friction="{mu} 0 0" {floor}/>
  <body name="body" pos="0 0 .1"><freejoint/><geom name="body" {shape} mass="1" friction="{mu} 0 0" {soft}/></body>
  </worldbody><keyframe><key name="thrown" qvel="{speed}"/></keyframe></mujoco>"""
BALL, BOX = 'type="sphere" size=".1"', 'type="box" size=".2 .15 .1"'
TOLD = (("pyramidal", BOX, 0.7), ("elliptic", BALL, 0.7), ("elliptic", BALL, 0.0), ("pyramidal", BALL, 0.0))
SLOPE = 0.4
DOWN = f"{float(G * np.sin(np.arctan(SLOPE)))!r} 0 {-float(G * np.cos(np.arctan(SLOPE)))!r}"


def file(folder: Path, **given: Any) -> Case:
    """Return a body that is thrown on a floor with friction."""
    numbers = {"gravity": f"0 0 {-G}", "cone": "pyramidal", "impratio": 1.0, "dt": 0.002, "mu": 0.5, "floor": "",
               "shape": BALL, "soft": "", "speed": "2 0 0 3 -5 4"}  # fmt: skip
    path = folder / "thrown.xml"
    path.write_text(FILE.format(**(numbers | given)))
    return cases.from_file(str(path), friction=1)


def run(case: Case, profile: str = "as_is", **settings: Any) -> Trajectory:
    """Return a motion in MuJoCo."""
    return engines.load("mujoco").prepare(case, profile, **settings).run()


def unexplained(case: Case, found: Trajectory, some: Any) -> float:
    """Return by how much v' of samples is not that of the case's forces and the recorded multipliers, over the largest.

    MuJoCo's contacts are half a penetration above the scene's points.
    """
    system, worst, largest = system_of(case), 0.0, 0.0
    for i in some:
        q, v = found.q[i], found.v[i]
        M, f = system.terms(q, v)[:2]
        given = np.linalg.solve(M, f + system.constraint(q, v)[0].T @ found.lam[i])
        dt = found.t[i + 1] - found.t[i]
        worst = max(worst, float(np.abs((found.v[i + 1] - v) / dt - given).max()))
        largest = max(largest, float(np.abs(given).max()))
    return worst / largest


@pytest.mark.parametrize(
    ("cone", "shape", "turn"),
    [
        pytest.param(*one, marks=() if one in TOLD else pytest.mark.slow)
        for one in product(("pyramidal", "elliptic"), (BALL, BOX), (0.0, 0.7))
    ],
)
def test_multipliers_explain_the_motion(cone: str, shape: str, turn: float, tmp_path: Path) -> None:
    """M v' = f + H^T lam with the reference's H: frames, signs and corners are the scene's."""
    case = file(tmp_path, cone=cone, shape=shape, floor=f'euler="0 0 {turn}"', speed="2 .5 0 0 0 0.5")
    found = run(case, dt=1e-4)
    some = np.flatnonzero(found.lam[:-1].any(axis=1))[5::97]
    assert len(some) > 20
    assert np.abs(found.lam[:, len(case.contacts) // 3 :]).max() > 1.0
    assert unexplained(case, found, some) < 1e-2
    assert {Mode.STICK, Mode.SLIP} <= set(found.mode[:, 0].tolist())


@pytest.mark.parametrize("order", [1, -1])
def test_spheres_that_rub_push_along_the_frame_of_their_rows(order: int) -> None:
    one, two = sphere_on_floor(0.4, 0.1), Rotation.from_euler("xyz", [0.3, -0.4, 0.2])
    body = one.bodies[0]
    pair = Pair(name="balls", first="sphere", second="other", friction=(0.4, 0.4, 0, 0, 0), dimension=3)
    scene = Scene(
        bodies=(body, Body(name="other", mass=2.0, inertia=body.inertia)),
        joints=tuple(Joint(name=f"of {name}", body=name, type="free") for name in ("sphere", "other")),
        shapes=(one.shapes[1], Shape(name="other", body="other", size=(0.15, 0, 0))),
        pairs=(replace(pair, first="other", second="sphere") if order < 0 else pair,),
        gravity=(0.0, 0.0, 0.0),
    )  # fmt: skip
    turn = two.as_quat(scalar_first=True)
    q0 = [0, 0, 0, 1, 0, 0, 0, *two.apply([0.2499, 0.0, 0.0]), *turn]
    v0 = [*two.apply([0.5, 0.2, -0.1]), 1, 2, 3, 0, 0, 0, 3, -1, 2]
    case = case_of(scene, q0=q0, v0=v0, t_end=0.02)
    found = run(case, "default", dt=1e-4)
    some = np.flatnonzero(found.lam[:-1].any(axis=1))[::5]
    assert len(some) > 5
    assert unexplained(case, found, some) < 1e-2


@pytest.mark.parametrize("case", [pytest.param(case, id=name) for name, case in rubbed()])
def test_solids_that_rub_push_along_the_frame_of_their_rows(case: Case) -> None:
    found = run(case, "default", dt=1e-4)
    some = np.flatnonzero(found.lam[:-1].any(axis=1))[::5]
    assert len(some) > 5
    assert np.abs(found.lam[:, len(case.contacts) // 3 :]).max() > 1.0
    assert unexplained(case, found, some) < 1e-2


@pytest.mark.parametrize("cone", ["pyramidal", "elliptic"])
@pytest.mark.parametrize("mu", [0.5, 0.9])
@pytest.mark.parametrize("impratio", [1.0, 10.0])
@pytest.mark.parametrize("solimp", [(0.9, 0.95, 0.001), (0.8, 0.8, 0.001)])
def test_a_point_creeps_down_a_slope_as_its_parameters_say(
    cone: str, mu: float, impratio: float, solimp: tuple[float, ...], tmp_path: Path
) -> None:
    """Below the cone nothing holds it: measured over predicted within 1 per cent, whatever the step."""
    text = FILE.replace("<freejoint/>", '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>')
    soft = f'solimp="{solimp[0]} {solimp[1]} {solimp[2]} .5 2"'
    path = tmp_path / "point.xml"
    path.write_text(text.format(gravity=DOWN, cone=cone, impratio=impratio, dt=0.002, mu=mu, floor=soft, shape=BALL,
                                soft=soft, speed="0 0"))  # fmt: skip
    found = run(cases.from_file(str(path), friction=1, t_end=2.0))
    assert set(found.mode[-100:, 0].tolist()) == {Mode.STICK}
    made = Soft(low=solimp[0], high=solimp[1], width=solimp[2], impratio=impratio)
    expected = creep(mu, SLOPE, G * np.cos(np.arctan(SLOPE)), made, elliptic=cone == "elliptic")
    assert found.v[-1, 0] == pytest.approx(expected, rel=1e-2)


def test_a_pyramid_pushes_off_the_slip_and_a_cone_does_not(tmp_path: Path) -> None:
    angles = {}
    for cone in ("pyramidal", "elliptic"):
        case = file(tmp_path, cone=cone, speed="2 1 0 0 0 0", mu=0.2)
        found = run(case)
        slides = (found.mode[:, 0] == Mode.SLIP) & (found.t > 0.02) & (found.t < 0.1)
        slip = np.array([system_of(case).constraint(q)[0][1:] @ v for q, v in zip(found.q, found.v, strict=True)])[
            slides
        ]
        force = found.lam[slides, 1:]
        cosine = -np.sum(slip * force, axis=1) / np.linalg.norm(slip, axis=1) / np.linalg.norm(force, axis=1)
        angles[cone] = float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)).max()))
    assert angles["elliptic"] < 0.1
    assert angles["pyramidal"] > 5.0


def test_cones_are_settings(tmp_path: Path) -> None:
    case = file(tmp_path, gravity=DOWN, shape=BOX, speed="0 0 0 0 0 0")
    creeps = [
        abs(run(case, **given).v[-1, 0])
        for given in (
            {},
            {"cone": "elliptic"},
            {"cone": "elliptic", "impratio": 100.0},
            {"cone": "elliptic", "noslip": 50},
        )
    ]
    assert creeps[1] / creeps[2] == pytest.approx(100.0, rel=1e-2)
    assert creeps[3] < 1e-3 * creeps[0]
    assert "cone" not in engines.load("mujoco").prepare(cases.load("bouncing_ball", "linear"), "default").settings


@pytest.mark.parametrize("profile", ["compiled", "as_is"])
def test_coefficients_of_zero_have_no_friction(profile: str, tmp_path: Path) -> None:
    case = file(tmp_path, mu=0.0, speed="2 0 0 0 0 0")
    engine = "reference" if profile == "compiled" else "mujoco"
    found = engines.load(engine).prepare(case, profile).run()
    assert case.contacts == ("floor:body",)
    assert found.lam[-1, 0] == pytest.approx(G, rel=1e-2)
    assert found.v[-1, 0] == pytest.approx(2.0, abs=1e-3)


def test_a_file_is_run_with_friction_where_its_motion_comes_to_some(tmp_path: Path) -> None:
    text = FILE.format(gravity=f"0 0 {-G}", cone="pyramidal", impratio=1, dt=0.002, mu=0.3, floor="", shape=BALL,
                       soft="", speed="1 0 0 0 0 0")  # fmt: skip
    picks = choice.picks(["reference:compiled", "mujoco:as_is", "mujoco:matched"])
    for height, rubs in ((".1", True), ("9", False)):
        path = tmp_path / "ball.xml"
        path.write_text(text.replace("0 0 .1", f"0 0 {height}"))
        found = jobs.run_case(cases.from_file(str(path), t_end=0.1), picks, refine=False)
        assert found.case.parameters["friction"] == (1 if rubs else -1)
        assert ("floor:body t1" in found.case.contacts) == rubs
        assert [bool(entry.skipped) for entry in found.entries] == [False, False, rubs]
        assert not rubs or "'floor:body' has friction" in found.entries[2].skipped


def test_the_reader_of_a_file_with_friction_is_judged(tmp_path: Path) -> None:
    """What is built from the scene slides as the file does."""
    case = file(tmp_path, shape=BOX, mu=0.3, cone="elliptic", impratio=5.0)
    file_, scene = (run(case, reader=reader) for reader in ("file", "scene"))
    assert np.abs(file_.q - scene.q).max() < 1e-9
    assert mujoco.MjModel.from_xml_path(case.file).opt.cone == int(mujoco.mjtCone.mjCONE_ELLIPTIC)


@pytest.mark.parametrize("scene", [box_on_floor(0.3), stack(0.2, 0.3)])
def test_scenes_in_python_run_in_the_obvious_model(scene: Scene) -> None:
    bodies = len(scene.bodies)
    q0 = [0, 0, 0.1, 1, 0, 0, 0, 0, 0, 0.3, 1, 0, 0, 0][: 7 * bodies]
    v0 = [0.5, *[0.0] * (6 * bodies - 1)]
    found = run(case_of(scene, q0=q0, v0=v0, t_end=0.5), "default")
    assert found.outcome.ok, found.message
    assert abs(found.v[-1, 0]) < 0.02
    assert found.lam[-1, :8].sum() == pytest.approx(G * sum(body.mass for body in scene.bodies), rel=1e-3)


SET = {"cone": ("pyramidal", "elliptic"), "impratio": (0.5, 1.0, 10.0, 100.0), "noslip": (0, 5, 50),
       "timeconst": (0.005, 0.01, 0.03), "dt": (0.001, 0.002)}  # fmt: skip


@pytest.mark.parametrize("seed", range(6))
def test_no_importer_is_accused_of_settings(seed: int, tmp_path: Path) -> None:
    """Every run that tells parts of an error has the settings that were asked: the readers agree to rounding."""
    rng = np.random.default_rng(seed)
    asked = {name: values[rng.integers(len(values))] for name, values in SET.items() if rng.random() < 0.6}
    case = file(tmp_path, shape=BOX, mu=0.5, speed="1 .3 0 0 0 0")  # a box that spins shares its load as no law says
    case = cases.from_file(case.file, t_end=0.1)
    found = jobs.run_case(case, choice.picks(["mujoco:as_is"]), settings=asked).entries[0]
    assert found.study is not None
    assert {name: found.settings[name] for name in asked} == asked
    assert np.abs(found.study.built.q - found.run.q).max() < 1e-9


@pytest.mark.parametrize("one", [{"cone": "elliptic"}, {"impratio": 100.0}, {"noslip": 50}, {"timeconst": 0.01}])
def test_settings_of_friction_are_offered_where_a_file_has_some(one: dict[str, Any], tmp_path: Path) -> None:
    """The scene has no rows for it before a run comes to some; MuJoCo has."""
    path = file(tmp_path, shape=BOX).file
    (name,) = one
    assert name in engines.load("mujoco").offered(cases.from_file(path), "as_is")
    assert engines.load("mujoco").prepare(cases.from_file(path), "as_is", **one).settings[name] == one[name]
    smooth = path.replace(".xml", "2.xml")
    Path(smooth).write_text(Path(path).read_text().replace("<geom ", '<geom condim="1" '))
    assert name not in engines.load("mujoco").offered(cases.from_file(smooth), "as_is")


@pytest.mark.parametrize("condim", [1, 3])
def test_a_coefficient_of_zero_is_no_friction(condim: int, tmp_path: Path) -> None:
    """Of a box at rest, whose corners share its weight, and of one that slides: rows and numbers as with condim 1."""
    for speed in ("0 0 0 0 0 0", "1 0 0 0 0 0"):
        soft = f'condim="{condim}"'
        path = file(tmp_path, shape=BOX, mu=0, floor=soft, soft=soft, speed=speed).file
        for rubs in (-1, 1):
            case = cases.from_file(path, friction=rubs, t_end=0.1)
            assert not any(" t" in name for name in case.contacts)
            result = jobs.run_case(case, choice.picks(["reference:compiled"]))
            words = [row.verdict for row in judged(result.case, result.entries, result.truth, "")]
            assert not {Word.CRASHED, Word.OUTSIDE} & set(words)
            assert result.entries[0].run.outcome.ok
