"""What the closed loop of the maze costs, against real time and against the number of rings."""

from __future__ import annotations

import pytest

from crossbody.cases import Outcome, load
from crossbody.reference import Options, prepare
from crossbody.reference.systems import maze

pytestmark = pytest.mark.bench


def best(**parameters):
    """Shortest of several runs, s, and steps."""
    case = load("ball_maze", variant="solve", **parameters)
    system = maze.build(case.parameters, case.law)
    run = prepare(system, case.q0, case.v0, Options(t_end=case.t_end, rtol=1e-8, collisions="sequential"))
    run.warm()
    ends = [run.go() for _ in range(7)]
    assert {outcome for outcome, _ in ends} == {Outcome.FINISHED}
    return min(wall for _, wall in ends), run.trajectory(*ends[0]).steps


def test_fifty_rings_cost_as_much_as_five():
    """45 of them outside the ball's motion."""
    (five, steps), (fifty, same) = best(rings=5), best(rings=50)
    print(f"5 rings {1e3 * five:.1f} ms, 50 rings {1e3 * fifty:.1f} ms, {steps} and {same} steps")
    assert steps == same
    assert fifty <= 1.2 * five


def test_closed_loop_runs_at_least_150_times_faster_than_real_time():
    wall, steps = best()
    print(f"75 s in {1e3 * wall:.1f} ms: {75.0 / wall:.0f} times real time, {steps} steps")
    assert 75.0 / wall >= 150.0
