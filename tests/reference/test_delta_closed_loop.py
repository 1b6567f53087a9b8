"""The delta robot under sampled control in the compiled integrator: four right-hand sides a tick, the same motion."""

import numpy as np
import pytest

from crossbody.reference import Options, delta, prepare
from crossbody.reference.delta import control, paths
from crossbody.reference.delta.control import Linearising, Sampling

PERIOD, T_END = 0.88e-3, 5.0
TICKS = int(np.ceil(T_END / PERIOD))


def loop(path, rtol):
    """A prepared run of the light robot, 18 bits, one sample of delay."""
    robot = delta.LIGHT
    program = control.program(robot, Linearising(), path, T_END, Sampling(period=PERIOD, delay=1, bits=18))
    q = delta.inverse(robot, (0.0, 0.0, 0.6))
    return prepare(
        delta.system(robot, program=program), q, np.zeros(9), Options(t_end=T_END, rtol=rtol, samples=[T_END])
    )


def test_four_right_hand_sides_a_tick_give_the_high_order_motion():
    path = paths.circle((0.0, 0.0, 0.6), 0.02, 0.5)
    short, high = loop(path, 1e-6), loop(path, 1e-11)
    ends = [run.trajectory(*run.go()) for run in (short, high)]
    assert all(run.outcome.ok for run in ends)
    assert ends[0].counts["rhs"] < 4.1 * TICKS
    assert ends[1].counts["rhs"] > 10.0 * TICKS
    apart = delta.flange(delta.LIGHT, ends[0].q[-1]) - delta.flange(delta.LIGHT, ends[1].q[-1])
    assert np.abs(apart).max() < 1e-8


@pytest.mark.bench
def test_closed_loop_against_real_time():
    run = loop(paths.hold((0.0, 0.0, 0.6)), 1e-6)
    run.warm()
    wall = min(run.go()[1] for _ in range(15))
    per_tick, rhs = wall / TICKS, int(run.state["rhs"][0]) / TICKS
    print(f"\nclosed loop at {1e3 * PERIOD:g} ms: {T_END / wall:.0f} times real time, {1e6 * per_tick:.2f} us and "
          f"{rhs:.1f} right-hand sides a tick")  # fmt: skip
    assert T_END / wall > 100.0
