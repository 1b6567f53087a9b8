"""The controlled delta robot as a linear model: what is characteristic of it, and the motion that it predicts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from crossbody import cases
from crossbody.reference import delta, simulate
from crossbody.reference.delta import control, paths
from crossbody.reference.delta.control import Gains, Linearising, Proportional, Sampling
from crossbody.reference.delta.kernels import control as compiled
from crossbody.reference.delta.kernels.robot import solve
from crossbody.reference.delta.kinematics import MOTORS, OTHERS
from crossbody.reference.delta.loop import characteristic, closed_loop
from crossbody.reference.linear import linearise
from crossbody.reports.analysis.numbers import coefficients
from crossbody.reports.analysis.places import places

LAW = np.tile([400.0, 40.0, 0.0], (6, 1))
POSES = [(0.0, 0.0, 0.6), (0.05, -0.02, 0.55), (0.1, 0.05, 0.5)]


@pytest.mark.parametrize("robot", delta.SETS.values(), ids=delta.SETS)
@pytest.mark.parametrize("z", POSES)
def test_characteristic_coefficients(robot, z):
    """(s + 7)^3 in every axis, and no axis moves another: what is linearised by feedback is linear."""
    found = characteristic(closed_loop(robot, delta.inverse(robot, z)))
    for matrix, coefficient in zip(found, (21.0, 147.0, 343.0), strict=True):
        np.testing.assert_allclose(matrix, coefficient * np.eye(3), atol=1e-10 * coefficient)


def test_gains_and_the_mass_that_is_believed_show():
    robot, q = delta.LIGHT, delta.inverse(delta.LIGHT, POSES[1])
    found = characteristic(closed_loop(robot, q, Linearising(gains=Gains(kp=75.0, kd=15.0, ki=125.0))))
    np.testing.assert_allclose([np.diag(c).mean() for c in found], [15.0, 75.0, 125.0], rtol=1e-9)
    rough = closed_loop(replace(robot, d1=0.0, d2=0.0, d3=0.0), q, Linearising(exact=False))
    ratio = np.linalg.eigvals(
        np.linalg.solve(delta.task_mass(robot, q), delta.task_mass(robot, q, exact=False))
    )  # fmt: skip
    np.testing.assert_allclose(
        np.sort(np.linalg.eigvals(characteristic(rough)[0]).real), np.sort(21.0 * ratio.real), rtol=1e-8
    )


def test_a_pd_on_the_motors_has_no_integral():
    loop = closed_loop(delta.LIGHT, delta.inverse(delta.LIGHT, POSES[0]), Proportional())
    assert len(loop.states) == 6
    assert loop.poles().real.max() < 0.0
    np.testing.assert_allclose(loop.response([1e-9])[0, :, :3], np.eye(3), atol=1e-6)  # it settles on its reference


def stepped(robot, q0, step, t):
    """The flange (m, 3) after the reference stepped, the controller evaluated in every stage of the integrator."""
    wanted = np.concatenate([delta.flange(robot, q0) + step, np.zeros(6)])
    gains, p, idx = Gains().values(), robot.array(), np.arange(6)

    def rate(_t, y):
        q, v, tau, u = y[:9].copy(), y[9:18].copy(), np.zeros(3), np.zeros(6)
        error = wanted[:3] - delta.flange(robot, q)
        given = q[MOTORS].copy(), q[OTHERS].copy(), v[MOTORS].copy()
        assert compiled.command(p, *given, wanted, y[18:].copy(), gains, True, True, True, 0.0, 1.0, tau) == 0
        a, lam, hd = np.zeros(9), np.zeros(6), np.zeros(6)
        u[:3] = tau
        assert solve(0.0, q, v, u, p, np.zeros(18), LAW, idx, 6, a, lam, hd) == 0
        return np.concatenate([v, a, error])

    start = np.concatenate([q0, np.zeros(12)])
    run = solve_ivp(rate, (0.0, t[-1]), start, method="DOP853", t_eval=t, rtol=1e-10, atol=1e-13)
    return np.array([delta.flange(robot, y[:9]) for y in run.y.T])


def predicted(loop, step, t):
    """The same (m, 3) from the linear model, from its pose."""
    n = len(loop.states)
    both = np.zeros((n + 3, n + 3))
    both[:n, :n], both[:n, n:] = loop.A, loop.B[:, :3]
    return np.array([(expm(both * s) @ np.concatenate([np.zeros(n), step]))[:3] for s in t])


def test_step_response_of_the_simulation_and_of_the_linear_model():
    """What the linear model leaves out is quadratic in the step: 0.4 % of a millimetre, four times as much of two."""
    robot, q = delta.LIGHT, delta.inverse(delta.LIGHT, POSES[1])
    loop, t, direction = closed_loop(robot, q), np.linspace(0.0, 1.5, 31), np.array([1.0, 0.5, -1.0]) / 1.5
    apart = []
    for size in (4e-3, 2e-3, 1e-3):
        moved = stepped(robot, q, size * direction, t) - delta.flange(robot, q)
        apart.append(np.abs(moved - predicted(loop, size * direction, t)).max())
    np.testing.assert_allclose(np.log2(apart[:2]) - np.log2(apart[1:]), 2.0, atol=0.1)
    assert apart[-1] < 5e-3 * 1e-3


def test_step_response_of_the_sampled_loop():
    """At the rig's period, without delay and encoder: the linear model up to one period of its fastest slope."""
    robot, z, step = delta.LIGHT, np.array(POSES[0]), np.array([1e-3, 0.0, 0.0])
    q, t = delta.inverse(robot, POSES[0]), np.linspace(0.0, 1.5, 31)
    program = control.program(robot, Linearising(), paths.hold(z + step), 1.5, Sampling(delay=0, bits=None))
    run = simulate(delta.system(robot, p=20.0, program=program), q, np.zeros(9), 1.5, samples=t, rtol=1e-9)
    moved = np.array([delta.flange(robot, x) for x in run.q]) - z
    expected = predicted(closed_loop(robot, q), step, t)
    fastest = np.abs(np.gradient(expected[:, 0], t)).max()
    assert np.abs(moved - expected).max() < 2.0 * program.tick * fastest


def test_each_jacobian_where_it_belongs():
    """A force on the flange acts through Jv on nine joints, motors through Jy: one motion, other loads in the loops."""
    robot, q = delta.LIGHT, delta.inverse(delta.LIGHT, POSES[1])
    hold = np.concatenate([delta.gravity_torque(robot, q)[0], np.zeros(3)])
    model = linearise(delta.system(robot), q, u=hold, outputs=("v", "lam"), reduce=True)
    _, Jy, _ = delta.jacobians(robot, q)
    by_motors, by_flange = model.B[:, :3], model.B[:, 3:]
    np.testing.assert_allclose(by_motors @ Jy.T, by_flange, atol=1e-9 * np.abs(by_flange).max())
    loads = model.D[9:]
    assert np.abs(loads[:, :3] @ Jy.T - loads[:, 3:]).max() > 0.1
    rates = np.asarray(delta.virtual_jacobian(robot, q)) @ model.C[:9]
    np.testing.assert_allclose(rates, Jy @ model.C[:9][MOTORS], atol=1e-12)


def test_the_analysis_of_a_tracking_robot_shows_its_loop():
    found = places(cases.load("delta_tracking"))
    rows = coefficients(found)
    assert rows[["s^2", "s", "1"]].to_numpy() == pytest.approx(np.tile([21.0, 147.0, 343.0], (3, 1)), rel=1e-9)
    assert rows["coupling"].max() < 1e-9
    open_loop, loop = found
    assert open_loop.spot is not None
    assert loop.spot is None
    assert loop.model.poles().real.max() < -6.9
