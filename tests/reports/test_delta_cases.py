"""The cases of the delta robot: their closed forms, the engines beside each other, and what bad input says."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import Case, CrossbodyError, InvalidValue, Outcome, SceneError, Tier, Trajectory, load
from crossbody.cases.mechanisms.delta import pose
from crossbody.cases.scene_contacts import under_law
from crossbody.reference import delta, simulate
from crossbody.reference.delta import scene
from crossbody.reference.delta.kinematics import tips
from crossbody.reference.delta.singularity import hanging_pose
from crossbody.reference.delta.statics import closure_jacobian, gravity_gradient
from crossbody.reports import metrics
from crossbody.reports.cli import main
from crossbody.reports.judging.comparison import compare
from crossbody.reports.measuring.truth import from_run

REFERENCE = engines.load("reference")
each_impulse = pytest.mark.parametrize("variant", cases.variants("delta_impulse"))


def numbers(case: Case) -> dict[str, float]:
    return {k: float(v) for k, v in case.parameters.items() if not isinstance(v, str)}


def at(case: Case, times: Any, rtol: float) -> Trajectory:
    return REFERENCE.prepare(case, "compiled", rtol=rtol, samples=times).run()


def once(run: Trajectory) -> np.ndarray:
    """Samples at instants that stand once: lam jumps at the others."""
    twice = np.flatnonzero(np.diff(run.t) == 0.0)
    keep = np.ones(len(run.t), dtype=bool)
    keep[np.concatenate([twice, twice + 1])] = False
    return keep


@pytest.mark.parametrize("mirrored", [1.0, -1.0])
@each_impulse
def test_closed_forms_of_the_case_are_those_of_the_library(variant: str, mirrored: float) -> None:
    case = load("delta_impulse", variant, x=0.05, y=-0.03, z=0.58, sign=mirrored)
    p, robot, J = numbers(case), scene.robot_of(case.parameters), np.array([0.3, -0.2, 0.1])
    q = delta.inverse(robot, (0.05, -0.03, 0.58))
    np.testing.assert_allclose(case.q0, q, atol=1e-14)
    np.testing.assert_allclose(pose.holding_torque(p, q), delta.gravity_torque(robot, q)[0], rtol=1e-12)
    np.testing.assert_allclose(pose.kicked(p, q, J), delta.kick(robot, q, np.zeros(9), J), atol=1e-12)
    assert pose.elbow_angle(p) == pytest.approx(delta.elbow_angle(robot), rel=1e-15)
    assert pose.swing_period(p) == pytest.approx(2 * np.pi / delta.pendulum_rate(robot), rel=1e-15)


@pytest.mark.parametrize("variant", ["light", "servos"])
def test_a_sample_where_an_input_jumps_may_stand_on_either_side(variant: str) -> None:
    """Its multipliers are those before the jump or behind it, and the law's are those behind it."""
    case = load("delta_impulse", variant)
    run = REFERENCE.prepare(case, "compiled").run()
    assert case.inputs is not None
    assert np.sum(np.isin(run.t, case.inputs.times[1:])) == 2 * len(case.inputs.times[1:]), "one on either side"
    found = metrics.load("law_residual").measure(from_run(run, Tier.D, "itself"), run, case)
    assert found is not None
    assert found < 1e-12


@each_impulse
def test_impulse_agrees_with_an_independent_solution(variant: str) -> None:
    """Reference at rtol 1e-10 against Pinocchio's constrained dynamics by CVODE at 1e-13: 1e-10 m and 1e-8 N."""
    pytest.importorskip("pinocchio")
    case = load("delta_impulse", variant)
    other = engines.load("pinocchio").prepare(case, "law", rtol=1e-13).run()
    keep = once(other)
    own, robot = at(case, other.t[keep], 1e-10), scene.robot_of(case.parameters)
    assert other.outcome.ok
    np.testing.assert_allclose(delta.flanges(robot, own.q), delta.flanges(robot, other.q[keep]), atol=1e-10)
    np.testing.assert_allclose(own.lam, other.lam[keep], atol=1e-8)


@each_impulse
@pytest.mark.parametrize(("name", "profile"), [("pinocchio", "law"), ("mujoco", "matched")])
def test_engines_that_follow_the_law_stay_within_ten_nanometres(name: str, profile: str, variant: str) -> None:
    pytest.importorskip(name)
    case = load("delta_impulse", variant)
    run = engines.load(name).prepare(case, profile).run()
    keep, robot = once(run), scene.robot_of(case.parameters)
    own = at(case, run.t[keep], 1e-12)
    np.testing.assert_allclose(delta.flanges(robot, run.q[keep]), delta.flanges(robot, own.q), atol=1e-8)


def test_verdicts_of_the_impulse() -> None:
    """Everything that follows the law is within; how far MuJoCo as it comes is off is known at the shipped horizon."""
    pytest.importorskip("mujoco")
    pytest.importorskip("pinocchio")
    case = load("delta_impulse", t_end=1.0)
    pairs = (("reference", "compiled"), ("mujoco", "matched"), ("mujoco", "default"), ("pinocchio", "law"))
    rows = compare(case, [engines.load(name).prepare(case, profile) for name, profile in pairs])
    words = rows.groupby(["engine", "profile"])["verdict"].agg(set)
    for pair in pairs:
        judged = words[pair] - {"not judged"}
        assert judged == {"within"}
    known = rows[(rows["verdict"] == "not judged") & rows["limit"].notna()]
    assert set(known["metric"]) >= {"flange", "lam_error", "constraint_drift"}
    assert set(known["profile"]) == {"default"}
    assert known["why"].str.contains("solref").all()
    assert (rows["tier"].isin([Tier.C.value, ""])).all()


@pytest.mark.parametrize("variant", cases.variants("delta_singularity"))
def test_swing_at_the_elbow_pose_has_the_period_of_the_closed_form(variant: str) -> None:
    case = load("delta_singularity", variant)
    run = REFERENCE.prepare(case, samples=3501).run()
    robot = scene.robot_of(case.parameters)
    assert run.outcome.ok, run.message
    x = delta.flanges(robot, run.q[run.t > 12.0])[:, 0]
    assert 0.0 < np.abs(x).max() < (0.02 if variant == "heavy" else 0.05) * robot.l2
    period = metrics.of(case)["swing_period"].measure(from_run(run, Tier.D, "itself"), run, case)
    assert period == pytest.approx(pose.swing_period(numbers(case)), rel=5e-3)
    H = closure_jacobian(robot, run.q[-1])
    assert np.linalg.matrix_rank(H, tol=1e-6) == 6


def test_index_three_is_index_one_from_a_start_on_the_manifold() -> None:
    """By IDA with h = 0 as its equations, against the compiled index 1 form: the position and lam."""
    case = load("delta_impulse", "dirac", t_end=1.0)
    system = scene.build(case.parameters, case.law)
    assert case.inputs is not None
    given = {"inputs": (case.inputs.times, case.inputs.values), "samples": np.linspace(0.1, 1.0, 10)}
    one = simulate(system, case.q0, case.v0, 1.0, rtol=1e-11, **given)
    three = simulate(system, case.q0, case.v0, 1.0, rtol=1e-9, solver="ida", index=3, **given)
    assert three.outcome.ok, three.message
    np.testing.assert_allclose(three.q, one.q, atol=1e-8)
    np.testing.assert_allclose(three.lam, one.lam, atol=1e-5)
    assert np.abs(three.gap).max() < 1e-9


@pytest.mark.parametrize("tilt", [0, 1, 2])
def test_where_lam_is_ill_posed_its_force_is_compared_instead(tilt: int) -> None:
    """H loses rank: no lam is reported; H^T lam is unique and the same in Pinocchio, MuJoCo and least squares."""
    pin = pytest.importorskip("pinocchio")
    mujoco = pytest.importorskip("mujoco")
    from crossbody.engines.mujoco._model import matched
    from crossbody.engines.pinocchio._model import build

    robot = delta.LIGHT
    q = hanging_pose(robot, delta.ill_posed_tilts(robot)[tilt])
    case = load("delta_free")
    run = simulate(scene.build(case.parameters, case.law), q, np.zeros(9), 0.1)
    assert run.outcome is Outcome.ILL_POSED
    assert np.isnan(run.lam).all() or len(run.t) == 0

    p = numbers(case)
    H, M, g = closure_jacobian(robot, q), pose.mass(p, q), gravity_gradient(robot, q)
    assert np.abs(tips(robot, q) - tips(robot, q)[0]).max() < 1e-14
    lam = np.linalg.lstsq(H @ np.linalg.solve(M, H.T), H @ np.linalg.solve(M, g), rcond=1e-9)[0]
    force = H.T @ lam
    form = case.form(case)
    r, rd = form.to_scene(q, np.zeros(9))

    closed = build(form.case, "forwardDynamics").rows.native
    closed.settings = pin.ProximalSettings(1e-12, 1e-6, 50)
    in_pinocchio = H.T @ closed.accelerate(r, rd, np.zeros(9))[1]
    model = matched(under_law(form.case.scene, case.law))
    data = mujoco.MjData(model)
    data.qpos[:] = r
    mujoco.mj_forward(model, data)
    for found in (in_pinocchio, H.T @ data.efc_force):
        np.testing.assert_allclose(found, force, atol=1e-6 * np.abs(force).max())


def test_sampled_control_is_the_same_in_every_engine() -> None:
    """The controller is called at the same instants with each engine's own state: 1e-9 m without an encoder."""
    pytest.importorskip("mujoco")
    case = load("delta_tracking", bits=52, t_end=0.3)
    run = engines.load("mujoco").prepare(case, "matched").run()
    keep, robot = once(run), scene.robot_of(case.parameters)
    assert run.outcome.ok
    t = run.t[run.t > 0]
    t = np.unique(t)
    _, first = np.unique(run.t, return_index=True)
    own = at(case, run.t[first], 1e-11)
    assert len(first) > 300
    assert not keep[1:-1].any()
    np.testing.assert_allclose(delta.flanges(robot, run.q[first]), delta.flanges(robot, own.q), atol=1e-9)


@pytest.mark.slow
def test_truth_of_a_chaotic_fall_is_trusted_until_its_sources_part() -> None:
    from crossbody.reports.judging.truth import truth_of

    case = load("delta_free", "undamped")
    truth = truth_of(case)
    assert case.chaos is not None
    assert case.chaos.until == truth.trusted < truth.parted < case.t_end
    assert truth.growth > 0.0
    assert f"{truth.parted:.4g}" in truth.source
    run = REFERENCE.prepare(case, rtol=1e-6).run()
    parted = metrics.load("divergence_time").measure(truth, run, case)
    assert parted is not None
    assert 0.5 < parted <= truth.trusted
    assert metrics.load("divergence_time").measure(truth, truth.trajectory, case) == pytest.approx(
        truth.trusted, abs=0.01
    )


BAD: list[tuple[str, dict[str, Any], str]] = [
    ("delta_impulse", {"x": 2.0}, "cannot be reached: arm 1"),
    ("delta_impulse", {"l1": -0.3}, "l1 is -0.3; valid: (0"),
    ("delta_impulse", {"sign": 0.5}, "sign"),
    ("delta_impulse", {"length": 0.0}, "start = 0"),
    ("delta_singularity", {"l1": 0.05}, "never meet"),
    ("delta_tracking", {"period": 0.0}, "period is 0; valid: (0"),
    ("delta_tracking", {"bits": 0.0}, "bits is 0; valid: [1"),
    ("delta_tracking", {"radius": 3.0}, "cannot be reached"),
    ("delta_tracking", {"controller": "fuzzy"}, "valid: linearising, pd"),
]


@pytest.mark.parametrize(("name", "overrides", "says"), BAD)
def test_bad_values_are_named(name: str, overrides: dict[str, Any], says: str) -> None:
    with pytest.raises(CrossbodyError) as told:
        REFERENCE.prepare(load(name, **overrides))
    assert says in str(told.value)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(("name", "overrides", "says"), BAD)
def test_bad_values_end_the_command_with_two(
    name: str, overrides: dict[str, Any], says: str, tmp_path: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    pairs = [word for k, v in overrides.items() for word in ("--set", f"{k}={v}")]
    variant = next(iter(cases.variants(name)))
    with pytest.raises(SystemExit) as end:
        main(["run", name, "--variant", variant, *pairs, "--engine", "reference", "--out", str(tmp_path / "out")])
    assert end.value.code == 2
    said = " ".join(capsys.readouterr().err.split())
    assert says in said
    assert "Traceback" not in said
    assert not (tmp_path / "out").exists()


OWN = """
from dataclasses import replace
import numpy as np
from crossbody.cases import Inputs, load
PARAMETERS, VARIANTS = {{}}, {{"own": {{}}}}

def build(variant, parameters):
    case = load("delta_impulse")
    return {what}
"""


@pytest.mark.parametrize(
    ("what", "says"),
    [
        ("replace(case, q0=case.q0 + 0.01 * np.eye(9)[1])", "closed pose with the same motor angles is q = [0.761"),
        ("replace(case, v0=np.eye(9)[0])", "nearest velocity that keeps them closed is v = ["),
        ("replace(case, inputs=Inputs(names=case.inputs.names, times=[0.0], values=[[1.0, 2.0, 3.0]]))", "(1, 6)"),
        ("replace(case, inputs=Inputs(names=('a',), times=[0.0], values=[[1.0]]))", "must have shape (1, 6)"),
        ("replace(case, inputs=Inputs(names=('a',), times=[1.0, 0.5], values=[[1.0], [2.0]]))", "increasing"),
    ],
)
def test_bad_scene_of_ones_own_ends_the_command_with_two(
    what: str, says: str, tmp_path: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    """An open start is refused with the closed one beside it, inputs of another length with the shape wanted."""
    path = tmp_path / "own.py"
    path.write_text(OWN.format(what=what), encoding="utf-8")
    with pytest.raises(SystemExit) as end:
        main(["run", str(path), "--engine", "reference", "--out", str(tmp_path / "out")])
    assert end.value.code == 2
    assert says in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize("name", ["mujoco", "pinocchio"])
def test_every_engine_refuses_an_open_start(name: str) -> None:
    from dataclasses import replace

    pytest.importorskip(name)
    case = load("delta_impulse")
    with pytest.raises(SceneError, match="does not close the loops"):
        engines.load(name).prepare(replace(case, q0=case.q0 + 0.01))


def test_unreachable_start_is_an_invalid_value() -> None:
    with pytest.raises(InvalidValue, match="cannot be reached: arm 1"):
        load("delta_free", z=2.0)
