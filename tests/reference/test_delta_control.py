"""Control of the delta robot: the linear model, the sampled loop against its prediction, limits and bad input.

The loop is closed here by a Runge-Kutta method of fixed step, independent of the project's integrators.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numba import njit
from scipy.linalg import expm

from crossbody.cases import InvalidValue
from crossbody.reference import delta
from crossbody.reference.delta import control, paths
from crossbody.reference.delta.control import Gains, Linearising, Proportional, Sampling
from crossbody.reference.delta.kernels import control as compiled
from crossbody.reference.delta.kernels import robot as kernels
from crossbody.reference.delta.kinematics import MOTORS, OTHERS

LAW = np.tile([25.0, 10.0, 0.0], (6, 1))
ROBOTS = [replace(robot, sign=sign) for robot in delta.SETS.values() for sign in (1.0, -1.0)]
POSES = [(0.0, 0.0, 0.6), (0.1, -0.05, 0.55)]
NONE = np.zeros(3)
solve = kernels.solve


@pytest.fixture(params=ROBOTS, ids=lambda r: f"m1={r.m1},sign={r.sign:+g}")
def robot(request):
    return request.param


@njit
def closed_loop(controller, n, period, q, v, plant, p, s, law, out, torque):
    """Fourth-order Runge-Kutta, one step a sample; the controller's parameters p need not be the plant's."""
    idx, u, w = np.arange(6), np.zeros(6), np.zeros(18)
    lam, hd, a = np.zeros(6), np.zeros(6), np.zeros(9)
    k, y, x = np.zeros((4, 18)), np.concatenate((q, v)), np.zeros(18)
    for i in range(n):
        out[i] = y
        controller(i * period, y[:9], y[9:], u, s, p)
        torque[i] = u[:3]
        for j in range(4):
            x[:] = y + (0.0 if j == 0 else (1.0 if j == 3 else 0.5)) * period * k[j - 1]
            if solve(0.0, x[:9], x[9:], u, plant, w, law, idx, 6, a, lam, hd) != 0:
                return i
            k[j, :9], k[j, 9:] = x[9:], a
        y += period / 6 * (k[0] + 2 * k[1] + 2 * k[2] + k[3])
    return n


def run(plant, controller, path, t_end, sampling, start=None, model=None):
    """Times, flange errors, states, torques, final memory; the controller believes in `model`."""
    program = control.program(model or plant, controller, path, t_end, sampling)
    n = int(t_end / program.tick)
    out, torque, s = np.zeros((n, 18)), np.zeros((n, 3)), np.zeros(program.memory)
    q = delta.inverse(plant, path(np.zeros(1))[0][0] if start is None else start)
    own, p = plant.array(), program.parameters
    done = closed_loop(program.control, n, program.tick, q, np.zeros(9), own, p, s, LAW, out, torque)
    assert done == n
    assert np.all(np.isfinite(out))
    t = np.arange(n) * program.tick
    return t, path(t)[0] - np.array([delta.flange(plant, x[:9]) for x in out]), out, torque, s


def near(robot, q0, z, zd):
    """Pose and velocity (9,) with the flange displaced by z and moving at zd, to first order."""
    Jy = delta.jacobians(robot, q0)[1]
    q = delta.forward(robot, q0[MOTORS] + np.linalg.solve(Jy, z), q0)
    _, Jy, X = delta.jacobians(robot, q)
    v = np.zeros(9)
    v[MOTORS] = np.linalg.solve(Jy, zd)
    v[OTHERS] = X @ v[MOTORS]
    return q, v


def torque(robot, q, v, reference, integral, **options):
    """The continuous controller's torques (3,)."""
    flags, tau, memory = {"exact": True, "feedforward": True, "friction": True} | options, np.zeros(3), integral.copy()
    given = robot.array(), q[MOTORS].copy(), q[OTHERS].copy(), v[MOTORS].copy(), reference, memory, Gains().values()
    assert compiled.command(*given, *flags.values(), 0.0, 1.0, tau) == 0
    return tau


def flange_acceleration(robot, q, v, tau):
    """z'' = Jv v' + Jv' v."""
    vd, lam, hd = np.zeros(9), np.zeros(6), np.zeros(6)
    u = np.concatenate([tau, np.zeros(3)])
    assert solve(0.0, q, v, u, robot.array(), np.zeros(18), LAW, np.arange(6), 6, vd, lam, hd) == 0
    h = 1e-6
    Jvd = (delta.virtual_jacobian(robot, q + h * v) - delta.virtual_jacobian(robot, q - h * v)) / (2 * h)
    return delta.virtual_jacobian(robot, q) @ vd + Jvd @ v


def derivative(function):
    """3 x 3 by central differences about 0."""
    h = 1e-4
    return np.column_stack([(function(h * e) - function(-h * e)) / (2 * h) for e in np.eye(3)])


def response(robot, q0, *, z=NONE, zd=NONE, integral=NONE, rdd=NONE, **options):
    """Acceleration of the flange under the continuous controller, its reference at rest at the pose q0."""
    q, v = near(robot, q0, z, zd)
    reference = np.concatenate([delta.flange(robot, q0), NONE, rdd])
    return flange_acceleration(robot, q, v, torque(robot, q, v, reference, integral, **options))


def linear_model(robot, q0, **options):
    """The 9 x 9 matrix of (z, z', INT e)."""
    names = ("z", "zd", "integral")
    row = [derivative(lambda x, name=name: response(robot, q0, **{name: x}, **options)) for name in names]
    zero, one = np.zeros((3, 3)), np.eye(3)
    return np.block([[zero, one, zero], row, [-one, zero, zero]])


@pytest.mark.parametrize("z0", POSES)
def test_characteristic_coefficients_of_the_linear_model(robot, z0):
    """Each axis is (s + 7)^3 and no axis moves another."""
    A = linear_model(robot, delta.inverse(robot, z0))
    for rows, expected in ((slice(0, 3), -147.0), (slice(3, 6), -21.0), (slice(6, 9), 343.0)):
        np.testing.assert_allclose(A[3:6, rows], expected * np.eye(3), rtol=0.005, atol=1e-3)


@pytest.mark.parametrize("name", delta.SETS)
def test_friction_that_is_not_compensated_adds_to_the_damping(name):
    """With gravity alone compensated the coefficient 21 grows by My^-1 S^T D S: 2.5 % (heavy), 3.6 % (light) at z0."""
    robot = delta.SETS[name]
    q = delta.inverse(robot, POSES[0])
    _, Jy, X = delta.jacobians(robot, q)
    S = np.zeros((9, 3))
    S[MOTORS], S[OTHERS] = np.eye(3), X
    D = np.diag([robot.d1, robot.d2, robot.d3] * 3)
    extra = Jy @ np.linalg.solve(delta.task_mass(robot, q), S.T @ D @ S) @ np.linalg.inv(Jy)
    A = linear_model(robot, q, friction=False)
    np.testing.assert_allclose(A[3:6, 3:6], -21 * np.eye(3) - extra, rtol=1e-6, atol=1e-6)
    assert extra[0, 0] / 21 == pytest.approx({"heavy": 0.0254, "light": 0.0356}[name], rel=0.01)


@pytest.mark.parametrize("y", [0.2, 0.5, 0.8, 1.2, 1.5, 1.65, 1.7, 1.72, 1.75, 1.8, 1.9, 2.0, 2.1])
def test_loop_with_the_approximate_mass_is_stable_while_the_ratio_exceeds_a_ninth(y):
    """s^3 + rho (21 s^2 + 147 s + 343) is stable for rho > 1/9, rho the ratio of model to plant."""
    robot = replace(delta.LIGHT, d1=0.0, d2=0.0, d3=0.0)
    q = delta.holding_pose(robot, y)
    ratio = np.linalg.eigvals(np.linalg.solve(delta.task_mass(robot, q), delta.task_mass(robot, q, exact=False))).real
    poles = np.linalg.eigvals(linear_model(robot, q, exact=False))
    assert (poles.real.max() < 0) == (ratio.min() > 1 / 9) == (y < 1.71 or y > 1.99)


@pytest.mark.parametrize("z0", POSES)
def test_with_the_acceleration_of_the_reference_nothing_is_left(robot, z0):
    """At e = e' = 0, z'' = r''; without it z'' = 0, which makes E/R = s^3/(s + 7)^3."""
    q, rdd = delta.inverse(robot, z0), np.array([1.0, -2.0, 0.5])
    np.testing.assert_allclose(response(robot, q, rdd=rdd), rdd, rtol=1e-9)
    np.testing.assert_allclose(response(robot, q, rdd=rdd, feedforward=False), 0.0, atol=1e-9)


def plant_model(robot, q0):
    """A (6, 6) and B (6, 3) of (z, z') under torques about the pose q0, held there."""
    hold = delta.gravity_torque(robot, q0)[0]
    by_z = derivative(lambda x: flange_acceleration(robot, *near(robot, q0, x, NONE), hold))
    by_zd = derivative(lambda x: flange_acceleration(robot, *near(robot, q0, NONE, x), hold))
    by_tau = derivative(lambda x: flange_acceleration(robot, q0, np.zeros(9), hold + x))
    return np.block([[np.zeros((3, 3)), np.eye(3)], [by_z, by_zd]]), np.vstack([np.zeros((3, 3)), by_tau])


def predicted_error(robot, q0, radius, sampling, feedforward):
    """Complex amplitude (3,) of e on a circle of 1 Hz: linear plant behind a zero-order hold, sampled controller."""
    T, w = sampling.period, 2 * np.pi
    Z = np.exp(1j * w * T)
    A, B = plant_model(robot, q0)
    held = expm(np.block([[A, B], [np.zeros((3, 9))]]) * T)
    G = np.linalg.solve(Z * np.eye(6) - held[:6, :6], held[:6, 6:])[:3] * Z**-sampling.delay

    rest = q0, np.zeros(9)

    def tau(state=rest, r=NONE, rd=NONE, rdd=NONE, integral=NONE):
        reference = np.concatenate([delta.flange(robot, q0) + r, rd, rdd])
        return torque(robot, *state, reference, integral, feedforward=feedforward)

    by_z = derivative(lambda x: tau((near(robot, q0, x, NONE)[0], np.zeros(9))))
    by_zd = derivative(lambda x: tau((q0, near(robot, q0, NONE, x)[1])))
    sums = derivative(lambda x: tau(integral=x)) * T * Z / (Z - 1)
    by_r, by_rd, by_rdd = (derivative(lambda x, name=name: tau(**{name: x})) for name in ("r", "rd", "rdd"))
    r = radius * np.array([1.0, -1j, 0.0])
    feedback = by_z + by_zd * (1 - 1 / Z) / T - sums
    given = (by_r + 1j * w * by_rd - w**2 * by_rdd + sums) @ r
    return r - np.linalg.solve(np.eye(3) - G @ feedback, G @ given)


@pytest.mark.parametrize("delay", [0, 1, 2])
@pytest.mark.parametrize("feedforward", [True, False])
@pytest.mark.parametrize("z0", POSES)
def test_sampled_loop_follows_its_discrete_prediction(robot, z0, delay, feedforward):
    """On a circle small enough for the linear model, the error at every sample within 1 % of its amplitude."""
    radius, sampling = 2e-4, Sampling(delay=delay, bits=None)
    controller, path = Linearising(feedforward=feedforward), paths.circle(z0, radius, 1.0)
    t, e, *_ = run(robot, controller, path, 4.0, sampling)
    E = predicted_error(robot, delta.inverse(robot, z0), radius, sampling, feedforward)
    late = t > 3
    expected = (E * np.exp(2j * np.pi * t[late, None])).real
    np.testing.assert_allclose(e[late], expected, atol=0.01 * np.abs(expected).max())


def test_wide_circle_leaves_about_a_tenth_of_a_millimetre(robot):
    """50 mm, 1 Hz: what the linear prediction leaves, changed by the velocity terms that the law omits."""
    t, e, *_ = run(robot, Linearising(), paths.circle((0.0, 0.0, 0.6), 0.05, 1.0), 5.0, Sampling())
    worst = np.linalg.norm(e[t > 4], axis=1).max()
    assert 0.05e-3 < worst < 0.25e-3


def test_constant_reference_with_the_encoder_of_the_rig(robot):
    """18 bits, one sample of delay: below 30 um after 3 s, from 50 mm away."""
    t, e, *_ = run(robot, Linearising(), paths.hold((0.05, 0.0, 0.6)), 5.0, Sampling(), start=(0.0, 0.0, 0.6))
    assert np.abs(e[t > 3]).max() < 30e-6


def test_loop_is_stable_while_its_integrator_saturates():
    """A load that the model does not know drives INT e into its bound; the loop rests where the bound leaves it."""
    heavier = replace(delta.LIGHT, m3=delta.LIGHT.m3 + 0.2)
    controller, path = Linearising(clamp=1e-3), paths.hold((0.0, 0.0, 0.6))
    t, e, states, _, s = run(heavier, controller, path, 8.0, Sampling(), model=delta.LIGHT)
    assert s[compiled._INTEGRAL + 2] == -1e-3
    late = t > 7
    assert np.abs(states[late, 9:]).max() < 0.05
    assert np.ptp(e[late, 2]) < 30e-6
    assert -0.1 < e[-1, 2] < -1e-3


def test_integral_never_exceeds_its_bound():
    tau, memory = np.zeros(3), np.array([0.9, -0.9, 0.0])
    q = delta.inverse(delta.LIGHT, POSES[0])
    y, x, far = q[MOTORS].copy(), q[OTHERS].copy(), np.array([9.0, -9.0, 0.6, *np.zeros(6)])
    compiled.command(
        delta.LIGHT.array(), y, x, np.zeros(3), far, memory, Gains().values(), True, True, True, 0.1, 1.0, tau
    )
    np.testing.assert_allclose(memory, [1.0, -1.0, 0.0], atol=1e-15)


def test_impedance_can_differ_with_direction_and_be_turned():
    """Stiffness R diag(k) R^T: a displacement along a task axis meets that axis's own stiffness."""
    c, s = np.cos(0.4), np.sin(0.4)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    stiffness = np.array([50.0, 400.0, 147.0])
    gains = Gains(kp=R @ np.diag(stiffness) @ R.T, kd=21.0, ki=0.0)
    q = delta.inverse(delta.LIGHT, POSES[0])
    for axis, k in zip(R.T, stiffness, strict=True):
        r = np.concatenate([np.array(POSES[0]) + 1e-4 * axis, np.zeros(6)])
        tau = np.zeros(3)
        y, x = q[MOTORS].copy(), q[OTHERS].copy()
        compiled.command(
            delta.LIGHT.array(), y, x, np.zeros(3), r, np.zeros(3), gains.values(), True, True, True, 0.0, 1.0, tau
        )
        Jy = delta.jacobians(delta.LIGHT, q)[1]
        acceleration = Jy @ np.linalg.solve(
            delta.task_mass(delta.LIGHT, q), tau - delta.gravity_torque(delta.LIGHT, q)[0]
        )
        np.testing.assert_allclose(acceleration, 1e-4 * k * axis, rtol=1e-9, atol=1e-12)


def torque_at(tick_time, gains):
    """First torque of the motor PD for a given error at one instant, without delay and gravity."""
    program = control.program(
        replace(delta.LIGHT, g=0.0), Proportional(gains=gains), paths.hold(POSES[0]), 1.0, Sampling(delay=0, bits=None)
    )
    q, u, s = delta.inverse(delta.LIGHT, (0.0, 0.0, 0.61)), np.zeros(6), np.zeros(program.memory)
    program.control(tick_time, q, np.zeros(9), u, s, program.parameters)
    return u[0]


def test_gains_are_linear_between_their_instants():
    schedule = {0.2: Gains(kp=1.0, kd=0.0), 0.4: Gains(kp=3.0, kd=0.0), 0.5: Gains(kp=2.0, kd=0.0)}
    one = torque_at(0.0, schedule)
    assert one != 0
    for t, factor in ((0.0, 1.0), (0.2, 1.0), (0.25, 1.5), (0.4, 3.0), (0.45, 2.5), (0.9, 2.0)):
        assert torque_at(t, schedule) == pytest.approx(factor * one, rel=1e-12)


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_torque_arrives_after_the_delay(delay):
    """A reference that jumps at tick 5 changes the torque at tick 5 + delay."""

    def jump(t):
        z = np.tile(POSES[0], (len(t), 1))
        z[5:, 2] += 0.001
        return z, 0 * z, 0 * z

    program = control.program(delta.LIGHT, Linearising(), jump, 0.02, Sampling(delay=delay, bits=None))
    q, s, u = delta.inverse(delta.LIGHT, POSES[0]), np.zeros(program.memory), np.zeros(6)
    torques = []
    for i in range(12):
        program.control(i * program.tick, q, np.zeros(9), u, s, program.parameters)
        torques.append(u[:3].copy())
    steady = delta.gravity_torque(delta.LIGHT, q)[0]
    np.testing.assert_allclose(torques[: 5 + delay], np.tile(steady, (5 + delay, 1)), rtol=1e-9)
    assert np.abs(torques[5 + delay] - steady).min() > 1e-3


def test_motor_pd_holds_and_its_torque_keeps_the_limit():
    path = paths.move((0.0, 0.0, 0.6), (0.05, 0.02, 0.55), 0.5)
    _, e, _, torques, _ = run(delta.LIGHT, Proportional(), path, 4.0, Sampling(limit=2.4))
    assert np.abs(torques).max() <= 2.4
    assert np.abs(e[-1]).max() < 1e-3


def test_reading_is_rounded_to_the_nearest_count():
    sampling = Sampling(bits=8, delay=0)
    program = control.program(delta.LIGHT, Linearising(), paths.hold(POSES[0]), 0.01, sampling)
    q, s = delta.inverse(delta.LIGHT, POSES[0]), np.zeros(program.memory)
    program.control(0.0, q, np.zeros(9), np.zeros(6), s, program.parameters)
    counts = s[compiled._Y : compiled._Y + 3] * 2**8 / (2 * np.pi)
    np.testing.assert_allclose(counts, np.rint(q[MOTORS] * 2**8 / (2 * np.pi)), atol=1e-12)


def test_singular_pose_ends_the_run_instead_of_holding_a_torque():
    program = control.program(delta.LIGHT, Linearising(), paths.hold(POSES[0]), 0.01, Sampling(bits=None, delay=0))
    q, u = delta.holding_pose(delta.LIGHT, delta.elbow_angle(delta.LIGHT)), np.zeros(6)
    program.control(0.0, q, np.zeros(9), u, np.zeros(program.memory), program.parameters)
    assert np.all(np.isnan(u[:3]))


@pytest.mark.parametrize(
    "path",
    [
        paths.move((0.0, 0.0, 0.6), (0.1, 0.05, 0.5), 0.7, begin=0.1),
        paths.circle((0.0, 0.0, 0.6), 0.05, 1.3, fade=0.5),
        paths.recorded(np.linspace(0, 1, 30), np.column_stack([np.sin(np.linspace(0, 3, 30))] * 3)),
    ],
)
def test_rates_of_paths_are_their_derivatives(path):
    t, h = np.linspace(0.15, 0.75, 41), 1e-5
    for order in (0, 1):
        slope = (path(t + h)[order] - path(t - h)[order]) / (2 * h)
        np.testing.assert_allclose(path(t)[order + 1], slope, rtol=1e-6, atol=1e-6)


def test_recorded_path_passes_its_samples_and_rests_outside():
    t, z = np.linspace(1.0, 2.0, 20), np.random.default_rng(0).normal(size=(20, 3))
    path = paths.recorded(t, z)
    np.testing.assert_allclose(path(t)[0], z, atol=1e-12)
    r, rd, rdd = path(np.array([0.0, 3.0]))
    np.testing.assert_allclose(r, z[[0, -1]], atol=1e-12)
    assert not rd.any()
    assert not rdd.any()


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Sampling(period=0.0), "period is 0.0 s"),
        (lambda: Sampling(bits=0), "bits is 0"),
        (lambda: Sampling(delay=-1), "delay is -1"),
        (lambda: Sampling(delay=0.5), "delay is 0.5"),
        (lambda: Sampling(limit=0.0), "limit is 0.0"),
        (lambda: Linearising(clamp=0.0), "clamp is 0.0"),
        (lambda: Gains(kp=[1.0, 2.0]).values(), "kp has shape"),
        (lambda: paths.circle((0, 0, 0.6), -0.1, 1.0), "radius is -0.1"),
        (lambda: paths.move((0, 0, 0.6), (0, 0, 0.5), 0.0), "duration is 0.0"),
        (lambda: paths.recorded([0.0, 1.0], np.zeros((2, 3))), "n >= 6"),
        (lambda: paths.recorded([0.0, 1, 2, 2, 3, 4], np.zeros((6, 3))), "times must increase"),
        (lambda: control.program(delta.LIGHT, Linearising(), paths.hold(POSES[0]), 0.0), "horizon is 0.0"),
        (lambda: control.program(delta.LIGHT, Linearising(gains={}), paths.hold(POSES[0]), 1.0), "increasing"),
        (lambda: delta.Servo(kp=-1.0), "kp is -1.0"),
        (lambda: delta.Servo(start=2.0, end=1.0), "end must not be before start"),
        (lambda: delta.Servo(y_end=(0.0, 0.0)), "y_end"),
    ],
)
def test_bad_input_is_named(make, words):
    with pytest.raises(InvalidValue, match=words):
        make()


def test_path_that_leaves_the_workspace_says_when_and_which_arm():
    path = paths.move((0.0, 0.0, 0.6), (0.0, 0.0, 1.2), 1.0)
    with pytest.raises(InvalidValue, match=r"At t = 0\.\d+ s: .*arm 1 would have to reach"):
        control.program(delta.LIGHT, Linearising(), path, 2.0)


@pytest.mark.parametrize(("depth", "stable"), [(0.30, False), (0.40, False), (0.42, True), (0.60, True), (0.75, True)])
def test_heave_under_constant_torque_is_unstable_above_a_depth(robot, depth, stable):
    """Under the balancing torque heave is unstable above about 0.41 m, the lateral modes are stable everywhere."""
    free = replace(robot, d1=0.0, d2=0.0, d3=0.0)
    stiffness = -plant_model(free, delta.inverse(free, (0.0, 0.0, depth)))[0][3:, :3]
    assert (stiffness[2, 2] > 0) == stable
    assert stiffness[0, 0] > 0
    assert stiffness[1, 1] == pytest.approx(stiffness[0, 0], rel=1e-4)
