"""Metrics of friction: nought of what follows the law, and of what does not exactly what was done to it."""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from friction_scenes import G, box_on_floor, point, sphere_on_floor, stack

from crossbody import cases, engines
from crossbody.cases import Case, Event, Mode, Tier, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint
from crossbody.reference import simulate
from crossbody.reports import metrics
from crossbody.reports.judging.controls import unseen
from crossbody.reports.judging.judge_controls import blind
from crossbody.reports.judging.planted import faults
from crossbody.reports.judging.verdict import Word
from crossbody.reports.measuring import friction, slow_slips
from crossbody.reports.measuring.alignment import clock
from crossbody.reports.measuring.friction import rubbing
from crossbody.reports.measuring.impulse import cumulative
from crossbody.reports.measuring.slow_slips import firm_until
from crossbody.reports.measuring.truth import Truth, before, from_run
from crossbody.reports.metrics import law_residual

NAMES = (
    "cone_violation", "creep_speed", "friction_angle", "friction_impulse", "friction_power", "friction_work",
    "law_residual", "slip_times", "stick_times",
)  # fmt: skip
SPEED, MU, RADIUS = 2.0, 0.2, 0.1
STOP = 2.0 * SPEED / (7.0 * MU * G)


def ball(**given: Any) -> Case:
    """Return a sphere that slides, then rolls."""
    scene = sphere_on_floor(MU, RADIUS, **given)
    return case_of(scene, q0=[0, 0, RADIUS, 1, 0, 0, 0], v0=[SPEED, 0, 0, 0, 0, 0], t_end=0.5)


CASE = ball()
RUN = engines.load("reference").prepare(CASE, "compiled", samples=np.linspace(0.0, 0.5, 501)).run()
TRUTH = from_run(RUN, Tier.A, "itself")


def measured(name: str, run: Trajectory = RUN, case: Case = CASE, truth: Truth = TRUTH) -> float | None:
    """Return one metric."""
    return metrics.load(name).measure(truth, run, case)


@pytest.mark.parametrize("times", [0.97, 1.0, 1.04])
def test_where_a_slip_stops_the_clock_is_the_truths(times: float) -> None:
    """If it is asked for what lam jumps at, and only then."""
    own = engines.load("reference").prepare(CASE, "compiled").run()
    truth = from_run(own, Tier.A, "itself")
    late = replace(own, t=times * own.t, events=tuple(replace(event, t=times * event.t) for event in own.events))
    (mine,), (theirs,) = ([e.t for e in run.events if e.after == Mode.STICK] for run in (late, own))
    asked, plain = (clock(truth, late, CASE, releases)[late.t == mine] for releases in (True, False))
    assert asked == pytest.approx(theirs, abs=1e-12)
    assert plain == pytest.approx(mine, abs=1e-12)


@pytest.mark.parametrize("which", [0, 1])
def test_a_pair_slides_where_any_of_its_places_does(which: int) -> None:
    """As what turns about a corner; how far is told by the place that slips most."""
    t, slip, none = np.linspace(0.0, 1.0, 101), np.zeros((101, 2, 2)), np.zeros((101, 2))
    slip[20:60, which, 0] = 1e-3
    events = [(0.0, 0, Mode.STICK), (0.0, 1, Mode.STICK), (0.2, which, Mode.SLIP), (0.6, which, Mode.STICK)]
    run = Trajectory(
        t=t, q=none, v=none, gap=none, lam=none, energy=none, mode=np.full((101, 2), int(Mode.STICK), np.int8),
        events=tuple(Event(t=at, contact=i, before=Mode.FREE, after=after) for at, i, after in events), steps=100,
    )  # fmt: skip
    rubs = friction.Rubbing(
        rows=np.arange(2), pair=np.zeros(2, dtype=np.intp), mu=np.ones(2), slip=slip, force=0.0 * slip,
        normal=np.ones((101, 2)), dry=np.zeros(2, dtype=bool),
    )  # fmt: skip
    assert list(friction.changes(run, rubs)) == [(0, 0.2, True), (0, 0.6, False)]
    mode = np.array(run.mode)
    mode[20:60, which] = Mode.FREE  # what moves in the air has not slid
    assert list(friction.changes(replace(run, mode=mode), rubs)) == []


def pushed(change: Any) -> Trajectory:
    """Return the run whose friction (n, 2) is another one."""
    lam = np.array(RUN.lam)
    lam[:, 1:] = change(lam[:, 1:])
    return replace(RUN, lam=lam)


def turned(angle: float) -> Any:
    """Return what turns forces about the normal, rad."""
    c, s = np.cos(angle), np.sin(angle)
    return lambda force: force @ np.array([[c, s], [-s, c]])


@pytest.mark.parametrize("name", NAMES)
def test_the_reference_has_none(name: str) -> None:
    value = measured(name)
    assert value is None if name == "slip_times" else abs(value or 0.0) < 1e-9


@pytest.mark.parametrize("name", NAMES)
def test_what_has_no_friction_has_no_such_number(name: str) -> None:
    case = cases.load("bouncing_ball", "linear", t_end=0.6)
    run = engines.load("reference").prepare(case, "compiled").run()
    value = measured(name, run, case, from_run(run, Tier.A, "itself"))
    assert value is not None if name == "law_residual" else value is None


@pytest.mark.parametrize("factor", [1.5, 0.5])
def test_friction_beyond_its_bound_or_below_it_is_seen(factor: float) -> None:
    run = pushed(lambda force: factor * force)
    assert measured("cone_violation", run) == pytest.approx(max(factor - 1.0, 0.0), abs=1e-9)
    assert measured("law_residual", run) == pytest.approx(MU * abs(factor - 1.0), rel=1e-3)
    assert measured("friction_impulse", run) == pytest.approx(abs(factor - 1.0) * MU * G * STOP, rel=1e-2)
    lost = 0.5 * SPEED**2 * 2.0 / 7.0
    assert measured("friction_work", run) == pytest.approx(abs(factor - 1.0) * lost, rel=1e-2)


def test_friction_is_held_against_its_own_bound_where_that_is_small() -> None:
    """What a contact could bear at another time, or another contact bears, excuses nothing."""
    lam, k = np.array(RUN.lam), int(np.flatnonzero(RUN.t > 0.5 * STOP)[0])
    lam[k, 0] *= 0.25
    assert measured("cone_violation", replace(RUN, lam=lam)) == pytest.approx(0.75, rel=1e-6)


@pytest.mark.parametrize("row", [1, 2])
def test_rows_of_friction_have_the_mode_of_their_contact(row: int) -> None:
    mode = np.array(RUN.mode)
    assert measured("mode_residual") == 0.0
    mode[[7, 90], row] = Mode.FREE
    assert measured("mode_residual", replace(RUN, mode=mode)) == 2.0


@pytest.mark.parametrize("angle", [0.1, -0.4, np.pi])
def test_friction_that_is_not_against_the_slip_is_seen(angle: float) -> None:
    run = pushed(turned(angle))
    assert measured("friction_angle", run) == pytest.approx(abs(angle), abs=1e-6)
    assert measured("cone_violation", run) == pytest.approx(0.0, abs=1e-9)
    power = MU * G * SPEED if angle == np.pi else 0.0
    assert measured("friction_power", run) == pytest.approx(power, rel=1e-6, abs=1e-9)


def test_creep_is_the_slip_of_what_holds() -> None:
    slow = replace(RUN, v=RUN.v + np.array([3e-3, 4e-3, 0, 0, 0, 0]))
    assert measured("creep_speed", slow) == pytest.approx(5e-3, rel=1e-9)
    slides = RUN.t < 0.2
    kept = {name: getattr(RUN, name)[slides] for name in ("t", "q", "v", "gap", "lam", "energy", "mode")}
    early = replace(RUN, ledger=None, **kept)
    assert measured("creep_speed", early) is None


@pytest.mark.parametrize(("low", "high", "creep"), [(1e-3, 6e-3, 5e-3), (3e-3, 4e-3, 3e-3), (-2e-3, 2e-3, 4e-3)])
def test_the_fastest_creep_of_two_contacts_counts(low: float, high: float, creep: float) -> None:
    places = [0, 0, 0.1, 1, 0, 0, 0, 0, 0, 0.3, 1, 0, 0, 0]
    case = case_of(stack(0.5, 0.5), q0=places, t_end=0.1)
    run = engines.load("reference").prepare(case, "compiled").run()
    v = run.v.copy()
    v[-1, 0], v[-1, 6] = low, high
    assert (run.mode[-1] == Mode.STICK).sum() >= 2
    crept = replace(run, v=v)
    assert measured("creep_speed", crept, case, from_run(run, Tier.A, "itself")) == pytest.approx(creep, rel=1e-6)


def test_an_instant_that_is_late_is_seen_and_its_jump_is_not() -> None:
    late = 3e-3
    rows = {name: getattr(RUN, name) for name in ("q", "v", "gap", "lam", "energy", "mode")}
    t = np.where(RUN.t >= STOP, np.maximum(RUN.t, STOP + late), RUN.t * (STOP + late) / STOP)
    events = tuple(replace(e, t=e.t + late) if e.t > 0.0 else e for e in RUN.events)
    run = replace(RUN, t=t, events=events, **rows)
    assert measured("stick_times", run) == pytest.approx(late, rel=1e-9)
    assert measured("friction_impulse", run) == pytest.approx(MU * G * late, rel=1e-2)


def test_a_pair_slides_while_a_place_of_it_does() -> None:
    """Corners that change one after the other are one change of their pair."""
    scene = box_on_floor(0.3)
    case = case_of(scene, q0=[0, 0, 0.1, 1, 0, 0, 0], v0=[1, 0, 0, 0, 0, 0], t_end=0.6)
    run = engines.load("reference").prepare(case, "compiled").run()
    truth = from_run(run, Tier.A, "itself")
    held = [e for e in run.events if e.t > 0.0]
    assert len(held) == 4
    apart = tuple(e for e in run.events if e.t == 0.0)
    apart += tuple(replace(e, t=e.t + 1e-3 * k) for k, e in enumerate(held))
    assert measured("stick_times", replace(run, events=apart), case, truth) == pytest.approx(3e-3, rel=1e-9)
    again = replace(run, events=(*apart, Event(t=0.5, contact=0, before=Mode.STICK, after=Mode.SLIP)))
    for speed, count in ((1e-2, 1), (1e-5, 0)):  # over .1 s: 1 mm, and as far as positions are not known
        moved = again.v + np.outer(again.t >= 0.5, [speed, 0, 0, 0, 0, 0])
        found = friction.turned(replace(again, v=moved), case)
        assert sum(slides for _, _, slides in found) == count


def test_spheres_and_turned_planes_are_measured_alike() -> None:
    found: list[Floats] = []
    for turn in (0.0, 0.9):
        case = ball(turn=turn)
        run = engines.load("reference").prepare(case, "compiled", samples=np.linspace(0.0, 0.5, 51)).run()
        values = [measured(name, run, case, from_run(run, Tier.A, "itself")) or 0.0 for name in NAMES]
        found.append(np.abs(values))
    assert max(map(np.max, found)) < 1e-9


def test_places_of_one_pair_are_one_beside_pairs_without_friction() -> None:
    """A box that slides on a floor without friction and carries one that rubs: eight corners, one pair."""
    case = case_of(stack(0.0, 0.4), q0=[0, 0, 0.1, 1, 0, 0, 0, 0, 0, 0.3, 1, 0, 0, 0], t_end=0.1)
    run = engines.load("reference").prepare(case, "compiled").run()
    found = rubbing(run, case)
    assert found is not None
    assert len(found.pair) == len(found.rows) > 1
    assert len(set(found.pair.tolist())) == 1


@pytest.mark.parametrize("seed", range(10))
def test_a_pair_that_comes_off_goes_on_with_what_it_did_last(seed: int) -> None:
    """A place at 1 m/s that is in modes at random: it changes where it slides or holds as it did not before."""
    rng = np.random.default_rng(seed)
    modes = [Mode.FREE, *rng.choice([Mode.FREE, Mode.STICK, Mode.SLIP], 12).tolist()]
    events = [Event(t=0.04 * k, contact=0, before=Mode(a), after=Mode(b)) for k, (a, b) in enumerate(pairwise(modes))]
    touches = [(event.t, event.after == Mode.SLIP) for event in events if event.after != Mode.FREE]
    moves = replace(RUN, v=np.tile([1.0, 0, 0, 0, 0, 0], (len(RUN.t), 1)), events=tuple(events))
    wanted = [(0, t, slides) for (_, did), (t, slides) in pairwise(touches) if did != slides]
    assert friction.turned(moves, CASE) == tuple(wanted)


@pytest.mark.parametrize("seed", range(5))
def test_what_brings_a_change_about_is_the_fastest_slip_or_the_nearest_bound(seed: int) -> None:
    """Of a box on its corners, which moves and turns at random, beside a joint with dry friction: alike in both."""
    rng, half = np.random.default_rng(seed), (0.2, 0.15, 0.1)
    scene, guide = box_on_floor(MU, half=half), Joint(name="x", body="rod", type="slide", axis=(1, 0, 0))
    scene = scene.replace(
        bodies=(*scene.bodies, Body(name="rod", mass=1.0)),
        joints=(*scene.joints, replace(guide, friction_loss=2.0)),
        gravity=(0.0, 0.0, 0.0),
    )
    case = case_of(scene, q0=[0, 0, half[2], 1, 0, 0, 0, 0], t_end=0.1)
    v = np.array([*rng.normal(size=2), 0, 0, 0, *rng.normal(size=2)])
    run = engines.load("reference").prepare(case, "compiled").run()
    first = {name: getattr(run, name)[:1] for name in ("t", "q", "gap", "energy")}
    lam, mode = rng.uniform(0.5, 1.0, (1, run.lam.shape[1])), np.full((1, run.mode.shape[1]), Mode.STICK)
    one = replace(run, **first, v=v[None], lam=lam, mode=mode)
    found = rubbing(one, case)
    assert found is not None
    corners = np.array(list(product(*[(-1.0, 1.0)] * 3)))[:, :2] * half[:2]
    speeds = np.hypot(v[0] - v[5] * corners[:, 1], v[1] + v[5] * corners[:, 0])
    assert np.sort(np.linalg.norm(found.slip[0], axis=-1)) == pytest.approx(np.sort([*speeds, abs(v[6])]))
    below = np.where(found.dry, 2.0, MU * one.lam[0, found.rows]) - np.linalg.norm(found.force[0], axis=-1)
    for pair in (0, 1):
        own = found.pair == pair
        slip = [speeds.max(), abs(v[6])][pair]
        assert friction.guard(one, case, pair, slides=False)[0](one) == pytest.approx(slip)
        assert friction.guard(one, case, pair, slides=True)[0](one) == pytest.approx(below[own].min())


@pytest.mark.parametrize("drift", [-0.7, 0.0, 0.3])
def test_slip_is_counted_from_the_surface(drift: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """A point on a belt: it slips as fast as it is less the belt."""
    system = point(0.2, 0.3, drift=drift)
    run = simulate(system, [0.0, 0.0], [1.0, 0.0], 0.3)
    monkeypatch.setattr(friction, "equations", lambda case: system)
    found = rubbing(run, replace(CASE, scene=None))
    assert found is not None
    np.testing.assert_allclose(found.slip[:, 0, 0], run.v[:, 0] - drift, atol=1e-14)
    np.testing.assert_array_equal(found.mu, 0.2)


@pytest.mark.parametrize("drift", [-0.1, 0.1])
def test_what_sticks_to_a_belt_follows_the_law_over_the_belt(drift: float, monkeypatch: pytest.MonkeyPatch) -> None:
    system = point(0.3, 0.0, spring=[100.0, 0.0], drift=drift)
    run = simulate(system, [0.0, 0.0], [0.9 * drift, 0.0], 0.2, samples=np.linspace(0.0, 0.2, 101))
    assert (run.mode[:, 0] == Mode.STICK).any()
    law = replace(CASE.law, a0=system.a0, a1=system.a1, a2=np.zeros(2), b0=np.zeros(2), b1=np.zeros(2),
                  unilateral=np.ones(2, dtype=np.bool_), touches=np.array([True, False]))  # fmt: skip
    for module in (friction, law_residual):
        monkeypatch.setattr(module, "equations", lambda case: system)
    case = replace(CASE, scene=None, law=law, inputs=None, contacts=("normal", "along"))
    assert measured("law_residual", run, case, from_run(run, Tier.A, "itself")) < 1e-9


def walker(name: str, folder: Path, t_end: float) -> Case:
    """Return a robot that walks in a plane under random controls."""
    found = find_spec("gymnasium")
    if found is None or found.origin is None:
        pytest.skip("gymnasium is not installed")
    path = Path(found.origin).parent / "envs" / "mujoco" / "assets" / f"{name}.xml"
    times = 0.008 * np.arange(40)
    table = np.column_stack([times, np.random.default_rng(0).uniform(-1.0, 1.0, (125, 6))[:40]])
    names = ",".join(["t", *(actuator.name for actuator in cases.load(str(path)).scene.actuators)])
    np.savetxt(folder / "u.csv", table, delimiter=",", header=names, comments="", fmt="%.17g")
    return cases.load(str(path), ctrl=str(folder / "u.csv"), t_end=t_end, friction=1)


def test_an_end_of_a_foot_that_holds_while_the_other_slides_is_no_instant(tmp_path: Path) -> None:
    """A pair holds when all its places do: a control that moves one of them in time is not one that is to be seen."""
    case = walker("walker2d", tmp_path, t_end=0.25)
    run = engines.load("reference").prepare(case, "compiled", samples=np.linspace(0.0, 0.25, 5001), rtol=1e-10).run()
    last = [e for e in run.events if (e.before, e.after) == (Mode.SLIP, Mode.STICK)][-1]
    mates = [k for k, name in enumerate(case.contacts) if name.startswith("floor:foot_left") and k != last.contact]
    assert (run.mode[int(np.searchsorted(run.t, last.t)), mates] == Mode.SLIP).any()
    assert list(unseen(case, from_run(run, Tier.A, "itself"), lambda name, value: True)) == []


def test_a_foot_that_rocks_and_lets_go_at_its_bound_is_measured_by_its_law(tmp_path: Path) -> None:
    """Both ends of a foot stick, which no forces keep in place at once; with mu = 1.9 one lets go that would jam."""
    case = walker("walker2d_v5", tmp_path, t_end=0.3)
    run = engines.load("reference").prepare(case, "compiled").run()
    assert any(e.before == Mode.STICK and e.after == Mode.BALLISTIC for e in run.events)
    truth = from_run(run, Tier.D, "itself")
    for name in ("event_gap", "law_residual", "cone_violation"):
        value = measured(name, run, case, truth)
        assert value is not None
        assert value < 1e-9


@pytest.mark.parametrize("name", ["lam_impulse", "lam_impulse_path"])
def test_where_a_slip_stops_friction_may_have_any_direction(name: str) -> None:
    """Slips that die out turn within nanoseconds: a sample there stood for half a step, of tens of newtons."""
    own = engines.load("reference").prepare(CASE, "compiled").run()
    truth = from_run(own, Tier.A, "itself")
    (stop,) = (event.t for event in own.events if event.after == Mode.STICK)
    before, lam = int(np.searchsorted(own.t, stop)), own.lam.copy()
    assert own.t[before] == own.t[before + 1] == stop
    lam[before, 1:] *= -1.0
    assert (measured(name, replace(own, lam=lam), truth=truth) or 0.0) < 1e-9
    lam[before - 1, 1:] *= -1.0
    assert (measured(name, replace(own, lam=lam), truth=truth) or 0.0) > 1e-3


@pytest.mark.parametrize("name", ["complementarity", "cone_violation", "friction_angle", "law_residual"])
def test_what_contacts_bear_where_a_slip_stops_is_not_looked_at(name: str) -> None:
    """A sample later or earlier is."""
    own = engines.load("reference").prepare(CASE, "compiled").run()
    (stop,) = (event.t for event in own.events if event.after == Mode.STICK)
    truth, at, normal = from_run(own, Tier.A, "itself"), int(np.searchsorted(own.t, stop)), CASE.law.touches
    v = own.v.copy()
    v[at, 0] += 1e-3  # as what a loose tolerance leaves of a slip that turns
    own = replace(own, v=v)
    for i, seen in ((at, False), (at - 1, True), (at + 1, name != "friction_angle")):
        lam = own.lam.copy()
        lam[i] = np.where(normal, -0.5, -2.0) * (lam[i] if name == "complementarity" or i <= at else lam[at - 1])
        value = measured(name, replace(own, lam=lam), truth=truth) or 0.0
        assert (value > 1e-3) == seen, (i - at, value)


def released(lam: float, ends: bool) -> Trajectory:
    """Return a motion whose row bears 1 N, and less from 0.5 s on, and lets go there or not."""
    t = np.linspace(0.0, 1.0, 101)
    none, late = np.zeros((101, 1)), (t >= 0.5)[:, None]
    events = [(0.1, Mode.FREE, Mode.CONTACT), *([(0.5, Mode.CONTACT, Mode.BALLISTIC)] if ends else [])]
    mode = np.where(late & ends, Mode.BALLISTIC, np.where(t[:, None] < 0.1, Mode.FREE, Mode.CONTACT))
    return Trajectory(
        t=t, q=none, v=none, gap=none - 1e-3, lam=np.where(late, 0.0 if ends else lam, 1.0), energy=np.zeros((101, 2)),
        mode=mode.astype(np.int8), steps=100,
        events=tuple(Event(t=at, contact=0, before=before, after=after) for at, before, after in events),
    )  # fmt: skip


@pytest.mark.parametrize(("lam", "counts"), [(0.0, 0.0), (0.9e-6, 0.0), (1.1e-6, 1.0), (0.5, 1.0)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_contact_that_bears_less_than_is_known_may_end_or_not(lam: float, counts: float, sign: float) -> None:
    """In either of the two motions; one that bears more counts."""
    case = cases.load("bouncing_ball")
    run, truth = (released(lam, ends) for ends in (sign > 0.0, sign < 0.0))
    assert measured("release_count", run, case, from_run(truth, Tier.A, "made up")) == sign * counts


@pytest.mark.parametrize(("speed", "seen"), [(0.5e-5, True), (2e-5, False)])
def test_a_hold_at_the_end_of_slides_too_slow_to_be_told_is_none(speed: float, seen: bool) -> None:
    """A motion that has it is measured by the others; where the truth slides faster it has another order."""
    own = engines.load("reference").prepare(ball(), "compiled", samples=np.linspace(0.0, 0.5, 501)).run()
    (stop,) = (e for e in own.events if e.after == Mode.STICK)
    behind = own.t >= 0.45
    again = [Event(t=0.4, contact=stop.contact, before=Mode.STICK, after=Mode.SLIP)]
    ended = [Event(t=0.45, contact=stop.contact, before=Mode.SLIP, after=Mode.STICK)]
    slides, v = np.array(own.mode), np.array(own.v)
    slides[(own.t >= 0.4) & (own.mode == Mode.STICK)[:, 0], 0] = Mode.SLIP
    v[own.t >= 0.4, 0] += 0.1 * SPEED
    v[behind, 0] = own.v[behind, 0] + speed * SPEED
    truth = replace(own, v=v, mode=slides, events=(*own.events, *again))
    held = np.array(slides)
    held[behind] = own.mode[behind]
    run = replace(truth, mode=held, events=(*truth.events, *ended))
    value = measured("stick_times", run, truth=from_run(truth, Tier.A, "made up"))
    assert (value is not None) == seen
    assert value is None or value < 1e-12


@pytest.mark.parametrize("known", [1e-6, 1e-7, 1e-9])
@pytest.mark.parametrize("rtol", [1e-9, 1e-11])
def test_friction_of_slow_slips_is_told_as_far_as_their_direction_is_known(
    known: float, rtol: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a ball whose slip dies out at a constant rate the integral of mu m g d/s is known."""
    open_ = 1e-8
    monkeypatch.setattr(slow_slips, "OPEN", open_)
    slow, lost = 1e-5 * SPEED, 3.5 * MU * G  # what is slow, and how fast it is lost
    near = STOP - slow / lost * np.geomspace(1e-8, 1.0, 20001)[::-1]
    at = np.unique([0.0, near[0] - 1e-12, *near, 0.5])
    own = engines.load("reference").prepare(CASE, "compiled", rtol=1e-12, samples=at).run()
    truth, whole = from_run(own, Tier.A, "itself"), float(np.max(np.abs(cumulative(own))))
    apart = known * rtol / 1e-9
    run = before(own, near[-1])
    found = firm_until(truth, replace(run, v=run.v + apart * np.array([0, 1.0, 0, 0, 0, 0])), rtol, CASE)
    bound = MU * float(own.lam[1, 0])
    left = open_ * whole / bound * lost / known  # ln of how much slower than what is slow it is then
    slowest = slow * np.exp(-left)
    if known == 1e-9:  # until it is none in any direction
        assert found > STOP - 1e-6 / lost
    else:
        assert slowest > 10.0 * known
        assert found == pytest.approx(STOP - slowest / lost, abs=0.02 * slowest / lost)


def test_impulses_are_compared_up_to_where_slips_tell_them() -> None:
    """A fault before that is seen, one behind it is not."""
    own = engines.load("reference").prepare(CASE, "compiled", samples=np.linspace(0.0, 0.5, 501)).run()
    truth = replace(from_run(own, Tier.A, "itself"), firm=0.3)
    for t, seen in ((0.2, True), (0.35, False)):
        more = replace(own, lam=np.where((own.t > t)[:, None], 1.01, 1.0) * own.lam)
        value = measured("lam_impulse_path", more, truth=truth) or 0.0
        assert (value > 1e-3) == seen


@pytest.mark.parametrize(("speed", "turns"), [(SPEED, True), (0.0, False)])
def test_a_row_says_where_no_friction_can_be_turned(speed: float, turns: bool) -> None:
    """As of a ball that lies still: else nobody knows that nothing was asked."""
    case = replace(CASE, v0=np.array([speed, 0.0, 0.0, 0.0, 0.0, 0.0]))
    run = engines.load("reference").prepare(case, "compiled", samples=np.linspace(0.0, 0.5, 501)).run()
    rows = [row for row in blind(case, from_run(run, Tier.A, "itself"), "") if row.metric == "friction_angle (control)"]
    assert [row.verdict for row in rows] == [Word.INFO] * (not turns)
    assert any("friction_angle" in fault.sees for fault in faults(case, run)) == turns


@pytest.mark.parametrize("seed", range(8))
def test_no_number_of_friction_asks_how_the_axes_of_a_floor_are_turned(seed: int) -> None:
    """What two rows of a plane bear is one force: whichever way they point, its error is as large."""
    draw = np.random.default_rng(seed)
    v0 = [*draw.uniform(-2.0, 2.0, 2), 0.0, *draw.uniform(-5.0, 5.0, 3)]
    angle = float(draw.uniform(-np.pi, np.pi))
    found = []
    for turn in (0.0, angle):
        scene = sphere_on_floor(MU, RADIUS, turn=turn)
        case = case_of(scene, q0=[0, 0, RADIUS, 1, 0, 0, 0], v0=v0, t_end=0.5)
        own = engines.load("reference").prepare(case, "compiled", samples=np.linspace(0.0, 0.5, 101)).run()
        rows = np.flatnonzero(~case.law.touches)
        # a force along the floor that the run has besides, by axes that do not turn
        more = np.random.default_rng(seed + 100).uniform(-1.0, 1.0, (len(own.t), 2))
        turned_ = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        lam = own.lam.copy()
        lam[:, rows] += more @ turned_.T
        run = replace(own, lam=lam)
        truth = from_run(own, Tier.A, "itself")
        names = (*NAMES, "lam_impulse", "lam_impulse_path", "mode_contradicted", "complementarity")
        found.append([measured(name, run, case, truth) for name in names])
    assert (found[0][3] or 0.0) > 1e-3  # friction_impulse
    for one, other in zip(*found, strict=True):
        assert (one is None) == (other is None)
        assert one is None or one == pytest.approx(other, rel=1e-8, abs=1e-9)
