"""Whether kernels may be differentiated by complex steps: `abs` or a maximum loses the derivative in silence."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba.core.errors import NumbaError

from crossbody.cases import SceneError
from crossbody.reference import kernels
from crossbody.reference._guarded import entry
from crossbody.reference._system import System
from crossbody.reference.kinds import Array, Floats

STEP = 1e-30
WIDTHS = (1e-4, 1e-5, 1e-6)  # of real differences, in units of the coordinates
AGREE = 1e-3  # part of a derivative by which the two may differ: what is lost is of its own size
ADVICE = "Derivatives need analytic kernels: np functions of complex numbers without abs, maximum, minimum or branches."


def check_analytic(system: System, t: float, q: Floats, v: Floats, u: Floats) -> None:
    """Compare complex steps through `dynamics` and `rows` with real differences along one direction.

    Raises:
        SceneError: naming the kernel, and the entry with both values or numba's reason.
    """
    for name in ("dynamics", "rows"):
        try:
            system.kernels[name].compile(kernels.COMPLEX[name])
        except NumbaError as error:
            reason = next((line.strip() for line in str(error).splitlines()[1:] if line.strip()), "")
            raise SceneError(f"Kernel {name} cannot be compiled for complex numbers: {reason}. {ADVICE}") from None
    draw = np.random.default_rng(0)
    x, sizes = np.concatenate([q, v, u]), (system.nq, system.nq + system.n)
    d = (1.0 + np.abs(x)) * draw.standard_normal(len(x))

    def at(x: Any) -> dict[str, Any]:
        return _terms(system, t, *np.split(x, sizes))

    here, stepped = at(x), at(x + 1j * STEP * d)
    rounded = float(np.abs(here["H"]).max(initial=0.0) * (1.0 + np.abs(v).max(initial=0.0)) ** 2)
    for name in here:
        exact, floor = stepped[name].imag / STEP, rounded if name == "Hdv" else 0.0  # products of v that may cancel
        with np.errstate(all="ignore"):  # a state so far out that sums overflow tells nothing
            wrong = _differs(lambda x, name=name: at(x)[name], x, d, exact, here[name], floor)  # type: ignore[misc]
        if np.any(wrong):
            first = tuple(np.argwhere(wrong)[0])
            slope = (at(x + WIDTHS[-1] * d)[name] - at(x - WIDTHS[-1] * d)[name]) / (2.0 * WIDTHS[-1])
            kernel = "dynamics" if name in ("M", "f") else "rows"
            raise SceneError(
                f"Kernel {kernel} gives {entry(name, wrong)} with the derivative "
                f"{exact[first]:.9g} by a complex step, but {slope[first]:.9g} by differences, "
                f"along one direction at q = {q.tolist()}. {ADVICE}"
            )


def _terms(system: System, t: float, q: Array, v: Array, u: Array) -> dict[str, Any]:
    """M, f, H, h and H'v of all rows, real or complex as the state is."""
    n, nc, kind = system.n, system.nc, q.dtype
    q, v, u, p = (np.array(part, dtype=kind) for part in (q, v, u, system.p))
    M, f, w = np.zeros((n, system.mass_block), kind), np.zeros(n, kind), np.zeros(system.scratch, kind)
    H, h, Hdv = np.zeros((nc, n), kind), np.zeros(nc, kind), np.zeros(nc, kind)
    system.dynamics(t, q, v, u, p, M, f, w)
    system.rows(t, q, v, p, w, np.arange(nc), nc, H, h, Hdv)
    return {"M": M, "f": f, "H": H, "h": h, "Hdv": Hdv}


def _differs(function: Callable[[Any], Any], x: Floats, d: Floats, exact: Any, here: Any, floor: float) -> Any:
    """Whether no real difference along d comes near the complex step; terms as large as floor may have cancelled."""
    wrong, last = np.ones(np.shape(exact), dtype=bool), np.full(np.shape(exact), np.inf)
    for width in WIDTHS:
        ahead, behind = function(x + width * d), function(x - width * d)
        middle = (ahead - behind) / (2.0 * width)
        largest = np.max(
            np.abs([here, ahead, behind]), initial=floor
        )  # terms that cancel in an entry leave their rounding
        spread = np.abs(ahead - 2.0 * here + behind) / width if width == WIDTHS[0] else np.abs(middle - last)
        noise = 64.0 * np.finfo(float).eps * largest / width
        wrong &= ~(np.abs(middle - exact) <= AGREE * (np.abs(middle) + np.abs(exact)) + spread + noise)
        last = middle
    return wrong & np.isfinite(exact) & np.isfinite(last)
