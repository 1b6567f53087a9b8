"""Controllers of the user's own: one callable in every engine, asked once a tick, with a copy for each run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from places import ROBOTS
from random_scenes import random_scene, random_state
from scenes import BALL

from crossbody import cases, engines
from crossbody.cases import (
    Case,
    Control,
    ControlError,
    Inputs,
    InvalidValue,
    Law,
    Outcome,
    SceneError,
    Tier,
    Trajectory,
)
from crossbody.cases.scene import Actuator, Body, Joint, Push, Scene
from crossbody.reference import ensemble, kernels, linear, simulate
from crossbody.reference.systems import absent
from crossbody.reference.tree.system import system
from crossbody.reports.bench.ladder import Ladder
from crossbody.reports.bench.measure import Effort, bench
from crossbody.reports.cli import cli
from crossbody.reports.measuring.modes import violated
from crossbody.reports.measuring.truth import from_run
from crossbody.reports.metrics import load as metric
from crossbody.reports.runs.choice import Pick

RUNS = (("reference", "compiled"), ("reference", "cvode"), ("reference", "ida"), ("mujoco", "matched"),
        ("pinocchio", "law"))  # fmt: skip
FEW = tuple(run for run in RUNS if run[1] != "ida")
"""IDA is driven as CVODE is."""
TIGHT = {"compiled": {"rtol": 1e-11}, "cvode": {"rtol": 1e-10}, "ida": {"rtol": 1e-9}, "law": {"rtol": 1e-10}}

ARM = Scene(
    bodies=(
        Body(name="upper", mass=1.0, com=(0.0, 0.0, -0.3), inertia=(0.1, 0.1, 0.02, 0.0, 0.0, 0.0)),
        Body(name="lower", parent="upper", position=(0.0, 0.0, -0.5), mass=0.6, com=(0.1, 0.0, -0.2),
             inertia=(0.05, 0.06, 0.02, 0.0, 0.01, 0.0)),
    ),
    joints=(
        Joint(name="shoulder", body="upper", type="hinge", axis=(0.0, 1.0, 0.0), damping=(0.1, 0.0, 0.0)),
        Joint(name="elbow", body="lower", type="hinge", axis=(0.0, 1.0, 0.0), damping=(0.1, 0.0, 0.0)),
    ),
    actuators=(Actuator(name="m1", joint="shoulder", gear=(2.0,)), Actuator(name="m2", joint="elbow")),
)  # fmt: skip
AIM = np.array([0.4, -0.3])


def pd(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    return 6.0 * (AIM * (1.0 + np.sin(2.0 * t)) - q) - 0.4 * v


class Pid:
    """Keeps all that it is handed, its sum, and a list of its calls that all copies share."""

    def __init__(self, calls: list[tuple[float, float]] | None = None) -> None:
        self.calls = calls
        self.sum = np.full(2, 1e3)  # reset() must be called before the first run

    def __deepcopy__(self, memo: Any) -> Pid:
        fresh = Pid(self.calls)
        fresh.sum = self.sum.copy()
        return fresh

    def reset(self) -> None:
        self.sum[:] = 0.0

    def __call__(self, t: float, q: np.ndarray, v: np.ndarray) -> list[float]:
        if self.calls is not None:
            self.calls.append((t, float(self.sum[0])))
        error = AIM - q
        self.sum += 0.02 * error
        q[:], v[:] = np.nan, np.nan  # its own copies
        return (5.0 * error + 3.0 * self.sum).tolist()


def arm(control: Any = None, tick: float = 0.02, t_end: float = 0.6, **given: Any) -> Case:
    control = None if control is None else Control(control, tick)
    return cases.from_scene(ARM, q0=[0.2, 0.1], v0=[0.3, -0.5], t_end=t_end, control=control, **given)


def run_in(case: Case, engine: str, profile: str, **settings: Any) -> Trajectory:
    found: Trajectory = engines.load(engine).prepare(case, profile, **{**TIGHT.get(profile, {}), **settings}).run()
    return found


def off(one: Trajectory, two: Trajectory) -> float:
    return float(np.abs(one.q[-1] - two.q[-1]).max() + np.abs(one.v[-1] - two.v[-1]).max())


@pytest.mark.parametrize(("engine", "profile"), RUNS)
def test_a_controller_is_asked_once_a_tick_in_order_by_a_copy_of_its_own(engine: str, profile: str) -> None:
    calls: list[tuple[float, float]] = []
    case = arm(Pid(calls))
    prepared = engines.load(engine).prepare(case, profile)
    for _ in range(2):
        calls.clear()
        run = prepared.run()
        assert run.outcome.ok, run.message
        assert [t for t, _ in calls] == [k * 0.02 for k in range(30)]
        assert calls[0][1] == 0.0
        assert run.inputs is not None
        assert run.inputs.times.tolist() == [t for t, _ in calls]
        assert 0.0 < run.control_s < run.wall_s


@pytest.mark.parametrize(("engine", "profile"), RUNS)
def test_steps_that_are_taken_back_ask_nothing_again(engine: str, profile: str) -> None:
    calls: list[float] = []

    def hammer(t: float, q: np.ndarray, v: np.ndarray) -> float:
        calls.append(t)
        return 8.0 if t < 0.5 else 12.0 * (0.1 - float(q[0])) - float(v[0])

    case = cases.from_scene(BALL, t_end=0.8, control=Control(hammer, 0.01))
    prepared = engines.load(engine).prepare(case, profile, **TIGHT.get(profile, {}))
    calls.clear()
    run = prepared.run()
    assert run.outcome.ok, run.message
    assert len(run.events) > 3  # it hits the wall again and again
    assert calls == [k * 0.01 for k in range(80)]
    law = metric("law_residual").measure(from_run(run, Tier.D, ""), run, case)
    assert law is not None
    assert law < 1e-6
    if engine == "reference":
        assert violated(case, run, 1e-8) == ()


def test_contacts_under_a_controller_agree() -> None:
    def push(t: float, q: np.ndarray, v: np.ndarray) -> float:
        return 8.0 if t < 0.5 else 12.0 * (0.1 - float(q[0])) - float(v[0])

    case = cases.from_scene(BALL, t_end=0.6, control=Control(push, 0.01))
    ours, *others = (run_in(case, *run) for run in RUNS if run[1] != "matched")
    for other in others:
        assert [event.after for event in other.events] == [event.after for event in ours.events]
        np.testing.assert_allclose([e.t for e in other.events], [e.t for e in ours.events], atol=1e-7)
        assert off(other, ours) < 1e-6


@pytest.mark.parametrize(("engine", "profile"), FEW)
def test_a_controller_may_run_a_model_of_its_own(engine: str, profile: str) -> None:
    """It looks ahead in MuJoCo, whose callbacks are those of the process, and in the compiled reference."""
    ahead = {name: cases.from_scene(BALL, t_end=0.02) for name in ("mujoco", "reference")}

    def looking(t: float, q: np.ndarray, v: np.ndarray) -> float:
        for name, case in ahead.items():
            moved = engines.load(name).prepare(replace(case, q0=q, v0=v)).run()
            assert moved.outcome.ok
        return 8.0 - float(q[0])

    plain = cases.from_scene(BALL, t_end=0.35, control=Control(lambda t, q, v: 8.0 - float(q[0]), 0.05))
    run, alone = (run_in(case, engine, profile) for case in (replace(plain, control=Control(looking, 0.05)), plain))
    assert run.q.tolist() == alone.q.tolist()
    assert len(run.events) > 1


@pytest.mark.parametrize(("engine", "profile"), FEW)
def test_what_a_controller_gave_moves_the_arm_alike_when_it_is_played(engine: str, profile: str) -> None:
    more = {"rtol": 1e-13} if engine == "reference" else {}
    run = run_in(arm(pd), engine, profile, **more)
    played = run_in(arm(inputs=run.inputs), engine, profile, **more)
    assert off(run, played) < 1e-12


@kernels.control
def compiled_pd(t, q, v, u, s, p):  # type: ignore[no-untyped-def]
    u[0] = 6.0 * (0.4 * (1.0 + np.sin(2.0 * t)) - q[0]) - 0.4 * v[0]
    u[1] = 6.0 * (-0.3 * (1.0 + np.sin(2.0 * t)) - q[1]) - 0.4 * v[1]


NO_LAW = Law(a0=np.zeros(0), a1=np.zeros(0), a2=np.zeros(0), unilateral=np.zeros(0, bool))


def test_a_callable_moves_as_a_compiled_controller_and_inputs_leave_what_both_hold() -> None:
    pushed = ARM.replace(pushes=(Push(name="push", body="lower"),))
    force = np.zeros((3, 5))
    force[:2, 2] = 4.0, -2.0
    plain, inputs = system(pushed, NO_LAW), ([0.105, 0.25, 0.31], force)  # between ticks
    callable_, compiled = {"control": Control(pd, 0.02, width=2)}, {"control": compiled_pd, "tick": 0.02}
    runs = {
        (solver, i): simulate(replace(plain, **how), [0.2, 0.1], [0.3, -0.5], 0.6, solver=solver, inputs=inputs)
        for solver in ("compiled", "cvode") for i, how in enumerate((callable_, compiled))
    }  # fmt: skip
    for solver in ("compiled", "cvode"):
        one, other = runs[solver, 0], runs[solver, 1]
        assert one.steps == other.steps
        np.testing.assert_allclose(one.q, other.q, rtol=0.0, atol=1e-14)  # one sine of two libraries
        assert (one.inputs is None, other.inputs is None) == (False, True)
    assert off(runs["compiled", 1], runs["cvode", 1]) < 1e-6


@pytest.mark.parametrize("seed", [3, pytest.param(8, marks=pytest.mark.slow)])
def test_random_scenes_with_an_impedance_law_move_alike_in_four_engines(seed: int) -> None:
    scene = random_scene(seed, bodies=4)
    free = tuple(
        replace(one, control_range=(-np.inf, np.inf), force_range=(-np.inf, np.inf)) for one in scene.actuators
    )
    joints = tuple(replace(one, force_range=(-np.inf, np.inf), range=(-np.inf, np.inf)) for one in scene.joints)
    springs = tuple(
        replace(one, rest=(0.0, 0.0), range=(-np.inf, np.inf) if one.bodies else one.range) for one in scene.tendons
    )
    scene = scene.replace(
        actuators=free, joints=joints, loops=(), pairs=(), tendons=springs, pushes=(Push(name="push", body="body 0"),)
    )
    assert scene.actuators
    rng = np.random.default_rng(seed)
    q, v, _ = random_state(scene, rng)
    K, D = (rng.normal(size=(len(scene.actuators), n)) * 0.3 for n in (scene.nq, scene.nv))

    def impedance(t: float, q_: np.ndarray, v_: np.ndarray) -> np.ndarray:
        for at in case.quaternions:
            assert np.linalg.norm(q_[at : at + 4]) == pytest.approx(1.0, abs=1e-5)
        return K @ (q - q_) - D @ v_

    blow = np.zeros((2, len(scene.inputs)))
    blow[0, -3:] = 1.0, -2.0, 3.0  # between two ticks: what the controller holds stays
    inputs = Inputs(names=scene.inputs, times=np.array([0.06, 0.115]), values=blow)
    case = cases.from_scene(scene, q0=q, v0=0.3 * v, t_end=0.15, inputs=inputs, control=Control(impedance, 0.025))
    ours, *others = (run_in(case, *run) for run in FEW)
    for other in others:
        assert other.outcome.ok, other.message
        assert off(other, ours) < 1e-6 * max(1.0, float(np.abs(ours.v).max()))
        np.testing.assert_allclose(other.inputs.values, ours.inputs.values, rtol=0.0, atol=1e-6 * np.abs(ours.v).max())


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["universal_robots_ur5e/ur5e", "unitree_go1/go1", "franka_emika_panda/panda"])
def test_published_robots_move_alike_under_one_impedance_law(robot: str) -> None:
    path = ROBOTS / f"{robot}.xml"
    if not path.is_file():
        pytest.skip(f"The robot's file {path} is not here.")
    start = cases.from_file(path, without="friction,contacts")
    nu = len(start.scene.actuators)

    def impedance(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        return start.q0[-nu:] + 0.2 * np.sin(5.0 * t) - 0.02 * v[-nu:]

    case = cases.from_file(path, control=Control(impedance, 5e-3), t_end=0.2, without="friction,contacts")
    ours, *others = (run_in(case, *run) for run in FEW)
    for other in others:
        assert off(other, ours) < 1e-6


def _late(value: Any) -> Callable[..., Any]:
    def control(t: float, q: np.ndarray, v: np.ndarray) -> Any:
        if t < 0.05:
            return [0.0, 0.0]
        return value() if callable(value) else value

    return control


@pytest.mark.parametrize(
    ("value", "told"),
    [
        (lambda: 1 / 0, "raises ZeroDivisionError"), (lambda: exit(3), "raises SystemExit"), (None, "None; valid: 2"),
        ([1.0], r"shape \(1,\); valid: 2 real numbers, of m1, m2"), (np.zeros((2, 1)), r"shape \(2, 1\)"),
        (1.0, "1.0; valid: 2"), (["1", "2"], "valid: 2"), ([1.0, 2j], "valid: 2"), ([[1.0], [1.0, 2.0]], "valid: 2"),
        ([True, False], "valid: 2"), ({"m1": 1.0}, "valid: 2"),
    ],
)  # fmt: skip
def test_wrong_use_is_an_error_that_names_controller_tick_and_time(value: Any, told: str) -> None:
    for run in {RUNS[0], RUNS[len(told) % len(RUNS)]}:  # all of them over the values
        with pytest.raises(ControlError, match=rf"control at tick 3, t = 0.06 s, .*{told}"):
            run_in(arm(_late(value)), *run)


@pytest.mark.parametrize("late", [False, True])
@pytest.mark.parametrize(("engine", "profile"), RUNS)
def test_what_is_not_finite_ends_the_run_at_its_tick(engine: str, profile: str, late: bool) -> None:
    bad = _late([np.nan, 1.0]) if late else lambda t, q, v: np.array([1.0, np.inf])
    case = arm(bad)
    run = run_in(case, engine, profile)
    assert run.outcome is Outcome.NOT_FINITE
    assert "tick 3, t = 0.06 s" in run.message if late else "tick 0, t = 0 s" in run.message
    assert run.t[-1] == (0.06 if late else 0.0)
    assert np.isfinite(run.q).all()
    assert len(run.inputs.times) == (3 if late else 0) + (0 if late else len(case.inputs.times))


class Bound:
    def __init__(self) -> None:
        self.count = 0

    def step(self, t: float, q: np.ndarray, v: np.ndarray) -> list[float]:
        self.count += 1
        return [float(self.count), 0.0]


@pytest.mark.parametrize("how", ["class", "object", "method", "factory"])
def test_every_run_begins_anew(how: str) -> None:
    kept = Bound()
    made = {
        "class": Control(type("Late", (Bound,), {"__call__": Bound.step}), 0.1),
        "object": Control(type("Late", (Bound,), {"__call__": Bound.step})(), 0.1),
        "method": Control(kept.step, 0.1), "factory": Control(lambda: Bound().step, 0.1, factory=True),
    }  # fmt: skip
    case = cases.from_scene(ARM, q0=[0.2, 0.1], t_end=0.3, control=made[how])
    for engine, profile in (RUNS[0], RUNS[3]):
        prepared = engines.load(engine).prepare(case, profile)
        for _ in range(2):
            assert prepared.run().inputs.values[:, 0].tolist() == [1.0, 2.0, 3.0]
    assert kept.count == 0


class Locked:
    def __init__(self) -> None:
        self.lock = Lock()

    def __call__(self, t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        return pd(t, q, v)


def test_what_cannot_be_copied_is_told() -> None:
    with pytest.raises(ControlError, match=r"Locked cannot be copied .* raises TypeError .*factory=True"):
        run_in(arm(Locked()), "reference", "compiled")
    assert run_in(arm(Locked), "reference", "compiled").outcome.ok  # a class makes one for each run
    with pytest.raises(ControlError, match="which cannot be called"):
        run_in(arm(type("NotCallable", (), {})), "mujoco", "matched")


@pytest.mark.parametrize(
    ("given", "told"),
    [(("pd", 0.1), "must be a callable"), ((pd, 0.0), "above 0 s"), ((pd, np.inf), "Control.tick"),
     ((pd, "fast"), "Control.tick")],
)  # fmt: skip
def test_a_control_is_checked_when_it_is_made(given: tuple[Any, Any], told: str) -> None:
    with pytest.raises(InvalidValue, match=told):
        Control(*given)


def test_what_contradicts_a_control_is_refused() -> None:
    for values in np.eye(4).reshape(4, 2, 2):  # a single number that is not 0
        held = Inputs(names=("m1", "m2"), times=np.array([0.0, 0.1]), values=values)
        with pytest.raises(SceneError, match="valid: one of them"):
            arm(pd, inputs=held)
    with pytest.raises(SceneError, match="no actuators"):
        cases.from_scene(ARM.replace(actuators=()), control=Control(pd, 0.1))
    with pytest.raises(InvalidValue, match="at most"):
        arm(pd, tick=1e-12)
    with pytest.raises(SceneError, match="is not a scene"):
        replace(cases.load("soft_contact"), control=Control(pd, 0.1))
    with pytest.raises(SceneError, match="sets 3 inputs"):
        replace(system(ARM, NO_LAW), control=Control(pd, 0.1, width=3))


def test_derivatives_and_ensembles_refuse_what_is_sampled() -> None:
    controlled = system(ARM, NO_LAW, control=Control(pd, 0.1))
    with pytest.raises(SceneError, match="controller"):
        linear.linearise(controlled, [0.0, 0.0])
    with pytest.raises(SceneError, match="controller"):
        linear.sensitivity(controlled, [0.0, 0.0], [0.0, 0.0], 0.1)
    with pytest.raises(SceneError, match="controller in Python"):
        ensemble(controlled, np.zeros((2, 2)), np.zeros((2, 2)), 0.1)


def test_a_scene_without_a_controller_has_none_in_its_kernels() -> None:
    plain = system(ARM, NO_LAW)
    assert plain.kernels["control"] is absent.control
    assert (plain.memory, plain.tick) == (0, 0.0)


@pytest.mark.parametrize(("engine", "profile"), FEW)
def test_ticks_that_are_meant_to_meet_do_so(engine: str, profile: str) -> None:
    """49 times 1/49 is less than 1, and 3 times .1 is more than .3, when a push ends."""
    pushed = ARM.replace(pushes=(Push(name="push", body="lower"),))
    force = np.zeros((2, 5))
    force[0, 2] = 1.0
    inputs = Inputs(names=pushed.inputs, times=np.array([0.1, 0.3]), values=force)
    for tick, t_end in ((1.0 / 49.0, 1.0), (0.1, 0.5)):
        case = cases.from_scene(pushed, q0=[0.2, 0.1], t_end=t_end, inputs=inputs, control=Control(pd, tick))
        run = run_in(case, engine, profile)
        assert run.outcome.ok, run.message
        assert run.t[-1] == pytest.approx(t_end, rel=1e-15)
        assert len(run.inputs.times) == round(t_end / tick) + (2 if t_end == 1.0 else 0)


def test_equal_steps_meet_every_tick_of_a_file_s_loop() -> None:
    case = arm(pd, tick=0.003)
    prepared = engines.load("mujoco").prepare(case, "matched", dt=0.002)
    assert prepared.settings["dt"] == pytest.approx(0.0015)
    assert "does not divide the controller's tick" in prepared.run().message
    settings = [setting for _, setting, _ in Ladder(case, Pick(engine="mujoco", profile="matched"), Effort())]
    assert settings == pytest.approx([0.003, 0.0015, 0.001, 0.0005, 0.00025, 0.000125])


FILE = """
import numpy as np

class Hold:
    def __init__(self):
        self.sum = 0.0

    def __call__(self, t, q, v):
        self.sum += .5 - q[0]
        return 4.0 * (.5 - q[0]) - .3 * v[0] + .05 * self.sum

def wrong(t, q, v):
    return [1.0, 2.0]
"""
MODEL = """
<mujoco><worldbody><body name="arm"><joint name="hinge" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0 0 -.4" size=".03" mass="1" contype="0" conaffinity="0"/></body></worldbody>
<actuator><motor name="m" joint="hinge"/></actuator>
<keyframe><key name="held" qpos=".2" ctrl="3"/></keyframe></mujoco>
"""


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "arm.xml").write_text(MODEL)
    (tmp_path / "hold.py").write_text(FILE)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_file_runs_under_a_controller_from_the_command_line(files: Path) -> None:
    words = ["run", "arm.xml", "-e", "reference:compiled", "--control", "hold.py:Hold", "--tick", ".02"]
    done = CliRunner().invoke(cli, [*words, "--t-end", ".1"], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    assert "controller: arm.xml:held reference:compiled" in done.output


@pytest.mark.slow
def test_a_benchmark_tells_the_controller_s_time_apart(files: Path) -> None:
    table = bench(cases.from_file("arm.xml", control="hold.py:Hold", tick=0.02, t_end=0.2),
                  [Pick(engine="reference", profile="compiled")], Effort(repeats=1, every=10))  # fmt: skip
    assert (table["control_ms"] > 0.0).all()
    assert (table["control_ms"] < table["median_ms"]).all()


def test_a_file_takes_a_control_from_python_or_by_name(files: Path) -> None:
    named = cases.from_file("arm.xml", control="hold.py:Hold", tick=0.02, t_end=0.2)
    run = run_in(named, "reference", "compiled")
    assert run.inputs.values[0, 0] == pytest.approx(4.0 * 0.3 + 0.05 * 0.3)  # not on top of the keyframe's 3
    table = np.column_stack([run.inputs.times, run.inputs.values])
    np.savetxt(files / "u.csv", table, delimiter=",", header="t,m", comments="", fmt="%.17g")
    played = run_in(cases.from_file("arm.xml", ctrl="u.csv", t_end=0.2), "reference", "compiled", rtol=1e-13)
    tight = run_in(named, "reference", "compiled", rtol=1e-13)
    assert off(played, tight) < 1e-9
    calls: list[float] = []

    def held(t: float, q: np.ndarray, v: np.ndarray) -> float:
        calls.append(t)
        return 4.0 * (0.5 - float(q[0]))

    given = run_in(cases.from_file("arm.xml", control=Control(held, 0.02), t_end=0.2), "mujoco", "as_is")
    assert calls == [k * 0.02 for k in range(10)]
    with pytest.raises(InvalidValue, match="tick is given together with a Control"):
        cases.from_file("arm.xml", control=Control(held, 0.02), tick=0.01)
    with pytest.raises(InvalidValue, match=r"from_file\.control"):
        cases.from_file("arm.xml", control=held)
    assert given.inputs.values[0, 0] == pytest.approx(1.2)
    assert given.steps == 100  # of the file's step, no other between


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["hold.py:wrong"], "gives an array of shape (2,); valid: 1 real numbers, of m."),
        (["hold.py"], "FILE.py:NAME"),
        (["hold.py:None2"], "no name 'None2' in hold.py"), (["absent.py:f"], "no controller file"),
        (["hold.py:np"], "must be a callable"), (["hold.py:Hold", "--ctrl", "u.csv"], "valid: one of them"),
        (["hold.py:Hold", "--tick", "0"], "tick is 0"), (["hold.py:Hold", "--tick", "nan"], "tick is nan"),
    ],
)  # fmt: skip
def test_wrong_controls_are_a_sentence(files: Path, words: list[str], told: str) -> None:
    (files / "u.csv").write_text("t,m\n0,1\n")
    done = CliRunner().invoke(cli, ["run", "arm.xml", "-e", "mujoco:as_is", "--control", *words])
    assert done.exit_code == 2 or done.exception is not None
    text = done.output + str(done.exception)
    assert told in text.replace("\n", " ")
    assert not (files / "out" / "verdicts.json").exists()
