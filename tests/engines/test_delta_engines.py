"""The same delta robot in the reference, in MuJoCo and in Pinocchio: M, bias, H and lam at random states."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from crossbody import engines
from crossbody.cases import Inputs, Law, load
from crossbody.cases.mechanisms.delta import pose
from crossbody.cases.mechanisms.delta.scene import NAMES, ROBOT
from crossbody.reference import delta
from crossbody.reference.delta.kernels import robot as kernels

pytest.importorskip("mujoco")
pytest.importorskip("pinocchio")

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


def reference_motion(robot, q, v, u):
    vd, lam, hd = np.zeros(9), np.zeros(6), np.zeros(6)
    code = kernels.solve(0.0, q, v, u, robot.array(), np.zeros(18), TABLE, np.arange(6), 6, vd, lam, hd)
    return code, vd, lam


MAKERS = {"mujoco": "matched", "pinocchio": "law"}


@pytest.fixture(params=MAKERS)
def maker(request):
    return request.param


def case_of(robot, q=None, v=None, u=None):
    """A robot that is let go with constant inputs."""
    numbers = {name: getattr(robot, "g" if name == "gravity" else name) for name in ROBOT if name != "p"}
    case = load("delta_free", t_end=1e-6, **numbers)
    inputs = None if u is None else Inputs(names=NAMES, times=np.zeros(1), values=u[None])
    return case if q is None else replace(case, q0=q, v0=v, inputs=inputs)


def off(a, b):
    return np.abs(a - b).max() / np.abs(b).max()


def test_chart_there_and_back():
    q, v, _ = states()
    r, rd = pose.to_tree(q, v)
    q2, v2 = pose.from_tree(r, rd)
    np.testing.assert_allclose(q2, q, atol=1e-12)
    np.testing.assert_allclose(v2, v, rtol=1e-10, atol=1e-10)


def test_rates_of_the_chart_are_derivatives():
    """r' by differences of r along q + t v, and v' by differences of v along the tree's steady motion."""
    q, v, _ = (x[:200] for x in states())
    h = 1e-6
    r, rd = pose.to_tree(q, v)
    slope = (pose.to_tree(q + h * v, v)[0] - pose.to_tree(q - h * v, v)[0]) / (2 * h)
    np.testing.assert_allclose(rd, slope, rtol=1e-5, atol=1e-5 * np.abs(rd).max())
    ahead, behind = (pose.from_tree(r + s * h * rd, rd)[1] for s in (1, -1))
    exact = pose.bend(r, rd)
    np.testing.assert_allclose(exact, (ahead - behind) / (2 * h), rtol=1e-5, atol=1e-5 * np.abs(exact).max())


def test_parity_of_mass_bias_and_constraint_jacobian(robot, maker):
    """At 300 random states, 1e-10 relative in the coordinates of the reference."""
    found = engines.load(maker).prepare(case_of(replace(robot, d1=0.0, d2=0.0, d3=0.0)), MAKERS[maker]).audit()
    worst = np.zeros(3)
    for q, v, _ in zip(*(x[:300] for x in states()), strict=True):
        terms = found["M"](q), found["bias"](q, v), found["H"](q)
        worst = np.maximum(worst, [off(a, b) for a, b in zip(terms, reference_terms(robot, q, v), strict=True)])
    assert worst.max() < 1e-10


CONDITION = 1e3
"""Of H M^-1 H', beyond which multipliers are ill posed."""


@pytest.mark.parametrize("closed", [True, False])
def test_multipliers_agree(robot, maker, closed):
    """On and off the manifold, where lam is not ill posed: Pinocchio to 1e-10, MuJoCo to softness times condition."""
    audit, worst, counted = engines.load(maker).prepare(case_of(robot), MAKERS[maker]).audit(), 0.0, 0
    for q, v, _ in closed_states(robot.sign) if closed else zip(*(x[:200] for x in states()), strict=True):
        M, _, H = reference_terms(robot, q, v)
        code, _, lam = reference_motion(robot, q, v, np.zeros(6))
        if np.linalg.cond(H @ np.linalg.solve(M, H.T)) > CONDITION:
            continue
        worst = max(worst, off(audit["lam"](q, v), lam))
        assert code == 0
        counted += 1
    assert counted > 100
    assert worst < (3e-10 * CONDITION if maker == "mujoco" else 1e-10)


def test_motors_and_a_force_on_the_flange_act_alike(robot, maker):
    """The multipliers at the start of a run are those of the reference under the same inputs."""
    for q, v, u in closed_states(robot.sign)[:20]:
        run = engines.load(maker).prepare(case_of(robot, q, v, u), MAKERS[maker]).run()
        assert off(run.lam[0], reference_motion(robot, q, v, u)[2]) < 1e-7


def test_mujoco_as_it_comes_has_a_softer_law(robot):
    """Default equalities: regularised, and with constants of MuJoCo's own; off by percents, not by rounding."""
    lam, worst = engines.load("mujoco").prepare(case_of(robot), "default").audit()["lam"], []
    for q, v, _ in closed_states(robot.sign):
        worst.append(off(lam(q, v), reference_motion(robot, q, v, np.zeros(6))[2]))
    assert 1e-3 < np.median(worst) < 0.3
