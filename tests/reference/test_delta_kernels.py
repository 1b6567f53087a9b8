"""Laws of the delta robot's equations at random states, for both parameter sets and both rotation signs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from crossbody.reference import delta
from crossbody.reference.delta.kernels import robot as kernels
from crossbody.reference.delta.robot import Servo

STEP = 1e-30
ROBOTS = [
    replace(robot, sign=sign, jm=jm) for robot in delta.SETS.values() for sign in (1.0, -1.0) for jm in (0.0, 0.02)
]
SERVO = Servo(kp=3.0, kd=0.4, start=-1.0, end=2.0, y_start=(0.5, 0.6, 0.7), y_end=(0.9, 0.7, 0.8), feedforward=True)
EVERY = np.arange(6)


@pytest.fixture(params=ROBOTS, ids=lambda r: f"m1={r.m1},sign={r.sign:+g},jm={r.jm}")
def robot(request):
    return request.param


@pytest.fixture
def states():
    rng = np.random.default_rng(20)
    q = rng.uniform(-1.0, 1.0, (20, 9)) + np.tile([0.8, 1.6, 0.0], 3)
    return list(zip(q, 3 * rng.normal(size=(20, 9)), rng.normal(size=(20, 6)), strict=True))


def dynamics(robot, q, v, u, servo=None, t=0.5):
    kind = np.result_type(q, v, u, float)
    M, f, w = np.zeros((9, 3), kind), np.zeros(9, kind), np.zeros(kernels.SCRATCH, kind)
    p = robot.array(servo)
    kernels.dynamics(t, *(np.asarray(a, kind) for a in (q, v, u, p)), M, f, w)
    dense = np.zeros((9, 9), kind)
    for k in (0, 3, 6):
        dense[k : k + 3, k : k + 3] = M[k : k + 3]
    return dense, f, w


def rows(robot, q, v, idx=EVERY):
    kind = np.result_type(q, v, float)
    _, _, w = dynamics(robot, q, v, np.zeros(6))
    H, h, Hdv = np.full((6, 9), np.nan, kind), np.zeros(6, kind), np.zeros(6, kind)
    kernels.rows(0.0, *(np.asarray(a, kind) for a in (q, v, robot.array(), w)), np.asarray(idx), len(idx), H, h, Hdv)
    n = len(idx)
    return H[:n], h[:n], Hdv[:n]


def gaps(robot, q, v):
    kind = np.result_type(q, v, float)
    h, hd = np.zeros(6, kind), np.zeros(6, kind)
    kernels.gaps(0.0, *(np.asarray(a, kind) for a in (q, v, robot.array())), h, hd)
    return h, hd


def energy(robot, q, v):
    kind = np.result_type(q, v, float)
    e = np.zeros(2, kind)
    kernels.energy(*(np.asarray(a, kind) for a in (q, v, robot.array())), e)
    return e


def power(robot, q, v, u, servo=None, t=0.5):
    e = np.zeros(2)
    kernels.power(t, q, v, u, robot.array(servo), e)
    return e


def along(function, q, direction):
    """Derivative by complex step."""
    return np.asarray(function(q + 1j * STEP * direction)).imag / STEP


def solve(robot, q, v, u, law, idx=EVERY, servo=None):
    na = len(idx)
    vd, lam, hd = np.zeros(9), np.zeros(na), np.zeros(na)
    code = kernels.solve(0.5, q, v, u, robot.array(servo), np.zeros(18), law, np.asarray(idx), na, vd, lam, hd)
    return code, vd, lam, hd


def kkt(robot, q, v, u, law, idx=EVERY, servo=None):
    """The dense system [[M, -H^T], [H, 0]] (v', lam) = (f, -(H'v + a1 h' + a0 h + a2 h^3))."""
    M, f, _ = dynamics(robot, q, v, u, servo)
    H, h, Hdv = rows(robot, q, v, idx)
    a0, a1, a2 = law[idx].T
    n = len(idx)
    K = np.block([[M, -H.T], [H, np.zeros((n, n))]])
    x = np.linalg.solve(K, np.concatenate([f, -(Hdv + a1 * (H @ v) + a0 * h + a2 * h**3)]))
    return x[:9], x[9:]


LAW = np.column_stack([np.full(6, 25.0), np.full(6, 10.0), np.linspace(0.0, 50.0, 6)])


def test_mass_is_symmetric_positive_definite(robot, states):
    for q, v, u in states:
        M = dynamics(robot, q, v, u)[0]
        np.testing.assert_array_equal(M, M.T)
        assert np.linalg.eigvalsh(M)[0] > 1e-3 * np.linalg.eigvalsh(M)[-1] * np.sin(q[[1, 4, 7]]).min() ** 2


def test_quadratic_terms_are_the_christoffel_terms_of_the_mass(robot, states):
    """C from M by complex step: M' - 2C is skew, and C v is what the kernel subtracts."""
    free = replace(robot, g=0.0, d1=0.0, d2=0.0, d3=0.0)
    for q, v, _ in states:
        D = np.array([along(lambda x, v=v: dynamics(free, x, v, np.zeros(6))[0], q, e) for e in np.eye(9)])
        C = 0.5 * np.einsum("kij,k->ij", D, v) + 0.5 * (np.einsum("jik,k->ij", D, v) - np.einsum("ijk,k->ij", D, v))
        skew = np.einsum("kij,k->ij", D, v) - 2 * C
        np.testing.assert_allclose(skew, -skew.T, atol=1e-13)
        np.testing.assert_allclose(-dynamics(free, q, v, np.zeros(6))[1], C @ v, rtol=1e-12, atol=1e-12)


def test_gravity_is_the_gradient_of_the_potential(robot, states):
    for q, _, _ in states:
        rest = np.zeros(9)
        gradient = [along(lambda x, rest=rest: energy(robot, x, rest)[1], q, e) for e in np.eye(9)]
        np.testing.assert_allclose(-dynamics(robot, q, rest, np.zeros(6))[1], gradient, rtol=1e-13, atol=1e-13)


def test_kinetic_energy_is_that_of_the_mass_matrix(robot, states):
    for q, v, u in states:
        np.testing.assert_allclose(energy(robot, q, v)[0], 0.5 * v @ dynamics(robot, q, v, u)[0] @ v, rtol=1e-13)


def test_rows_are_the_derivatives_of_the_gaps(robot, states):
    for q, v, _ in states:
        H, h, Hdv = rows(robot, q, v)
        np.testing.assert_allclose(
            H.T, [along(lambda x, v=v: gaps(robot, x, v)[0], q, e) for e in np.eye(9)], atol=1e-14
        )
        np.testing.assert_allclose(Hdv, along(lambda x, v=v: rows(robot, x, v)[0] @ v, q, v), rtol=1e-13, atol=1e-13)
        np.testing.assert_allclose((h, H @ v), gaps(robot, q, v), atol=1e-14)


@pytest.mark.parametrize("idx", [[4], [5, 0], [1, 3, 2]])
def test_rows_fill_the_active_ones_only(robot, states, idx):
    q, v, _ = states[0]
    whole, some = rows(robot, q, v), rows(robot, q, v, idx)
    for a, b in zip(whole, some, strict=True):
        np.testing.assert_array_equal(a[idx], b)


def test_rows_agree_with_the_rotated_tips(robot, states):
    for q, v, _ in states:
        tip = delta.kinematics.tips(robot, q)
        np.testing.assert_allclose(gaps(robot, q, v)[0], (tip[0] - tip[1:]).ravel(), atol=1e-15)


def test_flange_force_does_the_work_of_the_flange(robot, states):
    """The power identity of Jv: v . Jv^T f = f . z', z' by complex step of the mean of the tips."""
    for q, v, u in states:
        force = np.concatenate([np.zeros(3), u[3:]])
        tau = dynamics(robot, q, v, force)[1] - dynamics(robot, q, v, np.zeros(6))[1]
        Jv = delta.virtual_jacobian(robot, q)
        h = 1e-6
        zd = (delta.flange(robot, q + h * v) - delta.flange(robot, q - h * v)) / (2 * h)
        np.testing.assert_allclose(tau, Jv.T @ u[3:], atol=1e-13)
        np.testing.assert_allclose(Jv @ v, zd, atol=1e-8)
        np.testing.assert_allclose(power(robot, q, v, force)[0], u[3:] @ Jv @ v, rtol=1e-11, atol=1e-13)


def test_power_balances_the_energy(robot, states):
    """E' = inputs - dissipation + lam . h', along the motion that `solve` gives."""
    for q, v, u in states:
        _, vd, lam, hd = solve(robot, q, v, u, LAW, servo=SERVO)
        rate = along(lambda x, v=v: energy(robot, x, v).sum(), q, v) + along(
            lambda x, q=q: energy(robot, q, x).sum(), v, vd
        )
        gained, lost = power(robot, q, v, u, SERVO)
        np.testing.assert_allclose(rate, gained - lost + lam @ hd, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("idx", [EVERY, np.array([0, 1, 2]), np.array([5, 3]), np.array([2]), np.array([], dtype=int)])
@pytest.mark.parametrize("servo", [None, SERVO])
def test_structured_solve_is_the_dense_one(robot, states, idx, servo):
    for q, v, u in states:
        code, vd, lam, hd = solve(robot, q, v, u, LAW, idx, servo)
        vd0, lam0 = kkt(robot, q, v, u, LAW, idx, servo)
        assert code == 0
        np.testing.assert_allclose(vd, vd0, rtol=1e-12, atol=1e-12 * np.abs(vd0).max())
        np.testing.assert_allclose(lam, lam0, rtol=1e-12, atol=1e-12 * np.abs(lam0).max(initial=0.0))
        np.testing.assert_allclose(hd, (rows(robot, q, v)[0] @ v)[idx], atol=1e-14)


@pytest.mark.parametrize(("sign", "mirrored"), [(1.0, 1.0), (-1.0, -1.0)])
def test_check_value_of_the_static_pose(sign, mirrored):
    robot = replace(delta.HEAVY, sign=sign)
    q = np.tile([np.pi / 4, 2.3253653636460, 0.0], 3)
    np.testing.assert_allclose(delta.holding_pose(robot, np.pi / 4), q, atol=5e-14)
    np.testing.assert_allclose(delta.flange(robot, q), [0.0, 0.0, 0.6117707783], atol=5e-11)
    tau, lam = delta.gravity_torque(robot, q)
    np.testing.assert_allclose(tau, -20.0024198, atol=5e-8)
    expected = [mirrored * 22.6079, -13.0527, 0.0, -mirrored * 22.6079, -13.0527, 0.0]
    np.testing.assert_allclose(lam, expected, atol=5e-5)
    code, vd, running, _ = solve(robot, q, np.zeros(9), np.concatenate([tau, np.zeros(3)]), LAW)
    assert code == 0
    np.testing.assert_allclose(vd, 0.0, atol=1e-11)
    np.testing.assert_allclose(running, lam, atol=1e-11)


def test_servo_holds_the_pose_it_is_told():
    for y in (0.4, np.pi / 4, 1.2, delta.elbow_angle(delta.LIGHT) - 0.05):
        servo = Servo(kp=1.0, kd=0.2, y_start=(y,) * 3, y_end=(y,) * 3, feedforward=True)
        q = delta.holding_pose(delta.LIGHT, y)
        code, vd, _, _ = solve(delta.LIGHT, q, np.zeros(9), np.zeros(6), LAW, servo=servo)
        assert code == 0
        np.testing.assert_allclose(vd, 0.0, atol=1e-10)


def test_servo_reference_moves_smoothly_between_its_ends():
    servo = Servo(kp=2.0, kd=0.5, start=1.0, end=3.0, y_start=(0.2, 0.4, 0.6), y_end=(1.0, 0.1, 0.6))
    q, v = delta.holding_pose(delta.LIGHT, 0.8), np.zeros(9)

    def torque(t):
        with_servo, without = (dynamics(delta.LIGHT, q, v, np.zeros(6), s, t)[1] for s in (servo, None))
        return (with_servo - without)[[0, 3, 6]]

    start, stop = 2.0 * (np.array(servo.y_start) - 0.8), 2.0 * (np.array(servo.y_end) - 0.8)
    for t, expected in ((0.0, start), (1.0, start), (3.0, stop), (9.0, stop)):
        np.testing.assert_allclose(torque(t), expected, atol=1e-14)
    speed = 15 / 8 / 2.0 * (np.array(servo.y_end) - np.array(servo.y_start))
    np.testing.assert_allclose(torque(2.0), (start + stop) / 2 + 0.5 * speed, atol=1e-14)


def test_mobility_is_finite_where_the_chart_ends_but_the_angle_is_not():
    """At s2 = 0 the third angle of an arm is undefined: an answer would be wrong, so there is none."""
    q = np.tile([0.8, 2.0, 0.1], 3)
    q[1] = 0.0
    assert solve(delta.LIGHT, q, np.zeros(9), np.zeros(6), LAW)[0] == 1


def test_a_state_that_is_not_a_number_has_no_solution():
    q = np.tile([0.8, np.nan, 0.1], 3)
    assert solve(delta.LIGHT, q, np.zeros(9), np.zeros(6), LAW)[0] == 1
