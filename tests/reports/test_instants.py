"""Instants of events are judged as well as they can be known: by what the gap, the force or the slip makes of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from friction_scenes import HALF, G, box_body, box_on_floor, pair, stack
from hypothesis import given
from hypothesis import strategies as st

from crossbody import cases, engines
from crossbody.cases import Case, Mode, Tier, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Joint, RowLaw, Scene, Shape
from crossbody.reports import metrics
from crossbody.reports.judging.truth import with_both_sides
from crossbody.reports.measuring.instants import off
from crossbody.reports.measuring.truth import from_run, sample_times

PART = {"touch": 1e-6, "stick": 1e-5}
"""Of the largest gap and slip: the limits on them."""


def run(case: Case) -> Trajectory:
    """Return a motion by the reference, as dense as truths are, with both sides of every event.

    Slips of 1e-10 m/s are told apart, so that its own velocities are known to 1e-14.
    """
    reference = engines.load("reference")
    natural = reference.prepare(case, "compiled", rtol=1e-11).run()
    dense = reference.prepare(case, "compiled", rtol=1e-11, samples=sample_times(natural, case.t_end)).run()
    return replace(with_both_sides(dense, natural), events=natural.events)


def measured(name: str, case: Case, exact: Trajectory, found: Trajectory) -> float | None:
    """Return a metric of a run against another one."""
    return metrics.load(name).measure(from_run(exact, Tier.A, "itself"), found, case)


def slid(less: float, tilt: float, speed: float, beside: float = 0.0) -> tuple[Case, Trajectory]:
    """Return a block on a slope that loses `less` m/s^2, and stops; one that weighs and slides more beside it."""
    scene = box_on_floor(np.tan(tilt) + less / (G * np.cos(tilt)), tilt=tilt)
    q0, v0 = np.array([0, 0, 0.1, 1, 0, 0, 0]), np.array([speed, 0, 0, 0, 0, 0])
    if beside:
        scene, q0, v0 = and_another(scene, beside), np.append(q0, q0), np.append(v0, beside * v0)
    case = case_of(scene, q0=q0, v0=v0, t_end=1.5)
    return case, run(case)


def and_another(scene: Scene, mass: float) -> Scene:
    """Return a scene with one more block on a floor of its own, which nothing joins to the others."""
    floor, shape = Shape(name="own floor", type="plane"), Shape(name="other", body="other", type="box", size=HALF)
    return scene.replace(
        bodies=(*scene.bodies, box_body("other", HALF, mass)), shapes=(*scene.shapes, floor, shape),
        joints=(*scene.joints, Joint(name="other", body="other", type="free")),
        pairs=(*scene.pairs, pair("own floor", "other", 0.1)),
    )  # fmt: skip


def moved(motion: Trajectory, after: Mode, late: float) -> Trajectory:
    """Return a motion whose changes to a mode are later."""
    events = [replace(e, t=e.t + late) if e.after == after and e.t > 0.0 else e for e in motion.events]
    return replace(motion, events=tuple(sorted(events, key=lambda event: event.t)))


@pytest.mark.parametrize("seed", [0, 2, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 3, 4))])
def test_a_stop_is_known_as_well_as_the_slip_there(seed: int) -> None:
    """Blocks that lose 1e-1 to 1e-6 m/s^2: one that starts faster, by less than velocities may be off, is no fault."""
    rng = np.random.default_rng(seed)
    less, tilt = 10.0 ** rng.uniform(-6.0, -1.0), rng.uniform(0.05, 0.5)
    speed = rng.uniform(0.5, 1.0) * less
    case, exact = slid(less, tilt, speed)
    for faster in (3e-6, -3e-6, 3e-5, -3e-5):
        given = faster * max(speed, 1e-4)  # what moves slower than this is measured by it
        late = abs(given / less)
        wanted = late if late < 1e-6 or abs(faster) > PART["stick"] else 1e-6 * abs(faster) / PART["stick"]
        found = slid(less, tilt, speed + given)[1]
        assert measured("stick_times", case, exact, found) == pytest.approx(wanted, rel=2e-2)


@pytest.mark.parametrize(
    ("late", "beside"),
    [
        (2e-5, 0.0), (-2e-5, 0.0), (1e-3, 0.0), (0.4, 0.0),
        *(pytest.param(late, 1e4, marks=pytest.mark.slow) for late in (2e-5, -2e-5, 1e-3, 0.4)),
    ],
)  # fmt: skip
def test_a_stop_that_the_slip_does_not_explain_is_off_in_full(late: float, beside: float) -> None:
    """At 1e-3 m/s^2 from 1e-3 m/s: 1e-5 of it are lost in 1e-5 s, and .4 s later the block has long held."""
    case, exact = slid(1e-3, 0.3, 1e-3, beside)
    assert measured("stick_times", case, exact, moved(exact, Mode.STICK, late)) == pytest.approx(abs(late), rel=1e-9)


def test_a_stop_that_is_missing_or_of_other_shapes_has_no_number() -> None:
    """A block stops on one that slides on; the run has it the other way round."""
    case = case_of(stack(0.1, 0.5), q0=[0, 0, 0.1, 1, 0, 0, 0, 0, 0, 0.3, 1, 0, 0, 0], t_end=0.2,
                   v0=[1, 0, 0, 0, 0, 0, 1.3, 0, 0, 0, 0, 0])  # fmt: skip
    exact = run(case)
    stops = [e for e in exact.events if e.after == Mode.STICK]
    slides = [e.contact for e in exact.events if e.contact not in {e.contact for e in stops}]
    other = dict(zip([e.contact for e in stops], slides, strict=True))
    other |= {b: a for a, b in other.items()}
    swapped = [replace(e, contact=other[e.contact]) for e in exact.events]
    assert measured("stick_times", case, exact, exact) == 0.0
    for events in ([e for e in exact.events if e not in stops], swapped):
        assert measured("stick_times", case, exact, replace(exact, events=tuple(events))) is None


@pytest.mark.parametrize(("late", "part"), [(2e-6, 0.8), (-2e-6, 0.8), (3e-6, 1.2), (-0.1, 4e4)])
@pytest.mark.parametrize("beside", [0.0, 1e4])
def test_a_slip_is_known_as_well_as_friction_there(late: float, part: float, beside: float) -> None:
    """A spring that a belt stretches by .4 of the bound a second: in 2.5e-6 s by as much as friction may be off."""
    case = cases.load("block_on_belt", stiffness=0.4 * 0.3 * G / 0.1, t_end=3.0)
    if beside:
        assert case.scene is not None
        case = case_of(
            and_another(case.scene, beside), q0=[*case.q0, 0, 0, 0.1, 1, 0, 0, 0], v0=[*case.v0, *[0.0] * 6],
            t_end=3.0, inputs=case.inputs,
        )  # fmt: skip
    exact = run(case)
    wanted = 1e-6 * part if part < 1.0 else abs(late)
    assert measured("slip_times", case, exact, moved(exact, Mode.SLIP, late)) == pytest.approx(wanted, rel=1e-3)


@pytest.mark.parametrize("seed", range(4))
def test_a_touch_is_known_as_well_as_the_gap_there(seed: int) -> None:
    """A mass on a spring that comes near the end of its way slowly, from farther away by less than gaps may be off."""
    rng = np.random.default_rng(seed)
    least, stiff, far = 10.0 ** rng.uniform(-8.0, -3.5), rng.uniform(1.0, 4.0), 10.0 ** rng.uniform(0.5, 6.0)
    slide = Joint(name="x", body="a", type="slide", axis=(1, 0, 0), stiffness=(stiff, 0, 0), range=(least - 1.0, far),
                  law=RowLaw(a0=1e4, a1=200.0))  # fmt: skip
    scene = Scene(bodies=(box_body("a", (0.1, 0.1, 0.1)),), joints=(slide,), gravity=(0.0, 0.0, 0.0))

    def thrown(start: float) -> tuple[Case, Trajectory]:
        case = case_of(scene, q0=[start], t_end=0.9 * 2.0 * np.pi / np.sqrt(stiff))
        return case, run(case)

    case, exact = thrown(1.0)
    known = PART["touch"] * float(np.max(exact.gap[:, 0]))  # whatever the other end's
    for farther in (0.1 * least, 1e-7):
        found = thrown(1.0 + farther)[1]
        late = abs(found.events[0].t - exact.events[0].t)
        wanted = late if late < 1e-6 or farther > known else 1e-6 * farther / known
        assert measured("event_times", case, exact, found) == pytest.approx(wanted, rel=2e-2)
    pushed = replace(exact, lam=exact.lam + np.array([0.0, 1.0]))  # elsewhere: here it lets go at its touch
    held = moved(pushed, Mode.BALLISTIC, 1e-3)
    assert measured("event_times", case, pushed, held) == pytest.approx(1e-3, rel=1e-9)


@pytest.mark.parametrize("seed", range(50))
def test_a_guard_that_is_known_to_less_than_it_changes_leaves_an_instant_in_full(seed: int) -> None:
    """Guards that come to zero as a power of the time: by what they change in it, or else the time itself."""
    rng = np.random.default_rng(seed)
    size, power, late = 10.0 ** rng.uniform(-6, 3), rng.integers(1, 4), 10.0 ** rng.uniform(-8, -1)
    late, known = late * rng.choice([-1.0, 1.0]), 10.0 ** rng.uniform(-12, -3)
    t, blank = np.linspace(0.0, 1.0, 11), np.zeros((11, 1))
    rests = Trajectory(t=t, q=blank, v=blank, gap=blank, lam=blank, energy=np.zeros((11, 2)),
                       mode=blank.astype(np.int8))  # fmt: skip

    def guard(motion: Trajectory) -> Floats:
        ahead: Floats = 0.5 - motion.t
        return size * ahead**power

    part = size * abs(late) ** power / known
    wanted = abs(late) if abs(late) <= 1e-6 or part > 1.0 else 1e-6 * part
    assert off(from_run(rests, Tier.A, "itself"), 0.5, 0.5 + late, guard, known) == pytest.approx(wanted, rel=1e-6)


@given(st.floats(1e-7, 1e-1), st.floats(0.0, 1e6), st.floats(1.0, 1e8))
def test_an_event_is_no_further_off_than_by_its_instants(late: float, slope: float, grows: float) -> None:
    """However much errors grow: what its guard makes of an instant may excuse it, and never makes it worse."""
    times = np.linspace(0.0, 1.0, 11)
    still = np.zeros((len(times), 1))
    motion = Trajectory(
        t=times, q=still, v=still, gap=still, lam=still, energy=np.zeros((len(times), 2)), mode=still.astype(np.int8)
    )
    truth = replace(from_run(motion, Tier.A, "itself"), grows=grows)
    assert off(truth, 0.5, 0.5 + late, lambda run: slope * (0.5 - run.t), 1e-6) <= late * (1.0 + 1e-9)
