"""Dry friction of joints and tendons: closed forms, laws over random trees, both machines, files, and bad input."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from friction_scenes import G, _dynamics, _energy, _gaps, _rows, account, box_body, rubbed_tree, run
from scipy.optimize import lsq_linear

from crossbody import cases, engines
from crossbody.cases import Mode, Outcome, SceneError, Trajectory
from crossbody.cases.files.case import case_of
from crossbody.cases.library.dry_oscillator import oscillator
from crossbody.cases.scene import Body, Joint, Scene, Tendon
from crossbody.reference import System, ensemble, simulate
from crossbody.reference.tree.system import system

TIME, STATE = 1e-11, 1e-9
ROD = Body(name="rod", mass=1.5, com=(0.0, 0.0, -0.4), inertia=(0.1, 0.1, 0.02, 0.0, 0.0, 0.0))
TURNS = ROD.inertia[1] + ROD.mass * 0.4**2
WEIGHT = ROD.mass * G * 0.4


def swing(loss: float, *, gravity: float = G, **given: Any) -> Scene:
    """Return a rod on a hinge with dry friction."""
    hinge = Joint(name="hinge", body="rod", type="hinge", axis=(0.0, 1.0, 0.0), friction_loss=loss, **given)
    return Scene(bodies=(ROD,), joints=(hinge,), gravity=(0.0, 0.0, -gravity))


def moved(run_: Trajectory) -> list[tuple[float, str, str]]:
    """Return when something changed its mode, but at the start."""
    return [(e.t, e.before.name, e.after.name) for e in run_.events if e.t > 0.0]


@pytest.mark.parametrize("speed", [3.0, -0.2])
def test_a_hinge_slows_down_and_stops(speed: float) -> None:
    loss = 0.7
    run_ = run(swing(loss, gravity=0.0), [0.1], [speed], 2.0)
    brake = loss / TURNS
    [(t, *modes)] = moved(run_)
    assert modes == ["SLIP", "STICK"]
    assert abs(t - abs(speed) / brake) < TIME
    assert abs(run_.q[-1, 0] - 0.1 - speed * abs(speed) / (2.0 * brake)) < STATE
    assert run_.lam[[0, -1], 0] == pytest.approx([-loss * np.sign(speed), 0.0], abs=1e-12)
    assert run_.mode[[0, -1], 0].tolist() == [Mode.SLIP, Mode.STICK]
    assert account(run_) < STATE
    assert run_.ledger is not None
    assert run_.ledger.contact[-1, 0] == pytest.approx(-0.5 * TURNS * speed**2, rel=1e-12)


@pytest.mark.parametrize("start", [0.45, -0.3])
@pytest.mark.parametrize("speed", [0.0, 1.0, -2.0])
def test_half_swings_are_shorter_by_the_same(start: float, speed: float) -> None:
    numbers = {"mass": 2.0, "stiffness": 50.0, "friction_loss": 1.0, "start": start, "speed": speed, "t_end": 12.0}
    exact = oscillator(numbers)
    run_ = run(*oscillates(numbers), 12.0)
    assert [(e.before, e.after) for e in run_.events] == [(e.before, e.after) for e in exact.events]
    assert np.abs([a.t - b.t for a, b in zip(run_.events, exact.events, strict=True)]).max() < TIME
    found = exact(run_.t)
    assert np.abs(run_.q - found.q).max() < STATE
    turns = exact(np.array([e.t for e in exact.events if e.t > 0.0])).q[:, 0]
    assert np.diff(np.abs(turns)) == pytest.approx(-0.04, abs=1e-12)
    assert abs(run_.q[-1, 0]) < 0.02 + STATE
    assert account(run_) < STATE


def oscillates(p: dict[str, float]) -> tuple[Scene, list[float], list[float]]:
    """Return a mass on a spring and its start."""
    guide = Joint(name="guide", body="mass", type="slide", axis=(1, 0, 0), stiffness=(p["stiffness"], 0, 0),
                  friction_loss=p["friction_loss"])  # fmt: skip
    scene = Scene(bodies=(Body(name="mass", mass=p["mass"]),), joints=(guide,), gravity=(0, 0, 0))
    return scene, [p["start"]], [p["speed"]]


@pytest.mark.parametrize("part", [0.999, 1.001])
def test_a_pendulum_is_held_off_the_vertical_up_to_the_bound(part: float) -> None:
    angle = 0.6
    run_ = run(swing(WEIGHT * np.sin(angle) / part), [angle], [0.0], 0.5)
    if part < 1.0:
        assert not run_.events
        assert np.abs(run_.q - angle).max() < 1e-14
        assert run_.lam[-1, 0] == pytest.approx(WEIGHT * np.sin(angle), rel=1e-12)
    else:
        assert [(e.before, e.after) for e in run_.events] == [(Mode.STICK, Mode.SLIP)]
        assert run_.v[-1, 0] < 0.0
    assert account(run_) < STATE


def test_a_pendulum_swings_until_it_is_held() -> None:
    """Between two turns friction takes what weight gives: its work is the bound times the arc."""
    loss = 0.5
    run_ = run(swing(loss), [1.2], [0.0], 20.0)
    turns = np.array([1.2, *(run_.q[np.searchsorted(run_.t, t), 0] for t, _, _ in moved(run_))])
    lost = WEIGHT * np.diff(np.cos(turns))
    assert lost == pytest.approx(loss * np.abs(np.diff(turns)), abs=1e-9)
    assert run_.mode[-1, 0] == Mode.STICK
    assert abs(WEIGHT * np.sin(run_.q[-1, 0])) <= loss
    assert len(turns) == 1 + [after for _, _, after in moved(run_)].index("STICK") + 1


def test_a_surface_that_moves_drags_along() -> None:
    """The block on a belt, whose friction does not depend on what it carries: one stick phase, then a sine."""
    belt = System(
        n=1, dynamics=_dynamics, gaps=_gaps, rows=_rows, energy=_energy, parameters=[0.0, 0.0, 100.0, 1.0],
        a0=[0.0], a1=[200.0], friction_loss=[0.3 * G], drift=[0.1],
    )  # fmt: skip
    run_ = simulate(belt, [0.0], [0.0], 2.0, rtol=1e-11, ledger=True)
    stick, slip = moved(run_)
    assert abs(stick[0] - 0.0346692891616231) < TIME
    assert abs(slip[0] - 0.311458902406051) < TIME
    assert abs(run_.q[-1, 0] - 0.0201936922945194) < STATE
    assert account(run_) < 1e-10


def test_the_time_of_a_stop_falls_with_the_tolerance() -> None:
    """Weight makes the swing no polynomial."""
    exact = run(swing(0.5), [1.2], [0.0], 3.0, rtol=1e-13).events[1].t
    for rtol in (1e-5, 1e-7, 1e-9):
        assert abs(run(swing(0.5), [1.2], [0.0], 3.0, rtol=rtol).events[1].t - exact) < 10.0 * rtol


def obeys(scene: Scene, run_: Trajectory, rtol: float) -> None:
    """Check bounds, directions, powers, what sticks, and the account of a motion; and that no row chatters.

    Beside contacts rows may switch twice within 1e-7 s: friction of a contact whose slip dies out turns as fast.
    """
    made = system(scene, case_of(scene).law)
    instants, dry = {event.t for event in run_.events}, np.flatnonzero(made.dry)
    loss, fastest = np.asarray(made.friction_loss)[dry], max(float(np.abs(run_.v).max()), 1.0)
    slides = 0
    for t, q, v, lam, mode in zip(run_.t, run_.q, run_.v, run_.lam[:, dry], run_.mode[:, dry], strict=True):
        assert np.isin(mode, (Mode.STICK, Mode.SLIP)).all()
        if t in instants:
            continue
        rate = made.gap(q, v)[1][dry]
        slip = mode == Mode.SLIP
        assert np.abs(rate[~slip]).max(initial=0.0) < 1e3 * rtol * fastest
        assert (np.abs(lam) <= loss * (1.0 + 1e-9) + 1e5 * rtol * ~slip).all()
        assert np.abs(lam[slip]) == pytest.approx(loss[slip], rel=1e-12)
        clear = slip & (np.abs(rate) > 1e4 * rtol * fastest)
        assert (lam[clear] * rate[clear] < 0.0).all()
        slides += int(clear.any())
    assert slides > 0
    assert account(run_) < 1e3 * rtol
    for row in dry if not scene.pairs else ():
        times = np.array([event.t for event in run_.events if event.contact == row])
        assert (np.diff(times) > 1e-6).all()


@pytest.mark.parametrize(
    ("seed", "floor"),
    [(seed, False) for seed in range(60)]
    + [pytest.param(seed, True, marks=[] if seed in (3, 33) else pytest.mark.slow) for seed in range(60)],
)
def test_laws_over_random_trees(seed: int, floor: bool) -> None:
    scene, q0, v0 = rubbed_tree(seed, floor=floor)
    if not scene.dry:
        pytest.skip("nothing rubs")
    run_ = run(scene, q0, v0, 1.0, rtol=1e-9)
    assert run_.outcome is Outcome.FINISHED, run_.message
    obeys(scene, run_, 1e-9)


@pytest.mark.parametrize(
    ("seed", "floor"),
    [(3, False), (7, False), *(pytest.param(k, j, marks=pytest.mark.slow) for k in range(12) for j in (False, True))],
)
def test_both_machines_move_trees_alike(seed: int, floor: bool) -> None:
    scene, q0, v0 = rubbed_tree(seed, floor=floor)
    at = np.linspace(0.0, 0.2, 21)
    one, other = (
        run(scene, q0, v0, 0.2, rtol=rtol, samples=at, solver=solver)
        for solver, rtol in (("compiled", 1e-11), ("cvode", 1e-10))
    )
    assert one.outcome is other.outcome is Outcome.FINISHED, other.message
    assert np.abs(one.q - other.q).max() < 1e-8

    def told(run_: Trajectory) -> list[tuple[int, Mode, Mode]]:
        """What each contact goes through: which of two is the first within a microsecond no tolerance tells."""
        return [(e.contact, e.before, e.after) for e in sorted(run_.events, key=lambda e: (e.contact, e.t))]

    assert told(one) == told(other)
    times = [np.sort([e.t for e in run_.events]) for run_ in (one, other)]
    off = np.abs(times[0] - times[1])
    assert np.quantile(off, 0.9) < 1e-8
    assert off.max(initial=0.0) < 1e-6  # of a slip that comes near zero slowly


FILE = """<mujoco><option gravity="0 0 -9.81" timestep="{dt}"/><worldbody>
  <body name="b0"><joint name="j0" type="hinge" axis="0 1 0" frictionloss=".7" solimplimit="0.9 0.9 0.001"/>
    <inertial pos="0 0 -.3" mass="1" diaginertia=".05 .05 .01"/>
    <body name="b1" pos="0 0 -.6"><joint name="j1" type="hinge" axis="0 1 0" frictionloss=".2" stiffness="3"/>
      <inertial pos="0 0 -.3" mass="1" diaginertia=".05 .05 .01"/>
      <body name="b2" pos="0 0 -.6"><joint name="j2" type="ball" frictionloss=".05"/>
        <inertial pos="0 .02 -.1" mass=".3" diaginertia=".01 .01 .005"/></body></body></body></worldbody>
  <tendon><fixed name="rope" frictionloss=".1"><joint joint="j0" coef="1"/><joint joint="j1" coef="-.5"/></fixed>
  </tendon>
  <keyframe><key name="start" qpos="1 .2 1 0 0 0" qvel="0 1 .3 -.2 .5"/></keyframe></mujoco>"""


def test_a_file_moves_as_its_scene(tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(FILE.format(dt=0.002))
    case = cases.from_file(str(path))
    link = {"mass": 1.0, "com": (0.0, 0.0, -0.3), "inertia": (0.05, 0.05, 0.01, 0.0, 0.0, 0.0)}
    assert case.scene is not None
    hinge, laws = {"type": "hinge", "axis": (0.0, 1.0, 0.0)}, [joint.law for joint in case.scene.joints]
    scene = Scene(
        bodies=(
            Body(name="b0", **link), Body(name="b1", parent="b0", position=(0.0, 0.0, -0.6), **link),
            Body(name="b2", parent="b1", position=(0.0, 0.0, -0.6), mass=0.3, com=(0.0, 0.02, -0.1),
                 inertia=(0.01, 0.01, 0.005, 0.0, 0.0, 0.0)),
        ),
        joints=(
            Joint(name="j0", body="b0", friction_loss=0.7, law=laws[0], **hinge),
            Joint(name="j1", body="b1", friction_loss=0.2, stiffness=(3.0, 0.0, 0.0), law=laws[1], **hinge),
            Joint(name="j2", body="b2", type="ball", friction_loss=0.05, law=laws[2]),
        ),
        tendons=(Tendon(name="rope", joints=("j0", "j1"), coefficients=(1.0, -0.5), friction_loss=0.1,
                        law=case.scene.tendons[0].law),),
    )  # fmt: skip
    assert case.contacts == case_of(scene).contacts == (
        "j0 friction", "j1 friction", "j2 friction rx", "j2 friction ry", "j2 friction rz", "rope friction",
    )  # fmt: skip
    found = engines.load("reference").prepare(case, "compiled", rtol=1e-10).run()
    other = run(scene, case.q0, case.v0, case.t_end, rtol=1e-10, samples=found.t)
    assert np.abs(found.q - other.q).max() < 1e-12
    assert [(e.contact, e.after) for e in found.events] == [(e.contact, e.after) for e in other.events]
    obeys(scene, run(scene, case.q0, case.v0, 3.0, rtol=1e-9), 1e-9)
    without = cases.from_file(str(path), without="friction")
    assert without.contacts == ()


@pytest.mark.parametrize("reader", ["file", "scene"])
@pytest.mark.parametrize("soft", ["", 'solreffriction=".05 1" solimpfriction=".8 .95 .001 .5 2"'])
def test_a_held_joint_creeps_in_mujoco_as_its_parameters_say(reader: str, soft: str, tmp_path: Path) -> None:
    """(1 - d)/d of the inverse inertia stands between the force and a damper b: v = (1 - d)/d tau/(I b)."""
    path, angle = tmp_path / "rod.xml", 0.3
    path.write_text(
        '<mujoco><option gravity="0 0 -9.81"/><worldbody><body>'
        f'<joint type="hinge" axis="0 1 0" frictionloss="9" {soft}/>'
        '<inertial pos="0 0 -.4" mass="1.5" diaginertia=".1 .1 .02"/></body></worldbody>'
        f'<keyframe><key qpos="{angle}"/></keyframe></mujoco>'
    )
    found = engines.load("mujoco").prepare(cases.from_file(str(path), t_end=0.5), "as_is", reader=reader).run()
    assert set(found.mode[-20:, 0].tolist()) == {Mode.STICK}
    d, constant = (0.8, 0.05) if soft else (0.9, 0.02)
    b = 2.0 / (0.95 * constant)
    expected = -(1.0 - d) / d * WEIGHT * np.sin(found.q[-1, 0]) / TURNS / b
    assert found.v[-1, 0] == pytest.approx(expected, rel=0.05)
    assert found.lam[-1, 0] == pytest.approx(WEIGHT * np.sin(found.q[-1, 0]), rel=1e-2)


def test_a_string_of_two_points_rubs() -> None:
    ball, rope = box_body("ball", (0.1, 0.1, 0.1)), {"bodies": ("", "ball"), "positions": ((0, 0, 0), (0, 0, 0))}
    scene = Scene(
        bodies=(ball,),
        joints=tuple(Joint(name=n, body="ball", type="slide", axis=a) for n, a in (("x", (1, 0, 0)), ("y", (0, 1, 0)))),
        tendons=(Tendon(name="rope", friction_loss=2.0, **rope),), gravity=(0.0, 0.0, 0.0),
    )  # fmt: skip
    run_ = run(scene, [1.0, 0.0], [-1.0, 0.0], 1.0)
    [(t, *_)] = moved(run_)
    assert abs(t - 0.5) < TIME
    assert run_.q[-1] == pytest.approx([0.75, 0.0], abs=STATE)
    circle = run(scene, [1.0, 0.0], [0.0, 1.0], 1.0)
    assert not moved(circle)  # a circle needs 1 N: the string holds its length
    assert np.hypot(*circle.q[-1]) == pytest.approx(1.0, abs=1e-9)
    obeys(scene, run(scene, [1.0, 0.0], [-0.5, 2.0], 1.0, rtol=1e-9), 1e-9)


def test_an_ensemble_slides_as_single_runs_do() -> None:
    scene = swing(0.5)
    made = system(scene, case_of(scene).law)
    starts = np.array([[0.0], [1.0], [-2.0]])
    many = ensemble(made, np.full((3, 1), 0.2), starts, 0.7, rtol=1e-9)
    for k, v0 in enumerate(starts):
        one = simulate(made, [0.2], v0, 0.7, rtol=1e-9)
        assert many.q[k] == pytest.approx(one.q[-1], abs=1e-12)


@pytest.mark.parametrize("loss", [-1.0, np.inf, np.nan])
def test_bounds_that_are_none_are_refused(loss: float) -> None:
    with pytest.raises(SceneError, match="friction_loss"):
        swing(loss)
    with pytest.raises(SceneError, match="friction_loss"):
        Tendon(name="rope", joints=("hinge",), coefficients=(1.0,), friction_loss=loss)
    with pytest.raises(SceneError, match="friction_loss"):
        dry(friction_loss=[loss])


def dry(**given: Any) -> System:
    """Return one row with dry friction."""
    rows = len(given["friction_loss"])
    return System(
        n=1, dynamics=_dynamics, gaps=_gaps, rows=_rows, energy=_energy,
        parameters=[0.0, 0.0, 100.0, *[1.0] * rows], a0=[0.0] * rows, a1=[200.0] * rows, **given,
    )  # fmt: skip


@pytest.mark.parametrize(
    "given",
    [{"friction_loss": [1.0], "unilateral": [False]}, {"friction_loss": [1.0, 0.0], "follows": [1, -1]},
     {"friction_loss": [1.0, 0.0], "follows": [-1, 0]}],
)  # fmt: skip
def test_rows_that_cannot_rub_by_themselves_are_refused(given: dict[str, Any]) -> None:
    with pytest.raises(SceneError, match="Row 0 has dry friction of its own"):
        dry(**given)


def test_without_dry_friction_there_are_no_rows() -> None:
    assert case_of(swing(0.0)).contacts == ()
    assert replace(swing(1.0), joints=swing(0.0).joints).dry == ()


@pytest.mark.parametrize("seed", [pytest.param(s, marks=() if s < 12 else pytest.mark.slow) for s in range(80)])
def test_rows_that_nearly_depend_on_each_other_rub_as_the_least_of_a_convex_function_says(seed: int) -> None:
    """Of unit masses at rest v' is the least |f + H^T lam| over all |lam| <= bound: SciPy finds it by another way."""
    rng = np.random.default_rng(seed)
    for _ in range(20):
        n, rows = int(rng.integers(2, 9)), int(rng.integers(4, 15))
        base = rng.normal(size=(min(n, rows), n))
        mixed = rng.normal(size=(rows - len(base), len(base))) @ base
        H = np.vstack([base, mixed + 10.0 ** -rng.uniform(1.0, 5.0) * rng.normal(size=mixed.shape)])
        force, bound = 3.0 * rng.normal(size=n), rng.uniform(0.1, 2.0, size=rows)
        exact = force + H.T @ lsq_linear(H.T, -force, (-bound, bound), method="bvls", tol=1e-14, max_iter=1000).x
        system_ = System(
            n=n, dynamics=_dynamics, gaps=_gaps, rows=_rows, energy=_energy, friction_loss=bound,
            parameters=[0.0, *force, *np.zeros(n), *H.ravel(), rows], a0=[0.0] * rows, a1=[200.0] * rows,
        )  # fmt: skip
        run_ = simulate(system_, np.zeros(n), np.zeros(n), 1e-6, rtol=1e-6, max_steps=3)
        assert run_.outcome is not Outcome.NO_CONSISTENT_MODES, run_.message
        assert run_.v[-1] / run_.t[-1] == pytest.approx(exact, abs=1e-5 * np.abs(force).max())
