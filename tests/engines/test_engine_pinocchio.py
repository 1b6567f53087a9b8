"""Pinocchio: the law to tolerance, impacts by their closed form, time stepping of first order."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from random_scenes import random_scene, random_state

from crossbody import cases, engines
from crossbody.cases import Case, Mode, Outcome
from crossbody.cases import closed_forms as closed_forms

pin = pytest.importorskip("pinocchio")
from crossbody.engines._level_machine import LevelMachine  # noqa: E402 - they import the engine's package
from crossbody.engines._log import Log  # noqa: E402
from crossbody.engines.pinocchio._flow import Flow  # noqa: E402
from crossbody.engines.pinocchio._rows import PinRows  # noqa: E402

FREE, CONTACT, BALLISTIC, COLLISION = Mode.FREE, Mode.CONTACT, Mode.BALLISTIC, Mode.COLLISION


def ball(variant: str = "listing", **parameters: Any) -> Case:
    return cases.load("bouncing_ball", variant=variant, **parameters)


def run(case: Case, profile: str = "law", **settings: Any) -> cases.Trajectory:
    return engines.load("pinocchio").prepare(case, profile, **settings).run()


@pytest.mark.parametrize("algebra", ["forwardDynamics", "kkt"])
def test_multiplier_is_the_law_at_random_states(algebra: str) -> None:
    draw = np.random.default_rng(7)
    for _ in range(100):
        a0, a2 = 10.0 ** draw.uniform(0, 10), 10.0 ** draw.uniform(0, 8)
        a1, m, h, v = (
            2 * np.sqrt(a0) * draw.uniform(0, 3),
            10.0 ** draw.uniform(-3, 3),
            -(10.0 ** draw.uniform(-6, 0)),
            draw.normal(),
        )
        case = ball(mass=m, a0=a0, a1=a1, a2=a2)
        lam = engines.load("pinocchio").prepare(case, algebra=algebra).audit()["lam"](np.array([h]), np.array([v]))
        terms = m * np.array([9.81, -a1 * v, -a0 * h, -a2 * h**3])
        assert lam[0] == pytest.approx(terms.sum(), abs=1e-14 * np.abs(terms).sum())


def test_listing_has_three_contacts_and_seven_transitions() -> None:
    found = run(ball())
    went = [(e.before, e.after) for e in found.events]
    assert went == [(FREE, CONTACT), (CONTACT, BALLISTIC), (BALLISTIC, FREE)] * 2 + [(FREE, CONTACT)]
    assert found.lam[-1, 0] == pytest.approx(9.81, rel=1e-9)
    assert abs(found.gap[-1, 0]) < 1e-9


@pytest.mark.parametrize(
    "parameters", [{}, {"a0": 1e6, "a1": 300.0}, {"a0": 400.0, "a1": 0.0}, {"a0": 25.0, "a1": 30.0}]
)
def test_linear_law_against_its_closed_form(parameters: dict[str, float]) -> None:
    case = ball("linear", t_end=2.0, **parameters)
    assert case.closed_form is not None
    for rtol, bound in ((1e-6, 1e-3), (1e-10, 1e-6)):
        found = run(case, rtol=rtol)
        truth = case.closed_form(found.t)
        assert np.abs(found.q - truth.q).max() < bound
        assert [(e.before, e.after) for e in found.events] == [(e.before, e.after) for e in truth.events]
    times = np.array([[e.t for e in found.events], [e.t for e in truth.events]])
    assert np.abs(times[0] - times[1]).max() < 1e-7


@pytest.mark.parametrize("method", ["Adams", "BDF"])
def test_both_methods_and_both_algebras_agree(method: str) -> None:
    case = ball(t_end=1.0)
    want = run(case, rtol=1e-11)
    got = run(case, rtol=1e-9, method=method, algebra="kkt")
    assert [e.t for e in got.events] == pytest.approx([e.t for e in want.events], abs=1e-6)


def test_elastic_law_makes_its_energy_at_every_bounce() -> None:
    found = run(ball("elastic"), rtol=1e-12)
    gap = closed_forms.elastic_separation_gap(100.0, 1e6, 9.81)
    gain = closed_forms.contact_work(1.0, 9.81, 100.0, 0.0, 1e6, 0.0, gap, 0.0)
    exits = [i for i in range(1, len(found.t)) if found.mode[i - 1, 0] == CONTACT and found.mode[i, 0] == FREE]
    assert len(exits) == 5
    np.testing.assert_allclose(found.gap[exits, 0], gap, rtol=1e-8)
    np.testing.assert_allclose(found.total_energy[exits], 9.81 + gain * np.arange(1, 6), rtol=1e-9)


def test_a_dip_inside_one_step_is_found() -> None:
    # Thrown against a ceiling: the closest approach is a minimum of the gap, half a second from either end.
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -9.81])
    joint = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "height")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.05), pin.SE3.Identity())
    law = cases.Law(a0=np.array([1e4]), a1=np.array([0.0]), a2=np.array([0.0]), unilateral=np.array([True]))
    apex = 0.5 * 9.81 * 0.5**2
    for clearance in (-1e-9, 1e-9):
        rows = PinRows(
            model,
            jacobian=lambda q: np.array([[-1.0]]),
            heights=lambda q, c=clearance: apex + c - q,
            drift=lambda q, v: np.zeros(1),
            law=law,
        )
        flow = Flow(LevelMachine(rows), Log(), 1e-12, np.full(2, 1e-14), "Adams", 10_000)
        flow.run(np.zeros(1), np.array([9.81 * 0.5]), 1.0)
        assert flow.outcome is Outcome.FINISHED
        touched = [e for e in flow.log.events if e.after == CONTACT]
        assert len(touched) == (clearance < 0)
        assert all(abs(e.t - 0.5 + np.sqrt(2e-9 / 9.81)) < 1e-6 for e in touched)


RAIL = """<mujoco><worldbody>
<geom type="capsule" size="0.1 0.3" euler="0 90 0" condim="1" solref="-1e4 -20"/>
<body><freejoint/><geom type="sphere" size="0.1" mass="1" condim="1" solref="-1e4 -20"/></body>
</worldbody></mujoco>"""


@pytest.mark.slow
def test_what_flies_freely_past_a_shape_touches_it_where_its_parabola_does(tmp_path: Path) -> None:
    # Nothing bends a parabola: a step of the integrator is as long as the flight, up, down past the rail and beyond.
    path, rng, touched = tmp_path / "rail.xml", np.random.default_rng(18), 0
    path.write_text(RAIL)
    case = cases.load(str(path))
    fall = np.array([0.0, 0.0, -9.81])
    for _ in range(5):
        place, there = rng.uniform((-0.2, -1.0, -0.5), (0.2, 1.0, 0.5)), rng.uniform(-0.22, 0.22, 3)
        near = rng.uniform(0.2, 0.8)
        speed = (there - place) / near - 0.5 * near * fall
        t = np.linspace(0.0, near + 0.5, 10_001)[:, None]
        way = place + speed * t + 0.5 * fall * t**2
        gap = np.linalg.norm(way - np.clip(way[:, :1], -0.3, 0.3) * np.eye(3)[0], axis=1) - 0.2
        if gap[0] < 0.05 or abs(gap.min()) < 1e-3:
            continue
        below = np.flatnonzero(gap < 0.0)
        q0, v0 = np.array([*place, 1.0, 0.0, 0.0, 0.0]), np.array([*speed, 0.0, 0.0, 0.0])
        found = run(replace(case, q0=q0, v0=v0, t_end=float(t[-1, 0])))
        first = [e.t for e in found.events][:1]
        assert len(first) == bool(len(below)), (place, speed)
        assert not first or t[below[0] - 1, 0] <= first[0] <= t[below[0], 0]
        touched += len(first)
    assert touched > 2


@pytest.mark.parametrize("a1", [0.0, 20.0, 100.0, 150.0])
def test_an_impulse_has_the_restitution_of_the_law(a1: float) -> None:
    case = ball("linear", a1=a1, t_end=0.6)
    e = closed_forms.restitution(closed_forms.damping_ratio(1e4, a1))
    found = run(case, "impulse")
    k = int(np.flatnonzero(np.diff(found.t) == 0.0)[0])
    assert found.t[k] == pytest.approx(np.sqrt(2 / 9.81), rel=1e-9)
    assert found.v[k + 1, 0] == pytest.approx(-e * found.v[k, 0], rel=1e-12)
    assert [(f.before, f.after) for f in found.events] == [(FREE, COLLISION), (COLLISION, FREE)]


@pytest.mark.parametrize("factor", [0.999, 1.001])
def test_an_impulse_captures_below_the_threshold_speed(factor: float) -> None:
    speed = factor * closed_forms.threshold_speed(1e4, 20.0, 9.81)
    found = run(ball("linear", height=0.0, speed=speed, t_end=1e-3), "impulse")
    assert found.events[-1].after == (CONTACT if factor < 1 else FREE)
    assert found.lam[-1, 0] == pytest.approx(9.81 if factor < 1 else 0.0)


@pytest.mark.parametrize("seed", range(8))
def test_several_rows_are_struck_each_with_its_own_restitution(seed: int) -> None:
    draw = np.random.default_rng(seed)
    case = cases.load("newtons_cradle", variant="sliders")
    rows = engines.load("pinocchio").prepare(case, "impulse").scene.rows
    n = len(case.q0)
    struck = sorted(draw.choice(rows.nc, draw.integers(1, rows.nc + 1), replace=False).tolist())
    v, e = draw.normal(size=n), draw.choice([0.0, 0.3, 0.8], len(struck))
    after, p = rows.strike(np.zeros(n), v, struck, e.tolist())
    H = rows.jacobian(np.zeros(n))[struck]
    np.testing.assert_allclose(H @ after, -e * (H @ v), atol=1e-12)
    np.testing.assert_allclose(rows.delassus(np.zeros(n))[np.ix_(struck, struck)] @ p, H @ (after - v), atol=1e-12)


@pytest.mark.parametrize(("h", "v", "after"), [(-1e-3, 1.0, BALLISTIC), (1e-9, 1.0, FREE), (-1e-3, -1.0, CONTACT)])
def test_a_contact_that_pulls_is_released_wherever_it_is(h: float, v: float, after: Mode) -> None:
    rows = engines.load("pinocchio").prepare(ball("linear")).scene.rows
    settled = LevelMachine(rows).settle(np.array([h]), np.array([v]), (int(CONTACT),))
    assert settled.modes == (after,)


def test_impulses_lose_energy_only_by_restitution() -> None:
    found = run(ball("linear", a1=0.0), "impulse", rtol=1e-12)
    assert len(found.events) >= 8
    np.testing.assert_allclose(found.total_energy, 9.81, rtol=1e-9)


def test_time_stepping_is_of_first_order() -> None:
    case = ball("linear", t_end=0.9)
    steps = 1e-3 / np.sqrt(2) ** np.arange(0, 8)
    truth = run(case, "impulse", rtol=1e-12).q[-1, 0]
    found = [run(case, "admm", dt=float(dt)) for dt in steps]
    assert all(f.outcome.ok and f.counts["unsolved"] == 0 for f in found)
    errors = np.array([abs(f.q[-1, 0] - truth) for f in found])
    assert (errors < 4 * steps).all()  # an impact is taken up to half a step off: v (1 + e) dt / 2 or less
    assert np.median(errors[-4:]) < np.median(errors[:4])


def test_time_stepping_follows_a_bilateral_law() -> None:
    case = ball("bilateral", a0=100.0, a1=4.0, a2=0.0, t_end=1.0)
    assert case.closed_form is not None
    errors = []
    for dt in (4e-3, 2e-3, 1e-3):
        found = run(case, "admm", dt=dt)
        errors.append(float(np.abs(found.q - case.closed_form(found.t).q).max()))
    order = np.polyfit(np.log((4.0, 2.0, 1.0)), np.log(errors), 1)[0]
    assert 0.85 < order < 1.15


def test_the_free_parts_of_a_scene_are_not_solved_for() -> None:
    case = ball("listing", height=1e3, t_end=1.0)
    found = run(case)
    assert found.events == ()
    assert not found.lam.any()


@pytest.mark.parametrize("factor", [np.nan, 1e300])
def test_failures_are_outcomes_and_print_nothing(factor: float, capfd: pytest.CaptureFixture[str]) -> None:
    prepared = engines.load("pinocchio").prepare(ball(), "law", max_steps=2000)
    prepared.scene.rows.tau[:] = factor
    found = prepared.run()
    assert found.outcome in (Outcome.NOT_FINITE, Outcome.STEP_TOO_SMALL, Outcome.DIVERGED)
    assert (found.outcome is Outcome.NOT_FINITE) or not np.isnan(factor)
    assert "t = " in found.message
    assert capfd.readouterr() == ("", "")


def test_start_below_the_surface_going_up_is_not_struck() -> None:
    found = run(ball("linear", height=-0.01, speed=-1.0, gravity=0.0, t_end=0.1), "impulse")
    assert found.outcome.ok
    assert found.q[-1, 0] == pytest.approx(0.09)


@pytest.mark.parametrize("seed", range(24))
def test_what_rows_accelerate_by_themselves_is_how_their_rates_change(seed: int) -> None:
    """H' v of loops, welds, couplings, bounds and distances, off their surfaces, against differences of H v."""
    scene = random_scene(seed).replace(pairs=())
    q, v, _ = random_state(scene, np.random.default_rng(seed))
    prepared = engines.load("pinocchio").prepare(cases.from_scene(scene, q0=q, v0=v, t_end=0.1)).scene
    rows, (place, speed), h = prepared.rows, prepared.start, 1e-4
    if not rows.nc:
        return
    there, here = (rows.jacobian(pin.integrate(rows.model, place, t * speed)) @ speed for t in (h, -h))
    far, near = (rows.jacobian(pin.integrate(rows.model, place, t * speed)) @ speed for t in (2.0 * h, -2.0 * h))
    wanted = (8.0 * (there - here) - (far - near)) / (12.0 * h)
    size = 1.0 + np.abs(wanted).max()
    assert np.abs(rows.drift(place, speed) - wanted).max() < 1e-6 * size
