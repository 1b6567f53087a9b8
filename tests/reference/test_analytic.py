"""Linear models refuse kernels through which a complex step loses the derivative."""

from __future__ import annotations

from importlib import import_module

import numpy as np
import pytest

from crossbody import cases
from crossbody.cases import SceneError
from crossbody.reference import System, kernels
from crossbody.reference.linear._analytic import check_analytic


@kernels.dynamics
def _rough(t, q, v, u, p, M, f, w):
    M[0, 0] = 1.0
    f[0] = -q[0] - 0.3 * np.abs(v[0]) * v[0]


@kernels.dynamics
def _branched(t, q, v, u, p, M, f, w):
    M[0, 0] = 1.0
    f[0] = -q[0] if q[0] > 0.0 else 0.0


def test_abs_is_refused_with_both_values():
    with pytest.raises(SceneError, match=r"Kernel dynamics gives f\[0\] with the derivative .* but .* by differences"):
        check_analytic(System(n=1, dynamics=_rough), 0.0, np.array([0.4]), np.array([1.5]), np.zeros(0))


def test_a_branch_is_refused_with_the_reason():
    with pytest.raises(SceneError, match="Kernel dynamics cannot be compiled for complex numbers"):
        check_analytic(System(n=1, dynamics=_branched), 0.0, np.array([0.4]), np.array([1.5]), np.zeros(0))


@pytest.mark.parametrize("name", ["bouncing_ball", "newtons_cradle", "red_body", "soft_contact", "delta_free"])
def test_shipped_kernels_are_analytic(name):
    case = cases.load(name)
    system = import_module(f"crossbody.reference.systems.{case.mechanism}").build(case.parameters, case.law)
    draw = np.random.default_rng(1)
    for _ in range(5):
        q = np.array(case.q0) + 1e-2 * draw.standard_normal(system.n)
        check_analytic(system, 0.0, q, draw.standard_normal(system.n), draw.standard_normal(system.inputs))
