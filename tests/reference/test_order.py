"""The observed order of both integrators at their steps, and of what they say between them."""

import numpy as np
from four_bar import assembled, four_bar
from mechanisms import flyby
from scipy.integrate import solve_ivp

from crossbody.cases import Outcome
from crossbody.reference import Options, prepare, simulate
from crossbody.reference.core.dop853_table import STABILITY_LIMIT
from crossbody.reference.core.layout import DONE, IMPLICIT

START = ([1.0, 0.0], [0.0, -0.4])
T_END = 2.0


def pendulum():
    """A point on a circle, held by a soft row: nothing but the motion itself bounds the step."""
    return flyby(1.0, 9.81, a0=1.0, a1=2.0, unilateral=False)


def exact(times):
    """(q, v) of the rigid pendulum at these times, by another integrator in another coordinate."""
    found = solve_ivp(
        lambda t, y: [y[1], -9.81 * np.cos(y[0])], (0.0, T_END), [0.0, -0.4], method="DOP853", rtol=1e-13, atol=1e-14,
        t_eval=times,
    )  # fmt: skip
    angle, rate = found.y
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c, s, -s * rate, c * rate], axis=1)


BETWEEN = np.linspace(0.1, 1.9, 61)


def errors(run):
    """Error at the last step's end, and the largest between steps."""
    motion = run.trajectory(Outcome.FINISHED, 0.0)
    wrong = np.abs(np.hstack([motion.q, motion.v]) - exact(np.append(BETWEEN, T_END))).max(axis=1)
    return wrong[-1], wrong[:-1].max()


def explicit(step):
    """Steps of one length, after a few that grow to it: no error is too large."""
    options = Options(t_end=T_END, rtol=1e-1, atol=1e6, max_step=step, samples=np.append(BETWEEN, T_END))
    run = prepare(pendulum(), *START, options)
    run.start()
    while run.slice(1000) != DONE:
        pass
    return *errors(run), T_END / step


def implicit(rtol):
    """All steps but the first by the implicit method, whatever they cost."""
    run = prepare(pendulum(), *START, Options(t_end=T_END, rtol=rtol, samples=np.append(BETWEEN, T_END)))
    run.start()
    run.slice(1)
    run.state["method"], run.state["have_jacobian"], run.state["full_jacobian"] = IMPLICIT, 0, 1
    while run.slice(1000) != DONE:
        pass
    assert run.state["implicit_steps"][0] == run.state["steps"][0] - 1
    return *errors(run), run.state["steps"][0]


def slopes(found):
    """Orders of the errors in the number of steps, by least squares over the whole ladder."""
    end, between, steps = np.log10(np.array(found)).T
    return [-np.polyfit(steps, error, 1)[0] for error in (end, between)]


def test_explicit_steps_are_of_order_eight_and_their_dense_output_of_order_seven():
    found = [explicit(T_END / n) for n in (8, 12, 16, 24, 32)]
    end, between = slopes(found)
    assert 7.4 < end < 9.4
    assert 6.4 < between < 9.4
    for at_end, inside, _ in found:
        assert inside < 10.0 * at_end


def test_implicit_steps_are_of_order_four_and_so_is_their_dense_output():
    found = [implicit(rtol) for rtol in (1e-5, 1e-6, 1e-7, 1e-8)]
    end, between = slopes(found)
    assert 3.5 < end < 5.0
    assert 3.5 < between < 5.0
    for at_end, inside, _ in found:
        assert inside < 6.0 * at_end  # 5.3 at rtol 1e-6, whose end is the luckiest of the ladder; 1.2 at 1e-8


def test_what_a_stabiliser_costs_where_nothing_drifts():
    """Its poles bound the step by the errors of the stages, far below the limit of stability; drift it has none.

    Printed with `pytest tests/reference/test_order.py -s`: the figures of the model's page.
    """
    taken = {}
    for pole in (0.01, 1.0, 20.0, 100.0):
        system = four_bar((1.0, 2.0, 2.0), 2.5, pole=pole)
        q, v = assembled(system, 1.0, (0.2, -1.5))
        run = simulate(system, q, -v, 3.0, rtol=1e-6, implicit=False)
        taken[pole] = run.steps
        print(f"\npole {pole:g}/s: {run.steps} steps, drift {np.abs(run.gap).max():.1e} m")
        assert run.outcome.ok
        assert np.abs(run.gap).max() < 1e-6
    assert taken[0.01] < 15
    assert 4 * taken[1.0] < taken[20.0] < 120
    assert 20.0 * 3.0 / taken[20.0] < 0.2 * STABILITY_LIMIT
