"""The soft contact with the whole delta robot: its equations, and its run beside the one on an axis."""

from __future__ import annotations

import numpy as np
import pytest

from crossbody import cases
from crossbody.cases import Mode, Outcome
from crossbody.cases.mechanisms.delta import pose
from crossbody.engines import load
from crossbody.reference import delta
from crossbody.reference.delta.kernels import robot as arms
from crossbody.reference.linear import linearise
from crossbody.reference.systems import soft_delta as mechanism
from crossbody.reports import metrics

STEP = 1e-30
MOTORS = [0, 3, 6]
CASE = cases.load("soft_contact", "delta")
SYSTEM = mechanism.build(CASE.parameters, CASE.law)
P = {name: float(value) for name, value in CASE.parameters.items()}


def run(kstar, rtol=1e-8, **settings):
    case = cases.load("soft_contact", "delta", kstar=kstar)
    return case, load("reference").prepare(case, rtol=rtol, **settings).run()


@pytest.fixture(scope="module")
def pushed():
    return run(0.0)


@pytest.fixture(scope="module")
def felt():
    return run(20.0)


@pytest.fixture
def states():
    """Closed poses with velocities that keep them closed, and pads, block and controller anywhere."""
    rng, found = np.random.default_rng(3), []
    for _ in range(5):
        q, v = CASE.q0 + 0.01 * rng.normal(size=18), 0.3 * rng.normal(size=18)
        q[:9] = pose.pose(P, np.array([0.0, 0.0, 0.6]) + 0.05 * rng.uniform(-1, 1, 3))
        H = pose.closure(P, q[:9])
        v[:9] -= np.linalg.lstsq(H, H @ v[:9], rcond=None)[0]
        found.append((q, v, rng.normal(size=3)))
    return found


def dynamics(t, q, v, u):
    M, f, w = np.zeros((18, 3)), np.zeros(18), np.zeros(SYSTEM.scratch)
    mechanism.dynamics(t, q, v, u, np.array(SYSTEM.p), M, f, w)
    return M, f


def test_rows_are_the_derivatives_of_the_gaps(states):
    p = SYSTEM.p.astype(complex)
    for q, v, _ in states:
        H, h, drift = SYSTEM.constraint(q, v)
        gap, rate = np.zeros(9, complex), np.zeros(9, complex)
        for k, e in enumerate(np.eye(18)):
            mechanism.gaps(0.0, q + 1j * STEP * e, v.astype(complex), p, gap, rate)
            np.testing.assert_allclose(gap.imag / STEP, H[:, k], atol=1e-14)
        mechanism.gaps(0.0, q + 1j * STEP * v, v.astype(complex), p, gap, rate)
        np.testing.assert_allclose(rate.imag / STEP, drift, atol=1e-12)
        np.testing.assert_allclose([h, H @ v], SYSTEM.gap(q, v), atol=1e-14)


def test_the_torque_linearises_the_flange(states):
    """My Jy^-1 a + tau_g from the library's own kinematics and statics, the jaws open and still."""
    ki, kp, kd = 343.0, 147.0, 21.0
    for q, v, _ in states:
        _, f = dynamics(0.0, q, v, np.zeros(3))
        robot = delta.LIGHT
        z, Jy, _ = delta.jacobians(robot, q[:9])
        rate = delta.virtual_jacobian(robot, q[:9]) @ v[:9]
        np.testing.assert_allclose(rate, Jy @ v[MOTORS], atol=1e-12)
        felt = v[11] + 100.0 * 0.01 * (v[9] + v[10])
        wanted = ki * q[15:] + kp * v[15:] + kd * (np.array([0.2 * felt, 0.0, 0.0]) - rate)
        tau = delta.task_mass(robot, q[:9]) @ np.linalg.solve(Jy, wanted) + delta.gravity_torque(robot, q[:9])[0]
        half = 0.012 + 0.02
        fingers = [2e4 * (z[0] + s * half - q[pad]) + 30.0 * (rate[0] - v[pad]) for s, pad in ((-1, 9), (1, 10))]
        u = np.concatenate([tau, [-sum(fingers), 0.0, 0.0]])
        M, expected, w = np.zeros((9, 3)), np.zeros(9), np.zeros(18)
        arms.dynamics(0.0, q[:9], v[:9], u, robot.array(), M, expected, w)
        np.testing.assert_allclose(f[:9], expected, atol=1e-9 * np.abs(u).max())
        np.testing.assert_allclose(f[9:11], fingers, rtol=1e-10)
        np.testing.assert_allclose(f[15:], np.array([0.2 * felt, 0.0, 0.0]) - rate, atol=1e-12)


def test_power_balances_the_energy(states):
    """E' = inputs - dissipation + lam . h', with the jaws and the flange's reference moving."""
    p = np.array(SYSTEM.p)
    for t, (q, v, u) in zip((0.3, 1.7, 2.5, 4.6, 5.5), states, strict=True):
        blocks, f = dynamics(t, q, v, u)
        M = np.zeros((18, 18))
        for k in range(0, 18, 3):
            M[k : k + 3, k : k + 3] = blocks[k : k + 3]
        vd, e, power = np.linalg.solve(M, f), np.zeros(2, complex), np.zeros(2)
        mechanism.energy(q + 1j * STEP * v, v + 1j * STEP * vd, p.astype(complex), e)
        mechanism.power(t, q, v, u, p, power)
        np.testing.assert_allclose(e.sum().imag / STEP, power[0] - power[1], rtol=1e-8, atol=1e-8)


def test_robot_at_the_grasp_weighs_what_it_should():
    q = delta.inverse(delta.LIGHT, (0.0, 0.0, 0.6))
    _, Jy, _ = delta.jacobians(delta.LIGHT, q)
    mass = np.linalg.inv(Jy).T @ delta.task_mass(delta.LIGHT, q) @ np.linalg.inv(Jy)
    np.testing.assert_allclose(q[0], 0.76108, atol=5e-6)
    np.testing.assert_allclose(mass, np.diag([0.6452, 0.6452, 0.8096]), atol=5e-5)
    np.testing.assert_allclose(delta.gravity_torque(delta.LIGHT, q)[0], -1.45465, atol=5e-6)


@pytest.mark.parametrize("kstar", [0.0, 20.0])
def test_touches_are_those_of_the_axis(kstar, pushed, felt):
    case, found = felt if kstar else pushed
    axis = load("reference").prepare(cases.load("soft_contact", "axis", kstar=kstar), rtol=1e-8).run()
    for side in ("left", "right"):
        mine, alone = (
            metrics.of(scene)[f"touch_{side}"].measure(None, motion, scene)
            for motion, scene in ((found, case), (axis, cases.load("soft_contact", "axis", kstar=kstar)))
        )
        assert mine == pytest.approx(alone, abs=1e-3)
        assert mine == pytest.approx(alone, abs=1.5e-4)


def test_approach_soft_collision_hold_and_release(pushed, felt):
    for case, found in (pushed, felt):
        left, right, table = (case.contacts.index(name) for name in ("left", "right", "table"))
        assert found.outcome is Outcome.FINISHED
        assert np.abs(found.gap[:, :6]).max() < 1e-13
        np.testing.assert_allclose(found.lam[:, table], 0.981, atol=1e-9)
        closed = [(e.contact, e.after) for e in found.events if e.after == Mode.CONTACT]
        assert closed == [(table, Mode.CONTACT), (right, Mode.CONTACT), (left, Mode.CONTACT)]
        freed = {e.contact: e.t for e in found.events if e.after == Mode.FREE}
        assert freed == {left: pytest.approx(4.297, abs=1e-3), right: pytest.approx(4.297, abs=1e-3)}
        held = (found.t > 3.2) & (found.t < 4.0)
        assert found.lam[held][:, [left, right]].min() > 1.8


def test_the_robot_moves_and_not_the_block(pushed, felt):
    (_, still), (_, moved) = pushed, felt
    flanges = [delta.flanges(delta.LIGHT, found.q[:, :9]) for found in (still, moved)]
    end = [np.searchsorted(found.t, 4.1) for found in (still, moved)]
    assert abs(flanges[0][end[0], 0]) < 2e-4
    assert flanges[1][end[1], 0] == pytest.approx(6.4e-3, abs=2e-6)
    assert moved.q[-1, 12] == pytest.approx(6.401e-3, abs=1e-6)
    assert still.q[-1, 12] == pytest.approx(0.0, abs=1e-4)
    np.testing.assert_allclose(flanges[1][end[1], 1:], [0.0, 0.6], atol=1e-6)


def test_claims_come_out(pushed, felt):
    for case, found in (pushed, felt):
        allowed = {limit.metric: limit.value for limit in case.limits}
        assert {c.metric for c in case.claims} >= {"touch_left", "touch_right", "tactile_invariant"}
        for claim in case.claims:
            value = metrics.of(case)[claim.metric].measure(None, found, case)
            assert abs(value - claim.expected) <= allowed[claim.metric], (claim.metric, value)


@pytest.mark.parametrize("kstar", [0.0, 20.0])
@pytest.mark.parametrize("fingers", [[6, 7], [6], [7], []])
def test_the_robot_is_stable_in_grasp_and_in_single_contact(kstar, fingers):
    """The closures and the held rows leave a minimal model without the poles of their law."""
    case = cases.load("soft_contact", "delta", kstar=kstar)
    q = np.concatenate([pose.pose(P, np.array([0.0, 0.0, 0.6])), [-0.02, 0.02, 0.0, 0.0, 0.0, 0.6], np.zeros(3)])
    system = mechanism.build({**case.parameters, "squeeze": 0.0}, case.law)
    rows = [*range(6), *fingers, 8]
    model = linearise(system, q, active=rows, outputs=(), reduce=True, t=4.0)
    assert len(model.states) == 36 - 2 * len(rows)
    model = model.without_idle()
    poles = model.poles()
    zero = np.abs(poles) < 1e-6
    assert poles[~zero].real.max() < -1.0
    assert np.abs(poles + 20.0).min() > 0.1


@pytest.mark.slow
def test_cvode_gives_the_same_run(felt):
    case, found = felt
    other = load("reference").prepare(case, "cvode", rtol=1e-8).run()
    ours, theirs = ([e.t for e in r.events if e.after == Mode.CONTACT] for r in (found, other))
    assert theirs == pytest.approx(ours, abs=1e-6)
    np.testing.assert_allclose(other.q[-1, 9:15], found.q[-1, 9:15], atol=1e-7)
