"""Sensitivities through contacts against differences of runs, and forces from motion and torque."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from mechanisms import ball
from scipy.linalg import expm

from crossbody import cases
from crossbody.cases import InvalidValue, Mode, Outcome, SceneError, UnknownName
from crossbody.reference import System, delta, simulate
from crossbody.reference.linear import Unknown, balanced, filtered, sensitivity
from crossbody.reference.linear._kalman import Filter
from crossbody.reference.linear._point import Point
from crossbody.reference.systems.ball import KERNELS
from crossbody.reports.analysis import places as analyse


def ends(system, q, v, t_end, **options):
    run = simulate(system, q, v, t_end, rtol=1e-13, **options)
    assert run.outcome is Outcome.FINISHED
    return np.concatenate([run.q[-1], run.v[-1]])


def differences(function, x, step):
    columns = []
    for e in step * np.eye(len(x)):
        near, far = function(x + e) - function(x - e), function(x + 2 * e) - function(x - 2 * e)
        columns.append((8.0 * near - far) / (12.0 * step))
    return np.array(columns).T


def made(theta):
    return ball(mass=theta[0], gravity=theta[1], a0=theta[2], a1=theta[3], a2=0.0)


def test_through_ten_bounces_by_start_and_parameters():
    theta, t_end = np.array([1.0, 9.81, 1e4, 1.0]), 8.3
    found = sensitivity(made(theta), [1.0], [0.0], t_end, parameters=["p[0]", "p[1]", "a0[0]", "a1[0]"])
    assert sum(e.after == Mode.CONTACT for e in found.run.events) >= 10
    by_start = differences(lambda x: ends(made(theta), x[:1], x[1:], t_end), np.array([1.0, 0.0]), 1e-5)
    assert np.abs(found.by_start - by_start).max() < 1e-6 * np.abs(by_start).max()
    for k in range(1, 4):
        unit = np.eye(4)[k] * theta[k]
        one = differences(lambda x, unit=unit: ends(made(theta + x[0] * unit), [1.0], [0.0], t_end), np.zeros(1), 3e-6)
        expected = one[:, 0] / theta[k]
        assert np.abs(found.by_parameters[:, k] - expected).max() < 1e-6 * np.abs(expected).max()
    np.testing.assert_allclose(found.by_parameters[:, 0], 0.0, atol=1e-9)  # the law does not know the mass


def test_across_one_impact_the_jump_is_the_difference():
    """Touch at speed v: lam starts at m a1 v, so a touch that comes dtau later leaves v lower by a1 v dtau."""
    system, v = ball(a0=1e4, a1=40.0, a2=0.0, gravity=0.0), 1.3
    found = sensitivity(system, [0.01], [-v], 0.01 / v + 1e-3)
    (jump,) = found.jumps
    np.testing.assert_allclose(jump.matrix, [[1.0, 0.0], [-40.0, 1.0]], rtol=1e-9, atol=1e-9)
    fd = differences(lambda x: ends(system, x[:1], x[1:], 0.01 / v + 1e-3), np.array([0.01, -v]), 1e-6)
    np.testing.assert_allclose(found.by_start, fd, rtol=1e-7)


SCENES = {
    "pendulums": ("newtons_cradle", {"variant": "pendulums", "n": 3, "gap": 1e-3}, 1.3, 1e-6),
    "sliders": ("newtons_cradle", {"variant": "sliders", "n": 4, "gap": 1e-3}, 0.02, 1e-6),
    "cubic floor": ("bouncing_ball", {"variant": "listing"}, 1.1, 1e-6),
    "red body": ("red_body", {}, 0.078, 1e-7),
    "red body, frozen": ("red_body", {"variant": "frozen"}, 0.115, 1e-7),
}


@pytest.mark.parametrize("scene", SCENES)
def test_every_kind_of_event(scene):
    name, changed, t_end, step = SCENES[scene]
    case = cases.load(name, **changed)
    system, n = analyse.build(case), len(case.q0)
    rule = {"collisions": case.collisions}
    found = sensitivity(system, case.q0, case.v0, t_end, **rule)
    assert found.outcome is Outcome.FINISHED or "only touch" in found.message
    x = np.concatenate([case.q0, case.v0])
    moved = np.array([0, 1, 2, 6, 7, 8]) if name == "red_body" else np.arange(2 * n)  # what rests on the floor stays

    def end(part):
        whole = x.copy()
        whole[moved] = part
        return ends(system, whole[:n], whole[n:], t_end, **rule)

    fd = differences(end, x[moved], step)
    assert np.abs(found.by_start[:, moved] - fd).max() < 1e-6 * np.abs(fd).max()


@pytest.mark.parametrize("scene", ["red body", "red body, frozen"])
def test_every_kind_of_event_by_parameters(scene):
    """Inertias are in every map by which velocities jump, and in no start; the wall is in a guard."""
    name, changed, t_end, step = SCENES[scene]
    case = cases.load(name, **changed)
    system, rule = analyse.build(case), {"collisions": case.collisions}
    which = ["mass", "inertia", "gravity", "wall"]
    found = sensitivity(system, case.q0, case.v0, t_end, parameters=which, **rule)

    def end(part):
        given = {**system.parameters, **dict(zip(which, part.tolist(), strict=True))}
        return ends(replace(system, parameters=given), case.q0, case.v0, t_end, **rule)

    fd = differences(end, np.array([system.parameters[one] for one in which]), step)
    assert np.abs(found.by_parameters - fd).max() < 1e-5 * np.abs(fd).max()


def test_monodromy_of_a_bounce_without_loss():
    """A frozen collision gives back all speed: period 2 sqrt(2 h/g), and x' grows with x at the rate of the period."""
    period, g = 2.0 * np.sqrt(2.0 / 9.81), 9.81
    found = sensitivity(ball(b0=1e6, b1=0.0, a0=1e4, a1=200.0, a2=0.0), [1.0], [0.0], period)
    np.testing.assert_allclose(found.state, [1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(found.by_start, [[1.0, 0.0], [0.5 * g * period, 1.0]], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(np.abs(found.multipliers), 1.0, atol=1e-6)


def test_monodromy_of_a_cradle_keeps_volume():
    """Two pendulums that strike at one instant without loss: a canonical map, so its determinant is 1."""
    case = cases.load("newtons_cradle", variant="pendulums", n=2, gap=2e-3)
    found = sensitivity(analyse.build(case), case.q0, case.v0, 1.1)
    assert len(found.jumps) >= 2
    assert np.linalg.det(found.by_start) == pytest.approx(1.0, rel=1e-8)


def period_of(length, angle, gravity):
    """Of a pendulum released at rest, exactly: 2 pi sqrt(L/g) over the arithmetic-geometric mean of 1, cos(angle/2)."""
    a, b = 1.0, np.cos(0.5 * angle)
    while abs(a - b) > 1e-16:
        a, b = 0.5 * (a + b), np.sqrt(a * b)
    return 2.0 * np.pi * np.sqrt(length / gravity) / a


def test_monodromy_of_a_periodic_cradle():
    """Two balls that touch at rest change places twice a period: what shifts the time alone comes back as it was."""
    case = cases.load("newtons_cradle", variant="pendulums", n=2, gap=0.0)
    system, x = analyse.build(case), np.concatenate([case.q0, case.v0])
    period = period_of(case.number("length"), case.number("angle"), case.number("gravity"))
    found = sensitivity(system, case.q0, case.v0, period)
    assert len(found.jumps) == 2
    np.testing.assert_allclose(found.state, x, atol=1e-8)
    flow = np.concatenate([case.v0, [case.number("gravity") / case.number("length") * np.sin(-case.q0[0]), 0.0]])
    np.testing.assert_allclose(found.by_start @ flow, flow, rtol=1e-6, atol=1e-6 * np.abs(flow).max())
    np.testing.assert_allclose(np.abs(found.multipliers), 1.0, atol=1e-3)  # two of them are 1: scattered by the root
    assert np.linalg.det(found.by_start) == pytest.approx(1.0, rel=1e-8)
    fd = differences(lambda y: ends(system, y[:2], y[2:], period), x, 1e-6)
    np.testing.assert_allclose(found.by_start, fd, atol=1e-6 * np.abs(fd).max())


def test_a_row_of_balls_that_touch_is_passed_one_collision_after_another():
    """Four jumps at one instant; against one-sided differences along what parts the balls."""
    case = cases.load("newtons_cradle", variant="pendulums", n=5, gap=0.0)
    system, t_end, step = analyse.build(case), 0.45, 1e-5
    found = sensitivity(system, case.q0, case.v0, t_end)
    assert [(jump.t, jump.contact) for jump in found.jumps] == [(found.jumps[0].t, i) for i in range(4)]
    parts, lift = np.zeros(10), np.zeros(10)
    parts[6:], lift[0] = np.arange(1.0, 5.0), -1.0
    for along in (parts, parts + lift):
        values = [ends(system, case.q0 + k * step * along[:5], case.v0 + k * step * along[5:], t_end) for k in range(5)]
        fd = np.array([-25.0 / 12.0, 4.0, -3.0, 4.0 / 3.0, -0.25]) @ values / step
        np.testing.assert_allclose(found.by_start @ along, fd, atol=1e-6 * np.abs(fd).max())


@pytest.mark.parametrize("variant", ["sliders", "pendulums"])
def test_rows_that_strike_as_one_have_no_derivative(variant):
    """Three balls, one in: a deviation makes of (-1/3, 2/3, 2/3) the sequence that gives (0, 0, 1)."""
    case = cases.load("newtons_cradle", variant=variant, n=3, gap=0.0)
    with pytest.raises(SceneError, match="which comes first"):
        sensitivity(analyse.build(case), case.q0, case.v0, 0.3, collisions="simultaneous")


def test_wrong_use_is_told():
    system = ball()
    with pytest.raises(UnknownName, match="a0"):
        sensitivity(system, [1.0], [0.0], 1.0, parameters=["stiffness"])
    with pytest.raises(SceneError, match="sampled controller"):
        sensitivity(analyse.build(cases.load("delta_tracking", t_end=0.1)), np.zeros(9), np.zeros(9), 0.1)


@pytest.fixture(scope="module")
def pushed():
    """A delta robot under a random force on its flange: the force is a Gauss-Markov process, held between samples."""
    robot, rng, dt, count, time, size = delta.LIGHT, np.random.default_rng(3), 4e-3, 700, 0.1, 0.4
    system, q = delta.system(robot, p=20.0), delta.inverse(robot, [0.0, 0.0, 0.6])
    t, keep = dt * np.arange(count), np.exp(-dt / time)
    force = np.zeros((count, 3))
    force[0] = size * rng.normal(size=3)
    for k in range(1, count):
        force[k] = keep * force[k - 1] + size * np.sqrt(1.0 - keep**2) * rng.normal(size=3)
    u = np.hstack([np.tile(delta.gravity_torque(robot, q)[0], (count, 1)), np.zeros((count, 3))])
    run = simulate(
        system, q, np.zeros(9), t[-1], inputs=(t, u + np.hstack([0.0 * force, force])), samples=t, rtol=1e-10
    )  # fmt: skip
    return system, run, u, force, {"std_force": size, "time_force": time}, rng


def test_forces_on_the_flange_from_motor_angles_lie_in_their_band(pushed):
    system, run, u, force, known, rng = pushed
    std = 2e-5
    y = run.q[:, [0, 3, 6]] + std * rng.normal(size=(len(run.t), 3))
    common = {"unknown": Unknown(inputs=(3, 4, 5)), "measured": [0, 3, 6], "std_y": std, "q0": run.q[0], **known}
    found = filtered(system, run.t, y, u, **common)
    assert np.mean(np.abs(found.force - force) < 1.96 * found.std) == pytest.approx(0.95, abs=0.03)
    assert found.std.max() < known["std_force"]
    np.testing.assert_allclose(found.innovation.std(axis=0), 1.0, atol=0.1)


def test_forces_that_balance_one_instant_lie_in_their_band(pushed):
    system, run, u, force, _, rng = pushed
    n, std = 9, {"std_q": 1e-5, "std_v": 1e-4, "std_vd": 1e-2, "std_u": 1e-3}
    vd = np.array(
        [
            system_acceleration(system, run.q[k], run.v[k], u[k] + np.concatenate([np.zeros(3), force[k]]))
            for k in range(0, len(run.t), 2)
        ]
    )
    q, v, torque = (x[::2] for x in (run.q, run.v, u))
    noisy = [x + s * rng.normal(size=x.shape) for x, s in zip((q, v, vd, torque), std.values(), strict=True)]
    found = balanced(system, run.t[::2], *noisy, unknown=Unknown(inputs=(3, 4, 5)), **std)
    inside = np.abs(found.force - force[::2]) < 1.96 * found.std
    assert inside.mean() == pytest.approx(0.95, abs=0.03)
    assert n == q.shape[1]


def system_acceleration(system, q, v, u):
    M, f = system.terms(q, v, u)
    H, h, drift = system.constraint(q, v)
    a0, a1, _ = system.alpha.T
    K = np.block([[M, -H.T], [H, np.zeros((6, 6))]])
    return np.linalg.solve(K, np.concatenate([f, -(drift + a1 * (H @ v) + a0 * h)]))[:9]


def test_the_force_of_a_floor_is_found_without_its_law():
    """A ball on a soft floor whose law the estimate does not use: height alone gives lam."""
    floor = System(n=1, parameters=[1.0, 9.81], a0=400.0, a1=8.0, **KERNELS)
    t = np.arange(0.0, 0.12, 2e-4)
    run = simulate(floor, [0.0], [-1.0], 0.12, samples=t, rtol=1e-11)
    y = run.q + 1e-6 * np.random.default_rng(5).normal(size=run.q.shape)
    found = filtered(
        floor, t, y, unknown=Unknown(rows=(0,)), measured=[0], std_y=1e-6, q0=[0.0], v0=[-1.0], std_force=20.0,
        time_force=0.05,
    )  # fmt: skip
    part = slice(20, -20)
    error = np.abs(found.force[part, 0] - run.lam[part, 0])
    assert error.max() < 4.0 * found.std[part, 0].max() < 0.3 * run.lam.max()


def test_wrong_records_are_told():
    system = ball()
    good = {
        "unknown": Unknown(rows=(0,)),
        "measured": [0],
        "std_y": 1e-6,
        "q0": [0.0],
        "std_force": 1.0,
        "time_force": 1.0,
    }
    with pytest.raises(InvalidValue, match="increase"):
        filtered(system, [0.0, 0.0], [[0.0], [0.0]], **good)
    with pytest.raises(InvalidValue, match="std_y"):
        filtered(system, [0.0, 1.0], [[0.0], [0.0]], **{**good, "std_y": 0.0})
    with pytest.raises(SceneError, match="shape"):
        filtered(system, [0.0, 1.0], [[0.0]], **good)
    with pytest.raises(InvalidValue, match="deviation"):
        balanced(system, [0.0], [[0.0]], [[0.0]], [[0.0]], unknown=Unknown(rows=(0,)))


@pytest.mark.parametrize("dt", [0.05, 0.2, 0.5])
def test_noise_that_a_filter_adds_is_that_of_the_whole_interval(dt):
    """Of linear rates it is known in closed form (Van Loan 1978), and Simpson's rule has it to the fourth order."""
    system = ball(a0=1e4, a1=40.0, a2=0.0)
    record = SimpleNamespace(system=system, unknown=(0,), t=np.array([0.0, dt]))
    start = Point(system=system, t=0.0, q=np.zeros(1), v=np.zeros(1), u=np.zeros(0), active=np.zeros(0, dtype=np.int64))
    one = Filter(record, start, np.zeros(1, dtype=np.int64), np.ones(1), np.ones(1), 0.7, (0.0, 0.0))
    A = np.array([[0.0, 1.0, 0.0], [-3.0, -0.4, 1.0], [0.0, 0.0, -1.0 / 0.7]])
    one._flow = lambda k: (A @ one.z, A)
    one.P[:] = 0.0
    one._predict(0)
    both = expm(dt * np.block([[-A, one.Q], [np.zeros((3, 3)), A.T]]))
    expected = both[3:, 3:].T @ both[:3, 3:]
    assert np.abs(one.P - expected).max() < 0.05 * dt**4 * np.abs(expected).max()
