"""Cases with friction: their exact motions against the published digits, the laws, and the reference."""

from __future__ import annotations

import math
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import Case, InvalidValue, Mode, Tier, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.library.rocking_block import flat_at
from crossbody.reports import metrics
from crossbody.reports.judging.comparison import judged
from crossbody.reports.judging.run_verdicts import Judge
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.judging.verdict import Word, judge
from crossbody.reports.measuring.truth import from_run, sample_times
from crossbody.reports.runs import choice, jobs

NAMES = (
    "sliding_block", "rolling_sphere", "rocking_block", "block_on_belt", "stacked_blocks", "held_weight",
    "dry_oscillator",
)  # fmt: skip
ALL = [(name, variant) for name in NAMES for variant in cases.variants(name)]
BENT = [
    ("sliding_block", "askew"), ("rolling_sphere", "side_spin"), ("block_on_belt", "grazes"),
    ("dry_oscillator", "swings"),
]  # fmt: skip
"""Whose motions are no polynomials, so that a step has an error, and that switch."""
STATE, TIME = 1e-9, 1e-11


def exact(case: Case, t: Floats) -> Trajectory:
    """Return the exact motion at some instants."""
    assert case.closed_form is not None
    return case.closed_form(t)


def ran(case: Case, rtol: float = 1e-11, **given: Any) -> Trajectory:
    """Return the reference's motion."""
    return engines.load("reference").prepare(case, "compiled", rtol=rtol, **given).run()


def events(run: Trajectory) -> tuple[Floats, list[tuple[int, Mode, Mode]]]:
    """Return when contacts change their modes, and which do."""
    found = sorted(run.events, key=lambda e: (round(e.t, 9), e.contact))
    return np.array([e.t for e in found]), [(e.contact, e.before, e.after) for e in found]


def agree(case: Case, run: Trajectory, state: float = STATE, time: float = TIME) -> None:
    """Check states, forces away from events, modes and events against the exact motion."""
    found = exact(case, run.t)
    for name in ("q", "v", "gap"):
        assert np.abs(getattr(run, name) - getattr(found, name)).max() < state, name
    apart = np.all([np.abs(run.t - e.t) > 1e-6 for e in found.events], axis=0) if found.events else slice(None)
    assert np.abs(run.lam - found.lam)[apart].max() < 1e3 * max(state, 1e-7)
    assert np.array_equal(run.mode[apart], found.mode[apart])
    (when, which), (expected, of) = events(run), events(found)
    assert which == of
    assert np.abs(when - expected).max(initial=0.0) < time


@pytest.mark.parametrize(("name", "variant"), ALL)
def test_the_reference_is_at_the_exact_motion(name: str, variant: str) -> None:
    case = cases.load(name, variant)
    run = ran(case)
    assert run.outcome.ok, run.message
    agree(case, run)
    assert np.abs(run.energy - exact(case, run.t).energy).max() < STATE


@pytest.mark.parametrize(("name", "variant"), BENT)
def test_errors_fall_with_the_tolerance(name: str, variant: str) -> None:
    case, rungs = cases.load(name, variant), (1e-5, 1e-7, 1e-9, 1e-11)
    errors = []
    for rtol in rungs:
        run = ran(case, rtol)
        errors.append(float(np.abs(run.q - exact(case, run.t).q).max()))
    assert all(error < 100.0 * rtol for error, rtol in zip(errors, rungs, strict=True))
    assert np.polyfit(np.log(rungs), np.log(np.maximum(errors, 1e-14)), 1)[0] > 0.7


@pytest.mark.parametrize(("name", "variant"), ALL)
def test_exact_motions_keep_the_laws(name: str, variant: str) -> None:
    """Forces are those of stick and slip at every state, rates are those of the places, and energy is accounted for."""
    case = cases.load(name, variant)
    t = sample_times(exact(case, np.zeros(1)), case.t_end)
    run = exact(case, t)
    truth = from_run(run, Tier.A, "itself")
    for metric, most in (("law_residual", 1e-9), ("friction_angle", 1e-9), ("cone_violation", 1e-12),
                         ("gap_residual", 1e-12), ("energy_residual", 1e-12), ("mode_residual", 0.0)):  # fmt: skip
        value = metrics.load(metric).measure(truth, run, case)
        assert value is None or value <= most, metric
    inside = (np.diff(t) > 1e-6) & (run.mode[1:, 0] == run.mode[:-1, 0])
    if not case.quaternions:
        mean = 0.5 * (run.v[1:] + run.v[:-1])
        assert np.abs(np.diff(run.q, axis=0) - np.diff(t)[:, None] * mean)[inside].max() < 1e-6


def test_published_digits() -> None:
    steps = {150.0: 0.18736133037705, 60.0: 0.853916721031635}
    for angle, stop in steps.items():
        case = cases.load("sliding_block", "askew", angle=angle, t_end=1.0)
        assert exact(case, np.zeros(1)).events[-1].t == pytest.approx(stop, abs=1e-14)
    end = exact(cases.load("sliding_block", "askew"), np.array([0.3])).q[0, :2]
    assert end == pytest.approx([-0.05063281014555, 0.04271259886070], abs=1e-14)
    flat = exact(cases.load("sliding_block", "flat"), np.array([0.6]))
    assert flat.events[-1].t == pytest.approx(0.339789330615, abs=1e-12)
    assert flat.q[0, 0] == pytest.approx(0.169894665308, abs=1e-12)
    ball = exact(cases.load("rolling_sphere", "straight"), np.array([0.9]))
    assert ball.events[-1].t == pytest.approx(0.291247997670016, abs=1e-15)
    assert ball.v[0, 0] == pytest.approx(10.0 / 7.0, abs=1e-14)
    block = {key: float(value) for key, value in cases.load("rocking_block").parameters.items()}
    assert flat_at(block) == pytest.approx(0.34709358678889, abs=1e-13)
    belt = exact(cases.load("block_on_belt"), np.array([2.0]))
    assert [e.t for e in belt.events[1:]] == pytest.approx([0.0346692891616231, 0.311458902406051], abs=1e-15)
    assert belt.q[0, 0] + 0.1 * 2.0 == pytest.approx(0.0201936922945194, abs=1e-15)
    assert belt.v[0, 0] + 0.1 == pytest.approx(-0.0383283445633638, abs=1e-15)


@pytest.mark.parametrize("variant", cases.variants("tossed_cube"))
def test_a_tossed_cube_ends_alike_at_any_tolerance(variant: str) -> None:
    """Its corners touch, slide and stick some dozen times: what one tolerance decides otherwise ends elsewhere."""
    case = cases.load("tossed_cube", variant)
    ends = [ran(case, rtol).q[-1] for rtol in (1e-6, 1e-9, 1e-11)]
    assert np.abs(ends[0] - ends[2]).max() < 1e-5
    assert np.abs(ends[1] - ends[2]).max() < 1e-8


@pytest.mark.parametrize("seed", range(12))
def test_any_block_and_any_sphere_move_as_their_exact_motions(seed: int) -> None:
    rng = np.random.default_rng(seed)
    slope = {
        "mu": rng.uniform(0.05, 1.5), "slope": rng.choice([0.0, rng.uniform(0.0, 1.2)]), "speed": rng.uniform(0.1, 3.0),
        "angle": rng.choice([0.0, 180.0, rng.uniform(-170.0, 170.0)]), "t_end": 0.4, "gravity": rng.uniform(1.0, 20.0),
    }  # fmt: skip
    spin = {f"spin_{way}": rng.uniform(-20.0, 20.0) for way in "xyz"}
    thrown = {"mu": rng.uniform(0.05, 1.0), "speed": rng.uniform(-3.0, 3.0), "radius": rng.uniform(0.02, 0.5), **spin}
    for name, variant, given in (("sliding_block", "askew", slope), ("rolling_sphere", "side_spin", thrown)):
        case = cases.load(name, variant, **given)
        agree(case, ran(case), state=1e-8, time=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_any_stack_rests_goes_together_or_apart(seed: int) -> None:
    rng = np.random.default_rng(seed)
    push = rng.choice(["push_low", "push_high"])
    given = {"mu": rng.uniform(0.05, 0.6), "high_mu": rng.uniform(0.05, 0.6), push: rng.uniform(0.0, 25.0),
             "low_mass": rng.uniform(1.0, 4.0), "high_mass": rng.uniform(0.5, 2.0)}  # fmt: skip
    case = cases.load("stacked_blocks", "top_slides", **{"push_high": 0.0, **given})
    if case.closed_form is None:  # it tips, which a push of 25 N on 1 kg may do
        assert given[push] > 5.0
        return
    run = ran(case)
    found = exact(case, run.t)
    assert np.abs(run.q - found.q).max() < STATE
    assert np.array_equal(run.mode[-1], found.mode[-1])


FILE = """<mujoco><option gravity="{g[0]!r} {g[1]!r} {g[2]!r}"/>
  <default><geom solref="-9500 -190" friction="{mu} 0 0"/></default><worldbody>
  <geom name="floor" type="plane" size="5 5 1"/><body name="body" pos="0 0 .1">{joints}
  <inertial pos="0 0 0" mass="1" diaginertia="{J[0]!r} {J[1]!r} {J[2]!r}"/><geom name="body" {shape}/></body>
  </worldbody><keyframe><key qvel="{v}"/></keyframe></mujoco>"""
SLIDES = "".join(f'<joint type="slide" axis="{axis}"/>' for axis in ("1 0 0", "0 1 0", "0 0 1"))
SHAPES = {"askew": ('type="sphere" size=".1"', SLIDES), "flat": ('type="box" size=".2 .15 .1"', "<freejoint/>"),
          "side_spin": ('type="sphere" size=".1"', "<freejoint/>")}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "variant"), [("sliding_block", "askew"), ("sliding_block", "flat"), ("rolling_sphere", "side_spin")]
)
def test_files_move_as_scenes_do(name: str, variant: str, tmp_path: Path) -> None:
    case = cases.load(name, variant)
    assert case.scene is not None
    shape, joints = SHAPES[variant]
    path = tmp_path / "body.xml"
    path.write_text(FILE.format(
        g=case.scene.gravity, mu=case.number("mu"), joints=joints, J=case.scene.bodies[0].inertia[:3]
        if any(case.scene.bodies[0].inertia) else (1e-3,) * 3, shape=shape, v=" ".join(map(repr, case.v0.tolist())),
    ))  # fmt: skip
    of_file = cases.from_file(str(path), friction=1, t_end=case.t_end)
    assert np.abs(of_file.law.a0 - case.law.a0).max() < 1e-8
    agree(case, ran(of_file))


LEG = """<mujoco><compiler angle="radian"/><worldbody><geom name="floor" type="plane" size="5 5 1"/>
  <body name="thigh" pos=".1 0 1.22"><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>
  <joint name="turn" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 -.5" size=".04" mass="3"/>
  <body name="shank" pos="0 0 -.5"><joint name="knee" axis="0 1 0" range="-2 0" limited="true"/>
  <geom type="capsule" fromto="0 0 0 0 0 -.5" size=".04" mass="2"/><body name="foot" pos="0 0 -.5">
  <geom name="foot" type="capsule" fromto="-.13 0 -.1 .13 0 -.1" size=".06" mass="2"/></body></body></body>
  </worldbody></mujoco>"""


@pytest.mark.slow
def test_a_bound_that_bears_nothing_beside_a_contact_that_does_pulls_by_rounding_alone(tmp_path: Path) -> None:
    """A leg falls upright on its foot: the knee stays at its bound, and nothing presses it there."""
    path = tmp_path / "leg.xml"
    path.write_text(LEG)
    truth = truth_of(cases.from_file(str(path), friction=1, t_end=0.14))
    assert truth.trajectory.lam.max() > 100.0
    assert truth.trusted == math.inf, truth.source


def test_a_creep_that_is_predicted_has_two_bounds() -> None:
    case = cases.load("sliding_block", "rests")
    found = next(one for one in case.limits if one.metric == "creep_speed" and one.known_least > 0.0)
    run = engines.load("mujoco").prepare(case, "default").run()
    value = metrics.load("creep_speed").measure(from_run(run, Tier.A, ""), run, case)
    assert judge(value or 0.0, found, None)[0] is Word.EXPECTED
    middle = 0.5 * (found.known_least + found.known_size)
    assert value == pytest.approx(middle, rel=1e-2)
    for factor in (0.0, 0.9, 1.1):  # also where it is gone: what took it away may be in what measures it
        assert judge(factor * middle, found, None)[0] is Word.OUTSIDE


SETTINGS = {
    "cone": ("own", "elliptic", "pyramidal"), "impratio": (0.0, 0.5, 3.0, 100.0), "timeconst": (0.0, 0.005, 0.05),
    "dt": (0.0005, 0.002, 0.006, 0.03), "noslip": (-1, 0),
}  # fmt: skip
CREEPING = [
    ("sliding_block", "rests", "mujoco:default", {"mu": 0.6, "slope": 0.4}),
    ("sliding_block", "rests", "mujoco:default", {"mu": 1.1, "slope": 0.2}),
    ("sliding_block", "rests", "dart:matched", {}),
    ("dry_oscillator", "holds", "mujoco:default", {"mass": 3.0}),
]


def word(case: cases.Case, pick: str, given: dict[str, Any]) -> tuple[Word, str, float, float]:
    """Return what is said of a creep, why, the creep, and the middle of what a known property explains, m/s."""
    result = jobs.run_case(case, choice.picks([pick]), settings=given, refine=False)
    judge_ = Judge(result.case, result.entries[0], result.truth, "")
    row = next(one for one in judged(result.case, result.entries, result.truth, "") if one.metric == "creep_speed")
    limit = judge_.limit("creep_speed")
    assert limit is not None
    return Word(row.verdict), row.why, row.value, 0.5 * (limit.known_least + limit.known_size)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("name", "variant", "pick", "changed"), CREEPING)
def test_a_creep_is_predicted_from_the_settings_in_use(
    name: str, variant: str, pick: str, changed: dict[str, float], seed: int
) -> None:
    case, rng = cases.load(name, variant, **changed), np.random.default_rng([seed, len(name)])
    pytest.importorskip("dartpy" if pick.startswith("dart") else "mujoco")
    offered = engines.load(pick.split(":")[0]).offered(case, pick.split(":")[1])
    given = {key: values[rng.integers(len(values))] for key, values in SETTINGS.items() if key in offered}
    said, why, value, expected = word(case, pick, given)
    assert (said, value) == (Word.EXPECTED, pytest.approx(expected, rel=0.05)), (given, why)


@pytest.mark.parametrize(
    ("given", "named"), [({"noslip": 50}, "noslip=50"), ({"timeconst": 0.5}, "a time constant of 0.5 s within 1 s")]
)
def test_a_creep_that_nothing_predicts_is_not_judged(given: dict[str, float], named: str) -> None:
    said, why, value, _ = word(cases.load("sliding_block", "rests"), "mujoco:default", given)
    assert said is Word.INFO
    assert value > 1e-9
    assert f"no prediction for {named}" in why


def test_what_tips_has_no_exact_motion() -> None:
    """The corners in front would have to bear more than all there is."""
    assert cases.load("sliding_block", "flat", mu=1.9).closed_form is not None
    case = cases.load("sliding_block", "flat", mu=2.1, t_end=0.05)
    assert case.closed_form is None
    assert ran(case).q[-1, 5] != 0.0


@pytest.mark.parametrize(
    ("name", "given", "told"),
    [
        ("rocking_block", {"t_end": 0.4}, "the block is flat at 0.347094 s"),
        ("stacked_blocks", {"push_low": 1.0, "push_high": 1.0}, "valid: one of them"),
        ("sliding_block", {"mu": 0.0}, r"\(0, inf\)"),
        ("sliding_block", {"mu": math.inf}, "mu"),
        ("rolling_sphere", {"radius": -1.0}, "radius"),
    ],
)
def test_what_has_no_exact_motion_is_refused(name: str, given: dict[str, float], told: str) -> None:
    with pytest.raises(InvalidValue, match=told):
        cases.load(name, **given)


@pytest.mark.parametrize("given", [{"spin_z": 1e9}, {"mu": 1e-12, "t_end": 1e9}, {"spin_x": 1e7, "t_end": 10.0}])
def test_a_sphere_that_turns_without_end_costs_nothing_to_load(given: dict[str, float]) -> None:
    began = perf_counter()
    case = cases.load("rolling_sphere", "side_spin", **given)
    assert perf_counter() - began < 2.0
    assert case.closed_form is None


@pytest.mark.parametrize("given", [{"stiffness": 1e300}, {"friction_loss": 1e-300, "t_end": 1e12}])
def test_what_swings_nearly_for_ever_is_a_case_whose_truth_is_integrated(given: dict[str, float]) -> None:
    assert cases.load("dry_oscillator", "swings", **given).closed_form is None
