"""Motions of the delta robot by the compiled integrator, against closed forms and independent solutions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from crossbody.cases import InvalidValue, Outcome, SceneError, load
from crossbody.cases.mechanisms.delta import form as chart
from crossbody.reference import delta, simulate
from crossbody.reference.delta import control, kick, paths, system
from crossbody.reference.delta.kernels import robot as kernels
from crossbody.reference.delta.kinematics import MOTORS, OTHERS
from crossbody.reference.delta.singularity import hanging_pose

P = 5.0


def holding(robot, q):
    """Constant inputs that hold a pose."""
    return np.concatenate([delta.gravity_torque(robot, q)[0], np.zeros(3)])


def pulse(hold, force, start, length):
    """Inputs: a rectangular flange force on top of constant ones."""
    push = hold + np.concatenate([np.zeros(3), force])
    return (np.array([0.0, start, start + length]), np.array([hold, push, hold])) if start else (
        np.array([0.0, length]), np.array([push, hold])
    )  # fmt: skip


def random_states(robot, n, seed=7):
    """Consistent states (q, v)."""
    rng = np.random.default_rng(seed)
    for z in rng.uniform([-0.1, -0.1, 0.5], [0.1, 0.1, 0.65], (n, 3)):
        q, v, yd = delta.inverse(robot, z), np.empty(9), rng.normal(size=3)
        v[MOTORS], v[OTHERS] = yd, delta.jacobians(robot, q)[2] @ yd
        yield q, v


@pytest.mark.parametrize("p", [2.0, P])
@pytest.mark.parametrize("name", delta.SETS)
def test_drift_from_an_inconsistent_start_is_the_exact_exponential(name, p):
    """h(t) = (h0 + (h0' + p h0) t) e^{-p t}, whatever the robot does meanwhile."""
    robot = delta.SETS[name]
    q = delta.inverse(robot, (0.05, 0.0, 0.6))
    q0, v0 = q + 1e-3 * np.sin(np.arange(9.0)), 1e-2 * np.cos(np.arange(9.0))
    h, hd = np.zeros(6), np.zeros(6)
    kernels.gaps(0.0, q0, v0, robot.array(), h, hd)
    run = simulate(
        system(robot, p=p), q0, v0, 3.0, rtol=1e-11, samples=np.linspace(0, 3, 61),
        inputs=([0.0], [holding(robot, q)]), consistent=False,
    )  # fmt: skip
    t = run.t[:, None]
    assert run.outcome is Outcome.FINISHED
    np.testing.assert_allclose(run.gap, (h + (hd + p * h) * t) * np.exp(-p * t), atol=1e-8 * np.abs(h).max())


def energy_drift(robot, q, v):
    run = simulate(system(robot), q, v, 5.0, rtol=1e-11)
    assert run.outcome is Outcome.FINISHED
    return np.abs(run.total_energy - run.total_energy[0]).max() / run.energy[:, 0].max()


@pytest.mark.parametrize("name", delta.SETS)
def test_free_undamped_robot_keeps_its_energy(name):
    """5 s at rtol 1e-11: below 1e-9 of the largest kinetic energy; 100 states in the slow test."""
    robot = replace(delta.SETS[name], d1=0.0, d2=0.0, d3=0.0)
    assert max(energy_drift(robot, *state) for state in random_states(robot, 5)) < 1e-9


@pytest.mark.slow
def test_free_undamped_robot_keeps_its_energy_from_a_hundred_states():
    robot = replace(delta.LIGHT, d1=0.0, d2=0.0, d3=0.0)
    assert max(energy_drift(robot, *state) for state in random_states(robot, 100)) < 1e-9


@pytest.mark.parametrize("name", delta.SETS)
def test_short_pulse_converges_to_the_impulse_at_first_order(name):
    robot = delta.SETS[name]
    q = delta.inverse(robot, (0.05, 0.02, 0.6))
    J, hold, t = np.array([0.3, -0.2, 0.1]) * robot.m3, holding(robot, q), np.linspace(0.2, 1.0, 9)
    hit = simulate(system(robot), q, kick(robot, q, np.zeros(9), J), 1.0, rtol=1e-12, samples=t, inputs=([0.0], [hold]))
    errors = []
    for length in (20e-3, 10e-3, 5e-3, 2.5e-3):
        inputs = pulse(hold, J / length, 0.0, length)
        run = simulate(system(robot), q, np.zeros(9), 1.0, rtol=1e-12, samples=t, inputs=inputs)
        errors.append(np.abs(run.q - hit.q).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 1.0, atol=0.01)


def test_impulse_changes_the_momentum_that_the_loops_leave_free():
    """S^T M dv = Jy^T J, and H dv = 0."""
    robot = delta.LIGHT
    q, J = delta.inverse(robot, (0.05, 0.02, 0.6)), np.array([0.3, -0.2, 0.1])
    dv = kick(robot, q, np.zeros(9), J)
    _, Jy, X = delta.jacobians(robot, q)
    np.testing.assert_allclose(delta.statics.closure_jacobian(robot, q) @ dv, 0.0, atol=1e-13)
    np.testing.assert_allclose(dv[OTHERS], X @ dv[MOTORS], atol=1e-12)
    np.testing.assert_allclose(delta.task_mass(robot, q) @ dv[MOTORS], Jy.T @ J, rtol=1e-11)


def test_pulse_under_servos_agrees_with_pinocchio():
    """5 s at rtol 1e-10 against Pinocchio's constrained dynamics through SciPy's DOP853 at 1e-13."""
    pytest.importorskip("pinocchio")
    from crossbody.engines.pinocchio._model import build

    robot = delta.LIGHT
    q0 = delta.inverse(robot, (0.0, 0.0, 0.6))
    y0, kp, kd, force = q0[0], 20.0, 1.0, np.array([20.0, 5.0, -10.0])
    servo = delta.Servo(kp=kp, kd=kd, y_start=(y0,) * 3, y_end=(y0,) * 3)
    hold, t = holding(robot, q0), np.linspace(0.0, 5.0, 26)
    inputs = pulse(hold, force, 0.5, 0.02)
    run = simulate(system(robot, servo=servo), q0, np.zeros(9), 5.0, rtol=1e-10, samples=t, inputs=inputs)

    form = chart.in_tree(load("delta_free", p=P))
    closed = build(form.case, "forwardDynamics").rows.native

    def motion(r, rd, f):
        (q,), (v,) = chart.motion(r[None], rd[None])
        tau = -np.tile([robot.d1, robot.d2, robot.d3], 3) * v
        tau[MOTORS] += hold[:3] + kp * (y0 - q[MOTORS]) - kd * v[MOTORS]
        tau += delta.virtual_jacobian(robot, q).T @ f
        return closed.accelerate(r, rd, form.rate_matrix(r).T @ tau)

    x, states = np.concatenate(form.to_scene(q0, np.zeros(9))), []
    for start, stop, f in ((0.0, 0.5, 0 * force), (0.5, 0.52, force), (0.52, 5.0, 0 * force)):
        grid = t[(t >= start) & (t < stop)] if stop < 5 else t[t >= start]
        solved = solve_ivp(
            lambda _, x, f=f: np.concatenate([x[9:], motion(x[:9], x[9:], f)[0]]),
            (start, stop), x, "DOP853", np.append(grid, stop) if stop < 5 else grid, rtol=1e-13, atol=1e-15,
        )  # fmt: skip
        states.append(solved.y.T[: len(grid)])
        x = solved.y[:, -1]
    states = np.vstack(states)
    q = chart.motion(states[:, :9], states[:, 9:])[0]
    z, own = (np.array([delta.flange(robot, row) for row in rows]) for rows in (q, run.q))
    np.testing.assert_allclose(own, z, atol=1e-10)
    at = np.abs(t - 0.5) > 1e-9  # lam jumps where the pulse begins
    lam = np.array([motion(s[:9], s[9:], 0 * force)[1] for s in states])
    np.testing.assert_allclose(run.lam[at], lam[at], atol=1e-8)


def swing(robot, kp, kd, hit):
    """Times and flange of the published run: ramp to the elbow pose in 4 s, a pulse along x at 10 s, 35 s in all."""
    end = delta.elbow_angle(robot)
    servo = delta.Servo(kp=kp, kd=kd, end=4.0, y_start=(np.pi / 4,) * 3, y_end=(end,) * 3, feedforward=True)
    inputs = pulse(np.zeros(6), hit, 10.0, 0.05)
    run = simulate(
        system(robot, servo=servo), delta.holding_pose(robot, np.pi / 4), np.zeros(9), 35.0,
        samples=np.linspace(0, 35, 3501), inputs=inputs,
    )  # fmt: skip
    assert run.outcome is Outcome.FINISHED, run.message
    return run, np.array([delta.flange(robot, q) for q in run.q])


@pytest.mark.parametrize(("name", "kp", "kd"), [("heavy", 2000.0, 200.0), ("light", 200.0, 20.0)])
def test_robot_swings_as_a_spherical_pendulum_at_the_elbow_pose(name, kp, kd):
    """1 N for 50 ms; period within 0.5 %; no torque of the servos can hold the swing, H keeps its rank."""
    robot = delta.SETS[name]
    run, z = swing(robot, kp, kd, np.array([1.0, 0.0, 0.0]))
    t, x = run.t[run.t > 15], z[run.t > 15, 0]
    i = np.flatnonzero((x[:-1] < 0) & (x[1:] >= 0))
    crossings = t[i] - x[i] * (t[i + 1] - t[i]) / (x[i + 1] - x[i])
    assert np.abs(x).max() < 0.02 * robot.l2
    np.testing.assert_allclose(np.diff(crossings), 2 * np.pi / delta.pendulum_rate(robot), rtol=0.005)
    H = delta.statics.closure_jacobian(robot, run.q[-1])
    assert np.linalg.matrix_rank(H, tol=1e-6) == 6
    assert delta.margins(robot, run.q[-1]).direct < 1e-3


def test_pose_at_which_the_multipliers_are_ill_posed_is_an_outcome():
    robot = delta.LIGHT
    q = hanging_pose(robot, delta.ill_posed_tilts(robot)[0])
    run = simulate(system(robot), q, np.zeros(9), 0.1)
    assert run.outcome is Outcome.ILL_POSED


def test_sampled_loop_in_the_compiled_integrator():
    """The circle of the control tests, here by the integrator: the same error as by Runge-Kutta of fixed step."""
    path = paths.circle((0.0, 0.0, 0.6), 0.05, 1.0)
    program = control.program(delta.LIGHT, control.Linearising(), path, 5.0)
    q = delta.inverse(delta.LIGHT, (0.0, 0.0, 0.6))
    run = simulate(system(delta.LIGHT, program=program), q, np.zeros(9), 5.0, samples=np.linspace(4, 5, 201))
    assert run.outcome is Outcome.FINISHED
    error = path(run.t)[0] - np.array([delta.flange(delta.LIGHT, row) for row in run.q])
    assert 0.05e-3 < np.linalg.norm(error, axis=1).max() < 0.25e-3


@pytest.mark.parametrize("bad", [-1.0, np.nan, np.inf])
def test_pole_outside_its_range_is_named(bad):
    with pytest.raises(InvalidValue, match="p is"):
        system(delta.LIGHT, p=bad)


def test_torques_of_the_wrong_length_are_named():
    q = delta.inverse(delta.LIGHT, (0.0, 0.0, 0.6))
    with pytest.raises(SceneError, match="values"):
        simulate(system(delta.LIGHT), q, np.zeros(9), 0.1, inputs=([0.0], [[1.0, 2.0, 3.0]]))


def test_servo_and_program_together_are_refused():
    program = control.program(delta.LIGHT, control.Linearising(), paths.hold((0.0, 0.0, 0.6)), 1.0)
    with pytest.raises(SceneError, match="not both"):
        system(delta.LIGHT, servo=delta.Servo(), program=program)
