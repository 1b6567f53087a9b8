"""The ball maze in closed loop: balance, snatch, drop, catch, to the centre."""

from __future__ import annotations

import json
import math
from functools import cache

import numpy as np
import pytest

from crossbody.cases import CrossbodyError, Mode, Outcome, load
from crossbody.cases import closed_forms as cf
from crossbody.reference import simulate
from crossbody.reference.systems import maze
from crossbody.reports import metrics
from crossbody.reports.commands import maps
from crossbody.reports.maps import stability
from crossbody.reports.runs import choice

CHANNEL, LOWER, UPPER, MODE = range(4)
BALANCE, SNATCH, CENTRE = 1, 2, 3
FACES = (0, 3)


@cache
def solved(rtol=1e-8, **parameters):
    case = load("ball_maze", variant="solve", **parameters)
    system = maze.build(case.parameters, case.law)
    return simulate(system, case.q0, case.v0, case.t_end, rtol=rtol, collisions="sequential", ledger=True)


def changes(motion, variable=CHANNEL):
    return [s for s in motion.switches if s.variable == variable]


def ring_times(motion):
    return np.array([s.t for s in changes(motion)])


def test_ball_comes_to_the_centre_ring_by_ring():
    motion = solved()
    assert motion.outcome is Outcome.FINISHED
    assert [(s.before, s.after) for s in changes(motion)] == [(4, 3), (3, 2), (2, 1), (1, 0)]
    assert ring_times(motion) == pytest.approx([11.7, 21.9, 30.5, 59.05], abs=0.05)
    assert [s.after for s in changes(motion, MODE)] == [SNATCH, BALANCE] * 3 + [SNATCH, CENTRE]
    assert len([s for s in changes(motion, LOWER) if s.after >= 0]) == 4
    assert len(changes(motion, UPPER)) == 4 + 6  # a gap above after every ring; six edges that move no force


def test_ring_is_where_the_published_pictures_show_the_ball():
    """On ring 1 at 27 s, at rest in the centre at 65 s."""
    motion = solved()
    for t, rho in ((27.0, 0.0412 + 6.35e-3), (65.0, 0.016 - 6.35e-3)):
        x, y = (np.interp(t, motion.t, motion.q[:, i]) for i in (1, 2))
        assert math.hypot(x, y) == pytest.approx(rho, abs=1e-6)
    late = motion.t > 65.0
    assert np.abs(motion.v[late]).max() < 1e-5


def test_ring_changes_do_not_depend_on_the_tolerance():
    np.testing.assert_allclose(ring_times(solved(1e-8)), ring_times(solved(1e-10)), atol=1e-6, rtol=0.0)


def test_a_soft_slip_row_does_not_depend_on_the_tolerance():
    """A row without a position is not put where its gap, which is always 0, would say."""
    np.testing.assert_allclose(
        ring_times(solved(1e-8, a1_slip=20.0)), ring_times(solved(1e-10, a1_slip=20.0)), atol=1e-4, rtol=0.0
    )


def test_slip_constant_hardly_moves_the_ring_changes():
    np.testing.assert_allclose(ring_times(solved(a1_slip=20.0)), ring_times(solved()), atol=0.02)


def test_contacts_take_the_weight_times_the_height():
    motion = solved(1e-10)
    contact = motion.ledger.contact[-1]
    assert -contact.sum() == pytest.approx(7.00e-4, rel=1e-2)
    assert -contact[:6].sum() == pytest.approx(6.9997e-4, rel=1e-4)
    assert -contact[6:].sum() == pytest.approx(1.7e-7, rel=0.05)
    assert motion.ledger.input[-1] == pytest.approx(-1.04e-7, rel=0.01)
    E = motion.total_energy
    residual = E - E[0] - motion.ledger.input - motion.ledger.contact.sum(axis=1)
    assert np.abs(residual).max() < 1e-11


def test_landings_are_those_of_the_closed_forms():
    """Fall from the circle of the tips, restitution exp(-2), penetration v/(e w), contact 2/w."""
    motion = solved(1e-10)
    touches = [e for e in motion.events if e.contact in FACES and e.after == Mode.CONTACT]
    first = next(e for e in touches if e.t > 11.6)
    i = np.searchsorted(motion.t, first.t)
    v = np.linalg.norm(motion.v[i, 1:3])
    assert v == pytest.approx(0.186, abs=1e-3)
    leave = next(e for e in motion.events if e.t > first.t and e.after == Mode.BALLISTIC)
    assert leave.t - first.t == pytest.approx(2.0e-3, rel=0.03)
    window = (motion.t >= first.t) & (motion.t <= leave.t)
    assert -motion.gap[window, 0].min() == pytest.approx(v * math.exp(-1.0) / 1e3, rel=0.01)
    assert len(touches) == 13


def test_bounds_of_the_published_run_hold():
    motion = solved(1e-10)
    outside = motion.t < changes(motion)[-1].t
    held = outside & (motion.mode[:, 0] == Mode.CONTACT)
    delta = np.arctan2(motion.q[held, 1], motion.q[held, 2])
    assert np.abs(np.degrees(delta)).max() < 0.25
    assert 6.4 < np.abs(motion.v[:, 0]).max() <= 6.6
    pushing = motion.lam[:, :6].sum(axis=1) > 7e-3  # the ball's weight; no bound holds where a contact ends
    needed = np.abs(motion.lam[:, 6:]).sum(axis=1)[pushing] / motion.lam[pushing, :6].sum(axis=1)
    assert needed.max() < 0.26


def test_sampled_controller_arrives_at_the_same_times():
    motion = solved(controller="sampled", sample=5e-3, delay=1)
    assert ring_times(motion) == pytest.approx(ring_times(solved()), abs=0.2)


def test_noisy_readings_are_the_same_at_every_run_and_change_with_the_seed():
    settings = {"controller": "sampled", "sample": 2e-3, "noise": 2e-5, "noise_speed": 2e-3, "t_end": 1.0}
    a, b, c = solved(**settings), solved(rtol=1.0001e-8, **settings), solved(seed=1, **settings)
    assert np.abs(a.q[-1] - b.q[-1]).max() < 1e-6
    assert np.abs(a.q[-1, 0] - c.q[-1, 0]) > 1e-4


@pytest.mark.parametrize(("a0", "zeta"), [(1e4, 1.0), (1e5, 1.0), (1e6, 2.0), (1e7, 1.0), (1e6, 0.5), (1e6, 0.3)])
def test_softer_harder_and_livelier_contacts_solve_the_maze_at_the_same_times(a0, zeta):
    a1 = 2.0 * zeta * math.sqrt(a0)
    assert ring_times(solved(a0=a0, a1=a1, a1_slip=a1)) == pytest.approx(ring_times(solved()), abs=0.15)


@pytest.mark.parametrize("zeta", [0.1, 0.2])
def test_a_rebound_into_the_ring_above_loses_the_ball(zeta):
    """e is above the 0.33 that the channel's clearance allows; the first drop is the last that goes well.

    Each rebound makes errors grow: at 1e-8 when the ball is lost depends on the tolerance by seconds, at 1e-9 by .2 s.
    """
    a1 = 2000.0 * zeta
    motion = solved(rtol=1e-10, a1=a1, a1_slip=a1)
    limit = math.sqrt(2.0 * 0.855 * 2.3e-3) / 0.186  # up to it a ball that lands so fast does not reach the ring above
    assert cf.restitution(zeta) > limit == pytest.approx(0.33, abs=0.01)
    assert motion.outcome is Outcome.LOST
    assert "controller" in motion.message
    assert motion.t[-1] < 15.0


def test_a_maze_that_cannot_turn_fast_enough_loses_the_ball_and_says_where():
    motion = solved(u_max=0.02)
    assert motion.outcome is Outcome.LOST
    x, y = motion.q[-1, 1:3]
    assert y / math.hypot(x, y) == pytest.approx(0.5, abs=1e-9)
    assert changes(motion)[-1].after > 0


@pytest.mark.parametrize("angle", [1.1, -1.1])
def test_start_beyond_sixty_degrees_is_lost_at_once(angle):
    case = load("ball_maze", variant="solve", angle=angle)
    motion = simulate(maze.build(case.parameters, case.law), case.q0, case.v0, 1.0, collisions="sequential")
    assert motion.outcome is Outcome.LOST
    assert "t = 0 s" in motion.message


SAMPLE = {
    "angle = -0.05", "a_max = 40, u_max = 0", "a_max = 30, u_max = 0", "wn = 10", "omega = 0.03", "omega = 0.8",
    "theta = 0.8",
}  # fmt: skip


def test_a_sample_of_the_stability_map_is_as_published():
    points = [point for point in stability.POINTS if point.scene in SAMPLE]
    assert len(points) == len(SAMPLE)
    rows = stability.stability_map(points=points)
    assert stability.surprises(rows).empty, stability.surprises(rows).to_string()
    assert set(rows["outcome"]) == {"finished", "lost"}
    arrival = rows.set_index("scene")["arrival"]
    assert arrival["omega = 0.03"] == pytest.approx(118.0, abs=0.5)
    assert arrival["omega = 0.8"] == pytest.approx(4.8, abs=0.1)


@pytest.mark.slow
def test_the_whole_stability_map_is_as_published():
    rows = stability.stability_map()
    assert stability.surprises(rows).empty, stability.surprises(rows).to_string()


def test_surprises_are_the_points_that_end_otherwise():
    points = [
        stability.Point(change="t_end", parameters={"t_end": 12.0}),
        stability.Point(change="t_end", parameters={"t_end": 12.0}, expected="fails"),
        stability.Point(change="t_end", parameters={"t_end": 12.0}, expected=stability.TUMBLES),
    ]
    rows = stability.stability_map(points=points)
    assert stability.surprises(rows).index.tolist() == [0]
    assert rows["changes"].tolist() == [1, 1, 1]


def test_map_is_a_command_with_a_section_of_the_page(tmp_path, monkeypatch, capsys):
    points = (stability.Point(change="omega", parameters={"omega": 0.8}), stability.Point(change="default"))
    absent = stability.Point(change="t_end", parameters={"t_end": 2.0})
    monkeypatch.setattr(stability, "POINTS", (*points, absent))
    assert maps.stability_map((), tmp_path / "out", "crossbody stability") == 1
    said = capsys.readouterr().out
    assert "outside: reference:compiled t_end = 2: solved expected." in said
    page = (tmp_path / "out" / "index.html").read_text()
    assert 'id="index--stability"' in page
    assert "omega = 0.8" in page
    kept = json.loads((tmp_path / "out" / "stability.json").read_text())["rows"]
    assert [row["arrived"] for row in kept] == [True, True, False]


def test_an_engine_that_cannot_run_the_maze_says_so():
    pick = choice.Pick(engine="absent", profile="any", skipped="absent is not installed.")
    rows = stability.stability_map([pick], [stability.Point(change="default")])
    assert rows["outcome"].tolist() == ["skipped"]
    assert rows["why"].tolist() == ["absent is not installed."]
    assert stability.surprises(rows).empty


def test_metrics_of_ring_changes_compare_run_and_truth():
    class Truth:
        trajectory = solved(1e-10)

    case = load("ball_maze", variant="solve")
    own = metrics.of(case)
    assert own["ring_changes"].measure(Truth, solved(), case) == 4.0
    assert 0.0 < own["ring_change_times"].measure(Truth, solved(), case) < 1e-6
    assert own["ring_change_times"].measure(Truth, solved(u_max=0.02), case) is None
    assert not {"ring_changes", "ring_change_times", "leave_angle", "unstable_pole"} & set(
        metrics.of(load("bouncing_ball"))
    )


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"width3": 100.0}, ["Ring 3", "cover the whole ring", "width3 below 86.2"]),
        ({"gaps0": 3, "width0": 110.0}, ["Ring 0", "cover", "below"]),
        ({"ball_radius": 7.5e-3}, ["wider than the channel between ring 0 and ring 1", "below 0.0074"]),
        ({"ball_radius": 7.1e-3}, ["wider than the gaps of ring 1", "below 0.00697"]),
        ({"width2": 5.0}, ["wider than the gaps of ring 2", "wider gap"]),
        ({"inner3": 0.05}, ["Ring 2 and ring 3 overlap"]),
        ({"wall": 0.08}, ["Ring 3 and the wall overlap"]),
        ({"outer2": 0.05}, ["Ring 2", "outer2", "above inner2"]),
        ({"ring": 4}, ["ring is 4", "0 to 3"]),
        ({"rings": 2}, ["ring is 3", "0 to 1"]),
        ({"tip": 0.0}, ["tip is 0", "(0, 90]"]),
        ({"ball_mass": -1.0}, ["ball_mass"]),
        ({"controller": "pid"}, ["controller", "continuous"]),
        ({"sample": 0.0}, ["sample"]),
        ({"rings": 2.5}, ["rings", "whole number"]),
    ],
)
def test_bad_input_is_named_with_what_would_be_valid(parameters, words):
    with pytest.raises(CrossbodyError) as told:
        load("ball_maze", variant="solve", **parameters)
    for word in words:
        assert word in str(told.value), str(told.value)
