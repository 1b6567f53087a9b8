"""The same delta robot in the reference, in MuJoCo and in Pinocchio: M, bias, H and lam at random states."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from crossbody.cases import Law
from crossbody.engines._delta import chart
from crossbody.reference import delta
from crossbody.reference.delta.kernels import robot as kernels

mujoco = pytest.importorskip("mujoco")
pytest.importorskip("pinocchio")

from crossbody.engines.mujoco._delta_model import compiled  # noqa: E402
from crossbody.engines.pinocchio._delta_model import by_hand, imported  # noqa: E402

ROBOTS = {
    "light": delta.LIGHT,
    "heavy, mirrored": replace(delta.HEAVY, sign=-1.0),
    "light with rotors": replace(delta.LIGHT, jm=0.02),
}
P = 5.0
LAW = Law(a0=np.full(6, P**2), a1=np.full(6, 2 * P), a2=np.zeros(6), unilateral=np.zeros(6, bool))
TABLE = np.column_stack([LAW.a0, LAW.a1, LAW.a2])


@pytest.fixture(params=ROBOTS)
def robot(request):
    return ROBOTS[request.param]


@cache
def states(n=1000):
    """Poses away from the ends of both charts (sin q_i2 > .1, cos gamma > .1), rates and inputs; most are off h = 0."""
    rng = np.random.default_rng(314)
    q = np.empty((0, 9))
    while len(q) < n:
        draw = rng.uniform([-1.0, 0.0, -np.pi] * 3, [3.0, np.pi, np.pi] * 3, (4 * n, 9))
        s2, s3 = np.sin(draw[:, 1::3]), np.sin(draw[:, 2::3])
        q = np.concatenate([q, draw[np.all((s2 > 0.1) & (1 - (s2 * s3) ** 2 > 0.01), axis=1)]])
    return q[:n], 3 * rng.normal(size=(n, 9)), rng.normal(size=(n, 6))


@cache
def closed_states(sign, n=200):
    """Poses and rates that keep the loops closed."""
    rng, robot = np.random.default_rng(159), replace(delta.LIGHT, sign=sign)
    found = []
    for z in rng.uniform([-0.15, -0.15, 0.5], [0.15, 0.15, 0.65], (n, 3)):
        q = delta.inverse(robot, z)
        _, _, X = delta.jacobians(robot, q)
        v, yd = np.empty(9), 3 * rng.normal(size=3)
        v[[0, 3, 6]], v[[1, 2, 4, 5, 7, 8]] = yd, X @ yd
        found.append((q, v, rng.normal(size=6)))
    return found


def reference_terms(robot, q, v):
    """M, c + g without friction, and H of the reference."""
    M, f, w = np.zeros((9, 3)), np.zeros(9), np.zeros(kernels.SCRATCH)
    H, h, Hdv = np.zeros((6, 9)), np.zeros(6), np.zeros(6)
    p = replace(robot, d1=0.0, d2=0.0, d3=0.0).array()
    kernels.dynamics(0.0, q, v, np.zeros(6), p, M, f, w)
    kernels.rows(0.0, q, v, p, w, np.arange(6), 6, H, h, Hdv)
    dense = np.zeros((9, 9))
    for k in (0, 3, 6):
        dense[k : k + 3, k : k + 3] = M[k : k + 3]
    return dense, -f, H


def forces(robot, q, v, u):
    """Motors, flange force and friction on the absolute angles (9,)."""
    tau = -np.tile([robot.d1, robot.d2, robot.d3], 3) * v
    tau[[0, 3, 6]] += u[:3]
    return tau + delta.virtual_jacobian(robot, q).T @ u[3:]


def reference_motion(robot, q, v, u):
    vd, lam, hd = np.zeros(9), np.zeros(6), np.zeros(6)
    code = kernels.solve(0.0, q, v, u, robot.array(), np.zeros(18), TABLE, np.arange(6), 6, vd, lam, hd)
    return code, vd, lam


class InMujoco:
    """MuJoCo's terms and motion in the coordinates of its tree."""

    def __init__(self, robot, law):
        self.model = compiled(robot, law)
        self.data = mujoco.MjData(self.model)

    def _look(self, r, rd, tau):
        self.data.qpos[:], self.data.qvel[:], self.data.qfrc_applied[:] = r, rd, tau
        mujoco.mj_forward(self.model, self.data)

    def terms(self, r, rd):
        self._look(r, rd, 0.0)
        M = np.zeros((9, 9))
        mujoco.mj_fullM(self.model, self.data, M)
        return M, self.data.qfrc_bias.copy(), self.data.efc_J.reshape(6, 9).copy()

    def accelerate(self, r, rd, tau):
        self._look(r, rd, tau)
        return self.data.qacc.copy(), self.data.efc_force.copy()


MAKERS = {"mujoco": InMujoco, "pinocchio, imported": imported, "pinocchio, by hand": by_hand}


@pytest.fixture(params=MAKERS)
def maker(request):
    return MAKERS[request.param]


def off(a, b):
    return np.abs(a - b).max() / np.abs(b).max()


def test_chart_there_and_back():
    q, v, _ = states()
    r, rd = chart.to_tree(q, v)
    q2, v2 = chart.from_tree(r, rd)
    np.testing.assert_allclose(q2, q, atol=1e-12)
    np.testing.assert_allclose(v2, v, rtol=1e-10, atol=1e-10)


def test_rates_of_the_chart_are_derivatives():
    """r' by differences of r along q + t v, and v' by differences of v along the tree's motion."""
    q, v, _ = (x[:200] for x in states())
    h = 1e-6
    r, rd = chart.to_tree(q, v)
    slope = (chart.to_tree(q + h * v, v)[0] - chart.to_tree(q - h * v, v)[0]) / (2 * h)
    np.testing.assert_allclose(rd, slope, rtol=1e-5, atol=1e-5 * np.abs(rd).max())
    rdd = np.random.default_rng(0).normal(size=r.shape)
    ahead, behind = (chart.from_tree(r + s * h * rd, rd + s * h * rdd)[1] for s in (1, -1))
    exact = chart.accelerations(r, rd, rdd)
    np.testing.assert_allclose(exact, (ahead - behind) / (2 * h), rtol=1e-5, atol=1e-5 * np.abs(exact).max())


def test_parity_of_mass_bias_and_constraint_jacobian(robot, maker):
    """At 1,000 random states, 1e-10 relative in the coordinates of the reference."""
    engine = maker(robot, LAW)
    worst = np.zeros(3)
    for q, v, _ in zip(*states(), strict=True):
        r, rd = chart.to_tree(q, v)
        found = chart.absolute(r, rd, *engine.terms(r, rd))
        worst = np.maximum(worst, [off(a, b) for a, b in zip(found, reference_terms(robot, q, v), strict=True)])
    assert worst.max() < 1e-10


@pytest.mark.parametrize("closed", [True, False])
def test_multipliers_and_accelerations_agree(robot, maker, closed):
    """On and off the manifold: Pinocchio to 1e-10, MuJoCo matched to 1e-8; states whose lam is ill posed left out."""
    engine, worst, counted = maker(robot, LAW), 0.0, 0
    limit = 1e-8 if maker is InMujoco else 1e-10
    for q, v, u in closed_states(robot.sign) if closed else zip(*(x[:200] for x in states()), strict=True):
        M, _, H = reference_terms(robot, q, v)
        code, vd, lam = reference_motion(robot, q, v, u)
        if np.linalg.cond(H @ np.linalg.solve(M, H.T)) > 1e3:
            continue
        r, rd = chart.to_tree(q, v)
        rdd, found = engine.accelerate(r, rd, chart.rate_matrix(r).T @ forces(robot, q, v, u))
        worst = max(worst, off(found, lam), off(chart.accelerations(r, rd, rdd), vd))
        assert code == 0
        counted += 1
    assert counted > 100
    assert worst < limit


def test_mujoco_as_it_comes_has_a_softer_law(robot):
    """Default equalities: regularised, and with constants of MuJoCo's own; off by percents, not by rounding."""
    engine, worst = InMujoco(robot, None), []
    for q, v, u in closed_states(robot.sign):
        r, rd = chart.to_tree(q, v)
        _, found = engine.accelerate(r, rd, chart.rate_matrix(r).T @ forces(robot, q, v, u))
        worst.append(off(found, reference_motion(robot, q, v, u)[2]))
    assert 1e-3 < np.median(worst) < 0.3
