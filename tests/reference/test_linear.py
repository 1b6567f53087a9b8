"""Linear models: exact derivatives of every mechanism and mode set, against two independent ways."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mechanisms import ball
from scipy.signal import freqresp

from crossbody import cases
from crossbody.cases import InvalidValue, SceneError, UnknownName
from crossbody.reference import System, delta
from crossbody.reference.linear import LinearModel, linearise
from crossbody.reference.systems import soft_contact
from crossbody.reference.systems.ball import KERNELS

STEP = 1e-30
RNG = np.random.default_rng(8)


def _delta(active):
    q = RNG.uniform(-0.2, 0.2, 9) + np.tile([0.8, 1.8, 0.1], 3)
    servo = delta.Servo(kp=3.0, kd=0.4, y_start=(0.5, 0.6, 0.7), y_end=(0.9, 0.7, 0.8))
    return delta.system(delta.LIGHT, p=20.0, servo=servo), q, RNG.normal(size=9), RNG.normal(size=6), active


def _soft(active):
    case = cases.load("soft_contact")
    system = soft_contact.build(case.parameters, case.law)
    return system, case.q0 + 0.01 * RNG.normal(size=8), 0.1 * RNG.normal(size=8), RNG.normal(size=1), active


SCENES = {
    "ball free": (ball(), np.array([0.3]), np.array([-1.0]), np.zeros(0), []),
    "ball on a cubic floor": (ball(), np.array([-0.02]), np.array([-1.0]), np.zeros(0), [0]),
    "delta closed, moving": _delta([0, 1, 2, 3, 4, 5]),
    "delta with one loop": _delta([3, 4, 5]),
    "fingers free": _soft([]),
    "left finger": _soft([0]),
    "grasp": _soft([0, 1]),
}


@pytest.fixture(params=SCENES, ids=list(SCENES))
def scene(request):
    return SCENES[request.param]


def solution(system, q, v, u, active):
    """(v', lam) by one dense solve, in the type of the state."""
    kind, n, k, na = np.result_type(q, v, u, float), system.n, system.mass_block, len(active)
    blocks, f, w = np.zeros((n, k), kind), np.zeros(n, kind), np.zeros(system.scratch, kind)
    H, h, drift = np.zeros((na, n), kind), np.zeros(na, kind), np.zeros(na, kind)
    q, v, u, p = (np.array(x, kind) for x in (q, v, u, system.p))
    system.dynamics(0.0, q, v, u, p, blocks, f, w)
    system.rows(0.0, q, v, p, w, np.array(active, dtype=np.int64), na, H, h, drift)
    M = np.zeros((n, n), kind)
    for b in range(0, n, k):
        M[b : b + k, b : b + k] = blocks[b : b + k]
    a0, a1, a2 = system.alpha[active].T
    K = np.block([[M, -H.T], [H, np.zeros((na, na))]])
    return np.linalg.solve(K, np.concatenate([f, -(drift + a1 * (H @ v) + a0 * h + a2 * h**3)]))


def jacobian(system, q, v, u, active, column):
    """Columns of the derivative of (v', lam) by (q, v, u)."""
    n, x = system.n, np.concatenate([q, v, u])
    return np.array(
        [column(lambda y: solution(system, *np.split(y, [n, 2 * n]), active), x, e) for e in np.eye(len(x))]
    ).T


def by_complex_step(function, x, e):
    return function(x + 1j * STEP * e).imag / STEP


def by_differences(function, x, e):
    d = 1e-5
    return (8 * (function(x + d * e) - function(x - d * e)) - function(x + 2 * d * e) + function(x - 2 * d * e)) / (
        12 * d
    )


@pytest.mark.parametrize(("column", "bound"), [(by_complex_step, 1e-9), (by_differences, 1e-7)])
def test_derivatives_of_accelerations_and_multipliers(scene, column, bound):
    """Against the complex step through the whole solution, and against differences of the right-hand side."""
    system, q, v, u, active = scene
    n = system.n
    model = linearise(system, q, v, u, active)
    expected = jacobian(system, q, v, u, active, column)
    scale = np.abs(expected).max(axis=1, keepdims=True)
    lam = [model.outputs.index(f"lam[{i}]") for i in active]
    found = np.vstack([np.hstack([model.A[n:], model.B[n:]]), np.hstack([model.C[lam], model.D[lam]])])
    assert np.all(np.abs(found - expected) <= bound * np.maximum(scale, 1e-30))
    np.testing.assert_array_equal(model.A[:n], np.hstack([np.zeros((n, n)), np.eye(n)]))
    np.testing.assert_array_equal(model.B[:n], 0.0)


def test_outputs_are_the_gaps_and_silent_where_a_row_is_off(scene):
    system, q, v, _u, active = scene
    model = linearise(system, q, v, active=active, outputs=("gap", "lam"))
    H = system.constraint(q, v)[0]
    np.testing.assert_allclose(model.C[: system.nc], np.hstack([H, 0.0 * H]), atol=1e-14)
    off = [system.nc + i for i in range(system.nc) if i not in active]
    assert not model.C[off].any()
    assert not model.D[off].any()


def test_a_ball_in_contact_has_the_poles_of_its_law():
    a0, a1 = 1e4, 20.0
    poles = linearise(ball(a0=a0, a1=a1, a2=0.0), [0.0], active=[0]).poles()
    np.testing.assert_allclose(poles, np.roots([1.0, a1, a0]), rtol=1e-12)
    assert not linearise(ball(), [1.0], active=[]).poles().any()


def test_held_rows_leave_a_minimal_model_without_their_own_poles():
    """Six closures take 12 of 18 states and exactly the double pole -p of each."""
    q = delta.holding_pose(delta.LIGHT, 0.8)
    system, (tau, _) = delta.system(delta.LIGHT, p=20.0), delta.gravity_torque(delta.LIGHT, q)
    u = np.concatenate([tau, np.zeros(3)])
    full, minimal = (linearise(system, q, u=u, reduce=reduce) for reduce in (False, True))
    assert len(minimal.states) == 6
    law, rest = np.split(full.poles()[np.argsort(np.abs(full.poles() + 20.0))], [12])
    np.testing.assert_allclose(law, -20.0, rtol=1e-5)
    key = np.lexsort((rest.imag, rest.real)), np.lexsort((minimal.poles().imag, minimal.poles().real))
    np.testing.assert_allclose(minimal.poles()[key[1]], rest[key[0]], rtol=1e-8)
    omega = [0.3, 5.0, 100.0]
    a, b = full.response(omega), minimal.response(omega)
    np.testing.assert_allclose(b, a, atol=1e-9 * np.abs(a).max())


def test_a_moving_mechanism_is_not_held_at_rest():
    system, q, v, u, active = SCENES["delta closed, moving"]
    with pytest.raises(SceneError, match=r"leaves the subspace .* at rest"):
        linearise(system, q, v, u, active, reduce=True)


def test_response_is_that_of_scipy():
    model = LinearModel(
        A=[[0.0, 1.0], [-9.0, -0.6]], B=[[0.0], [2.0]], C=[[1.0, 0.3]], D=[[0.1]], states=("x", "x'"), inputs=("u",),
        outputs=("y",),
    )  # fmt: skip
    omega = np.array([0.5, 3.0, 200.0])
    np.testing.assert_allclose(model.response(omega)[:, 0, 0], freqresp(model.state_space(), omega)[1], rtol=1e-12)


def test_idle_states_are_dropped_and_only_they():
    A = np.array([[0.0, 1.0, 0.0], [0.0, -2.0, 0.0], [1.0, 0.0, 0.0]])
    model = LinearModel(
        A=A, B=np.ones((3, 1)), C=[[0.0, 1.0, 0.0]], D=[[0.0]], states=tuple("abc"), inputs=("u",), outputs=("y",)
    )
    assert model.without_idle().states == ("b",)
    assert replace(model, C=np.array([[1.0, 0.0, 0.0]])).without_idle().states == ("a", "b")


def test_wrong_use_is_told():
    system, q, v, u, _ = SCENES["grasp"]
    model = linearise(system, q, v, u, [0, 1])
    for wrong in ([0, 0], [2], [-1]):
        with pytest.raises(SceneError, match="different ones below 2"):
            linearise(system, q, active=wrong)
    with pytest.raises(SceneError, match="coordinates"):
        linearise(system, q, names=("x",))
    with pytest.raises(UnknownName, match="gap"):
        linearise(system, q, outputs=("gaps",))
    with pytest.raises(UnknownName, match="lam"):
        model.pick(["lam"])
    with pytest.raises(InvalidValue, match="finite"):
        model.response([1.0, np.nan])
    with pytest.raises(InvalidValue, match="pole"):
        linearise(ball(), [1.0], active=[]).pick(["q[0]"]).response([0.0])
    with pytest.raises(SceneError, match="no finite value"):
        linearise(ball(), [1e308], active=[0])
    with pytest.raises(SceneError, match="no inertia"):
        linearise(delta.system(delta.LIGHT), np.tile([0.8, 0.0, 0.1], 3), active=[])


def test_redundant_rows_are_told():
    twice = System(n=1, parameters=[1.0, 9.81], a0=[100.0, 100.0], a1=[20.0, 20.0], **KERNELS)
    assert linearise(twice, [0.0], active=[1]).poles() == pytest.approx([-10.0, -10.0])
    with pytest.raises(SceneError, match="redundant"):
        linearise(twice, [0.0], active=[0, 1])
