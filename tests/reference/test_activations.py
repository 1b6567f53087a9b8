"""Activations of actuators: their closed form, and the motions of robots that have some in every engine."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from published import moves_as_in_mujoco

from crossbody import cases, engines
from crossbody.cases import Control, Outcome, SceneError
from crossbody.cases.files.mjcf import scene_of
from crossbody.cases.files.reading import model_of
from crossbody.cases.scene import Actuator
from crossbody.engines.mujoco._build import compiled as build
from crossbody.engines.mujoco._build import spec_of
from crossbody.reference import recheck, simulate
from crossbody.reference._activations import Activations
from crossbody.reference.linear import linearise, sensitivity

ARM = """
<mujoco><compiler angle="radian"/><option timestep="1e-3" integrator="RK4"/><worldbody><body>
<joint name="shoulder" axis="0 1 0" damping=".3"/><geom type="capsule" fromto="0 0 0 0 0 -.4" size=".03" mass="1.2"/>
<body pos="0 0 -.4"><joint name="elbow" axis="0 1 0" damping=".2" {elbow}/>
<geom type="capsule" fromto="0 0 0 .3 0 0" size=".02" mass=".7"/></body></body></worldbody>
<actuator>
<general name="direct" joint="elbow" gainprm="2" ctrllimited="true" ctrlrange="-1 1"/>
<general name="sum" joint="shoulder" dyntype="integrator" gainprm="3" biastype="affine" biasprm="0 -2 -.1" {sum}/>
<general name="lag" joint="elbow" gear=".9" dyntype="filter" dynprm=".05" gainprm="4" biastype="affine"
biasprm=".1 -4 0" ctrllimited="true" ctrlrange="-2 .6"/>
<general name="exact" joint="shoulder" dyntype="filterexact" dynprm=".2" gainprm="1.5" {exact}/></actuator>
<keyframe><key name="go" qpos=".4 -.3" qvel="1 -2" act=".1 -.2 .3" ctrl=".3 1.5 2 1.2"/></keyframe></mujoco>
"""
HELD = {"sum": 'actlimited="true" actrange="-.4 .3"', "exact": 'actlimited="true" actrange="-1 .5"'}
FREE = {"sum": "", "exact": ""}
BOUND = 'limited="true" range="-1 .9"'
TABLE = ([0.1, 0.35, 0.6], [[0.5, 1.5, 2.0, 1.2], [-0.3, -2.0, -1.0, 0.1], [0.0, 0.1, 0.3, -0.4]])


def arm(folder: Path, ranges: dict[str, str] = HELD, **more: Any) -> cases.Case:
    path = folder / "arm.xml"
    path.write_text(ARM.format(**{"elbow": "", **ranges}), encoding="utf-8")
    return cases.load(str(path), t_end=0.8, **more)


def table(folder: Path) -> str:
    np.savez(folder / "u.npz", t=TABLE[0], ctrl=TABLE[1])
    return str(folder / "u.npz")


def drawn(seed: int) -> tuple[Activations, Any]:
    rng = np.random.default_rng(seed)
    ends = np.sort(rng.normal(size=(6, 2)), axis=1)
    bounded = rng.random(6) < 0.6
    span = np.where(bounded[:, None], ends, [-np.inf, np.inf])
    made = Activations(
        driven=rng.permutation(6), tau=np.where(rng.random(6) < 0.4, 0.0, rng.uniform(0.01, 1.0, 6)),
        control=np.array([[-1.0, 1.5]] * 6), span=span, start=rng.normal(size=6),
    )  # fmt: skip
    return made, rng


@pytest.mark.parametrize("seed", range(25))
def test_an_activation_follows_its_equation(seed: int) -> None:
    """a' is u, or (u - a)/tau, inside its range and 0 at an end that it leans on; parts of a time add up."""
    one, rng = drawn(seed)
    u, times = rng.normal(size=6) * 2.0, rng.uniform(0.0, 0.5, size=(2, 6))
    a = one.after(one.begin, u, times[0])
    assert np.abs(one.after(a, u, times[1]) - one.after(one.begin, u, times.sum(axis=0))).max() <= 1e-13
    c, step = np.clip(u[one.driven], -1.0, 1.5), 1e-7
    rate = np.where(one.tau > 0.0, (c - a) / np.where(one.tau > 0.0, one.tau, 1.0), c)
    low, high = one.span.T
    leans = ((a >= high) & (rate > 0.0)) | ((a <= low) & (rate < 0.0))
    near = (np.minimum(high - a, a - low) < 1e-4) & ~leans  # within a step of an end
    moved = (one.after(a, u, np.full(6, step)) - a) / step
    assert np.abs(np.where(near, 0.0, moved - np.where(leans, 0.0, rate))).max() <= 1e-4
    assert np.all((a >= low) & (a <= high))


@pytest.mark.parametrize("seed", range(25))
def test_inputs_change_where_an_activation_comes_to_an_end_of_its_range(seed: int) -> None:
    """Between two rows the unbounded formula stays within every range, and each row goes on where the last has come."""
    one, rng = drawn(seed)
    t, u = one.columns(np.array([0.3, 0.9, 1.4]), rng.normal(size=(3, 6)) * 2.0)
    free = dataclasses.replace(one, span=np.array([[-np.inf, np.inf]] * 6))
    assert np.all(np.diff(t) > 0.0)
    for k, end in enumerate([*t[1:], t[-1] + 1.0]):
        since, a = u[k, 6::2], u[k, 7::2]
        held = [one.after(a, u[k], at - since) for at in (t[k], end)]
        if k + 1 < len(t):
            assert np.abs(one.after(u[k + 1, 7::2], u[k + 1], t[k + 1] - u[k + 1, 6::2]) - held[1]).max() <= 1e-12
        loose = [free.after(a, u[k], at - since) for at in (t[k], end)]
        at_end = np.isin(a, one.span)  # from there on it leans on the end, or leaves it
        for bound, free_one in zip(held, loose, strict=True):
            assert np.abs(np.where(at_end, 0.0, bound - free_one)).max() <= 1e-12


@pytest.mark.parametrize("ranges", [HELD, FREE])
def test_forces_are_those_of_mujoco(tmp_path: Path, ranges: dict[str, str]) -> None:
    case = arm(tmp_path, ranges)
    model = model_of(Path(case.file))
    assert scene_of(model).activated == (1, 2, 3)
    moves_as_in_mujoco(model, scene_of(model))


@pytest.mark.parametrize("recorded", [False, True])
def test_an_arm_with_activations_moves_alike_in_every_engine(tmp_path: Path, recorded: bool) -> None:
    case = arm(tmp_path, ctrl=table(tmp_path) if recorded else "")
    assert case.act0.tolist() == [0.1, -0.2, 0.3]
    asked: Any = [("reference", "compiled"), ("reference", "cvode"), ("reference", "ida"), ("pinocchio", "law")]
    runs = [engines.load(name).prepare(case, profile, rtol=1e-11).run() for name, profile in asked]
    for run in runs:
        assert run.outcome is Outcome.FINISHED
        assert np.abs(run.q[-1] - runs[0].q[-1]).max() <= 1e-9
    ledger = runs[0].ledger
    assert ledger is not None
    account = runs[0].total_energy - ledger.contact.sum(axis=1) - ledger.input + ledger.dissipated
    assert np.abs(account - account[0]).max() <= 1e-9
    # Where an activation comes to an end of its range inside one of its steps, that is second order.
    run = engines.load("mujoco").prepare(case, "matched", dt=1e-4).run()
    assert np.abs(run.q[-1] - runs[0].q[-1]).max() <= 1e-6


def test_mujoco_integrates_activations_within_their_ranges_alike(tmp_path: Path) -> None:
    """By its own stages, on the model that is built from the scene."""
    case = arm(tmp_path, FREE)
    assert case.scene is not None
    assert case.inputs is not None
    ours = engines.load("reference").prepare(case, "compiled", rtol=1e-11).run()
    spec = spec_of(case.scene)
    spec.option.integrator, spec.option.timestep = mujoco.mjtIntegrator.mjINT_RK4, 2e-4
    model = build(spec, case.scene)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.act[:], data.ctrl[:] = case.q0, case.v0, case.act0, case.inputs.values[0]
    mujoco.mj_step(model, data, nstep=round(case.t_end / 2e-4))
    assert np.abs(data.qpos - ours.q[-1]).max() <= 1e-9


def test_a_file_with_activations_as_it_stands_steps_as_mujoco_does(tmp_path: Path) -> None:
    case = arm(tmp_path)
    run = engines.load("mujoco").prepare(case, "as_is").run()
    model = mujoco.MjModel.from_xml_path(case.file)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_step(model, data, nstep=800)
    assert np.abs(run.q[-1] - data.qpos).max() <= 1e-12
    built = engines.load("mujoco").prepare(case, "as_is", reader="scene").run()
    assert np.abs(built.q[-1] - run.q[-1]).max() <= 1e-12


def law(t: float, q: Any, v: Any) -> list[float]:
    return [0.2, float(1.5 * np.cos(8.0 * t) - q[0]), float(3.0 * np.sin(5.0 * t) - v[1]), 1.2 - float(q[1])]


def test_a_controller_drives_activations_alike_in_every_engine(tmp_path: Path) -> None:
    """What it gave, played without it, moves the same: the account of activations is kept tick by tick."""
    case = arm(tmp_path)
    scene = case.scene
    assert scene is not None
    driven = cases.from_scene(scene, q0=case.q0, v0=case.v0, act0=case.act0, t_end=0.5, control=Control(law, tick=0.02))
    asked: Any = [("reference", "compiled"), ("reference", "cvode"), ("pinocchio", "law")]
    runs = [engines.load(name).prepare(driven, profile, rtol=1e-11).run() for name, profile in asked]
    runs.append(engines.load("mujoco").prepare(driven, "matched", dt=1e-4).run())
    for k, run in enumerate(runs):
        assert run.outcome is Outcome.FINISHED
        assert run.inputs is not None
        assert run.inputs.names == scene.inputs
        assert np.abs(run.q[-1] - runs[0].q[-1]).max() <= (1e-6 if k == 3 else 1e-8)
    played = cases.from_scene(scene, q0=case.q0, v0=case.v0, act0=case.act0, t_end=0.5, inputs=runs[0].inputs)
    again = engines.load("reference").prepare(played, "compiled", rtol=1e-11)
    run = again.run()
    assert np.abs(run.q[-1] - runs[0].q[-1]).max() <= 1e-9
    for system, motion in ((again.system, run), (engines.load("reference").prepare(driven).system, runs[0])):
        given = (runs[0].inputs.times, runs[0].inputs.values)
        assert recheck(system, motion, inputs=given) == ()


def test_judging_knows_activations(tmp_path: Path) -> None:
    """The multipliers that the law asks for are found with the activations in force."""
    from crossbody.reports.judging.truth import truth_of
    from crossbody.reports.metrics.law_residual import measure

    case = arm(tmp_path, {**HELD, "elbow": BOUND})
    run = engines.load("reference").prepare(case, "compiled").run()
    assert any(event.contact == 0 for event in run.events) or any(event.contact == 1 for event in run.events)
    found = measure(truth_of(case), run, case)
    assert found is not None
    assert found <= 1e-8


def test_activations_are_states_of_a_linear_model(tmp_path: Path) -> None:
    """A small motion from a state at rest is the model's: all starts and controls, by differences of runs."""
    system = engines.load("reference").prepare(arm(tmp_path, FREE)).system
    q, u, a, T, step = np.array([0.2, -0.3]), np.array([0.1, 0.0, 0.2, 0.2]), np.array([0.0, 0.2, 0.2]), 5e-5, 1e-5
    model = linearise(system, q, u=u, activations=a)
    assert model.states == ("q[0]", "q[1]", "q[0]'", "q[1]'", "a[0]", "a[1]", "a[2]")
    assert len(model.inputs) == 4
    assert np.array_equal(model.A[4:], np.diag([0.0, 0.0, 0.0, 0.0, 0.0, -20.0, -5.0])[4:])
    assert np.array_equal(np.argwhere(model.B[4:]), [[0, 1], [1, 2], [2, 3]])

    def rate(x: np.ndarray, now: np.ndarray) -> np.ndarray:
        """(v', a') as runs begin: a short run from x with controls that hold."""
        made = dataclasses.replace(system.activations, start=x[4:])
        run = simulate(dataclasses.replace(system, parameters=system.p[: -system.latched or None], activations=made),
                       x[:2], x[2:4], T, rtol=1e-13, inputs=([0.0], [now]))  # fmt: skip
        return (run.v[-1] - run.v[0]) / T

    x = np.concatenate([q, np.zeros(2), a])
    for k in range(7):
        d = step * np.eye(7)[k]
        off = (rate(x + d, u) - rate(x - d, u)) / (2.0 * step) - model.A[2:4, k]
        assert np.abs(off).max() <= 1e-3 * np.abs(model.A[2:4]).max()
    with pytest.raises(SceneError, match="activation"):
        sensitivity(system, q, np.zeros(2), 0.1)
    with pytest.raises(SceneError, match=r"linearise\.activations"):
        linearise(system, q, activations=[0.0])


def test_an_activation_that_leans_on_its_end_stands_still_in_a_linear_model(tmp_path: Path) -> None:
    system = engines.load("reference").prepare(arm(tmp_path)).system  # the sum in -.4 .. .3, the last in -1 .. .5
    free = linearise(system, [0.0, 0.0], u=[0.0, 1.0, 3.0, 0.1], activations=[0.1, 0.2, 0.2])
    assert free.B[4, 1] == 1.0
    assert free.B[5, 2] == 0.0  # its control is beyond its range
    assert free.A[5, 5] == pytest.approx(-20.0)
    end = linearise(system, [0.0, 0.0], u=[0.0, 1.0, 3.0, 1.1], activations=[0.3, 0.2, 0.5])
    assert not end.A[[4, 6]].any()
    assert not end.B[[4, 6]].any()


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ('dyntype="muscle"', "mjDYN_MUSCLE"),
        ('dyntype="user"', "mjDYN_USER"),
        ('dyntype="filter" dynprm="0"', "time_constant"),
        ('dyntype="integrator" actearly="true"', "acts early"),
    ],
)
def test_activations_that_are_not_done_are_refused_by_name(tmp_path: Path, fields: str, said: str) -> None:
    text = ARM.format(**FREE, elbow="").replace(' act=".1 -.2 .3"', "")
    text = text.replace('<general name="direct"', f'<general name="direct" {fields}')
    path = tmp_path / "arm.xml"
    path.write_text(text, encoding="utf-8")
    mujoco.MjModel.from_xml_path(str(path))
    with pytest.raises(SceneError, match=said):
        cases.load(str(path))


@pytest.mark.parametrize("fields", [{"activation": "muscle"}, {"activation": "filter"}, {"time_constant": 0.1},
                                    {"activation_range": (1.0, 0.0)}])  # fmt: skip
def test_wrong_activations_of_a_scene_are_refused(fields: dict[str, Any]) -> None:
    with pytest.raises(SceneError, match="Actuator 'a'"):
        Actuator(name="a", joint="j", **fields)
