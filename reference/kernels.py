"""The functions that make up a mechanism, each with one fixed signature.

nq positions, n velocities (nq = n and q' = v unless there is `velocity`), nc constraint rows, nu
inputs, k the size of the blocks on the mass matrix's diagonal (n dense, 1 diagonal), na active rows.
Every array is filled by the kernel (H is zero where it writes nothing), none is allocated. A run
checks this, and that rows, gaps and mass matrix belong together, before it starts (`System.check`).

    dynamics(t, q, v, u, p, M, f, w)     M (n, k) mass blocks: row i holds row i of its own block
                                         f (n,) = B u + tau_ext - c - d - g;  w scratch that `rows` may read
    gaps(t, q, v, p, h, hd)              h, hd (nc,): gap and rate of EVERY row
    rows(t, q, v, p, w, idx, na, H, h, Hdv)
                                         for j < na and i = idx[j]: H[j] (n,) with h_i' = H_i v,
                                         which is dh_i/dq where q' = v; h[j], Hdv[j] = H_i' v
    energy(q, v, p, e)                   e (2,) = kinetic, potential
    power(t, q, v, u, p, e)              e (2,) = power of the inputs, power dissipated (optional)
    solve(t, q, v, u, p, w, law, idx, na, vd, lam, hd)
                                         optional, instead of the general algebra: acceleration vd
                                             (n,), multipliers
                                         lam[j] and rates hd[j]; law (nc, 3) = a0, a1, a2; returns
                                         0, or 1 if ill posed; w is its own scratch: dynamics is
                                         not called before it
    control(t, q, v, u, s, p)            optional, called at sampling instants: fills u (nu,), may keep its state in s
    velocity(t, q, v, p, qd)             optional: qd (nq,) = q' = N(q) v + r(q), where velocities are no derivatives of
                                         positions. No gap may change along r: it is 0, or keeps a
                                             quaternion's length
    watch(t, q, v, p, g)                 optional: g (ng,), each positive until it fires by falling to zero
    switch(t, q, v, p, mode, fired)      optional: writes the discrete variables at the end of p, and may move the mode
                                         of a row to another; fired is the index in g, START at t =
                                         0, or TOUCHED after the rows have settled, until it returns
                                         UNCHANGED; else CHANGED, or LOST, which ends the run; in a
                                         system with `kinks` GIVEN at every change of inputs

Each is compiled for float64, and for complex128 when a derivative is first asked for, which is a
complex step: use np functions only, and neither abs, hypot, atan2 nor a branch on a complex
value. `control` and `solve` are float64 alone. With CROSSBODY_DEBUG=1 in the environment every
index is checked. With NUMBA_DISABLE_JIT=1 kernels stay Python, which `System.check` runs as they
are, and a debugger steps through; runs need compiled ones.

Gaps must not depend on time (scleronomic): h' = H v. Discrete variables stand at the end of p, as
numbers: what a kernel branches on is constant between events. A row that cannot be touched in the
present discrete state reports a positive gap and no rate. `watch` should leave a dead band (1e-12 of its
range) around what it switches, so that a variable that just changed does not change back by rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import types
from numba.core import types as core_types

from crossbody.reference.cache import compiled

START, TOUCHED, GIVEN = np.array([-1, -2, -3])
UNCHANGED, CHANGED, LOST = np.arange(3)

_T = types.float64
_IDX = types.int64[::1]


def _vectors(scalar: Any) -> tuple[Any, Any]:
    return scalar[::1], scalar[:, ::1]


def _signatures(scalar: Any) -> dict[str, Any]:
    a, m = _vectors(scalar)
    return {
        "dynamics": types.void(_T, a, a, a, a, m, a, a),
        "gaps": types.void(_T, a, a, a, a, a),
        "rows": types.void(_T, a, a, a, a, _IDX, types.int64, m, a, a),
        "energy": types.void(a, a, a, a),
        "power": types.void(_T, a, a, a, a, a),
        "velocity": types.void(_T, a, a, a, a),
    }


_f, _fm = _vectors(types.float64)
REAL = {
    **_signatures(types.float64),
    "solve": types.int64(_T, _f, _f, _f, _f, _f, _fm, _IDX, types.int64, _f, _f, _f),
    "control": types.void(_T, _f, _f, _f, _f, _f),
    "watch": types.void(_T, _f, _f, _f, _f),
    "switch": types.int64(_T, _f, _f, _f, types.int8[::1], types.int64),
}
COMPLEX = _signatures(types.complex128)
NAMES = tuple(REAL)


def function_type(name: str) -> core_types.FunctionType:
    """The numba type of a kernel as an argument of compiled code."""
    return core_types.FunctionType(REAL[name])


def _declare(name: str) -> Callable[[Callable[..., Any]], Any]:
    lazy = [COMPLEX[name]] if name in COMPLEX else []

    def decorate(function: Callable[..., Any]) -> Any:
        return compiled(function, [REAL[name]], lazy=lazy)

    return decorate


dynamics = _declare("dynamics")
gaps = _declare("gaps")
rows = _declare("rows")
energy = _declare("energy")
power = _declare("power")
velocity = _declare("velocity")
solve = _declare("solve")
control = _declare("control")
watch = _declare("watch")
switch = _declare("switch")


def helper(function: Callable[..., Any]) -> Any:
    """Compile a function that kernels of one folder share; it is typed where it is used."""
    return compiled(function)
