"""How precisely kernels are held against each other: errors a hundred times the precision are named, small ones not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from crossbody.cases import SceneError
from crossbody.reference import System, kernels
from crossbody.reference._check import check_kernels

NAMES = (
    "none", "M is symmetric", "M of v", "M is constant", "f is constant", "h of rows", "rate", "gap of v", "gap of t",
    "H of v", "H", "Hdv", "rows asked for", "H is constant", "lam", "vd", "hd", "q' of v",
)  # fmt: skip
(
    NONE, SYMMETRIC, M_OF_V, M_CONSTANT, F_CONSTANT, H_OF_ROWS, RATE, GAP_OF_V, GAP_OF_T, SLOPE_OF_V, SLOPE, BEND,
    ASKED, SLOPE_CONSTANT, LAM, VD, HD, TURN,
) = range(len(NAMES))  # fmt: skip
START = np.array([0.2, 0.3])
DET = 2.75
"""2 x 1.5 - .5^2, of M."""

# p: which is wrong, by how much, and how much the first wall bends.


@kernels.dynamics
def _dynamics(t, q, v, u, p, M, f, w):
    M[0, 0], M[1, 1], M[0, 1], M[1, 0], f[0], f[1] = 2.0, 1.5, 0.5, 0.5, 1.0, -2.0
    if p[0] == SYMMETRIC:
        M[0, 1] *= 1.0 + p[1]
    if p[0] == M_OF_V:
        M[1, 1] *= 1.0 + p[1] * np.sin(v[0])
    if p[0] == M_CONSTANT:
        M[0, 0] *= 1.0 + p[1] * np.sin(q[0])
    if p[0] == F_CONSTANT:
        f[0] *= 1.0 + p[1] * np.sin(q[0])


@kernels.helper
def _gap(t, q, v, p):
    h = 0.3 - q[0] + 0.2 * q[1] + p[2] * q[1] * q[1]
    if p[0] == GAP_OF_V:
        h += p[1] * v[1]
    if p[0] == GAP_OF_T:
        h += p[1] * t
    if p[0] == SLOPE_CONSTANT:
        h += 0.5 * p[1] * q[0] * q[0]
    return h


@kernels.helper
def _slope(q, v, p):
    one, two = -1.0, 0.2 + 2.0 * p[2] * q[1]
    if p[0] == SLOPE_OF_V:
        one += p[1] * v[0]
    if p[0] == SLOPE:
        two *= 1.0 + p[1]
    if p[0] == SLOPE_CONSTANT:
        one += p[1] * q[0]
    return one, two


@kernels.gaps
def _gaps(t, q, v, p, h, hd):
    one, two = _slope(q, v, p)
    h[0], hd[0] = _gap(t, q, v, p), one * v[0] + two * v[1]
    h[1], hd[1] = 0.5 + q[0] - q[1], v[0] - v[1]
    if p[0] == RATE:
        hd[0] += p[1] * v[0]


@kernels.rows
def _rows(t, q, v, p, w, idx, na, H, h, Hdv):
    for j in range(na):
        if idx[j] == 1:
            H[j, 0], H[j, 1], h[j], Hdv[j] = 1.0, -1.0, 0.5 + q[0] - q[1], 0.0
            continue
        one, two = _slope(q, v, p)
        H[j, 0], H[j, 1], h[j], Hdv[j] = one, two, _gap(t, q, v, p), 2.0 * p[2] * v[1] * v[1]
        if p[0] == SLOPE_CONSTANT:
            Hdv[j] += p[1] * v[0] * v[0]
        if p[0] == H_OF_ROWS:
            h[j] += p[1]
        if p[0] == BEND:
            Hdv[j] *= 1.0 + p[1]
        if p[0] == ASKED and na < 2:
            H[j, 0] *= 1.0 + p[1]


@kernels.solve
def _solve(t, q, v, u, p, w, law, idx, na, vd, lam, hd):
    h, hd[0] = 0.5 + q[0] - q[1], v[0] - v[1]
    free, way = ((1.5 + 1.0) / DET, (-0.5 - 4.0) / DET), (2.0 / DET, -2.5 / DET)
    wanted = -(law[1, 1] * hd[0] + law[1, 0] * h + law[1, 2] * h * h * h)
    lam[0] = (wanted - (free[0] - free[1])) / (way[0] - way[1])
    if p[0] == VD:
        lam[0] *= 1.0 + p[1]
    for i in range(2):
        vd[i] = free[i] + way[i] * lam[0]
    if p[0] == LAM:
        lam[0] *= 1.0 + p[1]
    if p[0] == HD:
        hd[0] *= 1.0 + p[1]
    return 0


@kernels.velocity
def _velocity(t, q, v, p, qd):
    qd[0], qd[1] = v[0], v[1]
    if p[0] == TURN:
        qd[0] += p[1] * v[0] * v[0]


def _checked(which: int, size: float) -> None:
    more: dict[str, Any] = {}
    if which in (M_CONSTANT, F_CONSTANT, SLOPE_CONSTANT):
        more["affine"] = True
    if which in (LAM, VD, HD):
        more["solve"] = _solve
    if which == TURN:
        more["velocity"] = _velocity
    system = System(
        n=2, parameters=[float(which), size, 0.0 if "affine" in more else 0.7], a0=[1e2, 1e2], a1=2.0,
        unilateral=[True, False], dynamics=_dynamics, gaps=_gaps, rows=_rows, **more,
    )  # fmt: skip
    for seed in range(5):
        check_kernels(system, START, np.zeros(2), seed=seed)


BY_DIFFERENCES = (SLOPE, BEND, LAM, VD)
"""Known to 1e-6; from one near state to another constants change by 1e-2; all else is an identity to 1e-9."""
NEARBY = (M_CONSTANT, F_CONSTANT, SLOPE_CONSTANT)


@pytest.mark.parametrize("which", range(1, len(NAMES)), ids=lambda which: NAMES[which])
def test_errors_beyond_the_precision_are_named_and_those_below_it_are_not(which: int) -> None:
    precision = 1e-6 if which in BY_DIFFERENCES else 1e-7 if which in NEARBY else 1e-9
    _checked(which, 1e-2 * precision)
    with pytest.raises(SceneError, match="Kernel"):
        _checked(which, 1e2 * precision)
