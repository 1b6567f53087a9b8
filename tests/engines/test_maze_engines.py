"""The ball maze in MuJoCo and Pinocchio: each with rows, machine and controller of its own."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from crossbody.cases import CaseUnsupported, Outcome, load
from crossbody.cases.mechanisms.maze import closed_forms as cf
from crossbody.engines import load as load_engine
from crossbody.engines._maze.edges import SOLID, sector
from crossbody.engines._maze.machine import MazeMachine
from crossbody.engines._maze.memory import BALLISTIC, CONTACT, FREE, Memory, over_edge, through_gap
from crossbody.engines._maze.rows import ABOVE, BELOW, MazeRows, Place
from crossbody.engines._maze.scene import ball_maze
from crossbody.reports import metrics
from crossbody.reports.judging.audit import audit

pytest.importorskip("mujoco")
pytest.importorskip("pinocchio")

PINOCCHIO, CHAIN = ("pinocchio", "law"), ("MuJoCo's chain", "")
FOLLOWS = (PINOCCHIO, CHAIN)
"""The engine, and our machine once more on equations that MuJoCo evaluates."""
NO_TRUTH = None
LOCKED_G = 9.81 * math.sin(math.radians(5.0))


@cache
def run(engine, profile, variant, dt=None, **parameters):
    case = load("ball_maze", variant=variant, **parameters)
    if engine == CHAIN[0]:
        from maze_march import followed  # MuJoCo, which may not be there

        return case, followed(case, dt or 1e-3)
    return case, load_engine(engine).prepare(case, profile).run()


def measured(name, case, motion):
    return metrics.of(case)[name].measure(NO_TRUTH, motion, case)


def ring_times(motion):
    return [s.t for s in motion.switches if s.variable == 0]


@pytest.mark.parametrize("seed", range(20))
def test_what_a_ball_does_to_its_memory_it_undoes_on_the_way_back(seed):
    """Through a gap and back, over an edge and back: on the way the contacts go on, on the ring's other side."""
    rng = np.random.default_rng(seed)
    maze = ball_maze(load("ball_maze", variant="solve"))
    channel, modes = int(rng.integers(1, len(maze.rings))), [FREE] * maze.nc
    ring, gap = maze.rings[channel - 1], int(rng.integers(maze.rings[channel - 1].gaps))
    end, theta = int(rng.integers(2)), rng.uniform(-3.0, 3.0)
    at = theta + ring.tips(gap)[end] + (1 - 2 * end) * rng.uniform(0.01, 0.2) * ring.reach
    q = (theta, ring.middle * math.cos(at), ring.middle * math.sin(at), 0.0)
    modes[BELOW + 1 + end] = int(rng.choice([CONTACT, BALLISTIC]))
    placed = Place(channel, gap, sector(maze.rings[channel], at - theta))
    there = Memory(modes=tuple(modes), place=placed)
    inside = through_gap(there, maze.rings, True, q)
    assert (inside.place.channel, inside.place.above) == (channel - 1, gap)
    assert inside.modes[ABOVE + 1 + end] == modes[BELOW + 1 + end]
    assert sorted(inside.modes) == sorted(modes)
    assert through_gap(inside, maze.rings, False, q) == there
    rolled = over_edge(there, maze.rings, BELOW, q)
    assert rolled.place.below == SOLID
    assert rolled.modes[BELOW] == modes[BELOW + 1 + end]
    assert sorted(rolled.modes) == sorted(modes)
    assert over_edge(rolled, maze.rings, BELOW, q) == there


@pytest.mark.parametrize(("engine", "profile"), FOLLOWS)
@pytest.mark.parametrize("ring", [0, 3])
def test_period_inside_a_ring(engine, profile, ring):
    theta = -math.pi / 2.0 if ring == 0 else 0.0
    case, motion = run(engine, profile, "inside", ring=ring, theta=theta, t_end=9.0)
    R = float(case.parameters[f"inner{ring}"])
    exact = cf.period(LOCKED_G, R - 6.35e-3, 1.4, 1e-3)
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
    truth, mine = (load_engine(name).prepare(case, how).run() for name, how in (("reference", "compiled"), FOLLOWS[0]))
    assert [e.after for e in mine.events] == [e.after for e in truth.events] == [CONTACT, BALLISTIC, FREE]
    assert mine.events[0].t == pytest.approx((up - speed) / LOCKED_G, abs=2e-12 / speed)
    assert [e.t for e in mine.events] == pytest.approx([e.t for e in truth.events], abs=1e-5)
    np.testing.assert_allclose(mine.q[-1], truth.q[-1], atol=1e-8)
    if speed < LOCKED_G / float(case.law.a1[ABOVE]):
        assert mine.q[-1, 2] == pytest.approx(top - far + up * case.t_end - 0.5 * LOCKED_G * case.t_end**2, abs=1e-8)


@pytest.mark.parametrize(("engine", "profile"), FOLLOWS)
@pytest.mark.parametrize(("rolling", "cosine"), [(1, 10.0 / 17.0), (0, 2.0 / 3.0)])
def test_leave_angle_and_unstable_pole(engine, profile, rolling, cosine):
    case, motion = run(engine, profile, "outside", rolling=rolling, t_end=3.0)
    rho, mu = 81.5e-3 + 6.35e-3, 1.4 if rolling else 1.0
    assert measured("leave_angle", case, motion) == pytest.approx(cosine * math.cos(1e-3), abs=2e-6)
    assert measured("unstable_pole", case, motion) == pytest.approx(math.sqrt(LOCKED_G / (mu * rho)), rel=1e-6)


@pytest.mark.parametrize(("engine", "profile", "bound"), [(*PINOCCHIO, 1e-7), (*CHAIN, 1e-9)])
def test_free_maze_keeps_its_energy(engine, profile, bound):
    _, motion = run(engine, profile, "free", t_end=5.0)
    drift = np.abs(motion.total_energy - motion.total_energy[0]).max()
    assert drift < bound * motion.energy[:, 0].max()


@pytest.mark.parametrize(("engine", "profile"), FOLLOWS)
def test_ball_rolls_without_slip(engine, profile):
    _, motion = run(engine, profile, "free", t_end=5.0)
    x, y, v = motion.q[:, 1], motion.q[:, 2], motion.v
    rho = np.hypot(x, y)
    slip = (x * v[:, 2] - y * v[:, 1]) / rho + 6.35e-3 * v[:, 3] - 16e-3 * v[:, 0]
    assert np.abs(slip).max() < 1e-9 * np.abs(motion.v[:, 1:3]).max() + 1e-10


def test_walls_of_segments_lose_energy_and_more_of_them_do_not_cure_it(monkeypatch):
    """A swing of 0.5 rad: what one period costs at MuJoCo's own step; 15 to 26 % between 10 and 1 degrees."""
    from crossbody.engines.mujoco import _maze_segments

    lost = []
    for degrees in (10.0, 2.0):
        monkeypatch.setattr(_maze_segments, "ANGLE", math.radians(degrees))
        case = load("ball_maze", variant="inside", angle=0.5, t_end=2.1)
        motion = load_engine("mujoco").prepare(case, "default").run()
        depth = 8.4e-3 * LOCKED_G * (76.3e-3 - 6.35e-3) * (1.0 - math.cos(0.5))
        lost.append((motion.total_energy[0] - motion.total_energy[-1]) / depth)
    assert 0.04 < lost[0] < lost[1] < 0.32


def test_matched_chain_is_of_fourth_order():
    """Balanced by feedback from an offset, where the rows hold and the controller is smooth."""

    def end(dt):
        return run(*CHAIN, "balanced", dt=dt, t_end=0.5)[1].q[-1]

    errors = [np.abs(end(dt) - end(2.5e-4)).max() for dt in (2e-3, 1e-3)]
    assert 3.5 < math.log2(errors[0] / errors[1]) < 5.0


def start_before_a_gap():
    """Ring 3's gap reaches the top when the maze has turned by 0.6564 rad: start just before."""
    return {"theta": 0.655, "omega": 0.3, "t_end": 0.75}


def test_ring_is_changed_in_closed_loop_as_by_the_reference():
    case = load("ball_maze", variant="solve", **start_before_a_gap())
    truth = load_engine("reference").prepare(case, "compiled", rtol=1e-11).run()
    assert len(ring_times(truth)) == 1
    for (engine, profile), bound in zip(FOLLOWS, (1e-7, 1e-6), strict=True):
        _, motion = run(engine, profile, "solve", **start_before_a_gap())
        assert ring_times(motion) == pytest.approx(ring_times(truth), abs=bound)
        changes = [(s.variable, s.before, s.after) for s in motion.switches]
        assert changes == [(s.variable, s.before, s.after) for s in truth.switches]
        np.testing.assert_allclose(motion.q[-1], truth.q[-1], atol=3e-4 * np.abs(truth.q[-1]).max())


def test_whole_run_to_the_centre_is_that_of_the_reference():
    """Two programs that share only the geometry's numbers: ring changes of a minute, to 1e-6 s."""
    case, motion = run("pinocchio", "law", "solve")
    truth = load_engine("reference").prepare(case, "compiled", rtol=1e-11).run()
    np.testing.assert_allclose(ring_times(motion), ring_times(truth), atol=1e-6, rtol=0.0)
    assert [s.after for s in motion.switches if s.variable == 0] == [3, 2, 1, 0]
    assert motion.q[-1, 2] == pytest.approx(-(16e-3 - 6.35e-3), abs=1e-9)


@pytest.mark.parametrize(("engine", "profile"), [*FOLLOWS, ("mujoco", "default")])
def test_ball_far_from_the_top_is_lost(engine, profile):
    _, motion = run(engine, profile, "solve", angle=0.9, theta=0.3, t_end=3.0)
    assert motion.outcome is Outcome.LOST


@pytest.mark.parametrize("variant", ["inside", "free", "solve"])
def test_parity_audit(variant):
    case = load("ball_maze", variant=variant)
    theirs = load_engine("reference").prepare(case, "compiled").audit()
    mine = load_engine("pinocchio").prepare(case, "law").audit()
    assert all(row.ok for row in audit(mine, theirs, case))
    assert {"M", "bias", "constants", "gravity", "masses"} <= set(mine)


def test_rows_are_derivatives_of_their_gaps():
    """H and H' v against central differences along a motion, for faces and for both tips of a gap."""
    maze = ball_maze(load("ball_maze", variant="solve"))
    q, v = np.array([0.3, 0.02, 0.08, 1.0]), np.array([2.0, 0.1, -0.2, 5.0])
    for place in (Place(4, -1, -1), Place(4, 2, -1), Place(3, -1, 1)):
        for slot, row in maze.rows.at(place).items():
            if slot >= 6:
                continue
            eps = 1e-6
            (h0, H0, _), (h1, H1, _) = (row(tuple(q + s * eps * v), tuple(v)) for s in (-1.0, 1.0))
            _, H, Hdv = row(tuple(q), tuple(v))
            assert np.dot(H, v) == pytest.approx((h1 - h0) / (2 * eps), rel=1e-6, abs=1e-9)
            assert Hdv == pytest.approx(np.dot(np.subtract(H1, H0), v) / (2 * eps), rel=1e-6, abs=1e-7)


def test_face_hands_its_contact_to_the_tip_and_gets_it_back():
    case = load("ball_maze", variant="solve")
    maze = ball_maze(case)
    machine = MazeMachine(maze, lambda q, v, memory: (np.zeros(4), np.ones(8)))
    ring = maze.rings[3]
    rho, at = ring.outer + maze.plant.r, ring.centre(0) - ring.reach
    q = (0.0, rho * math.cos(at), rho * math.sin(at), 0.0)
    still, edge = (0.0,) * 4, 12
    closing = (0.0, -0.1 * math.cos(at), -0.1 * math.sin(at), 0.0)
    held = machine.settle(0.0, q, closing, machine.untouched((0.0, 0.0, rho, 0.0)), [0]).memory
    assert held.modes == (1, 0, 0, 0, 0, 0, 1, 0)
    opened = machine.settle(0.0, q, still, held, [edge]).memory
    assert (opened.modes, opened.place) == ((0, 1, 0, 0, 0, 0, 0, 0), Place(4, 0, -1))
    assert machine.settle(0.0, q, still, opened, [edge]).memory.modes == held.modes


def test_place_of_every_row_is_known_once():
    maze = ball_maze(load("ball_maze", variant="solve", rings=50))
    rows = MazeRows(maze.rings, maze.plant.r, rolling=True)
    assert set(rows.at(Place(0, -1, -1))) == {3, 7}
    assert set(rows.at(Place(50, -1, -1))) == {0, 3, 6, 7}
    assert rows.at(Place(7, 2, -1)) is rows.at(Place(7, 2, -1))


@pytest.mark.parametrize(("engine", "profile"), [PINOCCHIO, ("mujoco", "default")])
def test_sampled_controller_is_declined_with_a_sentence(engine, profile):
    with pytest.raises(CaseUnsupported, match="sampled controller runs in the reference alone"):
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
    few, many = (run("pinocchio", "law", "free", rings=n, t_end=0.5)[1] for n in (4, 50))
    np.testing.assert_array_equal(few.q, many.q)
