"""What changes at once in the ball maze: sectors, channels, modes of rows and of the controller."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from crossbody.cases import InvalidValue, load
from crossbody.cases.mechanisms.maze.geometry import maze_of
from crossbody.reference.kernels import CHANGED, LOST, START, TOUCHED, UNCHANGED
from crossbody.reference.systems import _maze_layout as layout
from crossbody.reference.systems import _maze_switch as machine
from crossbody.reference.systems import maze

FREE, CONTACT, BALLISTIC = 0, 1, 2
CASE = load("ball_maze", variant="solve")
GEOMETRY = maze_of(CASE.parameters)
SYSTEM = maze.build(CASE.parameters, CASE.law)
PASSIVE = maze.build({**CASE.parameters, "controller": "off"}, CASE.law)


def numbers(channel, lower, upper, mode=0, target=0.0, touching=0.0, system=SYSTEM):
    p = system.p.copy()
    p[layout.CHANNEL : layout.ANGLE] = channel, lower, upper, mode, target, touching
    return p


def state(p):
    return tuple(int(x) for x in p[layout.CHANNEL : layout.TARGET])


def ball(rho, b, theta=0.0):
    return np.array([theta, rho * math.cos(b), rho * math.sin(b), 0.0])


def guards(q, p, latch=False):
    """Every guard; `latch` counts from here, where the ball just got."""
    if latch:
        machine._latch(q, p)
    g = np.full(machine.GUARDS, np.nan)
    machine.watch(0.0, q, np.zeros(4), p, g)
    return g


def fire(q, p, modes, fired):
    mode = np.array([*modes, 0, 0], np.int8)
    code = machine.switch(0.0, q, np.zeros(4), p, mode, int(fired))
    return code, mode[:6].tolist()


def above(ring):
    return GEOMETRY.rings[ring].outer + GEOMETRY.ball


@pytest.mark.parametrize("ring", range(4))
@pytest.mark.parametrize("theta", [0.0, 0.7, -40.0, 123.4])
def test_start_finds_channel_sectors_and_mode(ring, theta):
    wall = GEOMETRY.rings[ring]
    for gap in range(wall.gaps):
        top = theta + wall.centre(gap)  # the place on the ring that is brought to the top
        for offset, sector in ((0.9 * wall.reach, gap), (-0.9 * wall.reach, gap), (1.1 * wall.reach, -1)):
            p = numbers(0, 0, 0)
            fire(ball(above(ring), 0.5 * math.pi, 0.5 * math.pi - top + theta - offset), p, [0] * 6, START)
            p[layout.ABOVE] = 0
            assert state(p) == (ring + 1, -1 if sector < 0 else sector, 0, 1 if sector < 0 else 2), offset


def test_start_inside_ring_0_is_the_centre_and_without_controller_is_off():
    q = ball(0.0096, -0.5 * math.pi)
    p = numbers(2, 1, 1)
    assert fire(q, p, [0] * 6, START)[0] == CHANGED
    assert state(p) == (0, -1, -1, 3)
    p = numbers(2, 1, 1, system=PASSIVE)
    fire(q, p, [0] * 6, START)
    assert state(p) == (0, -1, -1, 0)


def crossing(ring, end, into, below):
    """The ball on the edge of gap 0, at its clockwise or other end, a hair on the side that it comes from."""
    wall, rho = GEOMETRY.rings[ring], above(ring) if below else GEOMETRY.rings[ring].inner - GEOMETRY.ball
    edge = wall.centre(0) + (2 * end - 1) * wall.reach
    over = 2e-12 * (2 * end - 1) * (-1 if into else 1)
    return ball(rho, 0.5 * math.pi, 0.5 * math.pi - edge - over), wall


@pytest.mark.parametrize("ring", range(4))
@pytest.mark.parametrize("end", [0, 1])
@pytest.mark.parametrize("contact", [FREE, CONTACT, BALLISTIC])
@pytest.mark.parametrize("below", [True, False])
def test_a_contact_goes_from_face_to_tip_and_back_at_an_edge(ring, end, contact, below):
    face, tips, guard = (0, 1, machine.EDGE_BELOW) if below else (3, 4, machine.EDGE_ABOVE)
    channel, sector = ring + 1 if below else ring, layout.BELOW if below else layout.ABOVE
    p = numbers(channel, -1, -1, system=PASSIVE)
    q, _ = crossing(ring, end, True, below)
    assert guards(q, p, latch=True)[guard] < 0.0
    modes = [0] * 6
    modes[face] = contact
    code, after = fire(q, p, modes, guard)
    expected = [0] * 6
    expected[tips + end] = contact
    assert (code, after, p[sector]) == (CHANGED, expected, 0.0)
    assert guards(q, p)[guard] > 0.0  # the dead band: it does not change back
    q, _ = crossing(ring, end, False, below)
    assert guards(q, p)[guard] < 0.0
    code, after = fire(q, p, after, guard)
    assert (code, after, p[sector]) == (CHANGED, modes, -1.0)
    assert guards(q, p)[guard] > 0.0


@pytest.mark.parametrize("ring", range(4))
def test_tips_keep_identity_and_state_when_the_ball_passes_their_ring(ring):
    wall = GEOMETRY.rings[ring]
    gap = wall.gaps - 1
    theta = 0.5 * math.pi - wall.centre(gap) + 0.3 * wall.reach
    p = numbers(ring + 1, gap, -1, mode=2, target=0.1)
    q = ball(wall.middle - 2e-12, 0.5 * math.pi, theta)
    h = np.zeros((2, 6))
    maze.gaps(0.0, q, np.zeros(4), p, h[0], np.zeros(6))
    assert guards(q, p)[machine.INWARD] < 0.0
    code, after = fire(q, p, [0, BALLISTIC, CONTACT, 0, 0, 0], machine.INWARD)
    assert (code, after) == (CHANGED, [0, 0, 0, 0, BALLISTIC, CONTACT])
    assert state(p) == (ring, -1, gap, 2)  # neighbouring rings have their gaps elsewhere
    maze.gaps(0.0, q, np.zeros(4), p, h[1], np.zeros(6))
    np.testing.assert_array_equal(h[0, 1:3], h[1, 4:6])
    assert (guards(q, p)[: machine.STRAYED] > 0.0).all()
    q = ball(wall.middle + 2e-12, 0.5 * math.pi, theta)
    assert guards(q, p)[machine.OUTWARD] < 0.0
    code, after = fire(q, p, after, machine.OUTWARD)
    assert (code, after, state(p)[:2]) == (CHANGED, [0, BALLISTIC, CONTACT, 0, 0, 0], (ring + 1, gap))
    assert (guards(q, p) > 0.0).all()


def test_ring_is_passed_inside_its_gap_only():
    """Through solid wall there is no way: neither guard looks at the radius there."""
    for rho in (0.05, 0.0788, 0.0790, 0.2):
        g = guards(ball(rho, 0.5 * math.pi), numbers(4, -1, -1))
        assert (g[[machine.INWARD, machine.OUTWARD]] == 1.0).all()


def test_snatch_aims_the_gap_at_the_ball_as_it_was_on_the_edge():
    p = numbers(4, -1, -1, mode=1)
    q, wall = crossing(3, 1, True, below=True)
    machine._latch(q, p)
    fire(q, p, [CONTACT, 0, 0, 0, 0, 0], machine.EDGE_BELOW)
    assert state(p)[3] == layout.SNATCH
    target = p[layout.TARGET]
    assert abs(target - q[0]) == pytest.approx(wall.reach, abs=1e-10)
    assert math.remainder(target + wall.centre(0) - 0.5 * math.pi, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("channel", "lower", "modes", "after"),
    [
        (3, -1, [CONTACT, 0, 0, 0, 0, 0], 1),
        (3, -1, [0, 0, 0, CONTACT, 0, 0], 1),
        (0, -1, [0, 0, 0, CONTACT, 0, 0], 3),
        (3, 0, [0, CONTACT, 0, 0, 0, 0], 2),
        (3, 0, [0, 0, 0, CONTACT, 0, 0], 2),
        (3, -1, [BALLISTIC, 0, 0, 0, 0, CONTACT], 2),
    ],
)
def test_a_touched_face_ends_the_snatch_and_a_tip_does_not(channel, lower, modes, after):
    p = numbers(channel, lower, -1, mode=2)
    q = ball(0.06 if channel else 0.0096, 0.5 * math.pi if channel else -0.5 * math.pi)
    assert fire(q, p, modes, TOUCHED) == (CHANGED if after != 2 or modes[3] else UNCHANGED, modes)
    assert state(p) == (channel, lower, -1, after)
    assert fire(q, p, modes, TOUCHED)[0] == UNCHANGED


def test_touching_is_noted_for_the_rolling_damping():
    p, q = numbers(4, -1, -1, system=PASSIVE), ball(above(3), 0.5 * math.pi)
    for modes, touching in (([CONTACT, 0, 0, 0, 0, 0], 1.0), ([BALLISTIC, 0, 0, 0, 0, 0], 0.0)):
        assert fire(q, p, modes, TOUCHED)[0] == CHANGED
        assert p[layout.TOUCHING] == touching


def test_ball_is_lost_beyond_sixty_degrees_outside_ring_0():
    for degrees, lost in ((59.9, False), (60.1, True), (-60.1, True), (180.0, True)):
        q = ball(above(3), 0.5 * math.pi - math.radians(degrees))
        p = numbers(4, -1, -1, mode=1)
        assert (guards(q, p)[machine.STRAYED] < 0.0) == lost
        assert (fire(q, p, [0] * 6, START)[0] == LOST) == lost
        assert fire(q, numbers(4, -1, -1, system=PASSIVE), [0] * 6, START)[0] != LOST
    assert guards(ball(0.0096, -0.5 * math.pi), numbers(0, -1, -1, mode=3))[machine.STRAYED] > 0.0


@pytest.mark.parametrize("rings", [1, 2, 4, 7])
def test_channels_of_any_number_of_rings(rings):
    parameters = load("ball_maze", variant="solve", rings=rings, ring=0).parameters
    geometry = maze_of(parameters)
    system = maze.build(parameters, CASE.law)
    for ring, wall in enumerate(geometry.rings):
        p = np.array(system.p)
        fire(ball(wall.outer + geometry.ball, 0.5 * math.pi), p, [0] * 6, START)
        assert state(p)[0] == ring + 1
        h = np.zeros(8)
        maze.gaps(0.0, ball(wall.outer + geometry.ball, 1.2), np.zeros(4), p, h, np.zeros(8))
        assert (h > -1e-15).all()


@pytest.mark.parametrize("outer", [80e-3, 81.5e-3, 83e-3])
def test_rings_that_are_added_have_their_gaps_between_those_of_the_ring_below(outer):
    """As many, and as wide for the ball, however thick the last ring of the table is."""
    rings = maze_of(load("ball_maze", variant="solve", rings=9, outer3=outer).parameters).rings
    for below, ring in pairwise(rings[3:]):
        ahead = (ring.centre(0) - below.centre(0)) * below.gaps / (2.0 * math.pi)
        assert ahead % 1.0 == pytest.approx(0.5, abs=1e-12)
        assert ring.gaps == below.gaps
        assert ring.free_width == pytest.approx(below.free_width, rel=1e-12)


@pytest.mark.parametrize("seed", range(20))
def test_a_maze_is_refused_where_its_ball_does_not_fit(seed):
    """Through the narrowest of its hole, its channels and its gaps, measured between points of the walls."""
    rng = np.random.default_rng(seed)
    radii = np.cumsum(rng.uniform(0.01, 0.03, 8))
    given = {"rings": 4, "wall": radii[-1] + rng.uniform(0.01, 0.03), "ring": 0, "angle": 0.1}
    rooms = [2.0 * radii[0], *(radii[2::2] - radii[1:-1:2]), given["wall"] - radii[-1]]
    for i in range(4):
        inner, outer = radii[2 * i : 2 * i + 2]
        width = rng.uniform(0.3, 0.8)
        given |= {f"inner{i}": inner, f"outer{i}": outer, f"gaps{i}": 2, f"width{i}": math.degrees(width)}
        # Caps of half the wall's thickness about points of its middle circle, beyond the flat ends of the gap.
        middle, cap = 0.5 * (inner + outer), 0.5 * (outer - inner)
        half = 0.5 * width + math.asin(cap / middle)
        tips = middle * np.array([[math.sin(half), math.cos(half)], [-math.sin(half), math.cos(half)]])
        rooms.append(float(np.linalg.norm(tips[0] - tips[1])) - 2.0 * cap)
    fits = 0.5 * min(rooms)
    ok = load("ball_maze", variant="inside", ball_radius=(1.0 - 1e-9) * fits, **given)
    assert ok.parameters["ball_radius"] < fits
    with pytest.raises(InvalidValue, match="ball"):
        load("ball_maze", variant="inside", ball_radius=(1.0 + 1e-9) * fits, **given)


@pytest.mark.parametrize("turn", [0.2, 1.0, -1.0, 5.0, -7.0, 40.0])
def test_an_edge_that_was_passed_stays_passed_however_far_the_maze_turns(turn):
    """Steps of a quiet ball are longer than the time between gaps; an edge must not be missed for it."""
    q, p = ball(above(3), 0.5 * math.pi), numbers(4, 0, 0)
    fire(q, p, [0] * 6, START)
    g = guards(q + np.array([turn, 0.0, 0.0, 0.0]), p)
    assert (g[machine.EDGE_BELOW] < 0.0) == (abs(turn) > math.pi / 4 - GEOMETRY.rings[3].reach)
    assert g[machine.EDGE_ABOVE] == 1.0


def test_a_ball_whose_angle_jumps_at_the_axis_finds_its_sector():
    p = numbers(0, -1, -1, mode=3)
    q = ball(1e-6, math.pi, 0.0)  # gap 0 of ring 0 stands there
    fire(q, p, [0] * 6, START)
    assert state(p)[2] == 0
    q = ball(1e-6, 0.1, 0.0)
    assert guards(q, p)[machine.EDGE_ABOVE] < 0.0
    fire(q, p, [0] * 6, machine.EDGE_ABOVE)
    assert state(p)[2] == -1
    assert (guards(q, p) > 0.0).all()
