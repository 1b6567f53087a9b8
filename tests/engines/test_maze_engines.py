"""The ball maze in MuJoCo and Pinocchio: rows, gates and torque as data of the case, apart from the reference's."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from crossbody.cases import CaseUnsupported, Mode, Outcome, load
from crossbody.cases.gates import CHANGED, START
from crossbody.cases.mechanisms.maze import claims as cf
from crossbody.cases.mechanisms.maze import form as maze
from crossbody.cases.mechanisms.maze.gates import (
    ABOVE,
    BELOW,
    CHANNEL,
    EDGE_BELOW,
    INWARD,
    NORMALS,
    OUTWARD,
    SECTOR_ABOVE,
    SECTOR_BELOW,
    SOLID,
    STRAYED,
)
from crossbody.cases.mechanisms.maze.geometry import maze_of
from crossbody.engines import load as load_engine
from crossbody.reference.systems import maze as reference
from crossbody.reports import metrics
from crossbody.reports.judging.audit import audit

pytest.importorskip("mujoco")
pytest.importorskip("pinocchio")

PINOCCHIO = ("pinocchio", "law")
FREE, CONTACT, BALLISTIC = int(Mode.FREE), int(Mode.CONTACT), int(Mode.BALLISTIC)
NO_TRUTH = None
LOCKED_G = 9.81 * math.sin(math.radians(5.0))


@cache
def run(variant, **parameters):
    case = load("ball_maze", variant=variant, **parameters)
    return case, load_engine("pinocchio").prepare(case, "law").run()


def measured(name, case, motion):
    return metrics.of(case)[name].measure(NO_TRUTH, motion, case)


def ring_times(motion):
    return [s.t for s in motion.switches if s.variable == 0]


def gates(variant="solve", **parameters):
    """Rows and gates of a case, its geometry, and the numbers as they begin."""
    case = load("ball_maze", variant=variant, **parameters)
    found = case.form(case).case.gates
    return found, maze_of(case.parameters), found.numbers.copy()


def located(found, p, q):
    found.switch(np.array(q), p, np.zeros(8, np.int8), START)
    return int(p[CHANNEL]), int(p[SECTOR_BELOW]), int(p[SECTOR_ABOVE])


def at_radius(rho, angle, theta=0.0):
    return np.array([theta, rho * math.cos(angle), rho * math.sin(angle), 0.0])


@pytest.mark.parametrize("seed", range(20))
def test_what_a_ball_does_to_its_memory_it_undoes_on_the_way_back(seed):
    """Through a gap and back, over an edge and back: on the way the contacts go on, on the ring's other side."""
    rng = np.random.default_rng(seed)
    found, geometry, p = gates(controller="off")
    channel, modes = int(rng.integers(1, len(geometry.rings) + 1)), np.zeros(8, np.int8)
    ring = geometry.rings[channel - 1]
    gap, end, theta = int(rng.integers(ring.gaps)), int(rng.integers(2)), rng.uniform(-3.0, 3.0)
    at = theta + ring.tips(gap)[end] + (1 - 2 * end) * rng.uniform(0.01, 0.2) * ring.reach
    q = at_radius(ring.middle * (1.0 + 1e-9), at, theta)
    assert located(found, p, q)[:2] == (channel, gap)
    modes[BELOW + 1 + end] = int(rng.choice([CONTACT, BALLISTIC]))
    there, before = p.copy(), modes.copy()
    assert found.switch(q, p, modes, INWARD) == CHANGED
    assert (int(p[CHANNEL]), int(p[SECTOR_ABOVE])) == (channel - 1, gap)
    assert modes[ABOVE + 1 + end] == before[BELOW + 1 + end]
    assert sorted(modes) == sorted(before)
    found.switch(q, p, modes, OUTWARD)
    np.testing.assert_array_equal(p, there)
    np.testing.assert_array_equal(modes, before)
    found.switch(q, p, modes, EDGE_BELOW)
    assert p[SECTOR_BELOW] == SOLID
    assert modes[BELOW] == before[BELOW + 1 + end]
    assert sorted(modes) == sorted(before)
    modes_at_face = modes.copy()
    found.switch(q, p, modes, EDGE_BELOW)
    assert p[SECTOR_BELOW] == gap
    assert modes[BELOW + 1 + end] == modes_at_face[BELOW]


@pytest.mark.parametrize("seed", range(20))
def test_gates_are_where_the_reference_has_them(seed):
    """Place and guards of a ball anywhere, by two writings of the same rules: before an edge, and behind it."""
    rng = np.random.default_rng(seed)
    found, geometry, p = gates()
    case = load("ball_maze", variant="solve")
    ours = reference.constants(case.parameters, geometry)
    for _ in range(20):
        at = at_radius(rng.uniform(5e-3, 90e-3), rng.uniform(0.2, math.pi - 0.2), rng.uniform(-9.0, 9.0))
        place = located(found, p, at)
        np.testing.assert_array_equal(place, reference.start_state(ours, at)[:3])
        g, ring = np.empty(found.count), geometry.rings[place[0] - 1]
        found.guards(at, p, g)
        assert (g[:STRAYED] > 0.0).all()
        if place[0] and ring.gaps:
            step = 1.001 * g[EDGE_BELOW] * rng.choice([-1.0, 1.0])
            turned = [at + np.array([s, 0.0, 0.0, 0.0]) for s in (step, -step)]
            assert any(located(found, p.copy(), q)[1] != place[1] for q in turned)


@pytest.mark.parametrize("seed", range(10))
def test_rows_are_those_of_the_reference_and_derivatives_of_their_gaps(seed):
    """H and H' v against the other writing, and against central differences along a motion."""
    rng = np.random.default_rng(seed)
    case = load("ball_maze", variant="solve")
    found, geometry, p = gates()
    q = at_radius(rng.uniform(5e-3, 90e-3), rng.uniform(0.2, math.pi - 0.2), rng.uniform(-3.0, 3.0))
    v = np.array([2.0, 0.1, -0.2, 5.0]) * rng.uniform(-1.0, 1.0, 4)
    system = reference.build(case.parameters, case.law)
    located(found, p, q)

    def rows(q):
        h, H, drift = np.empty(8), np.empty((8, 4)), np.empty(8)
        found.rows(q, v, p, h, H, drift)
        return h, H, drift

    (h, H, drift), eps = rows(q), 1e-6
    h0, h1, H0, H1 = (rows(q + s * eps * v)[k] for k in (0, 1) for s in (-1.0, 1.0))
    np.testing.assert_allclose((H @ v)[:6], (h1 - h0)[:6] / (2.0 * eps), rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(drift, (H1 - H0) @ v / (2.0 * eps), rtol=1e-6, atol=1e-7)
    full = np.concatenate([reference.constants(case.parameters, geometry), np.zeros(9)])
    full[-9:-5] = reference.start_state(full[:-9], q)
    ours = [np.empty(8), np.empty((8, 4)), np.empty(8)]
    w = np.array([q[1], q[2], 0.0]) / math.hypot(q[1], q[2]) + [0.0, 0.0, math.hypot(q[1], q[2])]
    kernel = getattr(reference.rows, "py_func", reference.rows)
    kernel(0.0, q, v, full, w, np.arange(8), 8, ours[1], ours[0], ours[2])
    np.testing.assert_allclose(H, ours[1], rtol=1e-13, atol=1e-15)
    np.testing.assert_allclose(h, ours[0], rtol=1e-13, atol=1e-16)
    np.testing.assert_allclose(drift, ours[2], rtol=1e-12, atol=1e-14)
    assert system.nc == 8


@pytest.mark.parametrize("ring", [0, 3])
def test_period_inside_a_ring(ring):
    theta = -math.pi / 2.0 if ring == 0 else 0.0
    case, motion = run("inside", ring=ring, theta=theta, t_end=9.0)
    R = float(case.parameters[f"inner{ring}"])
    exact = cf.swing_period(LOCKED_G, R - 6.35e-3, 1.4, 1e-3)
    assert measured("swing_period", case, motion) == pytest.approx(exact, rel=1e-6)


@pytest.mark.parametrize("speed", [1e-5, 1e-4, 3e-4, 1e-3, 1e-2])
def test_a_ball_that_hardly_reaches_the_face_above_falls_again(speed):
    """Thrown up to touch at some speed: below g/a1 nothing pushes, and what weight pulls off does not stick.

    The slowest stays below its surface for less than a step of either integrator takes.
    """
    case = load("ball_maze", variant="inside", ring=3)
    top, far = float(case.parameters["inner3"]) - 6.35e-3, 1e-3
    up = math.sqrt(speed * speed + 2.0 * LOCKED_G * far)
    case = load("ball_maze", variant="inside", ring=3, t_end=up / LOCKED_G + 0.02)
    case = replace(case, q0=np.array([0.0, 0.0, top - far, 0.0]), v0=np.array([0.0, 0.0, up, 0.0]))
    truth, mine = (load_engine(name).prepare(case, how).run() for name, how in (("reference", "compiled"), PINOCCHIO))
    assert [e.after for e in mine.events] == [e.after for e in truth.events] == [CONTACT, BALLISTIC, FREE]
    assert mine.events[0].t == pytest.approx((up - speed) / LOCKED_G, abs=2e-12 / speed)
    assert [e.t for e in mine.events] == pytest.approx([e.t for e in truth.events], abs=1e-5)
    np.testing.assert_allclose(mine.q[-1], truth.q[-1], atol=1e-8)
    if speed < LOCKED_G / float(case.law.a1[ABOVE]):
        assert mine.q[-1, 2] == pytest.approx(top - far + up * case.t_end - 0.5 * LOCKED_G * case.t_end**2, abs=1e-8)


@pytest.mark.parametrize(("rolling", "cosine"), [(1, 10.0 / 17.0), (0, 2.0 / 3.0)])
def test_leave_angle_and_unstable_pole(rolling, cosine):
    case, motion = run("outside", rolling=rolling, t_end=3.0)
    rho, mu = 81.5e-3 + 6.35e-3, 1.4 if rolling else 1.0
    assert measured("leave_angle", case, motion) == pytest.approx(cosine * math.cos(1e-3), abs=2e-6)
    assert measured("unstable_pole", case, motion) == pytest.approx(math.sqrt(LOCKED_G / (mu * rho)), rel=1e-6)


def test_free_maze_keeps_its_energy():
    _, motion = run("free", t_end=5.0)
    drift = np.abs(motion.total_energy - motion.total_energy[0]).max()
    assert drift < 1e-7 * motion.energy[:, 0].max()


def test_ball_rolls_without_slip():
    _, motion = run("free", t_end=5.0)
    x, y, v = motion.q[:, 1], motion.q[:, 2], motion.v
    rho = np.hypot(x, y)
    slip = (x * v[:, 2] - y * v[:, 1]) / rho + 6.35e-3 * v[:, 3] - 16e-3 * v[:, 0]
    assert np.abs(slip).max() < 1e-9 * np.abs(motion.v[:, 1:3]).max() + 1e-10


def test_walls_of_segments_lose_energy_and_more_of_them_do_not_cure_it(monkeypatch):
    """A swing of 0.5 rad: what one period costs at MuJoCo's own step; 15 to 26 % between 10 and 1 degrees."""
    lost = []
    for degrees in (10.0, 2.0):
        monkeypatch.setattr(maze, "CHORD", math.radians(degrees))
        case = load("ball_maze", variant="inside", angle=0.5, t_end=2.1)
        motion = load_engine("mujoco").prepare(case, "default").run()
        depth = 8.4e-3 * LOCKED_G * (76.3e-3 - 6.35e-3) * (1.0 - math.cos(0.5))
        lost.append((motion.total_energy[0] - motion.total_energy[-1]) / depth)
    assert 0.04 < lost[0] < lost[1] < 0.32


def start_before_a_gap():
    """Ring 3's gap reaches the top when the maze has turned by 0.6564 rad: start just before."""
    return {"theta": 0.655, "omega": 0.3, "t_end": 0.75}


def test_ring_is_changed_in_closed_loop_as_by_the_reference():
    case = load("ball_maze", variant="solve", **start_before_a_gap())
    truth = load_engine("reference").prepare(case, "compiled", rtol=1e-11).run()
    assert len(ring_times(truth)) == 1
    _, motion = run("solve", **start_before_a_gap())
    assert ring_times(motion) == pytest.approx(ring_times(truth), abs=1e-7)
    changes = [(s.variable, s.before, s.after) for s in motion.switches]
    assert changes == [(s.variable, s.before, s.after) for s in truth.switches]
    mine, theirs = ([e.contact for e in one.events if e.after == CONTACT] for one in (motion, truth))
    assert mine == theirs
    assert all(e.contact < NORMALS for e in motion.events)
    np.testing.assert_allclose(motion.q[-1], truth.q[-1], atol=3e-4 * np.abs(truth.q[-1]).max())


@pytest.mark.slow
def test_whole_run_to_the_centre_is_that_of_the_reference():
    """Two programs that share only the geometry's numbers: ring changes of a minute, to 1e-6 s."""
    _, motion = run("solve")
    case = load("ball_maze", variant="solve")
    truth = load_engine("reference").prepare(case, "compiled", rtol=1e-11).run()
    np.testing.assert_allclose(ring_times(motion), ring_times(truth), atol=1e-6, rtol=0.0)
    assert [s.after for s in motion.switches if s.variable == 0] == [3, 2, 1, 0]
    assert motion.q[-1, 2] == pytest.approx(-(16e-3 - 6.35e-3), abs=1e-9)


@pytest.mark.parametrize(("engine", "profile"), [PINOCCHIO, ("mujoco", "default")])
def test_ball_far_from_the_top_is_lost(engine, profile):
    case = load("ball_maze", variant="solve", angle=0.9, theta=0.3, t_end=3.0)
    motion = load_engine(engine).prepare(case, profile).run()
    assert motion.outcome is Outcome.LOST


@pytest.mark.parametrize("variant", ["inside", "free", "solve"])
def test_parity_audit(variant):
    case = load("ball_maze", variant=variant)
    theirs = load_engine("reference").prepare(case, "compiled").audit()
    mine = load_engine("pinocchio").prepare(case, "law").audit()
    assert all(row.ok for row in audit(mine, theirs, case))
    assert {"M", "bias", "constants", "gravity", "masses"} <= set(mine)


@pytest.mark.parametrize(("engine", "profile"), [PINOCCHIO, ("mujoco", "default")])
def test_sampled_controller_is_declined_with_a_sentence(engine, profile):
    with pytest.raises(CaseUnsupported, match="only the reference runs a sampled controller"):
        load_engine(engine).prepare(load("ball_maze", variant="solve", controller="sampled"), profile)


def test_mujoco_says_that_its_own_contacts_are_not_the_rows_of_the_case():
    reason = load_engine("mujoco").why_not(load("ball_maze", variant="inside"), "matched")
    assert reason is not None
    assert "default" in reason


@pytest.mark.parametrize("profile", ["impulse", "admm"])
def test_profiles_without_gaps_say_so(profile):
    reason = load_engine("pinocchio").why_not(load("ball_maze", variant="inside"), profile)
    assert reason is not None
    assert "hand a contact over" in reason


def test_more_rings_outside_do_not_change_the_motion():
    few, many = (run("free", rings=n, t_end=0.5)[1] for n in (4, 50))
    np.testing.assert_array_equal(few.q, many.q)
