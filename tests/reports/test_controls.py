"""Known faults in the truth's own motion come out as large as they are, and outside; a metric that is blind is told."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from random_scenes import random_scene, random_state, with_own_laws

from crossbody import cases, engines
from crossbody.cases import Case, Claim, Limit, Mode, Tier
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, RowLaw, Scene
from crossbody.engines.equations import system_of
from crossbody.reports import metrics
from crossbody.reports.judging import audit, comparison, controls, judge_controls, known, planted, run_verdicts, verdict
from crossbody.reports.judging.comparison import judged
from crossbody.reports.judging.controls import unheard
from crossbody.reports.judging.reach import followed
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.judging.verdict import Verdict, Word
from crossbody.reports.measuring.truth import Truth, shortened, taken
from crossbody.reports.pages import site
from crossbody.reports.runs import jobs, study
from crossbody.reports.runs.output import folder

LABELS = (
    ("bouncing_ball", "elastic"), ("red_body", "resolved"), ("soft_contact", "delta"), ("sliding_block", "flat"),
    ("rolling_sphere", "side_spin"), ("held_weight", "sprung"), ("newtons_cradle", "unequal"),
    ("dry_oscillator", "stops"),
)  # fmt: skip
BALL = cases.load("bouncing_ball", "elastic")
TRUTH = truth_of(BALL)


@pytest.fixture(scope="module", autouse=True)
def _known_before() -> None:
    """Ask for the known answers, which are asked once a process, while no metric is another one."""
    assert [*known.wrong(scene=True)] == []


def blind(case: Case, truth: Truth) -> list[Verdict]:
    """The rows of controls, under the names of their metrics."""
    rows = judge_controls.blind(case, shortened(truth), "")
    return [replace(row, metric=row.metric.removesuffix(" (control)")) for row in rows]


@pytest.mark.parametrize(
    ("name", "variant"),
    [pytest.param(*label, marks=pytest.mark.slow if label[0] == "soft_contact" else ()) for label in LABELS],
)
def test_every_fault_of_a_shipped_case_is_seen(name: str, variant: str) -> None:
    case = cases.load(name, variant)
    assert blind(case, truth_of(case)) == []


def test_cases_that_ask_no_answers_of_scenes_have_no_friction_and_no_drive() -> None:
    asked = [case for case in map(cases.load, cases.names()) if judge_controls.plain(case)]
    assert {"bouncing_ball", "newtons_cradle"} <= {case.name for case in asked}
    for case in asked:
        system = system_of(case)
        assert not system.frictional
        assert (system.inputs, system.control, system.activations) == (0, None, None)


def test_all_metrics_that_every_case_limits_have_a_control() -> None:
    made = [cases.load(name, variant) for name, variant in LABELS]
    seen = {name for case in made for fault in planted.faults(case, truth_of(case).trajectory) for name in fault.sees}
    limited = {limit.metric for case in made for limit in cases.defaults.default_limits(case)}
    assert limited - seen <= {"*", "slip_times"}  # of these none turns from stick to slip


@pytest.mark.parametrize("factor", [0.0, 0.1, 10.0])
@pytest.mark.parametrize(
    "name",
    [
        "position", "velocity", "gap_error", "energy_drift", "energy_integrator", "energy_residual", "contact_work",
        "lam_impulse_path", "law_residual", "complementarity", "rate_residual", "start_error", "touch_count",
        "release_count", "mode_residual", "event_times", "event_gap", "gap_residual",
    ],
)  # fmt: skip
def test_a_metric_that_is_wrong_by_a_factor_is_told(name: str, factor: float, monkeypatch: pytest.MonkeyPatch) -> None:
    own = metrics.load(name)

    def measure(*given: Any) -> float | None:
        value = own.measure(*given)
        return None if value is None else factor * value

    wrong = SimpleNamespace(UNIT=own.UNIT, CLAIMED=own.CLAIMED, measure=measure)
    every = metrics.of
    monkeypatch.setattr(metrics, "of", lambda case: {**every(case), name: wrong})
    rows = blind(BALL, TRUTH)
    assert [(row.metric, row.verdict) for row in rows] == [(name, Word.OUTSIDE)]


def test_a_verdict_or_a_cap_that_lets_faults_pass_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    own = run_verdicts.judge
    monkeypatch.setattr(run_verdicts, "WIDEST", 1.0)
    capped = {row.metric for row in blind(BALL, TRUTH)}
    monkeypatch.undo()
    monkeypatch.setattr(run_verdicts, "judge", lambda value, *more: own(0.0 * value, *more))
    assert {row.metric for row in blind(BALL, TRUTH)} >= {"position", "velocity", "touch_count"}
    assert capped >= {"position", "velocity"}


def test_a_limit_too_wide_is_told_in_a_case_of_the_library_and_belongs_to_one_s_own() -> None:
    wide = replace(BALL, limits=(*BALL.limits, Limit(metric="velocity", value=0.5, why="wide")))
    assert [row.metric for row in blind(wide, TRUTH)] == ["velocity"]
    assert blind(replace(wide, name="my_ball"), TRUTH) == []


@pytest.mark.parametrize("key", ["constants", "q0", "M", "bias", "H", "lam"])
def test_what_the_audit_does_not_ask_for_is_told(key: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert list(unheard(BALL)) == []
    for name in ("NUMBERS", "FUNCTIONS"):
        monkeypatch.setattr(audit, name, tuple(one for one in getattr(audit, name) if one != key))
    assert {fault.partition(" ")[0] for _, _, _, fault in unheard(BALL)} == {key}


def test_a_truth_that_is_not_finite_or_has_few_samples_has_no_controls() -> None:
    few = replace(TRUTH, trajectory=taken(TRUTH.trajectory, np.arange(5)))
    q = np.array(TRUTH.trajectory.q)
    q[3] = math.nan
    for truth in (few, replace(TRUTH, trajectory=replace(TRUTH.trajectory, q=q))):
        assert blind(BALL, truth) == []


def test_a_blind_metric_makes_the_table_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    entry = comparison._entry(engines.load("reference").prepare(BALL, "compiled"))
    assert verdict.exit_code(row.verdict for row in judged(BALL, [entry], TRUTH, "")) == 0
    monkeypatch.setattr(metrics.load("velocity"), "measure", lambda *given: 0.0)
    assert verdict.exit_code(row.verdict for row in judged(BALL, [entry], TRUTH, "")) == 1


@pytest.mark.parametrize("seed", [0, 6, *(pytest.param(k, marks=pytest.mark.slow) for k in (2, 14, 17, 25))])
def test_no_control_fails_on_random_scenes(seed: int) -> None:
    scene = with_own_laws(random_scene(seed, bodies=1 + seed % 4), seed)
    q, v, _ = random_state(scene, np.random.default_rng(seed))
    known = followed(cases.from_scene(scene, q0=q, v0=0.3 * v, t_end=0.3), 1.0)
    truth = truth_of(known.case, known, 0.5)
    assert len(list(planted.faults(known.case, shortened(truth).trajectory))) > 8
    assert blind(known.case, truth) == []


def test_a_limit_of_a_case_that_does_not_judge_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    tracks = cases.load("delta_tracking", "circle")
    assert list(judge_controls._unruled(tracks)) == []
    monkeypatch.setattr(judge_controls, "limits_of", lambda case: (*case.limits, *cases.defaults.default_limits(case)))
    assert [name for name, _, _, _ in judge_controls._unruled(tracks)]


def test_a_known_deviation_that_passes_in_any_size_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    entry = comparison._entry(engines.load("mujoco").prepare(cases.load("sliding_block", "stops"), "default"))
    case = cases.load("sliding_block", "stops")
    truth = truth_of(case)
    rows = judged(case, [entry], truth, "")
    assert any(row.verdict == Word.EXPECTED for row in rows)
    assert not any("(control)" in row.metric for row in rows)
    for factor in ("FACTOR", "AGAIN"):
        monkeypatch.setattr(run_verdicts, factor, 100.0)
    assert any("(control)" in row.metric for row in judged(case, [entry], truth, ""))


def test_sources_that_are_not_held_against_each_other_by_events_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(controls, "agreement", lambda *given: {"position": 0.0})
    assert [row.metric for row in blind(BALL, TRUTH)] == ["event_times"]


def test_without_the_reference_its_audit_is_not_asked_and_a_metric_that_throws_says_so_in_its_own_row(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fails(*given: Any) -> float:
        raise ZeroDivisionError("planted")

    monkeypatch.setattr(metrics.load("velocity"), "measure", fails)
    monkeypatch.setattr(engines, "names", lambda: ("mujoco",))
    assert list(unheard(BALL)) == []
    assert [row.metric for row in blind(BALL, TRUTH)] == []


def test_rows_of_the_truth_have_no_name_of_a_metric_and_stand_on_a_page(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A claim that judged nothing, and a blind metric: a page that looks for a metric finds runs alone."""
    claim = Claim(metric="largest position (step)", expected=0.0, tier=Tier.A, source="nobody")
    monkeypatch.setattr(metrics.load("velocity"), "measure", lambda *given: 0.0)
    case = replace(BALL, name="my_ball", claims=(claim,))
    entry = comparison._entry(engines.load("reference").prepare(case, "compiled"))
    result = jobs.CaseResult(case=case, truth=TRUTH, entries=(entry,))
    rows = study.judge([result], {case.label: "again"})
    mine = [row["metric"] for row in rows if row["engine"] == "truth" and row["metric"] != "truth"]
    assert set(mine) == {"largest position (step) (claim)", "velocity (control)"}
    assert not set(mine) & {*metrics.of(case), *run_verdicts.LARGEST_PARTS}
    with folder(tmp_path / "out") as out:
        study.write(out, [result], rows, {"command": "crossbody run", "time": ""})
        site.write(out)
    assert "velocity (control)" in (tmp_path / "out" / f"case-{case.label.replace(':', '.')}.html").read_text()


@pytest.mark.parametrize("seed", range(4))
def test_no_control_fails_on_dry_friction_however_light_beside_what_flies(seed: int) -> None:
    draw = np.random.default_rng(seed)
    loss, stops = 10.0 ** draw.uniform(-2.0, 1.0), draw.uniform(0.02, 0.4)
    inertia, mass = float(draw.uniform(0.01, 0.1)), float(draw.uniform(0.5, 3.0))
    wheel = Body(name="wheel", mass=mass, inertia=(inertia,) * 3 + (0.0,) * 3)
    weight = Body(name="weight", mass=mass, inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0))
    joints = (Joint(name="turn", body="wheel", type="hinge", axis=(0.0, 1.0, 0.0), friction_loss=loss),
              Joint(name="fall", body="weight", type="slide", axis=(0.0, 0.0, 1.0)))  # fmt: skip
    scene = Scene(bodies=(wheel, weight), joints=joints, gravity=(0.0, 0.0, -9.81))
    case = case_of(scene, name="stops", q0=[0.1, 1.0], v0=[loss / inertia * stops, 2.0], t_end=0.5)
    assert blind(case, truth_of(case)) == []


@pytest.mark.parametrize("unit", [1.0, 1e-6])
def test_faults_are_seen_in_whatever_unit_of_time_a_motion_is_fast(unit: float) -> None:
    """A limit of a microsecond says nothing of a motion of some."""
    law = RowLaw(a0=1e4 / unit**2, a1=20.0 / unit)
    height = Joint(name="height", body="ball", type="slide", range=(0.0, math.inf), law=law)
    scene = Scene(bodies=(Body(name="ball", mass=1.0),), joints=(height,), gravity=(0.0, 0.0, -9.81 / unit**2))
    case = cases.from_scene(scene, q0=[1.0], t_end=1.5 * unit)
    truth = truth_of(case)
    assert truth.trajectory.outcome.ok
    assert blind(case, truth) == []
    judge_ = run_verdicts.Judge(case, judge_controls.JUDGED, replace(truth, grows=1e12), "")
    assert judge_.judged("event_times", 0.01 * case.t_end, "s", truth, 1.0).verdict == Word.OUTSIDE


def test_a_word_that_a_judge_does_not_say_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    assert blind(BALL, TRUTH) == []
    monkeypatch.setattr(judge_controls, "exit_code", lambda words, lost=(): int(Word.CRASHED in set(words)))
    told = [row for row in blind(BALL, TRUTH) if row.metric == "exit code"]
    assert told
    assert {row.verdict for row in told} == {Word.CRASHED}  # which it does know


@pytest.mark.parametrize("times", [0.5, 100.0])
def test_numbers_beside_limits_that_are_judged_by_others_are_told(
    monkeypatch: pytest.MonkeyPatch, times: float
) -> None:
    judge = verdict.judge

    def wider(value: float, limit: Limit | None, *more: Any) -> tuple[Word, str]:
        return judge(value, limit and replace(limit, value=times * limit.value), *more)

    monkeypatch.setattr(run_verdicts, "judge", wider)
    assert {"position", "velocity", "event_times"} <= {row.metric for row in blind(BALL, TRUTH)}


def test_limits_and_claims_are_those_of_the_stored_runs() -> None:
    for case in (cases.load(name, variant) for name, variant in LABELS):
        assert list(comparison.unlike_stored(case, "")) == []
        wider = replace(case, limits=(*case.limits, Limit(metric="position", value=1e-4)))
        other = replace(case, claims=(*case.claims, Claim(metric="transitions", expected=7.0, tier=Tier.A, source="")))
        for changed in (wider, other):
            assert [row.verdict for row in comparison.unlike_stored(changed, "")] == [Word.OUTSIDE]


def test_every_run_has_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    result = jobs.run_case(BALL, (jobs.Pick(engine="reference", profile="compiled", every=False),), truth=TRUTH)
    monkeypatch.setattr(study, "judged", lambda *_: [])
    with pytest.raises(RuntimeError, match="nothing is said of reference:compiled"):
        study.judge([result], {BALL.label: ""})


@pytest.mark.parametrize(("name", "variant"), [("sliding_block", "stops"), ("red_body", "resolved")])
def test_modes_that_gaps_and_forces_contradict_are_counted(name: str, variant: str) -> None:
    case = cases.load(name, variant)
    truth = truth_of(case)
    measure = metrics.load("mode_contradicted").measure
    assert measure(truth, truth.trajectory, case) == 0.0
    swapped = np.array(truth.trajectory.mode)
    for one, other in ((Mode.CONTACT, Mode.FREE), (Mode.SLIP, Mode.STICK)):
        swapped[truth.trajectory.mode == one] = other
    assert measure(truth, replace(truth.trajectory, mode=swapped), case) > 0.0


LONGER = [("unequal", 0.3), *(pytest.param("unequal", zeta, marks=pytest.mark.slow) for zeta in (0.1, 0.7))]


@pytest.mark.parametrize(("variant", "zeta"), LONGER)
def test_no_control_is_blind_over_a_horizon_that_a_parameter_has_made_longer(variant: str, zeta: float) -> None:
    """A coordinate was off at the last sample, which nobody looked at; and limits grow with the horizon."""
    case = cases.load("newtons_cradle", variant, zeta=zeta)
    told = [(row.metric, row.why) for row in judge_controls.blind(case, shortened(truth_of(case)), "")]
    assert not [one for one in told if "control" in one[0]], told


@pytest.mark.parametrize("t_end", [60.0, pytest.param(1500.0, marks=pytest.mark.slow)])
def test_no_control_is_blind_where_bounces_have_few_samples(t_end: float) -> None:
    """Where a ball moves far from sample to sample a touch that is early by a hair is early by little of that."""
    case = cases.load("bouncing_ball", "linear", a0=11000.0, a1=0.0, t_end=t_end)
    told = [(row.metric, row.why) for row in judge_controls.blind(case, shortened(truth_of(case)), "")]
    assert not [one for one in told if "control" in one[0]], told
