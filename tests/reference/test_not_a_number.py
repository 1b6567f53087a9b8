"""A kernel that turns to NaN on the way: no solver calls the run finished."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from crossbody.cases import Outcome
from crossbody.reference import System, kernels, simulate
from crossbody.reference.systems import ball

SOLVERS = ("compiled", "cvode", "ida")
LOW = 0.7  # m: below it the kernel returns NaN; the ball falls from 1 m to the floor at 0


@kernels.dynamics
def _force(t: float, q: Any, v: Any, u: Any, p: Any, M: Any, f: Any, w: Any) -> None:
    M[0, 0], f[0] = p[0], -p[0] * p[1]
    if q[0].real < LOW:
        f[0] = np.nan


@kernels.dynamics
def _mass(t: float, q: Any, v: Any, u: Any, p: Any, M: Any, f: Any, w: Any) -> None:
    M[0, 0], f[0] = p[0], -p[0] * p[1]
    if q[0].real < LOW:
        M[0, 0] = np.nan


@kernels.gaps
def _gap(t: float, q: Any, v: Any, p: Any, h: Any, hd: Any) -> None:
    h[0], hd[0] = q[0], v[0]
    if q[0].real < LOW:
        h[0] = np.nan


@kernels.gaps
def _rate(t: float, q: Any, v: Any, p: Any, h: Any, hd: Any) -> None:
    h[0], hd[0] = q[0], v[0]
    if q[0].real < LOW:
        hd[0] = np.nan


@kernels.rows
def _row(t: float, q: Any, v: Any, p: Any, w: Any, idx: Any, na: int, H: Any, h: Any, Hdv: Any) -> None:
    for j in range(na):
        H[j, 0], h[j], Hdv[j] = 1.0, q[0], 0.0
        if q[0].real < LOW:
            Hdv[j] = np.nan


@kernels.energy
def _energy(q: Any, v: Any, p: Any, e: Any) -> None:
    e[0], e[1] = 0.5 * p[0] * v[0] * v[0], p[0] * p[1] * q[0]
    if q[0].real < LOW:
        e[1] = np.nan


@kernels.power
def _power(t: float, q: Any, v: Any, u: Any, p: Any, e: Any) -> None:
    e[0], e[1] = 0.0, 0.0
    if q[0].real < LOW:
        e[1] = np.nan


@kernels.watch
def _watch(t: float, q: Any, v: Any, p: Any, g: Any) -> None:
    g[0] = q[0] + 1e3
    if q[0] < LOW:
        g[0] = np.nan


@kernels.switch
def _switch(t: float, q: Any, v: Any, p: Any, mode: Any, fired: int) -> int:
    return 0


BROKEN: dict[str, dict[str, Any]] = {
    "force": {"dynamics": _force},
    "mass": {"dynamics": _mass},
    "gap": {"gaps": _gap},
    "rate of the gap": {"gaps": _rate},
    "row": {"rows": _row},
    "energy": {"energy": _energy},
    "power": {"power": _power},
    "watch": {"watch": _watch, "switch": _switch, "guards": 1},
}
NAMED = {
    "force": "Kernel dynamics gives f[0] = nan", "mass": "Kernel dynamics gives M[0, 0] = nan",
    "gap": "Kernel gaps gives h[0] = nan", "rate of the gap": "Kernel gaps gives hd[0] = nan",
    "row": "Kernel rows gives Hdv[0] = nan", "energy": "Kernel energy gives e[1] = nan",
    "power": "Kernel power gives e[1] = nan", "watch": "Kernel watch gives g[0] = nan",
}  # fmt: skip


@pytest.mark.parametrize("samples", [None, np.linspace(0.0, 1.0, 11)], ids=["own steps", "samples"])
@pytest.mark.parametrize("shortcuts", [True, False])
@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("name", BROKEN)
def test_a_nan_is_not_finished(name: str, solver: str, shortcuts: bool, samples: Any) -> None:
    fields = ball.KERNELS | BROKEN[name]
    system = System(
        n=1, parameters=[1.0, 9.81], a0=[1e4], a1=20.0, affine=shortcuts and name not in ("force", "mass"), **fields
    )
    run = simulate(system, [1.0], [0.0], 1.0, solver=solver, shortcuts=shortcuts, samples=samples, ledger=True)
    ends = {Outcome.NOT_FINITE, Outcome.ILL_POSED} if name == "mass" else {Outcome.NOT_FINITE}
    assert run.outcome in ends, run.message
    assert run.outcome is Outcome.ILL_POSED or NAMED[name] in run.message
    assert np.isfinite(run.q).all()
    assert run.q.min() > -1e-3


@kernels.control
def _control(t: float, q: Any, v: Any, u: Any, s: Any, p: Any) -> None:
    u[0] = 0.0 if t < 0.1 else np.inf


@kernels.dynamics
def _driven(t: float, q: Any, v: Any, u: Any, p: Any, M: Any, f: Any, w: Any) -> None:
    M[0, 0], f[0] = p[0], u[0] - p[0] * p[1]


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_controller_that_is_not_finite_is_named(solver: str) -> None:
    fields = ball.KERNELS | {"dynamics": _driven, "control": _control}
    system = System(n=1, parameters=[1.0, 9.81], a0=[1e4], a1=20.0, inputs=1, tick=0.01, **fields)
    run = simulate(system, [1.0], [0.0], 1.0, solver=solver)
    assert run.outcome is Outcome.NOT_FINITE
    assert "Kernel control gave u[0] = inf" in run.message


@pytest.mark.parametrize("solver", SOLVERS)
def test_an_energy_that_nobody_gives_is_no_fault(solver: str) -> None:
    fields = {name: kernel for name, kernel in ball.KERNELS.items() if name != "energy"}
    system = System(n=1, parameters=[1.0, 9.81], a0=[1e4], a1=20.0, **fields)
    assert simulate(system, [1.0], [0.0], 0.6, solver=solver).outcome is Outcome.FINISHED


@kernels.dynamics
def _upper(t: float, q: Any, v: Any, u: Any, p: Any, M: Any, f: Any, w: Any) -> None:
    M[0, 0], M[1, 1], M[1, 0], M[0, 1] = 2.0, 2.0, 0.5, 0.5
    f[0] = f[1] = -1.0
    if q[0].real < LOW:
        M[0, 1] = np.nan


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_nan_in_the_half_of_the_mass_matrix_that_is_not_read(solver: str) -> None:
    run = simulate(System(n=2, parameters=[1.0], dynamics=_upper), [1.0, 1.0], [0.0, 0.0], 2.0, solver=solver)
    assert run.outcome in (Outcome.NOT_FINITE, Outcome.ILL_POSED)
