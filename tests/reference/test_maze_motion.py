"""Motion of the ball in the maze against its closed forms, and balls that meet gaps, tips and wedges."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from crossbody.cases import Mode, Outcome, load
from crossbody.cases.library.ball_maze import VARIANTS
from crossbody.cases.mechanisms.maze import claims as cf
from crossbody.cases.mechanisms.maze.geometry import Ring, maze_of
from crossbody.reference import prepare, simulate
from crossbody.reference.options import Options
from crossbody.reference.systems import _maze_layout as layout
from crossbody.reference.systems import maze
from crossbody.reports import metrics

TOP = math.pi / 2
G = 9.81 * math.sin(math.radians(5.0))


def run(variant, rtol=1e-9, samples=None, **parameters):
    """The case, and its motion by the compiled reference."""
    case = load("ball_maze", variant=variant, **parameters)
    system = maze.build(case.parameters, case.law)
    options = {"collisions": "sequential", "rtol": rtol, "samples": samples, "ledger": True}
    return case, simulate(system, case.q0, case.v0, case.t_end, **options)


@pytest.mark.parametrize("seed", range(20))
def test_a_cap_touches_the_flat_end_of_its_wall_and_both_faces(seed):
    """The flat ends lie on the rays at half a gap's width; what a ball may pass is between the caps."""
    rng = np.random.default_rng(seed)
    inner = rng.uniform(0.01, 0.1)
    ring = Ring(
        inner=inner, outer=inner * rng.uniform(1.02, 1.5), gaps=int(rng.integers(1, 5)), width=rng.uniform(0.1, 1.2),
        phase=rng.uniform(-3.0, 3.0),
    )  # fmt: skip
    for gap in range(ring.gaps):
        ends = ring.middle * np.exp(1j * np.array(ring.tips(gap)))
        rays = np.exp(1j * (ring.phase + 2.0 * math.pi * gap / ring.gaps + 0.5 * ring.width * np.array([-1.0, 1.0])))
        off = (ends / rays).imag  # from the ray, counter-clockwise
        np.testing.assert_allclose(off, [-ring.cap, ring.cap], rtol=1e-12)
        np.testing.assert_allclose([np.abs(ends) - ring.cap, np.abs(ends) + ring.cap], [[inner] * 2, [ring.outer] * 2])
        assert abs(ends[1] - ends[0]) - 2.0 * ring.cap == pytest.approx(ring.free_width, rel=1e-9)


def measure(name, motion, case):
    return metrics.of(case)[name].measure(None, motion, case)


def ledger_residual(motion):
    E, ledger = motion.total_energy, motion.ledger
    return np.abs(E - E[0] - ledger.input + ledger.dissipated - ledger.contact.sum(axis=1)).max()


def solid(ring):
    """Angles of the maze that keep the top, and what lies to +x of it, of a ring's outer face solid."""
    return {0: 0.0, 1: 1.05, 2: 0.3, 3: 1.05}[ring]


@pytest.mark.parametrize("ring", range(4))
@pytest.mark.parametrize("inertia", [1e6, 1e-3, 1e-5])
def test_unstable_pole_and_leave_angle(ring, inertia):
    case, motion = run("outside", maze_inertia=inertia, ring=ring, theta=solid(ring), t_end=5.0, gaps2=0, gaps1=0)
    R = maze_of(case.parameters).rings[ring].outer
    mu = cf.effective_mass(8.4e-3, R, inertia, True)
    assert measure("unstable_pole", motion, case) == pytest.approx(cf.pole(G, R + 6.35e-3, mu), rel=2e-9)
    assert measure("leave_angle", motion, case) == pytest.approx(cf.leave_cosine(1e-3, mu), rel=1e-7)


def test_published_poles_and_angles():
    locked = [cf.pole(G, R + 6.35e-3, 1.4) for R in (0.0815, 0.0613, 0.0412, 0.0212)]
    assert locked == pytest.approx([2.63662, 3.00459, 3.58380, 4.70823], abs=5e-6)
    for inertia, pole, cosine in ((1e-3, 2.644882, 0.58975), (1e-5, 2.942882, 0.64024)):
        mu = cf.effective_mass(8.4e-3, 0.0815, inertia, True)
        assert cf.pole(G, 0.08785, mu) == pytest.approx(pole, abs=5e-7)
        assert cf.leave_cosine(0.0, mu) == pytest.approx(cosine, abs=2e-5)
    assert cf.leave_cosine(0.0, 1.4) == pytest.approx(10 / 17)
    assert cf.leave_cosine(0.0, 1.0) == pytest.approx(2 / 3)
    periods = [cf.swing_period(G, R - 6.35e-3, 1.4, 1e-3) for R in (0.016, 0.036, 0.0562, 0.0763)]
    assert periods == pytest.approx([0.789814, 1.384439, 1.795122, 2.126450], abs=5e-7)


def test_frictionless_ball_leaves_at_two_thirds():
    case, motion = run("outside", rolling=0)
    assert case.contacts == load("ball_maze", variant="outside").contacts[:6]
    assert measure("leave_angle", motion, case) == pytest.approx(2 / 3 * math.cos(1e-3), rel=1e-7)
    assert measure("unstable_pole", motion, case) == pytest.approx(math.sqrt(G / 0.08785), rel=2e-9)
    assert motion.q[-1, 3] == 0.0


@pytest.mark.parametrize("ring", range(4))
@pytest.mark.parametrize(("inertia", "rolling"), [(1e6, 1), (1e-3, 1), (1e6, 0)])
def test_period_inside_a_ring(ring, inertia, rolling):
    theta = -TOP if ring == 0 else math.pi / 4 if ring == 2 else 0.0
    case, motion = run("inside", ring=ring, maze_inertia=inertia, rolling=rolling, theta=theta, angle=0.2)
    (claim,) = (claim for claim in case.claims if claim.metric == "swing_period")
    assert measure("swing_period", motion, case) == pytest.approx(claim.expected, rel=1e-6)


def test_free_maze_without_input_keeps_its_energy():
    _, motion = run("free", rtol=1e-9)
    E, T = motion.total_energy, motion.energy[:, 0].max()
    assert motion.outcome is Outcome.FINISHED
    assert np.abs(E - E[0]).max() < 1e-9 * T
    assert ledger_residual(motion) < 1e-9 * T
    assert np.ptp(motion.q[:, 0]) > 1e-4  # the maze does turn


def test_swing_persists_without_damping_and_decays_with_it():
    """Amplitude falls as exp(-c t/(2.8 m r^2)) for a locked maze."""
    c, size, t_end = 1e-7, {}, 14.0 * cf.swing_period(G, 0.036 - 6.35e-3, 1.4, 0.02)
    for damping in (0.0, c):
        _, motion = run("inside", rolling_damping=damping, ring=1, angle=0.02, t_end=t_end)
        energy = motion.total_energy + 8.4e-3 * G * (0.036 - 6.35e-3)
        size[damping] = 0.5 * math.log(energy[-1] / energy[0]) / t_end
        assert ledger_residual(motion) < 1e-6 * energy[0]
    assert abs(size[0.0]) < 1e-7
    assert size[c] == pytest.approx(-c / (2.8 * 8.4e-3 * 6.35e-3**2), rel=1e-3)


@pytest.mark.parametrize("ring", range(4))
def test_closed_loop_follows_its_placed_poles(ring):
    """(s + 5)^3 in (eps, eps', y') from 0.01 rad; y'' = g cos b makes the chart linear but for sin(eps)."""
    times = np.linspace(0.0, 2.0, 21)
    _, motion = run("balanced", ring=ring, theta=0.5 if ring == 2 else 0.0, samples=times, t_end=2.0, a_max=0, u_max=0)
    A = np.array([[0.0, 1.0, 0.0], [-75.0, -15.0, 125.0 / G], [-G, 0.0, 0.0]])
    wanted = [(expm(A * t) @ [-0.01, 0.0, 0.0])[0] for t in times]
    eps = np.arctan2(motion.q[:, 2], motion.q[:, 1]) - TOP
    np.testing.assert_allclose(eps, wanted, atol=5e-6 * 0.01)


def start(system, q0, v0, t_end, **options):
    return simulate(system, q0, v0, t_end, **{"collisions": "sequential", "rtol": 1e-9, "ledger": True} | options)


def passive(**parameters):
    case = load("ball_maze", variant="outside", **parameters)
    return case, maze.build(case.parameters, case.law)


def switched(motion, variable):
    return [(s.before, s.after) for s in motion.switches if s.variable == variable]


def test_ball_dropped_over_a_gap_falls_through_without_a_touch():
    case, system = passive(theta=math.pi / 4)
    motion = start(system, [math.pi / 4, 0.0, 0.0875, 0.0], np.zeros(4), 0.19)
    assert not motion.events
    assert switched(motion, 0) == [(4, 3)]
    (change,) = (s for s in motion.switches if s.variable == case.discrete.index("channel"))
    assert change.t == pytest.approx(math.sqrt(2.0 * (0.0875 - 0.0789) / G), abs=1e-10)


def test_slip_at_a_landing_decays_and_dissipates_as_an_inelastic_impulse():
    """Work -slip^2/(2 G_tt) (1 - exp(-2 a1_slip t)), 1/G_tt from R^2/Jm + 1/mb + r^2/Jb: -1.189e-5 J on ring 2."""
    case, system = passive(ring=2, theta=0.4, angle=0.0, a1_slip=2000.0, maze_inertia=1e-3)
    motion = start(system, case.q0, [0.0, -0.1, -0.186, 0.0], 2e-3, rtol=1e-11)
    mobility = 0.0613**2 / 1e-3 + (1.0 + 2.5) / 8.4e-3
    assert (motion.mode[1:-1, 6] == Mode.CONTACT).all()
    slip = [system.gap(q, v)[1][6] for q, v in zip(motion.q, motion.v, strict=True)]
    np.testing.assert_allclose(slip, 0.1 * np.exp(-2000.0 * motion.t), atol=1e-9)
    expected = -0.5 * 0.1**2 / mobility * (1.0 - math.exp(-8.0))
    assert expected == pytest.approx(-1.189e-5, rel=1e-3)
    assert motion.ledger.contact[-1, 6] == pytest.approx(expected, rel=2e-3)
    assert ledger_residual(motion) < 1e-14


def test_ball_that_rolls_into_a_gap_turns_about_its_tip():
    """Over the edge the contact goes to the tip at the same instant, without a FREE between or a jump of the motion."""
    case, system = passive()
    edge = math.pi / 4 + maze_of(case.parameters).rings[3].reach
    b = edge + 0.02
    motion = start(system, [0.0, 0.08785 * math.cos(b), 0.08785 * math.sin(b), 0.0], np.zeros(4), 1.0)
    enter = next(s for s in motion.switches if s.variable == 1)
    here = [(e.contact, e.after) for e in motion.events if e.t == enter.t]
    assert here[:2] == [(0, Mode.FREE), (2, Mode.CONTACT)]
    i = np.flatnonzero(motion.t == enter.t)
    np.testing.assert_array_equal(motion.q[i[0]], motion.q[i[-1]])
    np.testing.assert_array_equal(motion.v[i[0]], motion.v[i[-1]])
    on_tip = motion.mode[:, 2] == Mode.CONTACT
    assert motion.lam[on_tip, 2].max() > 1e-4
    assert np.abs(motion.lam[on_tip, 6:]).max() == 0.0
    assert ledger_residual(motion) < 1e-7 * np.ptp(motion.energy[:, 1])


def test_ball_hits_a_tip_and_leaves_it_with_the_restitution_of_the_law():
    """A double pole: e = exp(-2), contact time 2/sqrt(a0)."""
    case, system = passive(rolling=0, gravity=1e-9)
    wall, ball = maze_of(case.parameters).rings[3], 6.35e-3
    tip = wall.middle * np.array([math.cos(wall.tips(0)[0]), math.sin(wall.tips(0)[0])])
    aim = np.array([math.cos(0.9), math.sin(0.9)])  # between the radius and the gap
    motion = start(system, [0.0, *(tip + aim * (wall.cap + ball + 1e-4)), 0.0], [0.0, *(-0.2 * aim), 0.0], 4e-3)
    assert {e.contact for e in motion.events} == {1}
    touch, release = motion.events[0], motion.events[1]
    assert (touch.after, release.after) == (Mode.CONTACT, Mode.BALLISTIC)
    out = motion.v[np.searchsorted(motion.t, release.t), 1:3]
    assert np.linalg.norm(out) / 0.2 == pytest.approx(math.exp(-2.0), rel=1e-6)
    assert release.t - touch.t == pytest.approx(2e-3, rel=1e-6)


def test_wedge_of_a_face_and_the_tip_of_another_ring():
    """Where a channel is too narrow, which no case admits, the ball is held by a face, a tip and one slip row."""
    _, system = passive(maze_inertia=1e6)
    ring, rho = Ring(inner=0.0733, outer=0.0815, gaps=4, width=math.radians(11.0), phase=TOP / 2), 0.0613 + 6.35e-3
    reach = ring.cap + 6.35e-3
    swing = math.acos((rho**2 + ring.middle**2 - reach**2) / (2.0 * rho * ring.middle))
    theta = TOP - 0.1 - swing - ring.tips(0)[0]
    p = np.array(system.parameters)
    line = layout.TABLE + 3 * layout.STRIDE
    p[[line + layout.INNER, line + layout.REACH]] = ring.inner, ring.reach
    narrow = replace(system, parameters=p)
    motion = start(narrow, [theta, rho * math.sin(0.02), rho * math.cos(0.02), 0.0], np.zeros(4), 3.0)
    assert motion.outcome is Outcome.FINISHED
    assert motion.mode[-1].tolist() == [1, 0, 0, 0, 1, 0, 1, 0]
    np.testing.assert_allclose(math.atan2(motion.q[-1, 1], motion.q[-1, 2]), 0.1, atol=1e-7)
    np.testing.assert_allclose(motion.v[-1], 0.0, atol=1e-7)
    tip_x, tip_y = (ring.middle * f(theta + ring.tips(0)[0]) for f in (math.cos, math.sin))
    x, y = motion.q[-1, 1:3]
    pushes = np.array([[x / rho, (x - tip_x) / reach], [y / rho, (y - tip_y) / reach]])
    np.testing.assert_allclose(pushes @ motion.lam[-1, [0, 4]], [0.0, 8.4e-3 * G], atol=1e-8)
    assert ledger_residual(motion) < 1e-7 * np.ptp(motion.energy[:, 1])


def test_a_channel_hardly_wider_than_the_ball_is_never_touched_on_both_sides():
    case, system = passive(inner3=0.0613 + 0.0127 + 1e-6, ring=2, theta=0.4)
    motion = start(system, case.q0, [0.0, 0.05, 0.3, 0.0], 0.05)
    assert motion.outcome is Outcome.FINISHED
    assert {e.contact for e in motion.events if e.after == Mode.CONTACT} == {0, 3}
    assert -motion.gap[:, [0, 3]].min() > 1e-5  # deeper than the channel is wide
    assert not ((motion.mode[:, 0] == Mode.CONTACT) & (motion.mode[:, 3] == Mode.CONTACT)).any()
    assert ledger_residual(motion) < 1e-7 * motion.energy[:, 0].max()


@pytest.mark.parametrize("variant", VARIANTS)
def test_every_variant_meets_its_claims(variant):
    case, motion = run(variant)
    limits = {limit.metric: limit.value for limit in case.limits}
    assert motion.outcome is Outcome.FINISHED
    for claim in case.claims:
        assert abs(measure(claim.metric, motion, case) - claim.expected) <= limits[claim.metric], claim.metric


def test_claims_are_void_where_they_would_not_hold():
    def claimed(variant, **parameters):
        return {claim.metric for claim in load("ball_maze", variant=variant, **parameters).claims}

    assert claimed("outside") == {"unstable_pole", "leave_angle"}
    assert not claimed("outside", theta=0.0)  # a gap is on the way
    assert not claimed("outside", t_end=1.0)  # it does not come so far
    assert not claimed("outside", rolling_damping=1e-7)
    assert claimed("inside") == claimed("free") == {"swing_period"}
    assert not claimed("free", theta=0.0, ring=3)
    assert not claimed("inside", t_end=5.0)
    assert not claimed("solve", t_end=30.0)


def test_independent_solver_finds_the_same_events():
    case = load("ball_maze", variant="outside", t_end=3.1)
    system = maze.build(case.parameters, case.law)
    runs = [
        prepare(system, case.q0, case.v0, Options(t_end=3.1, rtol=1e-10, solver=solver, collisions="sequential"))
        for solver in ("compiled", "cvode")
    ]
    ours, theirs = (r.trajectory(*r.go()) for r in runs)
    assert [s.variable for s in ours.switches] == [s.variable for s in theirs.switches]
    assert [s.t for s in ours.switches] == pytest.approx([s.t for s in theirs.switches], abs=1e-6)
    landed = [next(e.t for e in r.events if e.contact == 3) for r in (ours, theirs)]
    assert landed[0] == pytest.approx(landed[1], abs=1e-6)
