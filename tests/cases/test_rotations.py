"""Positions that are not integrals of velocities: q' = N(q) v, quaternions in every integrator of the compiled loop."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from rotating_bodies import (
    GRAVITY,
    body_on_floor,
    free_body,
    free_dynamics,
    free_energy,
    top,
    top_velocity,
)
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from crossbody.cases import InvalidValue, Mode, Outcome, SceneError, rotations
from crossbody.reference import System, ensemble, kernels, prepare, simulate
from crossbody.reference.core.exact import linear_arc
from crossbody.reference.kinds import Array, Floats
from crossbody.reference.linear import poses, tangents
from crossbody.reference.options import Options

START = np.array([0.3, -0.2, 1.0, 0.8, 0.2, -0.4, 0.4])
SPIN = np.array([0.5, -1.0, 2.0, 1.5, -2.5, 1.0])


def matrix(q: Array) -> Any:
    """Rotations of quaternions, w first."""
    return Rotation.from_quat(np.asarray(q), scalar_first=True).as_matrix()


def angle(one: Any, other: Any) -> float:
    """Largest entry by which rotations differ."""
    return float(np.abs(one - other).max())


def tumbled(inertia: Any, R0: Any, w0: Any, t_end: float) -> Any:
    """Rotation matrices and rates by Euler's equations, with no quaternion: SciPy's DOP853 at its tightest."""
    J = np.asarray(inertia)

    def rate(t: float, y: Floats) -> Floats:
        R, w = y[:9].reshape(3, 3), y[9:]
        spin = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        return np.concatenate([(R @ spin).ravel(), -np.cross(w, J * w) / J])

    done = solve_ivp(
        rate, (0.0, t_end), np.concatenate([R0.ravel(), w0]), method="DOP853", rtol=1e-13, atol=1e-14, dense_output=True
    )
    return lambda t: (done.sol(t)[:9].T.reshape(-1, 3, 3), done.sol(t)[9:].T)


def test_a_symmetric_top_precesses_as_in_closed_form() -> None:
    """R(t) = exp(L t / A) R0 exp((A - C)/A w3 t e3): a turn about the angular momentum, and one about the own axis."""
    A, C, t = 2.0, 0.7, np.linspace(0.0, 5.0, 101)
    q0, w0 = np.array([0.8, 0.2, -0.4, 0.4]), np.array([0.9, -0.3, 3.0])
    run = simulate(top((A, A, C), quaternions=[0]), q0, w0, 5.0, rtol=1e-11, samples=t)
    R0 = matrix(q0)
    L = R0 @ (np.array([A, A, C]) * w0)
    own = np.outer(t, [0.0, 0.0, (A - C) / A * w0[2]])
    exact = Rotation.from_rotvec(np.outer(t, L) / A).as_matrix() @ R0 @ Rotation.from_rotvec(own).as_matrix()
    assert angle(matrix(run.q), exact) < 1e-9


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12])
def test_a_tumbling_body_agrees_with_rotation_matrices(rtol: float) -> None:
    """Each tolerance keeps the rotation within what it asks for, at samples inside the steps too."""
    inertia, t = (1.0, 2.0, 3.5), np.linspace(0.0, 4.0, 57)
    truth = tumbled(inertia, matrix(START[3:]), SPIN[3:], 4.0)
    run = simulate(free_body(inertia), START, SPIN, 4.0, rtol=rtol, samples=t)
    R, w = truth(t)
    assert angle(matrix(run.q[:, 3:]), R) < 100.0 * rtol + 1e-11
    assert np.abs(run.v[:, 3:] - w).max() < 300.0 * rtol + 1e-11
    np.testing.assert_allclose(run.q[:, :3], START[:3] + np.outer(t, SPIN[:3]), rtol=0.0, atol=1e-12)


def test_steps_have_order_eight_and_their_dense_output_seven() -> None:
    """Errors at steps of equal length fall by 2^8 as it is halved, and inside by at least 2^7."""
    inertia, R0 = (1.0, 2.0, 3.5), matrix(START[3:])
    truth = tumbled(inertia, R0, SPIN[3:], 4.0)
    ends, between = [], []
    for step in (0.2, 0.1):
        t = np.arange(0.0, 4.0 + 1e-9, step / 4.0)
        run = simulate(free_body(inertia), START, SPIN, 4.0, rtol=1e-1, max_step=step, samples=t)
        off = np.abs(matrix(run.q[:, 3:]) - truth(run.t)[0]).max(axis=(1, 2))
        ends.append(off[::4].max())
        between.append(off.max())
    assert ends[0] / ends[1] > 2.0**7.3
    assert between[0] / between[1] > 2.0**6.3


@kernels.control
def no_control(t: float, q: Floats, v: Floats, u: Floats, s: Floats, p: Floats) -> None:
    """Nothing is changed, but the motion is cut at its ticks."""
    u[0] = 0.0


def test_between_ticks_the_short_method_keeps_its_order() -> None:
    """Bogacki and Shampine's pair: third order at the ticks and, of its interpolant, between them."""
    inertia = (1.0, 2.0, 3.5)
    truth = tumbled(inertia, matrix(START[3:]), SPIN[3:], 1.0)
    errors = []
    for tick in (0.01, 0.005):
        t = np.sort(np.concatenate([np.arange(0.0, 1.0, tick), np.arange(tick / 3.0, 1.0, tick)]))
        run = simulate(
            top(inertia, inputs=1, control=no_control, tick=tick, quaternions=[0]),
            START[3:], SPIN[3:], 1.0, rtol=1e-3, samples=t,
        )  # fmt: skip
        R, w = truth(t)
        errors.append([angle(matrix(run.q), R), np.abs(run.v - w).max()])
    ratios = np.divide(*errors)
    assert np.all(ratios > 2.0**2.7), ratios
    assert np.all(np.array(errors[1]) < 1e-5)


def test_a_thrown_body_follows_its_parabola_and_turns_evenly() -> None:
    """Spin about a principal axis stays as it is, whatever the centre does."""
    t = np.linspace(0.0, 2.0, 21)
    run = simulate(
        free_body((1.0, 2.0, 3.5), gravity=GRAVITY),
        [0, 0, 1, 1, 0, 0, 0],
        [1, 2, 3, 0, 0, 4],
        2.0,
        rtol=1e-11,
        samples=t,
    )
    height = 1.0 + 3.0 * t - 0.5 * GRAVITY * t**2
    np.testing.assert_allclose(run.q[:, :3], np.column_stack([t, 2.0 * t, height]), rtol=0.0, atol=1e-11)
    exact = Rotation.from_rotvec(np.outer(t, [0.0, 0.0, 4.0])).as_matrix()
    assert angle(matrix(run.q[:, 3:]), exact) < 1e-9


def test_a_ball_joint_without_spin_is_a_spherical_pendulum() -> None:
    """The direction u of the centre obeys u'' = -(g/l)(e - (e.u) u) - |u'|^2 u, integrated on its own."""
    J, torque, t = 0.4, 3.0, np.linspace(0.0, 4.0, 41)
    q0, w0 = np.array([0.9, 0.3, -0.2, 0.1]) / np.linalg.norm([0.9, 0.3, -0.2, 0.1]), np.array([1.0, 2.0, 0.0])
    run = simulate(top((J, J, 0.15), torque=torque, quaternions=[0]), q0, w0, 4.0, rtol=1e-11, samples=t)
    down = np.array([0.0, 0.0, -1.0])

    def rate(t: float, y: Floats) -> Floats:
        u, ud = y[:3], y[3:]
        return np.concatenate([ud, torque / J * (down - (down @ u) * u) - (ud @ ud) * u])

    start = np.concatenate([matrix(q0) @ down, matrix(q0) @ np.cross(w0, down)])
    done = solve_ivp(rate, (0.0, 4.0), start, method="DOP853", rtol=1e-13, atol=1e-14, t_eval=t)
    np.testing.assert_allclose(matrix(run.q) @ down, done.y[:3].T, rtol=0.0, atol=2e-9)


def test_momenta_energy_and_length_are_kept() -> None:
    """Over 5 s at rtol 1e-11: drift below 1e-10, and the quaternion's own length within 1e-10 of 1."""
    inertia, t = np.array([1.0, 2.0, 3.5]), np.linspace(0.0, 5.0, 101)
    run = prepare(free_body(tuple(inertia), gravity=GRAVITY), START, SPIN, Options(t_end=5.0, rtol=1e-11, samples=t))
    motion = run.trajectory(*run.go())
    momentum = np.einsum("kij,kj->ki", matrix(motion.q[:, 3:]), inertia * motion.v[:, 3:])
    assert np.abs(momentum - momentum[0]).max() < 1e-10 * np.linalg.norm(momentum[0])
    energy = motion.energy.sum(axis=1)
    assert np.abs(energy / energy[0] - 1.0).max() < 1e-10
    raw = np.linalg.norm(run.buffers["out"][:101, 4:8], axis=1)
    assert 0.0 < np.abs(raw - 1.0).max() < 1e-10
    np.testing.assert_allclose(np.linalg.norm(motion.q[:, 3:], axis=1), 1.0, rtol=0.0, atol=3e-16)


@pytest.mark.parametrize("length", [1.0, 1.3])
def test_the_pull_to_length_one_does_not_turn(length: float) -> None:
    """Runs with and without it agree in R to 100 rtol, from quaternions of any length."""
    rtol, t = 1e-9, np.linspace(0.0, 4.0, 33)
    q0 = START[3:] / np.linalg.norm(START[3:]) * length
    runs = [simulate(top((1.0, 2.0, 3.5), pull=pull), q0, SPIN[3:], 4.0, rtol=rtol, samples=t).q for pull in (0.1, 0.0)]
    assert angle(*map(matrix, runs)) < 100.0 * rtol
    lengths = [np.linalg.norm(q, axis=1) for q in runs]
    np.testing.assert_allclose(lengths[1], length, rtol=1e-8)
    exact = 1.0 / np.sqrt(1.0 + (length**-2 - 1.0) * np.exp(-0.2 * t))  # of l' = 0.1 (1 - l^2) l
    np.testing.assert_allclose(lengths[0], exact, rtol=1e-8)


TRIPOD = np.array([[0.3, 0.0, -0.2], [-0.15, 0.26, -0.2], [-0.15, -0.26, -0.2]])


def test_a_corner_that_strikes_follows_its_law() -> None:
    """While one row acts its gap obeys h'' + a1 h' + a0 h = 0, whatever the body does; the energy account closes."""
    a0, a1 = 1e4, 40.0
    system = body_on_floor(TRIPOD, (0.02, 0.03, 0.04), a0=[a0] * 3, a1=[a1] * 3)
    system.check(START, SPIN)
    q0 = np.array([0.0, 0.0, 1.0, 0.9, 0.3, 0.2, 0.1])
    run = simulate(system, q0, [0.3, 0.0, 0.0, 2.0, 1.0, -3.0], 1.2, rtol=1e-10, ledger=True)
    assert run.outcome is Outcome.FINISHED
    assert run.ledger is not None
    assert len(run.events) >= 4
    touch, release = run.events[:2]
    i = touch.contact
    inside = (run.t > touch.t) & (run.t < release.t)
    assert inside.sum() > 5
    before = np.flatnonzero(run.t == touch.t)[-1]
    rate = system.gap(run.q[before], run.v[before])[1][i]
    exact = [linear_arc(a0, a1, 0.0, rate, t - touch.t)[0] for t in run.t[inside]]
    np.testing.assert_allclose(run.gap[inside, i], exact, rtol=0.0, atol=1e-9)
    at = np.flatnonzero(run.t == release.t)[0]
    assert abs(run.lam[at, i]) < 1e-6 * run.lam[inside, i].max()
    booked = run.ledger.contact.sum(axis=1) + run.ledger.input - run.ledger.dissipated
    energy = run.energy.sum(axis=1)
    np.testing.assert_allclose(energy - energy[0], booked, rtol=0.0, atol=1e-8)


@pytest.mark.parametrize("implicit", [True, False])
def test_a_tripod_turns_on_its_stiff_feet(implicit: bool) -> None:
    """Three rows press m g / 3 each while the body turns evenly about the vertical; the implicit method takes it."""
    a0 = 1e8 if implicit else 1e4
    feet = 0.3 * np.array([[np.cos(x), np.sin(x), -2.0 / 3.0] for x in 2.0 * np.pi / 3.0 * np.arange(3)])
    system = body_on_floor(feet, (0.03, 0.03, 0.04), a0=[a0] * 3, a1=[2.0 * np.sqrt(a0)] * 3)
    t = np.linspace(0.0, 2.0, 41)
    run = simulate(
        system, [0, 0, 0.2, 1, 0, 0, 0], [0.5, 0, 0, 0, 0, 3.0], 2.0, rtol=1e-9, samples=t, implicit=implicit
    )
    assert run.outcome is Outcome.FINISHED
    assert (run.counts["implicit_steps"] > 20) is implicit
    assert np.all(run.mode[1:] == Mode.CONTACT)
    np.testing.assert_allclose(run.lam[1:], GRAVITY / 3.0, rtol=1e-6)
    exact = Rotation.from_rotvec(np.outer(t, [0.0, 0.0, 3.0])).as_matrix()
    assert angle(matrix(run.q[:, 3:]), exact) < 1e-7
    np.testing.assert_allclose(run.q[:, :3], np.column_stack([0.5 * t, 0.0 * t, 0.2 + 0.0 * t]), rtol=0.0, atol=1e-8)


def test_the_implicit_method_agrees_with_the_explicit_one_while_feet_swing() -> None:
    """Stiff rows under a body that tumbles and rocks: both methods and both give the same motion."""
    system = body_on_floor(TRIPOD, (0.02, 0.03, 0.04), a0=[1e6] * 3, a1=[2e3] * 3)
    start = np.array([0.0, 0.0, 0.2, 1.0, 0.0, 0.0, 0.0]), np.array([0.2, 0.1, 0.0, 0.0, 0.0, 6.0])
    runs = [
        simulate(system, *start, 0.6, rtol=1e-9, samples=[0.2, 0.4, 0.6], implicit=implicit)
        for implicit in (True, False)
    ]
    assert runs[0].counts["implicit_steps"] > 20
    np.testing.assert_allclose(runs[0].q, runs[1].q, rtol=0.0, atol=2e-7)
    np.testing.assert_allclose(runs[0].v, runs[1].v, rtol=0.0, atol=2e-6)


def test_an_ensemble_is_its_runs() -> None:
    """Ends of many starts at once are those of single runs, with quaternions of length 1."""
    system = free_body((1.0, 2.0, 3.5), gravity=GRAVITY)
    draw = np.random.default_rng(3)
    q0, v0 = draw.standard_normal((5, 7)), draw.standard_normal((5, 6))
    many = ensemble(system, q0, v0, 1.0, threads=1)
    for r in range(5):
        one = simulate(system, q0[r], v0[r], 1.0)
        np.testing.assert_array_equal(many.q[r], one.q[-1])
        np.testing.assert_array_equal(many.v[r], one.v[-1])


@pytest.mark.parametrize("solver", ["cvode", "ida"])
def test_other_solvers_turn_the_body_as_the_compiled_loop_does(solver: str) -> None:
    """A body that falls on its feet: the same events, the same motion, quaternions of length 1."""
    system = body_on_floor(TRIPOD, (0.02, 0.03, 0.04), a0=[1e4] * 3, a1=[40.0] * 3)
    start = np.array([0.0, 0.0, 1.0, 0.9, 0.3, 0.2, 0.1]), np.array([0.3, 0.0, 0.0, 2.0, 1.0, -3.0])
    t = np.linspace(0.0, 0.8, 9)
    mine = simulate(system, *start, 0.8, rtol=1e-11, samples=t)
    theirs = simulate(system, *start, 0.8, rtol=1e-10, samples=t, solver=solver, ledger=True)
    assert theirs.outcome is Outcome.FINISHED
    assert [(e.contact, e.after) for e in theirs.events] == [(e.contact, e.after) for e in mine.events]
    assert len(mine.events) >= 2
    np.testing.assert_allclose([e.t for e in theirs.events], [e.t for e in mine.events], rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(theirs.q[:, :3], mine.q[:, :3], rtol=0.0, atol=1e-7)
    assert angle(matrix(theirs.q[:, 3:]), matrix(mine.q[:, 3:])) < 1e-7
    np.testing.assert_allclose(np.linalg.norm(theirs.q[:, 3:], axis=1), 1.0, rtol=0.0, atol=3e-16)


def test_what_asks_for_velocities_that_are_rates_is_refused() -> None:
    """Stabilised rows of index 3, and derivatives at many states: one sentence each."""
    system = body_on_floor(TRIPOD, (0.02, 0.03, 0.04), a0=[1e4] * 3, a1=[40.0] * 3)
    with pytest.raises(InvalidValue, match="index is 3; valid: 1, since the system has a kernel velocity"):
        simulate(system, START, SPIN, 1.0, solver="ida", index=3)
    for refused in (
        lambda: poses(system, START[None], hold=[0]),
        lambda: tangents(system, START[None]),
    ):
        with pytest.raises(SceneError, match=r"System\.velocity is given: q. is not v"):
            refused()


@kernels.velocity
def euler_velocity(t: float, q: Array, v: Array, p: Array, qd: Array) -> None:
    """Angles z, y, x in this order, from body rates."""
    for i in range(3):
        qd[i] = v[i]
    s, c = np.sin(q[5]), np.cos(q[5])
    qd[3] = (v[4] * s + v[5] * c) / np.cos(q[4])
    qd[4] = v[4] * c - v[5] * s
    qd[5] = v[3] + np.sin(q[4]) * qd[3]


def test_as_many_positions_as_velocities_need_not_be_their_integrals() -> None:
    """The same body in Euler's angles turns as in quaternions."""
    body = System(n=6, dynamics=free_dynamics, velocity=euler_velocity, energy=free_energy,
                  parameters=[1.0, 1.0, 2.0, 3.5, 0.0, GRAVITY])  # fmt: skip
    spin = np.array([0.0, 0.0, 1.0, 0.4, 0.3, 1.0])
    angles = simulate(body, np.zeros(6), spin, 1.0, rtol=1e-11)
    turned = simulate(free_body((1.0, 2.0, 3.5), gravity=GRAVITY), [0, 0, 0, 1, 0, 0, 0], spin, 1.0, rtol=1e-11)
    R = Rotation.from_euler("ZYX", angles.q[-1, 3:]).as_matrix()
    assert angle(R, matrix(turned.q[-1, 3:])) < 1e-9


@kernels.velocity
def partial_velocity(t: float, q: Array, v: Array, p: Array, qd: Array) -> None:
    """Four of the seven entries."""
    top_velocity(t, q, v, p, qd)


@kernels.velocity
def bent_velocity(t: float, q: Array, v: Array, p: Array, qd: Array) -> None:
    """Not affine in v."""
    for i in range(7):
        qd[i] = v[0] * v[0]


@kernels.velocity
def drifting_velocity(t: float, q: Array, v: Array, p: Array, qd: Array) -> None:
    """The body sinks by itself."""
    for i in range(7):
        qd[i] = 0.0
    qd[2] = v[2] - 0.1


SINGLE: dict[str, Any] = {"a0": [1e4], "a1": [10.0]}


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"nq": 7, "velocity": None}, "System.nq is 7 and System.n is 6; valid: as many positions as velocities"),
        ({"nq": 5}, "System.nq is 5 and System.n is 6"),
        ({"quaternions": [4]}, "System.quaternions is [4]; each is the first of four entries"),
        ({"quaternions": [0, 3]}, "System.quaternions is [0, 3]"),
        ({"nq": 0, "velocity": None}, "System.quaternions are given without the kernel velocity"),
        ({"affine": True}, "System.affine is true, but with a kernel velocity"),
        ({"velocity": no_control}, "System.velocity is not a kernel of the right signature"),
    ],
)
def test_what_does_not_fit_is_named(given: dict[str, Any], message: str) -> None:
    """Wrong sizes and wrong kernels are refused when the system is made."""
    whole: dict[str, Any] = {"n": 6, "nq": 7, "quaternions": [3], "dynamics": free_dynamics, "velocity": bent_velocity}
    with pytest.raises(SceneError, match=re.escape(message)):
        System(**(whole | given), parameters=[1.0] * 6)


@pytest.mark.parametrize(
    ("velocity", "message"),
    [
        (bent_velocity, "Kernel velocity gives qd[0] = "),
        (drifting_velocity, "along which gap 0 changes"),
        (partial_velocity, "Kernel velocity leaves qd[4] unfilled"),
    ],
)
def test_a_wrong_kernel_is_found_at_the_start(velocity: Any, message: str) -> None:
    """What is not affine, what moves a gap at rest and what leaves entries unfilled is an error before the run."""
    good = body_on_floor(TRIPOD[:1], (0.02, 0.03, 0.04), **SINGLE)
    wrong = System(
        n=6,
        nq=7,
        dynamics=good.dynamics,
        velocity=velocity,
        gaps=good.gaps,
        rows=good.rows,
        parameters=good.p,
        **SINGLE,
    )
    with pytest.raises(SceneError, match=re.escape(message)):
        simulate(wrong, START, SPIN, 1.0)


def test_a_row_that_does_not_belong_to_the_velocities_is_found() -> None:
    """H is h' per velocity: a kernel that turns the body at another rate contradicts its rows."""
    good = body_on_floor(TRIPOD[:1], (0.02, 0.03, 0.04), **SINGLE)

    wrong = System(
        n=6, nq=7, dynamics=good.dynamics, velocity=half_velocity, gaps=good.gaps, rows=good.rows, parameters=good.p,
        **SINGLE,
    )  # fmt: skip
    with pytest.raises(SceneError, match=r"Kernel rows gives H\[0, [345]\] = .* along velocity [345] by differences"):
        simulate(wrong, START, SPIN, 1.0)


@kernels.velocity
def half_velocity(t: float, q: Array, v: Array, p: Array, qd: Array) -> None:
    """A body that turns at half its rate."""
    for i in range(3):
        qd[i] = v[i]
    w, x, y, z = q[3], q[4], q[5], q[6]
    a, b, c = 0.25 * v[3], 0.25 * v[4], 0.25 * v[5]
    qd[3], qd[4] = -x * a - y * b - z * c, w * a + y * c - z * b
    qd[5], qd[6] = w * b + z * a - x * c, w * c + x * b - y * a


def test_a_quaternion_without_direction_is_refused() -> None:
    """Zero has no rotation."""
    with pytest.raises(SceneError, match="the quaternion at entries 3 to 6 is zero"):
        simulate(free_body((1.0, 2.0, 3.5)), np.zeros(7), np.zeros(6), 1.0)


@pytest.mark.parametrize("seed", range(6))
def test_rotations_are_those_of_scipy_whatever_the_length_and_sign_of_their_quaternions(seed: int) -> None:
    """As many at once as there are, with other positions around them."""
    rng = np.random.default_rng(seed)
    shape = [(), (7,), (3, 5)][seed % 3]
    a, b = rng.normal(size=(2, *shape, 4)) * 10.0 ** rng.uniform(-2.0, 2.0, (2, *shape, 1))
    np.testing.assert_allclose(rotations.matrices(a), matrix(a), atol=1e-14)
    one, other = (Rotation.from_quat(x.reshape(-1, 4), scalar_first=True) for x in (a, b))
    between = (one.inv() * other).as_rotvec().reshape(*shape, 3)
    np.testing.assert_allclose(rotations.turned(b, a), between, atol=1e-13)
    q, r = (np.concatenate([rng.normal(size=(len(x), 2)), x, rng.normal(size=(len(x), 1))], axis=1)
            for x in (one.as_quat(scalar_first=True), -3.0 * other.as_quat(scalar_first=True)))  # fmt: skip
    apart = np.zeros(q.shape)
    apart[:, [0, 1, 6]] = np.abs(q - r)[:, [0, 1, 6]]
    apart[:, 2] = (one.inv() * other).magnitude()
    np.testing.assert_allclose(rotations.differences(q, r, [2]), apart, atol=1e-13)
    v, step = rng.normal(size=(len(q), 6)), 1e-6
    ahead, behind = (q + sign * step * rotations.rates(q, v, [2]) for sign in (1.0, -1.0))
    np.testing.assert_allclose((ahead - behind)[:, [0, 1, 6]] / (2.0 * step), v[:, [0, 1, 5]], atol=1e-8)
    np.testing.assert_allclose(rotations.turned(ahead[:, 2:6], behind[:, 2:6]) / (2.0 * step), v[:, 2:5], atol=1e-8)
    long = np.linalg.norm(rotations.normalised(r, [2])[:, 2:6], axis=1)
    np.testing.assert_allclose(long, 1.0, atol=1e-15)
