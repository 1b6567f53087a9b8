"""Kinematics, statics and singularities of the delta robot."""

from __future__ import annotations

import ast
from dataclasses import fields, replace

import numpy as np
import pytest
from numba import njit

from crossbody.cases import InvalidValue, SceneError
from crossbody.reference import delta
from crossbody.reference.delta.kernels import kinematics as compiled
from crossbody.reference.delta.kernels import robot as kernels
from crossbody.reference.delta.kinematics import MOTORS, OTHERS, tips
from crossbody.reference.delta.singularity import hanging_pose
from crossbody.reference.delta.statics import closure_jacobian, gravity_gradient

ROBOTS = [replace(robot, sign=sign) for robot in delta.SETS.values() for sign in (1.0, -1.0)]
CENTRES = np.array([[0.0, 0.0, 0.6], [0.1, -0.05, 0.55], [-0.12, 0.1, 0.65], [0.02, 0.15, 0.5], [-0.05, -0.2, 0.6]])


@pytest.fixture(params=ROBOTS, ids=lambda r: f"m1={r.m1},sign={r.sign:+g}")
def robot(request):
    return request.param


@pytest.fixture(params=CENTRES, ids=lambda z: ",".join(map(str, z)))
def pose(request, robot):
    return delta.inverse(robot, request.param)


def dense_mass(robot, q):
    M, f, w = np.zeros((9, 3)), np.zeros(9), np.zeros(kernels.SCRATCH)
    kernels.dynamics(0.0, q, np.zeros(9), np.zeros(6), robot.array(), M, f, w)
    dense = np.zeros((9, 9))
    for k in (0, 3, 6):
        dense[k : k + 3, k : k + 3] = M[k : k + 3]
    return dense


@pytest.mark.parametrize("outward", [True, False])
@pytest.mark.parametrize("z", CENTRES)
def test_inverse_then_tips_is_the_position(robot, z, outward):
    q = delta.inverse(robot, z, outward=outward)
    np.testing.assert_allclose(tips(robot, q), np.tile(z, (3, 1)), atol=1e-15)
    np.testing.assert_allclose(delta.flange(robot, q), z, atol=1e-15)


def test_forward_after_inverse_is_the_identity(robot, pose):
    np.testing.assert_allclose(delta.forward(robot, pose[MOTORS]), pose, atol=1e-13)


def test_newton_warm_started_one_sample_away_needs_two_steps(robot, pose):
    """0.88 ms at 1 rad/s; the polished pose is the one of the closed form."""
    p, y, x = robot.array(), pose[MOTORS] + 0.88e-3 * np.array([1.0, -1.0, 0.5]), pose[OTHERS].copy()
    steps = compiled.forward(p, y, x, 1e-5, 10)
    assert steps in (1, 2)
    np.testing.assert_allclose(x, delta.forward(robot, y)[OTHERS], atol=1e-9)


def test_newton_steps_are_those_of_the_six_by_six_system(robot, pose):
    """One step from a pose that is not closed: h_x dx = -h."""
    q = pose + 0.05 * np.sin(np.arange(9.0))
    H = closure_jacobian(robot, q)
    h = (tips(robot, q)[0] - tips(robot, q)[1:]).ravel()
    x = q[OTHERS].copy()
    assert compiled.forward(robot.array(), q[MOTORS].copy(), x, 0.0, 1) == compiled.NOT_CONVERGED
    np.testing.assert_allclose(x - q[OTHERS], -np.linalg.solve(H[:, OTHERS], h), rtol=1e-11, atol=1e-13)


def test_control_jacobian_by_differences(robot, pose):
    z, Jy, X = delta.jacobians(robot, pose)
    np.testing.assert_allclose(z, delta.flange(robot, pose), atol=1e-15)
    h = 1e-5
    for j, e in enumerate(np.eye(3)):
        after, before = (delta.forward(robot, pose[MOTORS] + s * h * e, pose) for s in (1, -1))
        np.testing.assert_allclose(
            Jy[:, j], (delta.flange(robot, after) - delta.flange(robot, before)) / (2 * h), atol=1e-8
        )
        np.testing.assert_allclose(X[:, j], (after - before)[OTHERS] / (2 * h), atol=1e-8)


def test_control_jacobian_by_the_implicit_function_theorem(robot, pose):
    """X = -h_x^-1 h_y and Jy = Jv_y + Jv_x X with the full matrices."""
    _, Jy, X = delta.jacobians(robot, pose)
    H, Jv = closure_jacobian(robot, pose), delta.virtual_jacobian(robot, pose)
    full = -np.linalg.solve(H[:, OTHERS], H[:, MOTORS])
    np.testing.assert_allclose(X, full, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(Jy, Jv[:, MOTORS] + Jv[:, OTHERS] @ full, rtol=1e-11, atol=1e-12)


def test_gravity_torque_balances_and_agrees_with_the_compiled_one(robot, pose):
    tau, lam = delta.gravity_torque(robot, pose)
    full = closure_jacobian(robot, pose).T @ lam
    full[MOTORS] += tau
    np.testing.assert_allclose(full, gravity_gradient(robot, pose), atol=1e-12)
    own, x, y = np.zeros(3), pose[OTHERS].copy(), pose[MOTORS].copy()
    assert compiled.update(robot.array(), y, x, np.zeros(3), np.zeros((3, 3)), np.zeros((6, 3)), own) in (1, 2)
    np.testing.assert_allclose(own, tau, rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize("exact", [True, False])
def test_task_mass_is_that_of_the_full_matrices(robot, pose, exact):
    M, X = dense_mass(robot, pose), delta.jacobians(robot, pose)[2]
    S = np.zeros((9, 3))
    S[MOTORS], S[OTHERS] = np.eye(3), X
    expected = S.T @ M @ S if exact else M[np.ix_(MOTORS, MOTORS)] + M[np.ix_(MOTORS, OTHERS)] @ X
    np.testing.assert_allclose(delta.task_mass(robot, pose, exact=exact), expected, rtol=1e-11, atol=1e-13)


@pytest.mark.parametrize("name", delta.SETS)
def test_approximate_task_mass_is_about_half_the_exact_one(name):
    """Eigenvalues of exact^-1 approximate lie in .4-.7 at y = pi/4."""
    robot = delta.SETS[name]
    q = delta.holding_pose(robot, np.pi / 4)
    ratio = np.linalg.eigvals(np.linalg.solve(delta.task_mass(robot, q), delta.task_mass(robot, q, exact=False)))
    assert np.all(np.abs(ratio.imag) < 1e-12)
    assert 0.40 < ratio.real.min() < 0.42
    assert 0.70 < ratio.real.max() < 0.71


@pytest.mark.parametrize("name", delta.SETS)
def test_approximate_task_mass_has_a_negative_eigenvalue_beyond_the_elbow_pose(name):
    robot = delta.SETS[name]
    q = delta.holding_pose(robot, 1.8)
    assert np.linalg.eigvals(delta.task_mass(robot, q, exact=False)).real.min() < 0
    assert np.linalg.eigvalsh(delta.task_mass(robot, q)).min() > 0


def test_rank_at_the_elbow_pose(robot):
    """h_x loses two; H keeps six; H with locked motors has seven of nine."""
    q = delta.holding_pose(robot, delta.elbow_angle(robot))
    H = closure_jacobian(robot, q)
    assert np.linalg.matrix_rank(H[:, OTHERS], tol=1e-10) == 4
    assert np.linalg.matrix_rank(H, tol=1e-10) == 6
    assert np.linalg.matrix_rank(np.vstack([H, np.eye(9)[MOTORS]]), tol=1e-10) == 7
    assert delta.margins(robot, q).direct < 1e-15


def test_elbow_pose_is_a_clear_error_for_kinematics(robot):
    q = delta.holding_pose(robot, delta.elbow_angle(robot))
    with pytest.raises(SceneError, match="control Jacobian is singular"):
        delta.jacobians(robot, q)
    with pytest.raises(SceneError, match="control Jacobian is singular"):
        delta.forward(robot, q[MOTORS])
    with pytest.raises(SceneError, match="control Jacobian is singular"):
        delta.forward(robot, q[MOTORS], q)
    with pytest.raises(SceneError, match="singular"):
        delta.task_mass(robot, q)


def solve_at(robot, q):
    vd, lam, hd, law = np.zeros(9), np.zeros(6), np.zeros(6), np.tile([25.0, 10.0, 0.0], (6, 1))
    code = kernels.solve(
        0.0, q, np.zeros(9), np.zeros(6), robot.array(), np.zeros(18), law, np.arange(6), 6, vd, lam, hd
    )
    return code, lam


def condition(robot, q):
    H = closure_jacobian(robot, q)
    return np.linalg.cond(H @ np.linalg.solve(dense_mass(robot, q), H.T))


def test_multipliers_are_ill_posed_at_the_three_tilts_only(robot):
    for d in delta.ill_posed_tilts(robot):
        q = hanging_pose(robot, d)
        np.testing.assert_allclose(tips(robot, q), np.tile(tips(robot, q)[0], (3, 1)), atol=1e-15)
        assert condition(robot, q) > 1e10
        assert solve_at(robot, q)[0] == 1
        for angle in (np.deg2rad(2.0), np.deg2rad(60.0)):
            c, s = np.cos(angle), np.sin(angle)
            beside = hanging_pose(robot, np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ d)
            assert condition(robot, beside) < 1e10
            assert solve_at(robot, beside)[0] == 0


def test_constraint_forces_stay_determined_at_an_ill_posed_tilt(robot):
    """lam is not unique there, H^T lam is: the equations remain consistent, and what is free in lam exerts no force."""
    for d in delta.ill_posed_tilts(robot):
        q = hanging_pose(robot, d)
        H, M = closure_jacobian(robot, q), dense_mass(robot, q)
        G, right = H @ np.linalg.solve(M, H.T), H @ np.linalg.solve(M, gravity_gradient(robot, q))
        lam = np.linalg.lstsq(G, right, rcond=1e-9)[0]
        idle = np.linalg.svd(H.T)[2][-1]
        np.testing.assert_allclose(G @ lam, right, atol=1e-12 * np.abs(right).max() + 1e-13)
        np.testing.assert_allclose(H.T @ idle, 0.0, atol=1e-14)


def test_gravity_torque_near_the_elbow_pose_stays_finite(robot):
    """Least squares: at y* the torque of each proximal link under the hanging load; close by, nearly the same."""
    y = delta.elbow_angle(robot)
    R = robot.offset
    load = (robot.m1 / 2 + robot.m2 + robot.m3 / 3) * robot.g * R
    np.testing.assert_allclose(delta.gravity_torque(robot, delta.holding_pose(robot, y))[0], load, rtol=1e-12)
    for off in (1e-3, 1e-5, 1e-7):
        tau, _ = delta.gravity_torque(robot, delta.holding_pose(robot, y + off))
        np.testing.assert_allclose(tau, load, rtol=100 * off / R)


def spans(robot, i, z):
    """Whether arm i + 1 can bring its tip to z: by trying motor angles."""
    local = delta.kinematics.rotations(robot)[i].T @ z
    a = np.linspace(0, 2 * np.pi, 20001)
    distance = np.hypot(
        local[0], np.hypot(local[1] - robot.offset - robot.l1 * np.cos(a), local[2] - robot.l1 * np.sin(a))
    )
    return distance.min() <= robot.l2 <= distance.max()


def test_unreachable_position_names_the_arms_that_cannot_reach(robot):
    rng, seen = np.random.default_rng(5), set()
    for z in rng.uniform([-0.7, -0.7, 0.0], [0.7, 0.7, 1.0], (150, 3)):
        wrong = {i for i in range(3) if not spans(robot, i, z)}
        seen.add(frozenset(wrong))
        if not wrong:
            delta.inverse(robot, z)
            continue
        with pytest.raises(InvalidValue, match="cannot be reached") as caught:
            delta.inverse(robot, z)
        assert {i for i in range(3) if f"arm {i + 1} would" in str(caught.value)} == wrong
    assert {frozenset({i}) for i in range(3)} | {frozenset()} <= seen


def test_motor_angles_at_which_the_arms_cannot_meet():
    with pytest.raises(InvalidValue, match="cannot meet"):
        delta.forward(replace(delta.LIGHT, l2=0.3), (0.1, 0.0, 0.0))


def test_start_that_does_not_close_offers_one_that_does(robot):
    q = delta.holding_pose(robot, 0.8)
    np.testing.assert_array_equal(delta.closed_pose(robot, q), q)
    with pytest.raises(SceneError, match="closed pose with the same motor angles is q = ") as caught:
        delta.closed_pose(robot, q + 0.01 * np.eye(9)[4])
    offered = np.array(ast.literal_eval(str(caught.value).split("q = ")[1].rstrip(".")))
    np.testing.assert_allclose(offered, q, atol=1e-12)


@pytest.mark.parametrize("name", [f.name for f in fields(delta.Robot)])
def test_bad_number_is_refused_by_name(name):
    with pytest.raises(InvalidValue, match=f"Robot.{name} is nan"):
        replace(delta.LIGHT, **{name: float("nan")})


@pytest.mark.parametrize(
    ("name", "value"), [("l1", -0.35), ("l2", 0.0), ("r_base", -0.1), ("m3", -1.0), ("d1", -1.0), ("sign", 0.5)]
)
def test_number_outside_its_range_is_refused_by_name(name, value):
    with pytest.raises(InvalidValue, match=f"Robot: {name} is"):
        replace(delta.LIGHT, **{name: value})


@pytest.mark.parametrize("none", [("m2", "m3"), ("m1", "m2", "jm")])
def test_a_robot_without_inertia_about_an_angle_is_refused(none: tuple[str, ...]) -> None:
    """One mass of those that move with an angle is enough; which one does not matter."""
    for kept in none:
        replace(delta.LIGHT, **dict.fromkeys(none, 0.0) | {kept: 0.1})
    with pytest.raises(InvalidValue, match="inertia"):
        replace(delta.LIGHT, **dict.fromkeys(none, 0.0))


@pytest.mark.parametrize("bad", [[0.0, 0.0], [0.0, 0.0, np.nan], [[0.0, 0.0, 0.6]]])
def test_position_of_another_shape_is_refused(bad):
    with pytest.raises(InvalidValue, match="3 finite numbers"):
        delta.inverse(delta.LIGHT, bad)


def test_undamped_small_swing_at_the_elbow_pose():
    """The pendulum's rate from the constrained linear model with the motors locked, both sets."""
    for robot in delta.SETS.values():
        q = delta.holding_pose(robot, delta.elbow_angle(robot))
        M, h = dense_mass(robot, q), 1e-6
        H = np.vstack([closure_jacobian(robot, q), np.eye(9)[MOTORS]])
        N = np.linalg.svd(H)[2][np.linalg.matrix_rank(H, tol=1e-9) :].T
        angle = np.linalg.norm(N[:, 0][[1, 4, 7]])
        assert angle > 0

        def force(d, robot=robot):
            return gravity_gradient(robot, hanging_pose(robot, d))

        for tilt in np.eye(3)[:2]:
            plus, minus = (hanging_pose(robot, np.array([0, 0, 1.0]) + s * h * tilt) for s in (1, -1))
            direction = (plus - minus) / (2 * h)
            potential = [
                -(
                    (robot.m1 / 2 + robot.m2 + robot.m3 / 3) * robot.l1 * np.sin(p[[0, 3, 6]]).sum()
                    + (robot.m2 / 2 + robot.m3 / 3) * robot.l2 * (np.sin(p[[1, 4, 7]]) * np.cos(p[[2, 5, 8]])).sum()
                )
                * robot.g
                for p in (hanging_pose(robot, np.array([0, 0, 1.0]) + s * 1e-3 * tilt) for s in (1, 0, -1))
            ]
            stiffness = (potential[0] - 2 * potential[1] + potential[2]) / 1e-6
            rate = np.sqrt(stiffness / (direction @ M @ direction))
            np.testing.assert_allclose(rate, delta.pendulum_rate(robot), rtol=1e-5)


@njit
def _updates(n, p, y, x, z, Jy, X, tau):
    done = 0
    for i in range(n):
        y[0] += 1e-3 if i % 2 else -1e-3
        done += compiled.update(p, y, x, z, Jy, X, tau) > 0
    return done


def test_every_control_update_of_a_long_row_converges():
    q = delta.inverse(delta.LIGHT, CENTRES[1])
    buffers = q[MOTORS].copy(), q[OTHERS].copy(), np.zeros(3), np.zeros((3, 3)), np.zeros((6, 3)), np.zeros(3)
    assert _updates(1000, delta.LIGHT.array(), *buffers) == 1000
