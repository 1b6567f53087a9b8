"""Touches are laid on the truth's where that brings motions nearer: never are they farther than at equal times."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import Case, Event, Mode, Tier, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.reports import metrics
from crossbody.reports.judging.made_up import case_of
from crossbody.reports.judging.parts import Positions
from crossbody.reports.measuring.alignment import clock, which_laid
from crossbody.reports.measuring.laid import APART, TOLD, Laid, _least, _path, straight
from crossbody.reports.measuring.scale import scale_of, scale_of_rates
from crossbody.reports.measuring.truth import Truth, from_run

G, T = 9.81, 1.0
CASE = replace(case_of(("m", "m", "rad"), (True,), 1), t_end=T)
GRID = np.linspace(0.0, T, 1001)


def motion(touches: Floats, t: Floats, speed: float, turn: float, rebound: float) -> Trajectory:
    """A body thrown along a floor, which bounces at instants, s, rebounds from the last, m/s, and turns."""
    t = np.sort(np.concatenate([t, touches, touches]))
    past = np.searchsorted(touches, t, side="left") + np.append(False, t[1:] == t[:-1])
    starts = np.append(-touches[0], touches)[past]
    ends = np.append(touches, touches[-1] + 2.0 * rebound / G)[past]
    z, w = 0.5 * G * (t - starts) * (ends - t), 0.5 * G * (starts + ends - 2.0 * t)
    slides = (past == len(touches)) & (rebound == 0.0)
    z, w = np.where(slides, 0.0, z), np.where(slides, 0.0, w)
    events = [
        Event(t=float(at), contact=0, before=a, after=b)
        for at in touches for a, b in ((Mode.FREE, Mode.CONTACT), (Mode.CONTACT, Mode.FREE))
    ]  # fmt: skip
    none = np.zeros((len(t), 1))
    return Trajectory(
        t=t, q=np.column_stack([speed * t, z, 0.5 * turn * t * t]), v=np.column_stack([0.0 * t + speed, w, turn * t]),
        gap=z[:, None], lam=none, energy=np.zeros((len(t), 2)), mode=none.astype(np.int8), events=tuple(events),
    )  # fmt: skip


def thrown(draw: np.random.Generator) -> tuple[Truth, Trajectory]:
    """A truth and a run that bounces at other instants, and is off by draws besides."""
    touches = np.cumsum(draw.uniform(0.02, 0.4, draw.integers(1, 6)))
    touches = np.append(10.0 ** draw.uniform(-9.0, -3.0), touches)[draw.integers(0, 2) :]
    touches, speed = touches[touches < 0.9], draw.choice([0.1, 3.0, 100.0])
    turn, rebound = draw.choice([0.0, 1e-9, 10.0]), draw.choice([0.0, draw.uniform(0.1, 2.0)])
    late = 10.0 ** draw.uniform(-6.0, -2.0) * draw.uniform(-0.5, 1.0, len(touches))
    other = np.sort(np.maximum(touches + late, 1e-4))
    off = 1.0 + 10.0 ** draw.uniform(-7.0, -2.0, 3)
    exact = motion(touches, np.linspace(0.0, T, 4001), speed, turn, rebound)
    some = np.linspace(0.0, T, int(draw.choice([41, 301, 1001])))
    run = motion(other, some, speed * off[0], turn * off[1], rebound * off[2])
    return from_run(exact, Tier.A, "thrown"), run


def at_equal_times(name: str, truth: Truth, run: Trajectory, case: Case) -> float:
    """What a metric says where no touch is matched."""
    found = metrics.load(name).measure(truth, replace(run, events=()), case)
    assert found is not None
    return found


@pytest.mark.parametrize("seed", range(150))
def test_no_clock_brings_a_motion_farther_from_the_truth_than_time_itself(seed: int) -> None:
    truth, run = thrown(np.random.default_rng(seed))
    for name in ("position", "velocity"):
        found = metrics.load(name).measure(truth, run, CASE)
        assert found is not None
        plain, least = at_equal_times(name, truth, run, CASE), APART if name == "velocity" else TOLD
        assert found <= max(plain * (1.0 + 1e-9), TOLD) or plain >= least == APART


@pytest.mark.parametrize("seed", range(20))
def test_a_copy_of_the_truth_that_bounces_late_is_off_by_nothing(seed: int) -> None:
    draw = np.random.default_rng(seed)
    truth, _ = thrown(draw)
    exact = truth.trajectory
    touches = np.array([e.t for e in exact.events if e.before == Mode.FREE])
    late = 10.0 ** draw.uniform(-6.0, -3.0) * draw.uniform(-0.3, 1.0, len(touches)) * touches.min()
    if len(touches) > 1:
        late *= min(1.0, float(np.diff(touches).min()))

    def shown(t: Floats) -> Floats:
        return t + np.interp(t, np.append(0.0, touches), np.append(0.0, late))

    events = tuple(replace(e, t=float(shown(np.array(e.t)))) for e in exact.events)
    run = replace(exact, t=shown(exact.t), events=events)
    for name in ("position", "velocity"):
        found = metrics.load(name).measure(truth, run, CASE)
        assert found is not None
        assert found <= 2.0 * TOLD


@pytest.mark.parametrize("seed", range(60))
def test_the_way_through_arcs_is_the_least_of_all(seed: int) -> None:
    draw = np.random.default_rng(seed)
    costs = draw.uniform(size=(draw.integers(1, 8), 2, 2))
    ways = [np.array([0, *(k >> i & 1 for i in range(len(costs) - 1)), 0]) for k in range(2 ** (len(costs) - 1))]
    paid = [costs[np.arange(len(costs)), way[:-1], way[1:]] for way in ways]
    for join, total in ((np.maximum, np.max), (np.add, np.sum)):
        most, laid = _path(costs, join)
        assert most == pytest.approx(min(total(one) for one in paid))
        assert total(costs[np.arange(len(costs)), 1 - laid, np.append(1 - laid[1:], 0)]) == pytest.approx(most)


@pytest.mark.parametrize("seed", range(60))
def test_the_largest_errors_of_both_kinds_are_least_together_and_none_is_larger_than_at_equal_times(seed: int) -> None:
    draw = np.random.default_rng(seed)
    parts = draw.uniform(0.0, 1.3, size=(draw.integers(1, 6), 2, 2, 2))
    parts[:, 1, 1] /= parts[:, 1, 1].max(axis=0)
    ways = [np.array([0, *(k >> i & 1 for i in range(len(parts) - 1)), 0]) for k in range(2 ** (len(parts) - 1))]
    paid = {tuple(way[:-1] == 0): parts[np.arange(len(parts)), way[:-1], way[1:]] for way in ways}
    allowed = {laid: one for laid, one in paid.items() if (one <= 1.0).all()}
    if not allowed:
        return
    worst = {laid: one.max(axis=0).sum() for laid, one in allowed.items()}
    found = tuple(_least(parts).tolist())
    assert found in allowed
    assert worst[found] == pytest.approx(min(worst.values()))


@pytest.mark.parametrize("seed", range(20))
def test_another_run_is_laid_on_the_touches_that_are_told_by_one(seed: int) -> None:
    """Each touch as the nearest that is told of, and between them time goes straight."""
    draw = np.random.default_rng(seed)
    at = np.append(0.0, 0.1 * np.arange(1, 8) + draw.uniform(-0.02, 0.02, 7))
    on = np.append(True, draw.random(7) < 0.5)
    some = at + draw.uniform(-0.02, 0.02, 8)
    assert np.array_equal(Laid(at=at, on=on).of(some), on)
    assert Laid(at=at[:1], on=on[:1]).of(some).all()
    truth, run = (
        from_run(motion(at[1:], GRID, 1.0, 0.0, 1.0), Tier.A, "thrown"),
        motion(at[1:] + 5e-3, GRID, 1.0, 0.0, 1.0),
    )
    shown = clock(truth, run, CASE, laid=Laid(at=at, on=on))
    np.testing.assert_allclose(np.interp(at[1:] + 5e-3, run.t, shown), at[1:] + np.where(on[1:], 0.0, 5e-3), atol=1e-12)


def test_parts_are_told_by_the_clock_of_the_judged_run() -> None:
    """Of a slide that is judged at equal times, another run is too, though by itself its touch would be laid."""
    truth = from_run(motion(np.array([1e-6]), GRID, 3.0, 0.0, 0.0), Tier.A, "slides")
    judged = motion(np.array([4e-3]), GRID, 3.0 * (1.0 + 1e-5), 0.0, 0.0)
    other = motion(np.array([2e-3]), GRID, 3.0, 0.0, 0.0)
    late = replace(other, q=np.column_stack([3.0 * (other.t - 2e-3), other.q[:, 1:]]))
    assert not which_laid(truth, judged, CASE).on[1]
    assert which_laid(truth, late, CASE).on[1]
    assert np.max(np.abs(Positions(CASE, truth, judged)(late))) == pytest.approx(2e-3, rel=0.1)


def test_rates_of_what_does_not_turn_are_measured_by_a_radian_over_the_horizon(tmp_path: Path) -> None:
    case = placed(tmp_path, "box", 0.0, 0.2, 0.0, 3.0)
    exact = engines.load("reference").prepare(case, "compiled").run()
    assert np.max(np.abs(exact.v[:, 3:])) < 1e-6
    sizes = scale_of_rates(exact, case)
    assert sizes[3:] == pytest.approx(1.0 / case.t_end)
    assert sizes[:3] == pytest.approx(3.0)
    slow = replace(exact, v=exact.v + np.array([0.0, 0.0, 0.0, 0.01, 0.0, 0.0]))
    assert scale_of_rates(slow, case)[3:] == pytest.approx(0.01, rel=1e-3), "of what turns by its own"


PLANE = """<mujoco model="m"><option timestep="0.001"/><worldbody>
<geom name="floor" type="plane" size="9 9 .1" euler="0 {tilt} 0" friction="{mu} 0 0"/>
<body name="b" pos="{x} 0 {z}" euler="0 {tilt} 0"><freejoint name="free"/>
<geom name="g" type="{shape}" size=".1 .1 .1" mass="1" friction="{mu} 0 0"/></body></worldbody>
<keyframe><key name="k" qpos="{x} 0 {z} {w} 0 {y} 0" qvel="{v} 0 0 0 0 0"/></keyframe></mujoco>"""


def placed(folder: Path, shape: str, tilt: float, mu: float, above: float, v: float = 0.0) -> Case:
    """A body on, or a hair above, a plane."""
    a, half = np.deg2rad(tilt), 0.5 * np.deg2rad(tilt)
    x, z = np.sin(a) * (0.1 + above), np.cos(a) * (0.1 + above)
    file = folder / "plane.xml"
    file.write_text(
        PLANE.format(shape=shape, tilt=tilt, mu=mu, x=f"{x:.17g}", z=f"{z:.17g}", v=v, w=np.cos(half), y=np.sin(half))
    )
    return cases.from_file(file, "k", t_end=T, friction=1)


@pytest.mark.parametrize(
    ("shape", "tilt", "mu", "v"), [("box", 0.0, 0.2, 3.0), ("box", 20.0, 0.2, 0.0), ("sphere", 10.0, 0.8, 0.0)]
)
@pytest.mark.parametrize("above", [0.0, 1e-9, 4.5e-9, 1e-7])
def test_a_body_that_starts_a_hair_above_a_plane_is_off_by_what_it_is_at_equal_times(
    tmp_path: Path, shape: str, tilt: float, mu: float, v: float, above: float
) -> None:
    """A box that slides, with speed or down a slope, and a sphere that rolls: by their closed forms."""
    case = placed(tmp_path, shape, tilt, mu, above, v)
    exact = engines.load("reference").prepare(case, "compiled", rtol=1e-11, samples=np.linspace(0.0, T, 2001)).run()
    truth = replace(from_run(exact, Tier.A, "reference", case.law.touches), joined=True)
    a, size = np.deg2rad(tilt), scale_of(exact, case)[:3].max()
    along = G * np.sin(a) / 1.4 if shape == "sphere" else G * (np.sin(a) - mu * np.cos(a))
    way = np.array([np.cos(a), 0.0, -np.sin(a)])
    for engine, profile, known in (("pinocchio", "admm", 1e-4), ("mujoco", "as_is", 2e-3)):
        run = engines.load(engine).prepare(case, profile).run()
        assert all(np.isfinite(x).all() for one in (exact, run) for x in (one.q, one.v))
        closed = np.outer(v * run.t + 0.5 * along * run.t**2, way)
        off = np.max(np.abs(run.q[:, :3] - case.q0[:3] - closed)) / size
        found = metrics.load("position").measure(truth, run, case)
        assert found is not None
        assert off - 1e-4 <= found <= at_equal_times("position", truth, run, case) * (1.0 + 1e-6)
        assert off <= known


@pytest.mark.parametrize("seed", range(50))
def test_a_clock_that_is_laid_on_the_same_instants_shows_them_without_a_rounding(seed: int) -> None:
    """Else the last sample of a run was behind the end of its truth, and nobody looked at it."""
    rng = np.random.default_rng(seed)
    knots, t = np.append(0.0, np.sort(rng.uniform(0.0, 3.0, 40))), np.sort(rng.uniform(0.0, 9.0, 400))
    np.testing.assert_array_equal(straight(t, knots, knots), t)
    late = knots + np.append(0.0, rng.uniform(0.0, 1e-3, 40))
    np.testing.assert_array_equal(straight(knots, knots, late), late)
