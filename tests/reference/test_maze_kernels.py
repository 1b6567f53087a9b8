"""Laws of the ball maze's equations at random states, in every discrete state that a ball can be in."""

from __future__ import annotations

import numpy as np
import pytest

from crossbody.cases import load
from crossbody.cases.mechanisms.maze.geometry import maze_of
from crossbody.reference.systems import _maze_layout as layout
from crossbody.reference.systems import maze
from crossbody.reference.systems._maze_control import sampled

STEP = 1e-30
NORMAL, ALL = np.arange(6), np.arange(8)
# channel, sector below, sector above
PLACES = [(0, -1, -1), (0, -1, 0), (1, -1, 2), (2, 3, -1), (3, 1, 0), (4, -1, -1), (4, 2, -1), (3, -1, 3)]


def system_of(**parameters):
    case = load("ball_maze", variant="solve", **parameters)
    return maze.build(case.parameters, case.law)


SYSTEM = system_of()
DAMPED = system_of(rolling_damping=1e-6)
GEOMETRY = maze_of(load("ball_maze", variant="solve").parameters)


def there(channel, lower, upper, mode=0, target=0.3, touching=0.0, system=SYSTEM):
    p = system.p.copy()
    p[layout.CHANNEL : layout.ANGLE] = channel, lower, upper, mode, target, touching
    return p


@pytest.fixture(params=PLACES, ids=str)
def p(request):
    return there(*request.param)


@pytest.fixture
def states():
    rng = np.random.default_rng(5)
    q = rng.uniform(-3.0, 3.0, (20, 4))
    rho, b = rng.uniform(0.01, 0.09, 20), rng.uniform(-3.0, 3.0, 20)
    q[:, 1], q[:, 2] = rho * np.cos(b), rho * np.sin(b)
    v = rng.normal(size=(20, 4)) * [2.0, 0.2, 0.2, 30.0]
    return list(zip(q, v, strict=True))


def dynamics(q, v, p, u=0.0):
    kind = np.result_type(q, v, p, float)
    M, f, w = np.zeros((4, 1), kind), np.zeros(4, kind), np.zeros(maze.SCRATCH, kind)
    maze.dynamics(0.0, *(np.asarray(a, kind) for a in (q, v, [u], p)), M, f, w)
    return M[:, 0], f, w


def rows(q, v, p, idx=ALL):
    kind = np.result_type(q, v, float)
    w = dynamics(q, v, p)[2]
    n = len(idx)
    H, h, Hdv = np.full((n, 4), np.nan, kind), np.full(n, np.nan, kind), np.full(n, np.nan, kind)
    maze.rows(0.0, *(np.asarray(a, kind) for a in (q, v, p, w)), np.asarray(idx), n, H, h, Hdv)
    return H, h, Hdv


def gaps(q, v, p, count=8):
    kind = np.result_type(q, v, float)
    h, hd = np.zeros(count, kind), np.zeros(count, kind)
    maze.gaps(0.0, *(np.asarray(a, kind) for a in (q, v, p)), h, hd)
    return h, hd


def energy(q, v, p):
    kind = np.result_type(q, v, float)
    e = np.zeros(2, kind)
    maze.energy(*(np.asarray(a, kind) for a in (q, v, p)), e)
    return e.sum()


def along(function, x, direction):
    """Derivative by complex step."""
    return np.asarray(function(x + 1j * STEP * direction)).imag / STEP


def accelerate(q, v, p, idx, u=0.0, system=SYSTEM):
    """v' and lam from the dense saddle-point system."""
    M, f, _ = dynamics(q, v, p, u)
    H, h, Hdv = rows(q, v, p, idx)
    a0, a1, _ = system.alpha[idx].T
    held = np.where(idx >= 6, 0.0, h)
    n = len(idx)
    K = np.block([[np.diag(M), -H.T], [H, np.zeros((n, n))]])
    x = np.linalg.solve(K, np.concatenate([f, -(Hdv + a1 * (H @ v) + a0 * held)]))
    return x[:4], x[4:]


def test_normal_rows_are_the_derivatives_of_the_gaps(p, states):
    for q, v in states:
        H, h, _ = rows(q, v, p, NORMAL)
        derivatives = [along(lambda x, v=v: gaps(x, v, p)[0][:6], q, e) for e in np.eye(4)]
        np.testing.assert_allclose(H.T, derivatives, atol=1e-14)
        np.testing.assert_allclose(h, gaps(q, v, p)[0][:6], atol=1e-16)


def test_rates_are_h_times_v_in_every_row_that_is_there(p, states):
    for q, v in states:
        np.testing.assert_allclose(rows(q, v, p)[0] @ v, gaps(q, v, p)[1], rtol=1e-13, atol=1e-15)


def test_curvature_is_the_derivative_of_the_rows_along_the_motion(p, states):
    for q, v in states:
        turning = along(lambda x, v=v: rows(x, v, p)[0] @ v, q, v)
        np.testing.assert_allclose(rows(q, v, p)[2], turning, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("idx", [[0], [6, 0], [3, 7], [5, 0, 6]])
def test_rows_fill_those_asked_for_in_their_order(states, idx):
    p = there(4, -1, -1)
    for q, v in states[:3]:
        for some, whole in zip(rows(q, v, p, idx), rows(q, v, p), strict=True):
            np.testing.assert_array_equal(some, whole[idx])


def test_rows_that_cannot_be_touched_are_far_and_still(p, states):
    q, v = states[0]
    h, hd = gaps(q, v, p)
    channel, lower, upper = p[layout.CHANNEL : layout.MODE]
    there_now = {0, 6} if lower < 0 else {1, 2}
    there_now = (there_now if channel > 0 else set()) | ({3, 7} if upper < 0 else {4, 5})
    away = sorted(set(range(8)) - there_now)
    np.testing.assert_array_equal(h[away], [GEOMETRY.wall if i < 6 else 0.0 for i in away])
    np.testing.assert_array_equal(hd[away], 0.0)


def test_frictionless_maze_has_the_same_normal_rows(p, states):
    q, v = states[1]
    np.testing.assert_array_equal(gaps(q, v, p, 6), np.array(gaps(q, v, p))[:, :6])


@pytest.mark.parametrize("ring", range(4))
@pytest.mark.parametrize("end", [0, 1])
@pytest.mark.parametrize("side", ["below", "above"])
def test_gap_and_normal_are_continuous_where_a_face_hands_over_to_a_tip(ring, end, side):
    wall, theta, gap = GEOMETRY.rings[ring], 0.7, GEOMETRY.rings[ring].gaps - 1
    b = theta + wall.tips(gap)[end]
    rho = wall.outer + GEOMETRY.ball if side == "below" else wall.inner - GEOMETRY.ball
    q, v = np.array([theta, rho * np.cos(b), rho * np.sin(b), 0.1]), np.array([0.3, 0.01, -0.02, 1.0])
    channel = ring + 1 if side == "below" else ring
    face, tip = (0, 1 + end) if side == "below" else (3, 4 + end)
    solid = rows(q, v, there(channel, -1, -1))
    rounded = rows(q, v, there(channel, gap, -1) if side == "below" else there(channel, -1, gap))
    np.testing.assert_allclose(solid[0][face], rounded[0][tip], atol=1e-14)
    np.testing.assert_allclose((solid[1][face], rounded[1][tip]), 0.0, atol=1e-16)


def test_normal_and_slip_on_one_face_are_decoupled_and_the_slip_feels_three_inertias(states):
    for channel, face, slip, R in ((4, 0, 6, GEOMETRY.rings[3].outer), (0, 3, 7, GEOMETRY.rings[0].inner)):
        p = there(channel, -1, -1)
        for q, v in states:
            H = rows(q, v, p, [face, slip])[0]
            G = H / dynamics(q, v, p)[0] @ H.T
            mass, r = p[layout.MB], GEOMETRY.ball
            expected = R**2 / p[layout.JM] + 1.0 / mass + r**2 / (0.4 * mass * r**2)
            np.testing.assert_allclose(G, np.diag([1.0 / mass, expected]), rtol=1e-12, atol=1e-10)


def test_two_rolling_contacts_have_one_row_too_many(states):
    q, v = states[0]
    H = rows(q, v, there(4, -1, -1), np.array([0, 3, 6, 7]))[0]
    assert np.linalg.matrix_rank(H) == 3


@pytest.mark.parametrize("touching", [0.0, 1.0])
@pytest.mark.parametrize(("mode", "idx"), [(0, [0, 6]), (1, [0, 6]), (2, [3]), (1, [3, 7])])
def test_energy_changes_by_power_and_the_work_of_the_rows(states, mode, idx, touching):
    p = there(4, -1, -1, mode, touching=touching, system=DAMPED)
    idx = np.array(idx)
    for q, v in states:
        vd, lam = accelerate(q, v, p, idx, 0.02)
        rate = along(lambda x, v=v: energy(x, v, p), q, v) + along(lambda x, q=q: energy(q, x, p), v, vd)
        e = np.zeros(2)
        maze.power(0.0, q, v, np.array([0.02]), p, e)
        scale = 1.0 + np.abs(lam).max()
        np.testing.assert_allclose(rate, e[0] - e[1] + lam @ (rows(q, v, p, idx)[0] @ v), atol=1e-10 * scale)
        assert (e[1] > 0.0) == (touching > 0.0)


def on_face(ring, top, eps, epsd, thetad, theta=0.2):
    """State of a ball that rolls without slip, possibly complex."""
    wall, r = GEOMETRY.rings[ring], GEOMETRY.ball
    s, R, rho = (-1.0, wall.outer, wall.outer + r) if top else (1.0, wall.inner, wall.inner - r)
    b = (0.5 if top else -0.5) * np.pi + eps
    spin = (R * thetad - rho * epsd) / (s * r)
    q = np.array([theta + 0.0 * eps, rho * np.cos(b), rho * np.sin(b), 0.0 * eps])
    return q, np.array([thetad, -rho * np.sin(b) * epsd, rho * np.cos(b) * epsd, spin])


def loop(ring, top, omega):
    """d/dt (eps, eps', theta') of the closed loop on a face, as a function of them."""
    system = system_of(omega=omega, a_max=0, u_max=0)
    p = there(ring + 1 if top else 0, -1, -1, 1 if top else 3, system=system)
    idx = np.array([0, 6]) if top else np.array([3, 7])

    def rate(z):
        q, v = on_face(ring, top, *z)
        vd, _ = accelerate(q, v, p, idx, system=system)
        square = q[1] ** 2 + q[2] ** 2
        slow = (q[1] * v[1] + q[2] * v[2]) / square
        return np.array([z[1], (q[1] * vd[2] - q[2] * vd[1]) / square - 2.0 * slow * z[1], vd[0]])

    return rate


@pytest.mark.parametrize(("ring", "top"), [(0, True), (1, True), (2, True), (3, True), (0, False)])
def test_feedback_places_the_poles(ring, top):
    omega = 0.06 if top else 0.0
    rate = loop(ring, top, omega)
    at = np.array([0.0, 0.0, omega])
    np.testing.assert_allclose(rate(at), 0.0, atol=1e-12)
    A = np.array([along(rate, at, e) for e in np.eye(3)]).T
    rho = GEOMETRY.rings[0].inner - GEOMETRY.ball
    w0 = np.sqrt(SYSTEM.p[layout.G] / (1.4 * rho))
    wanted = np.poly([-5.0] * 3) if top else np.polymul([1.0, w0, w0**2], [1.0, 4.0])
    np.testing.assert_allclose(np.poly(A), wanted, rtol=1e-10)


def test_law_gives_exactly_the_angular_acceleration_it_asks_for():
    rng = np.random.default_rng(8)
    for ring in range(4):
        rate = loop(ring, True, 0.06)
        for eps, epsd, thetad in rng.normal(size=(5, 3)) * [0.3, 0.3, 2.0]:
            R, rho = GEOMETRY.rings[ring].outer, GEOMETRY.rings[ring].outer + GEOMETRY.ball
            output = 0.4 * R * thetad - 1.4 * rho * epsd
            w = -15.0 * epsd - 75.0 * eps + 125.0 * (output - 0.4 * R * 0.06) / SYSTEM.p[layout.G]
            np.testing.assert_allclose(rate(np.array([eps, epsd, thetad]))[1], w, rtol=1e-10)


def test_torque_and_acceleration_are_limited():
    system = system_of(a_max=20.0, u_max=0.05)
    p = there(4, 0, -1, 2, target=0.5, system=system)
    q, v = np.array([0.4, 0.0, 0.08, 0.0]), np.zeros(4)
    assert dynamics(q, v, p)[1][0] == pytest.approx(20.0 * 1e-3)  # 1600 * 0.1 = 160, limited to 20
    p[layout.A_MAX] = 0.0
    assert dynamics(q, v, p)[1][0] == pytest.approx(0.05)
    assert dynamics(q + np.array([0.2, 0.0, 0.0, 0.0]), v, p)[1][0] == pytest.approx(-0.05)


def ticks(system, p, states, delay):
    memory, torques = np.zeros(1 + delay), []
    for q, v in states:
        u = np.zeros(1)
        sampled(0.0, q, v, u, memory, p)
        torques.append(u[0])
    return np.array(torques)


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_sampled_torque_is_the_continuous_one_some_samples_late(states, delay):
    system = system_of(controller="sampled", delay=delay)
    p, q = there(4, -1, -1, 1, system=system), there(4, -1, -1, 1)
    wanted = np.array([dynamics(*state, q)[1][0] for state in states])
    found = ticks(system, p, states, delay)
    np.testing.assert_allclose(found[delay:], wanted[: len(wanted) - delay], rtol=1e-14)
    np.testing.assert_array_equal(found[:delay], 0.0)
    np.testing.assert_array_equal([dynamics(*state, p)[1][0] for state in states], 0.0)


def test_noise_is_normal_repeatable_and_depends_on_its_seed():
    rest = [(np.array([0.0, 0.0, 0.08785, 0.0]), np.zeros(4))] * 4000
    torques = []
    for seed in (1, 1, 2):
        system = system_of(controller="sampled", delay=0, noise=1e-6, seed=seed, a_max=0, u_max=0, omega=0)
        torques.append(ticks(system, there(4, -1, -1, 1, system=system), rest, 0))
    np.testing.assert_array_equal(torques[0], torques[1])
    assert abs(np.corrcoef(torques[0], torques[2])[0, 1]) < 0.05
    scaled = torques[0] / torques[0].std()
    assert abs(scaled.mean()) < 0.05
    assert np.mean(scaled**4) == pytest.approx(3.0, abs=0.3)
    assert abs(np.corrcoef(scaled[1:], scaled[:-1])[0, 1]) < 0.05
