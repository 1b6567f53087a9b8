"""What every engine owes, on every engine found: the same for each of its profiles and each variant of the ball."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from random_scenes import random_scene, random_state

from crossbody import cases, engines
from crossbody.cases import CaseUnsupported, EngineUnavailable, InvalidValue, Trajectory, UnknownName
from crossbody.cases.files.case import case_of
from crossbody.engines import Engine, Run
from crossbody.reports.cli import main
from crossbody.reports.commands.planned import tell

T_END = 0.8


def installed(name: str) -> Engine | None:
    try:
        return engines.load(name)
    except EngineUnavailable:
        return None


FOUND = {name: engine for name in engines.names() if (engine := installed(name)) is not None}
BALL = cases.load("bouncing_ball")
PAIRS = [
    (name, profile)
    for name, engine in FOUND.items()
    for profile in engine.profiles
    if engine.why_not(BALL, profile) is None  # a rule for several contacts has nothing to do here
]
OTHERS = (("delta_free", "light"), ("newtons_cradle", "pendulums"), ("red_body", "resolved"), ("soft_contact", "axis"),
          ("ball_maze", "inside"))  # fmt: skip
BOUNDED = [("bouncing_ball", "listing", *pair) for pair in PAIRS] + [
    (case, variant, name, profile)
    for case, variant in OTHERS
    for name in ("mujoco", "pinocchio")
    for profile in (FOUND[name].profiles if name in FOUND else ())
    if FOUND[name].why_not(cases.load(case, variant), profile) is None
]
each_variant = pytest.mark.parametrize("variant", cases.variants("bouncing_ball"))
each_profile = pytest.mark.parametrize(("name", "profile"), PAIRS)


def prepared(name: str, profile: str, variant: str) -> Run:
    """Or a skip, once the refusal has proved to be the engine's own sentence."""
    case = cases.load("bouncing_ball", variant=variant, t_end=T_END)
    reason = FOUND[name].why_not(case, profile)
    if reason is None:
        return FOUND[name].prepare(case, profile)
    with pytest.raises(CaseUnsupported) as refusal:
        FOUND[name].prepare(case, profile)
    assert str(refusal.value) == reason
    pytest.skip(reason)


@pytest.fixture
def quiet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Iterator[None]:
    """Nothing printed, by Python or beneath it, and no file left in the working directory."""
    monkeypatch.chdir(tmp_path)
    yield
    out, err = capfd.readouterr()
    waiting = "crossbody: another process compiles what this one needs; waiting for it.\n"  # a cold cache, many workers
    assert (out, err.replace(waiting, "")) == ("", "")
    assert list(tmp_path.iterdir()) == []


def columns(run: Trajectory) -> tuple[Any, ...]:
    return run.t, run.q, run.v, run.gap, run.lam, run.energy, run.mode


@each_variant
@each_profile
@pytest.mark.usefixtures("quiet")
def test_runs_to_its_horizon_and_twice_the_same(name: str, profile: str, variant: str) -> None:
    run = prepared(name, profile, variant)
    first, second = run.run(), run.run()
    assert first.outcome.ok, first.message
    assert (run.engine, run.profile) == (name, profile)
    for a, b in zip(columns(first), columns(second), strict=True):
        np.testing.assert_array_equal(a, b)
    assert (first.events, first.steps, first.outcome) == (second.events, second.steps, second.outcome)


@pytest.mark.parametrize("who", ["mujoco:matched", "mujoco:default", "pinocchio:law"])
@pytest.mark.parametrize("scene", ["newtons_cradle pendulums", "newtons_cradle sliders", "red_body resolved",
                                   "soft_contact axis", "delta_impulse light", "ball_maze outside"])  # fmt: skip
def test_a_model_that_has_moved_starts_anew(scene: str, who: str) -> None:
    """What one run leaves behind (clocks, modes, forces to begin with) is nothing to the next."""
    engine, profile = who.split(":")
    case = cases.load(*scene.split(), t_end=0.02)
    if why := engines.load(engine).why_not(case, profile):
        pytest.skip(why)
    run = engines.load(engine).prepare(case, profile)
    first, second = run.run(), run.run()
    assert first.outcome.ok, first.message
    for a, b in zip(columns(first), columns(second), strict=True):
        np.testing.assert_array_equal(a, b)
    assert (first.events, first.steps) == (second.events, second.steps)


@pytest.mark.parametrize("who", ["mujoco:matched", "pinocchio:law"])
@pytest.mark.parametrize("seed", range(8))
def test_recorded_energies_are_those_of_the_recorded_states(seed: int, who: str) -> None:
    """Of joints of every type with armature, springs on joints and tendons, and bodies that are spared their weight."""
    engine, profile = who.split(":")
    scene = random_scene(seed).replace(loops=(), pairs=())
    q, v, _ = random_state(scene, np.random.default_rng(seed))
    case = case_of(scene, q0=q, v0=v, t_end=1e-4)
    run = engines.load(engine).prepare(case, profile).run()
    reference = engines.load("reference").prepare(case, "compiled").run()
    assert run.energy[0] == pytest.approx(reference.energy[0], rel=1e-12, abs=1e-12 * np.abs(reference.energy).max())


@each_variant
@each_profile
def test_says_what_the_trajectory_promises(name: str, profile: str, variant: str) -> None:
    case = cases.load("bouncing_ball", variant=variant, t_end=T_END)
    run = prepared(name, profile, variant).run()
    assert run.t[0] == 0.0
    assert run.t[-1] == pytest.approx(T_END, abs=1e-9)
    assert (np.diff(run.t) >= 0.0).all()
    np.testing.assert_array_equal((run.q[0], run.v[0]), (case.q0, case.v0))
    np.testing.assert_allclose(run.gap, run.q, atol=1e-15)
    m, g = case.number("mass"), case.number("gravity")
    np.testing.assert_allclose(run.energy, np.column_stack((m * run.v[:, 0] ** 2 / 2, m * g * run.q[:, 0])), atol=1e-12)
    assert run.steps > 0
    assert run.wall_s > 0.0
    assert all(np.isfinite(c).all() for c in (run.t, run.q, run.v))
    if case.law.unilateral.all():
        assert not (run.lam < -1e-9).any()
    assert [e.t for e in run.events] == sorted(e.t for e in run.events)
    for e, f in zip(run.events, run.events[1:], strict=False):
        assert f.before == e.after


@each_profile
def test_audit_reads_the_case_back(name: str, profile: str) -> None:
    case = cases.load("bouncing_ball", mass=2.5, gravity=3.7, height=0.3, speed=1.0, a0=1e3, a1=7.0, a2=10.0)
    found = FOUND[name].prepare(case, profile).audit()
    assert np.ravel(found["masses"]) == pytest.approx(2.5)
    assert found["gravity"] == pytest.approx(3.7)
    np.testing.assert_array_equal((found["q0"], found["v0"]), (case.q0, case.v0))
    assert "constants" in {*found, *FOUND[name].hidden_in(profile)}
    q, v = np.array([-0.01]), np.array([-1.0])
    for key, args, want in (("M", (q,), [[2.5]]), ("bias", (q, v), [2.5 * 3.7]), ("H", (q,), [[1.0]])):
        if key in found:
            np.testing.assert_allclose(found[key](*args), want, rtol=1e-12, strict=True)


@each_profile
def test_what_an_engine_does_not_show_its_contract_names(name: str, profile: str) -> None:
    prepared = FOUND[name].prepare(cases.load("bouncing_ball"), profile)
    hidden, run = {**FOUND[name].hidden_in(profile), **prepared.audit().get("hidden", {})}, prepared.run()
    shown = {*prepared.audit(), *(("ledger",) if run.ledger is not None else ())}
    assert set(engines.QUANTITIES) - shown <= set(hidden)
    assert set(hidden) <= set(engines.QUANTITIES)
    assert all(why.endswith(".") for why in hidden.values())


@each_profile
def test_an_audit_leaves_the_run_as_it_was(name: str, profile: str) -> None:
    case = cases.load("bouncing_ball", t_end=0.6)
    plain, audited = FOUND[name].prepare(case, profile), FOUND[name].prepare(case, profile)
    found = audited.audit()
    for key in {"M", "H"} & set(found):
        found[key](np.array([-0.01]))
    for key in {"bias", "lam"} & set(found):
        found[key](np.array([-0.01]), np.array([3.0]))
    for a, b in zip(columns(plain.run()), columns(audited.run()), strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("name", FOUND)
def test_a_profile_that_does_not_exist(name: str) -> None:
    with pytest.raises(UnknownName) as error:
        FOUND[name].prepare(cases.load("bouncing_ball"), "no such profile")
    assert all(profile in str(error.value) for profile in FOUND[name].profiles)


@each_profile
def test_a_setting_that_does_not_exist(name: str, profile: str) -> None:
    with pytest.raises(UnknownName, match="no_such_setting") as error:
        FOUND[name].prepare(cases.load("bouncing_ball"), profile, no_such_setting=1)
    assert any(setting in str(error.value) for setting in ("dt", "rtol"))


@pytest.mark.parametrize("value", [-1.0, 0.0, float("nan"), float("inf"), "fast", None])
@each_profile
def test_a_setting_outside_its_range(name: str, profile: str, value: Any) -> None:
    case = cases.load("bouncing_ball")
    used = FOUND[name].prepare(case, profile).settings
    setting = "dt" if "dt" in used else "rtol"
    assert setting in used
    with pytest.raises(InvalidValue, match=setting):
        FOUND[name].prepare(case, profile, **{setting: value})


@pytest.mark.parametrize(("scene", "variant", "name", "profile"), BOUNDED)
def test_steps_are_bounded(scene: str, variant: str, name: str, profile: str) -> None:
    case = cases.load(scene, variant)
    if "max_steps" not in FOUND[name].prepare(case, profile).settings:
        pytest.skip(f"{name}:{profile} has no max_steps.")
    prepared = FOUND[name].prepare(case, profile, max_steps=3)
    for run in (prepared.run(), prepared.run()):
        assert (run.outcome, run.steps) == (cases.Outcome.STEP_LIMIT, 3)
        assert "step" in run.message


@pytest.mark.parametrize("name", FOUND)
def test_matched_is_a_name_in_every_engine(name: str) -> None:
    profile = FOUND[name].prepare(cases.load("bouncing_ball")).profile
    assert profile == ("matched" if "matched" in FOUND[name].profiles else next(iter(FOUND[name].profiles)))


@pytest.mark.parametrize("name", FOUND)
def test_versions_are_stated(name: str) -> None:
    assert FOUND[name].name == name
    assert FOUND[name].versions
    assert all(version[0].isdigit() for version in FOUND[name].versions.values())


ROUGH = '<mujoco><worldbody><geom name="floor" type="plane" size="5 5 .1" condim="3"/><body pos="0 0 .5"><freejoint/>' \
    '<geom name="box" type="box" size=".1 .1 .1" condim="3"/></body></worldbody></mujoco>'  # fmt: skip


def test_a_plan_of_a_file_has_both_what_runs_without_a_contact_and_with_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("mujoco")
    (tmp_path / "box.xml").write_text(ROUGH)
    asked = ("-e", "reference:compiled", "-e", "mujoco:matched", "--dry-run", "--json")
    with pytest.raises(SystemExit) as end:
        main(["run", str(tmp_path / "box.xml"), *asked])
    assert not end.value.code
    free, rubs = json.loads(capsys.readouterr().out)
    assert (free["if"], free["rows"]) == ("", 0)
    assert all("settings" in one for one in free["engines"])
    assert (rubs["if"], rubs["rows"]) == ("if its motion comes to a contact with friction", 24)
    assert ["skipped" in one for one in rubs["engines"]] == [False, True]


def test_a_dry_run_builds_nothing_of_the_reference(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """What would be compiled for a run; the settings told are those that it has all the same."""
    case, engine = cases.load("bouncing_ball"), engines.load("reference")
    told = {profile: dict(engine.prepare(case, profile).settings) for profile in ("compiled", "ida")}

    def build(*_: object, **__: object) -> None:
        raise AssertionError

    monkeypatch.setattr("crossbody.engines.reference.equations_of", build)
    assert {profile: dict(engine.planned(case, profile)) for profile in told} == told
    assert tell(["bouncing_ball"], ["reference"], None, (), None, (), tmp_path / "out", None, (), 0.0, 60.0) == 0
