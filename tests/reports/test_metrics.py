"""Every metric on motions whose answer is known beforehand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from resting import plate
from resting import run as run_to_the_end

from crossbody.cases import Case, Event, Ledger, Mode, Tier, Trajectory, load
from crossbody.cases.arrays import Floats
from crossbody.cases.contacts import contacts
from crossbody.reports import metrics
from crossbody.reports.judging.truth import agreement, truth_of
from crossbody.reports.measuring import scale
from crossbody.reports.measuring.alignment import clock
from crossbody.reports.measuring.equations import equations
from crossbody.reports.measuring.impulse import cumulated, cumulative
from crossbody.reports.measuring.modes import violated
from crossbody.reports.measuring.scale import RESTS
from crossbody.reports.measuring.truth import Truth, before, from_run, sample_times


@pytest.fixture(scope="module")
def case() -> Case:
    return load("bouncing_ball", "linear")


@pytest.fixture(scope="module")
def truth(case: Case) -> Truth:
    return truth_of(case)


def measure(name: str, truth: Truth, run: Trajectory, case: Case) -> float | None:
    return metrics.load(name).measure(truth, run, case)


ERRORS = [
    "energy_drift", "energy_integrator", "position", "lam_impulse", "lam_impulse_path", "event_times", "touch_count",
    "penetration_error", "restitution_error",
]  # fmt: skip


@pytest.mark.parametrize("name", ERRORS)
def test_the_truth_has_no_error(name: str, truth: Truth, case: Case) -> None:
    value = measure(name, truth, truth.trajectory, case)
    assert value is not None
    assert abs(value) < 1e-12


@pytest.mark.parametrize("name", metrics.names())
def test_every_metric_says_what_it_is(name: str, truth: Truth, case: Case) -> None:
    metric = metrics.load(name)
    assert metrics.summary(name).endswith((".", ")"))
    assert metric.UNIT in ("1", "s", "m", "m/s", "N", "J", "W", "N s", "rad", "1/s")
    value = metric.measure(truth, truth.trajectory, case)
    assert value is None or np.isfinite(value)


def shifted(run: Trajectory, by: float) -> Trajectory:
    """The same motion, later: what an engine does that finds every impact late."""
    events = tuple(replace(e, t=e.t + by) for e in run.events)
    return replace(run, t=np.concatenate([[0.0], run.t[1:] + by]), events=events)


def test_a_late_impact_is_an_error_of_time_not_of_position(truth: Truth, case: Case) -> None:
    late = shifted(truth.trajectory, 2e-3)
    assert measure("event_times", truth, late, case) == pytest.approx(2e-3, rel=1e-9)
    raw = np.abs(late.v - truth.at(np.clip(late.t, 0, case.t_end)).v).max()
    assert raw > 0.5, "a raw difference of velocities would say that all is lost"
    # It rests at the end, and has borne its weight for 2 ms less.
    assert measure("lam_impulse", truth, late, case) == pytest.approx(2e-3 / case.t_end, rel=1e-3)
    # The first arc is stretched from rest, where 2 ms matter little.
    assert measure("position", truth, late, case) < 2e-2


def test_clock_puts_every_touch_on_the_truths(truth: Truth, case: Case) -> None:
    late = shifted(truth.trajectory, 2e-3)
    mapped = clock(truth, late, case)
    for mine, theirs in zip(contacts(late), contacts(truth.trajectory), strict=True):
        assert mapped[late.t == mine.touch] == pytest.approx(theirs.touch, abs=1e-14)
    assert np.all(np.diff(mapped) >= 0)


def test_sources_of_a_truth_agree_in_their_events_too(truth: Truth, case: Case) -> None:
    """A late impact is laid on the other's before positions are compared."""
    found = agreement(truth, shifted(truth.trajectory, 2e-3), case)
    assert found["event_times"] == pytest.approx(2e-3, rel=1e-6)
    assert found["position"] < 2e-2


def test_scaled_force_scales_the_impulse_error(truth: Truth, case: Case) -> None:
    run = replace(truth.trajectory, lam=1.01 * truth.trajectory.lam)
    assert measure("lam_impulse", truth, run, case) == pytest.approx(0.01, rel=1e-9)
    assert measure("lam_impulse_path", truth, run, case) == pytest.approx(0.01, rel=1e-9)


def test_impulse_is_the_momentum_that_the_floor_gave(truth: Truth, case: Case) -> None:
    from crossbody.reports.measuring.impulse import cumulative

    given = cumulative(truth.trajectory)[-1, 0]
    momentum = truth.trajectory.v[-1, 0] - truth.trajectory.v[0, 0] + 9.81 * case.t_end
    assert given == pytest.approx(momentum, rel=1e-4)


def test_raised_position_is_a_position_error(truth: Truth, case: Case) -> None:
    run = replace(truth.trajectory, q=truth.trajectory.q + 1e-4)
    assert measure("position", truth, run, case) == pytest.approx(1e-4, rel=1e-9)


def test_energy_of_what_rests_is_measured_as_its_positions_are(truth: Truth) -> None:
    """The swing of a weight that sinks by a nanometre is that of one that sinks by a tenth of a millimetre."""
    run = truth.trajectory
    depth = np.linspace(0.0, 1.0, len(run.t))
    for moved in (1e-9, 1e-6, RESTS):
        energy = np.column_stack([0.0 * depth, -3.0 * moved * depth])
        sunk = replace(run, q=1.0 - moved * depth[:, None], energy=energy, lam=np.full_like(run.lam, 3.0))
        assert scale.energy(sunk) == pytest.approx(3.0 * RESTS, rel=1e-6)
    assert scale.energy(replace(sunk, q=run.q + depth[:, None])) == pytest.approx(3.0 * RESTS, rel=1e-6)
    still = replace(sunk, q=np.ones_like(run.q), energy=np.zeros_like(run.energy))
    assert scale.energy(still) == pytest.approx(3.0 * RESTS), "what rows carry, where not even rounding moves anything"


def test_unexplained_energy_belongs_to_the_integrator(truth: Truth, case: Case) -> None:
    energy = truth.trajectory.energy.copy()
    energy[len(energy) // 2 :, 0] += 0.05
    run = replace(truth.trajectory, energy=energy)
    size = max(truth.trajectory.energy[:, 0].max(), np.ptp(truth.trajectory.energy[:, 1]))
    assert measure("energy_integrator", truth, run, case) == pytest.approx(0.05 / size, rel=1e-9)
    assert measure("energy_drift", truth, run, case) == pytest.approx(0.05 / size, rel=1e-9)


def test_energy_made_by_the_law_is_the_gain_of_every_bounce() -> None:
    case = load("bouncing_ball", "linear", a0=400.0, a1=0.0)
    truth = truth_of(case)
    gain = next(c.expected for c in case.claims if c.metric == "energy_per_bounce")
    ended = [c for c in contacts(truth.trajectory) if np.isfinite(c.release)]
    size = truth.trajectory.energy[:, 0].max()
    assert measure("energy_law", truth, truth.trajectory, case) == pytest.approx(len(ended) * gain / size, rel=1e-9)
    assert measure("energy_per_bounce", truth, truth.trajectory, case) == pytest.approx(gain, rel=1e-10)
    assert measure("energy_integrator", truth, truth.trajectory, case) < 1e-12


@pytest.mark.parametrize("gap", [0.0, 0.4, 0.9])
def test_energy_of_switching_is_all_that_a_row_of_balls_gains_without_damping(gap: float) -> None:
    """Of constant mass and rows, once nothing pushes any more."""
    plain = load("newtons_cradle", "sliders", n=3, zeta=0.0)
    case = load(
        "newtons_cradle", "sliders", n=3, zeta=0.0, collisions="resolved", t_end=2.0 * plain.t_end,
        gap=gap * plain.number("speed") / np.sqrt(plain.number("a0")),
    )  # fmt: skip
    truth = truth_of(case)
    energy = truth.trajectory.total_energy
    gained = (energy[-1] - energy[0]) / truth.trajectory.energy[:, 0].max()
    assert (gained > 0.01) or gap == 0.0
    assert measure("energy_switching", truth, truth.trajectory, case) == pytest.approx(gained, abs=1e-7)
    assert measure("energy_switching_error", truth, truth.trajectory, case) == pytest.approx(0.0, abs=1e-7)


def test_without_a_ledger_nothing_is_said_of_it(truth: Truth, case: Case) -> None:
    run = replace(truth.trajectory, ledger=None)
    assert np.isnan(measure("energy_law", truth, run, case))
    assert np.isnan(measure("energy_integrator", truth, run, case))


def test_unknown_force_is_no_number(truth: Truth, case: Case) -> None:
    run = replace(truth.trajectory, lam=np.full_like(truth.trajectory.lam, np.nan))
    for name in ("lam_impulse", "lam_impulse_path", "complementarity"):
        assert np.isnan(measure(name, truth, run, case))


def test_a_pulling_contact_violates_complementarity(truth: Truth, case: Case) -> None:
    lam = truth.trajectory.lam.copy()
    lam[10] = -0.1 * lam.max()
    assert measure("complementarity", truth, replace(truth.trajectory, lam=lam), case) == pytest.approx(0.1)
    lam[10] = 0.2 * lam.max()
    assert truth.trajectory.gap[10, 0] > 0.5
    assert measure("complementarity", truth, replace(truth.trajectory, lam=lam), case) == pytest.approx(0.2)
    assert measure("complementarity", truth, truth.trajectory, case) < 1e-12


def test_missing_contact_is_counted(truth: Truth, case: Case) -> None:
    events = truth.trajectory.events
    kept = tuple(e for e in events if e.t != contacts(truth.trajectory)[-1].touch)
    assert measure("touch_count", truth, replace(truth.trajectory, events=kept), case) == -1.0


def test_one_impact_gives_the_closed_forms() -> None:
    case = load("bouncing_ball", "linear", gravity=0.0, speed=2.0, a1=60.0)
    truth = truth_of(case)
    assert len(case.claims) == 4
    for claim in case.claims:
        tolerance = 1e-4 if claim.metric == "penetration" else 1e-12
        value = measure(claim.metric, truth, truth.trajectory, case)
        assert value == pytest.approx(claim.expected, rel=tolerance), claim.metric


def test_contacts_of_a_measurement_are_read_from_the_sign_of_the_gap(truth: Truth, case: Case) -> None:
    times = np.linspace(0, 2.0, 20001)
    run = replace(truth.at(times), events=(), mode=np.full((len(times), 1), -1))
    found = contacts(run)
    exact = [c for c in contacts(truth.trajectory) if c.touch < 2.0]
    assert [c.touch for c in found] == pytest.approx([c.touch for c in exact], abs=1e-6)


def test_a_run_can_be_the_truth(truth: Truth, case: Case) -> None:
    recorded = from_run(truth.trajectory, Tier.D, "itself")
    times = sample_times(truth.trajectory, case.t_end, grid=777)
    assert np.abs(recorded.at(times).q - truth.at(times).q).max() < 1e-7
    assert measure("position", recorded, truth.at(times), case) < 1e-7


def test_modes_that_a_run_does_not_tell_are_not_looked_at(truth: Truth, case: Case) -> None:
    mode = truth.trajectory.mode.copy()
    mode[len(mode) // 2] = -1
    assert violated(case, truth.trajectory, 1e-9) == ()
    assert violated(case, replace(truth.trajectory, mode=mode), 1e-9) is None


def test_sample_times_hold_both_sides_of_every_event(truth: Truth, case: Case) -> None:
    times = sample_times(truth.trajectory, case.t_end)
    assert np.all(np.diff(times) >= 0)
    for event in truth.trajectory.events:
        assert np.count_nonzero(times == event.t) == 2


def test_ledger_shape_is_kept(truth: Truth) -> None:
    assert isinstance(truth.trajectory.ledger, Ledger)
    assert truth.trajectory.ledger.contact.shape == truth.trajectory.lam.shape


def coarse(truth: Truth) -> Trajectory:
    """The truth at so few samples that metrics which look at some of a run look at all of them."""
    run = truth.at(np.linspace(0.0, float(truth.trajectory.t[-1]), 301))
    return replace(run, events=truth.trajectory.events)


WORST = {
    "position": "q", "velocity": "v", "gap_error": "gap", "gap_residual": "gap", "energy_drift": "energy",
    "energy_residual": "energy", "law_residual": "lam", "contact_work": "contact", "energy_integrator": "contact",
}  # fmt: skip
"""Metric that is the largest of something -> what is spoiled."""


def spoiled(run: Trajectory, signal: str, at: dict[int, float]) -> Trajectory:
    """The run with parts of the largest value added to one signal at some samples."""
    if signal == "contact":
        assert run.ledger is not None
        return replace(run, ledger=replace(run.ledger, contact=_spoiled(run.ledger.contact, at)))
    return replace(run, **{signal: _spoiled(getattr(run, signal), at)})


def _spoiled(values: Floats, at: dict[int, float]) -> Floats:
    found = values.copy()
    for k, part in at.items():
        found[k, 0] += part * np.abs(values).max()
    return found


@pytest.mark.parametrize("name", WORST)
def test_the_worst_sample_counts(name: str, truth: Truth, case: Case) -> None:
    """Neither their mean, nor the last one, nor what others cancel."""
    run = coarse(truth)
    pressed = np.flatnonzero(run.lam[:, 0] > 0.0)
    first, middle, last = (int(k) for k in pressed[[len(pressed) // 4, len(pressed) // 2, -2]])
    right, worst, both = (
        measure(name, truth, spoiled(run, WORST[name], at), case)
        for at in ({}, {middle: 0.02}, {first: -0.01, middle: 0.02, last: -0.01})
    )
    assert worst > 1e3 * max(right, 1e-12)
    assert both == pytest.approx(worst, rel=1e-3)


@pytest.mark.parametrize("name", WORST)
def test_nothing_is_compared_behind_the_time_for_which_a_truth_is_trusted(
    name: str, truth: Truth, case: Case
) -> None:  # fmt: skip
    """Whoever asks: the judge cuts the truth there, others do not."""
    run, until = coarse(truth), 0.6 * case.t_end
    late = dict.fromkeys(np.flatnonzero(run.t > 1.01 * until).tolist(), 0.5)
    value = measure(name, replace(truth, trusted=until), spoiled(run, WORST[name], late), case)
    if name.endswith(("_residual", "_integrator")):  # which hold a run against itself
        assert value > 0.1
    else:
        assert value < 1e-6


@pytest.mark.parametrize(("name", "signal"), [("velocity", "v"), ("start_error", "v"), ("position", "q")])
def test_what_hardly_moves_is_measured_by_what_the_scene_says_of_it(name: str, signal: str) -> None:
    """Rates by rates, and positions by sizes."""
    case = load("bouncing_ball", "linear", height=0.0)
    coordinates, velocities = (
        tuple(replace(one, size=2.0, rate=50.0) for one in named) for named in (case.coordinates, case.velocities)
    )
    case = replace(case, coordinates=coordinates, velocities=velocities)
    t = np.linspace(0.0, case.t_end, 11)
    none, start = np.zeros((11, 1)), np.zeros(1)
    still = Trajectory(
        t=t, q=none, v=none, gap=none, lam=none, energy=np.zeros((11, 2)), mode=np.zeros((11, 1), np.int8), events=(),
        steps=10,
    )  # fmt: skip
    truth = from_run(still, Tier.A, "at rest")
    off = replace(still, **{signal: none + 1e-3})
    value = measure(name, truth, off, replace(case, q0=start, v0=start))
    assert value == pytest.approx(1e-3 / (50.0 if signal == "v" else 2.0))


@pytest.mark.parametrize(
    ("name", "parts"),
    [("friction_power", (-1.0, -2.0)), ("cone_violation", (2.0, 3.0)), ("friction_angle", (1.0, -1.0))],
)
def test_the_worst_sample_of_friction_counts(name: str, parts: tuple[float, float]) -> None:
    case = load("sliding_block", "turns")
    truth = truth_of(case)
    run = coarse(truth)
    system = equations(case)
    assert system is not None
    along = np.flatnonzero(np.asarray(system.follows) >= 0)
    slides = np.flatnonzero((run.mode == Mode.SLIP).any(axis=1) & run.lam[:, along].any(axis=1))
    first, middle = int(slides[len(slides) // 3]), int(slides[len(slides) // 2])

    def found(at: dict[int, float]) -> float:
        lam = run.lam.copy()
        for k, part in at.items():
            lam[k, along] *= part
        value = metrics.of(case)[name].measure(truth, replace(run, lam=lam), case)
        assert value is not None
        return value

    right, worst = found({}), found({middle: parts[1]})
    assert worst > 1e3 * max(right, 1e-12)
    assert found({first: parts[0], middle: parts[1]}) == pytest.approx(worst)


@pytest.mark.parametrize("signal", ["q", "v"])
@pytest.mark.parametrize("name", ["energy_residual", "gap_residual", "law_residual", "rate_residual", "position"])
def test_one_state_that_is_no_number_leaves_none(name: str, signal: str, truth: Truth, case: Case) -> None:
    """Among more samples than are looked at."""
    run = truth.trajectory
    assert len(run.t) > 1000
    for k in np.random.default_rng(6).integers(1, len(run.t), 5):
        values = getattr(run, signal).copy()
        values[k] = np.nan
        if (name, signal) != ("position", "v"):
            assert np.isnan(measure(name, truth, replace(run, **{signal: values}), case))


def test_a_start_in_contact_is_no_touch_that_is_off_its_surface(truth: Truth, case: Case) -> None:
    run = truth.trajectory
    begun = (Event(t=0.0, contact=0, before=Mode.FREE, after=Mode.CONTACT), *run.events)
    assert run.gap[0, 0] > 0.5
    assert (
        measure("event_gap", truth, replace(run, events=begun), case) == measure("event_gap", truth, run, case) < 1e-6
    )
    later = tuple(replace(e, t=0.01 * case.t_end) for e in begun)
    assert measure("event_gap", truth, replace(run, events=later), case) > 1.0
    below = replace(run, events=later, gap=np.where(run.t[:, None] <= later[0].t, -0.5, run.gap))
    assert measure("event_gap", truth, replace(below, events=later[:1]), case) == 0.0
    left = below.gap.copy()
    left[0] = 0.5
    assert measure("event_gap", truth, replace(below, events=later[:1], gap=left), case) > 0.1


@pytest.mark.parametrize(("off", "limit"), [(0.0, 0.0), (5e-7, 0.0), (1e-3, np.inf)])
def test_what_touches_beside_another_is_known_as_positions_are(off: float, limit: float) -> None:
    case = plate(np.array([(x, y, 0.0) for x in (-0.1, 0.1) for y in (-0.1, 0.1)]), height=0.05, t_end=0.2)
    run = run_to_the_end(case)
    touch = next(event.t for event in run.events)
    assert sum(event.t == touch for event in run.events) == 4
    gap = run.gap.copy()
    gap[run.t == touch, 1] += off
    found = measure("event_gap", from_run(run, Tier.A, "itself"), replace(run, gap=gap), case)
    assert (found == 0.0) if limit == 0.0 else (1e-6 < found < limit)


def test_what_touches_alone_touches_at_its_surface(truth: Truth, case: Case) -> None:
    """By less than positions are known to, where nothing was located beside it that it could have joined."""
    run = truth.trajectory
    touch = next(event.t for event in run.events if event.after == Mode.CONTACT)
    gap = run.gap.copy()
    gap[run.t == touch] += 5e-7
    way = np.max(np.abs(np.diff(gap[:, 0])))
    assert measure("event_gap", truth, replace(run, gap=gap), case) == pytest.approx(5e-7 / way, rel=1e-2)


@pytest.mark.parametrize("level", [-3e6, 3e6])
def test_an_energy_is_measured_by_no_less_than_rounding_leaves_of_it(level: float, truth: Truth) -> None:
    run = truth.trajectory
    still = replace(
        run, q=np.ones_like(run.q), energy=np.full_like(run.energy, (0.0, level)), lam=np.zeros_like(run.lam)
    )  # fmt: skip
    assert scale.energy(still) == pytest.approx(1e-8 * 3e6)


@pytest.mark.parametrize("part", [0.05, 0.5, 0.95])
@pytest.mark.parametrize("name", ["lam_impulse", "lam_impulse_path"])
def test_an_impulse_counts_whenever_it_acts(name: str, part: float, truth: Truth, case: Case) -> None:
    run = coarse(truth)
    pressed = np.flatnonzero(run.lam[:, 0] > 0.0)
    k = int(pressed[int(part * len(pressed))])
    total = float(np.sum(0.5 * np.diff(run.t) * (run.lam[1:, 0] + run.lam[:-1, 0])))
    more = 0.02 * float(run.lam.max()) * 0.5 * float(run.t[k + 1] - run.t[k - 1])
    right, wrong = (measure(name, truth, spoiled(run, "lam", at), case) for at in ({}, {k: 0.02}))
    assert right < 1e-12
    assert wrong == pytest.approx(more / total, rel=1e-3)


def test_integrals_over_a_motion_are_exact_for_what_grows_steadily() -> None:
    """Whatever the lengths of its steps."""
    t = np.sort(np.random.default_rng(3).uniform(0.0, 2.0, 40))
    lam = np.column_stack([3.0 * t - 1.0, 0.5 - t])
    n = len(t)
    run = Trajectory(
        t=t, q=lam, v=lam, gap=lam, lam=lam, energy=lam, mode=np.zeros((n, 2), np.int8), events=(), steps=n
    )  # fmt: skip
    wanted = np.column_stack([1.5 * (t**2 - t[0] ** 2) - (t - t[0]), 0.5 * (t - t[0]) - 0.5 * (t**2 - t[0] ** 2)])
    for found in (cumulated(run, lam), cumulative(run)):
        np.testing.assert_allclose(found, wanted, atol=1e-13)


def test_what_is_cut_off_a_motion_leaves_what_a_run_to_that_horizon_is(truth: Truth, case: Case) -> None:
    until = 0.55 * case.t_end
    shorter = before(truth.trajectory, until)
    whole = truth_of(replace(case, t_end=until, closed_form=load("bouncing_ball", "linear", t_end=until).closed_form))
    assert [(e.t, e.before, e.after) for e in shorter.events] == [
        (e.t, e.before, e.after) for e in whole.trajectory.events
    ]
    assert shorter.ledger is not None
    assert len(shorter.ledger.input) == len(shorter.t) == np.sum(truth.trajectory.t <= until) > 100
