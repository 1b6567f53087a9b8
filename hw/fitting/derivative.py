"""Residuals of a replay and their derivatives by what is to be identified: exact, by complex step through the motion.

A run of the kernels from x + i s e_k carries d/dx_k in its imaginary part (s = 1e-30, Squire and
Trapp 1998): parameters, the start that follows from them through the closed rows, and the start
itself. The delay acts by y(t - d), whose derivative is -y'(t - d).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import UnknownName, Value
from crossbody.cases.arrays import Floats
from crossbody.engines.equations import system_of
from crossbody.hw.fitting.covariance import Layout
from crossbody.hw.fitting.rk4 import march
from crossbody.hw.fitting.search import Deadline
from crossbody.hw.models.contract import Model
from crossbody.hw.windows.lift import check_measured, lift
from crossbody.hw.windows.window import Window, overlap
from crossbody.reference import System

Array = NDArray[np.complex128]
STEP = 1e-30
DELAY = "delay"
SETTLED = 1e-6  # change of a motion, as a part of its largest value, below which its steps are short enough
MOST_PARTS = 64


class Exact:
    """Residuals of many windows, measured less predicted.

    Args:
        model: with `places`, and rows that are always on.
        numbers: every parameter of the model.
        free: names of parameters, or "delay".
        cut: the windows.
        starts: whether the measured coordinates and rates at each start are unknowns too.
        stride: of so many samples one is compared.
    """

    how = "complex step through the motion"
    most = 200
    tolerance = 1e-3
    ftol = 1e-12
    deadline = Deadline()

    def __init__(
        self, model: Model, numbers: Mapping[str, Value], free: Sequence[str],
        cut: Sequence[Window], starts: bool, stride: int,
    ) -> None:  # fmt: skip
        self.model, self.numbers, self.free, self.cut = model, dict(numbers), tuple(free), tuple(cut)
        for name in free:
            if name not in model.places and name != DELAY:
                raise UnknownName(f"free parameter of {model.name}", name, (*model.places, DELAY))
        self.starts, self.stride, self.k = starts, stride, len(model.seen)
        self.grids = [np.unique(np.append(np.arange(0, len(w.t), stride), len(w.t) - 1)) for w in cut]
        self.systems: dict[bytes, tuple[System, Floats]] = {}
        self.parts = 1
        self._settle()

    def _settle(self) -> None:
        """As many integration steps between samples as the first window needs."""
        z = self.first().astype(np.complex128)
        coarse = self._run(0, z)[1].real
        while self.parts < MOST_PARTS:
            self.parts *= 2
            fine = self._run(0, z)[1].real
            if not np.any(np.abs(fine - coarse) > SETTLED * np.max(np.abs(fine), axis=0)):
                self.parts //= 2
                return
            coarse = fine

    def first(self) -> Floats:
        """The unknowns at the beginning: parameters, delay, and each window's start where it is free."""
        own = [0.0 if name == DELAY else float(self.numbers[name]) for name in self.free]
        ends = [np.concatenate([w.segment.y, w.segment.yd]) for w in self.cut] if self.starts else []
        return np.concatenate([own, *ends])

    def residual(self, x: Floats) -> Floats:
        """All windows' residuals (N,)."""
        return np.concatenate([self.residual_of(j, x) for j in range(len(self.cut))])

    def jacobian(self, x: Floats) -> Floats:
        """Their derivatives (N, P)."""
        found = np.zeros((len(self.layout.windows()), len(x)))
        begin = 0
        for j in range(len(self.cut)):
            block = self.block(j, x)
            found[begin : begin + len(block), self._columns(j)] = block
            begin += len(block)
        return found

    def residual_of(self, j: int, x: Floats) -> Floats:
        """Residuals of one window (k m,)."""
        return self._window(j, x, None)[0]

    def block(self, j: int, x: Floats) -> Floats:
        """Their derivatives by the parameters and, where it is free, by the window's own start."""
        return np.stack([self._window(j, x, i)[1] for i in self._columns(j)], axis=1)

    def checked(self, x: Floats, J: Floats, sizes: Floats, low: Floats) -> float:
        """Largest relative difference of the first columns of J, one a size, and central differences."""
        return max(apart(self.residual, x, J, i, 1e-5 * size, low[i]) for i, size in enumerate(sizes))

    def flat(self, x: Floats) -> dict[int, str]:
        """Nothing: exact derivatives tell what is flat."""
        return {}

    @property
    def layout(self) -> Layout:
        """How residuals follow each other."""
        return Layout(samples=tuple(len(grid) for grid in self.grids), k=self.k, overlap=overlap(self.cut))

    def _columns(self, j: int) -> list[int]:
        own = list(range(len(self.free)))
        begin = len(self.free) + 2 * self.k * j
        return own + (list(range(begin, begin + 2 * self.k)) if self.starts else [])

    def _window(self, j: int, x: Floats, column: int | None) -> tuple[Floats, Floats]:
        """Residuals of one window (k m,), and their derivative by one unknown."""
        self.deadline.check()
        z = x.astype(np.complex128)
        if column is not None:
            z[column] += 1j * STEP
        delay = z[self.free.index(DELAY)] if DELAY in self.free else 0.0
        window, grid = self.cut[j], self.grids[j]
        times, motion = self._run(j, z)
        seen = list(self.model.seen)
        y, yd = motion[:, seen], motion[:, [self.model_n + i for i in seen]]
        if np.any(window.age[0] != 0.0) or DELAY in self.free:
            y = _hermite(times, y, yd, window.age[grid] - delay)
        elif len(times) != len(grid):
            y = y[grid]
        residual = (window.y[grid] - y).T.ravel()
        return np.ascontiguousarray(residual.real), np.ascontiguousarray(residual.imag) / STEP

    def _run(self, j: int, z: Array) -> tuple[Floats, Array]:
        """Times of one window from 0 and its motion (m, 2 n)."""
        window = self.cut[j]
        system, q0, p = self._system(j, z)
        y, yd = window.segment.y.astype(np.complex128), window.segment.yd.astype(np.complex128)
        if self.starts:
            begin = len(self.free) + 2 * self.k * j
            y, yd = z[begin : begin + self.k], z[begin + self.k : begin + 2 * self.k]
        driven = bool(len(window.segment.times))
        times = window.t - window.t[0]
        times = times if driven else times[self.grids[j]]
        u = np.zeros((len(times), system.inputs), np.complex128)
        if driven:
            u[:-1, : window.segment.inputs.shape[1]] = window.segment.inputs
        out = np.zeros((len(times), 2 * system.n), np.complex128)
        out[0] = lift(system, self.model.seen, q0, y, yd, p)
        with np.errstate(all="ignore"):
            march(
                system.dynamics, system.rows, np.ascontiguousarray(times), self.parts, u, p,
                np.array(system.alpha), system.mass_block, system.scratch, out,
            )  # fmt: skip
        return times, out

    def _system(self, j: int, z: Array) -> tuple[System, Array, Array]:
        """The mechanism of a window, a closed pose near its start, and the parameters of the kernels."""
        real = {name: float(z[i].real) for i, name in enumerate(self.free) if name != DELAY}
        key = np.array([j, *real.values()]).tobytes()
        if key not in self.systems:
            case = self.model.build(self.numbers | real, self.cut[j].segment)
            system = system_of(case)
            check_measured(system, self.model.seen, self.model.name)
            self.model_n = system.n
            if len(self.systems) > 4 * len(self.cut):
                self.systems.clear()
            self.systems[key] = system, np.array(case.q0)
        system, q0 = self.systems[key]
        p = system.p.astype(np.complex128)
        for i, name in enumerate(self.free):
            if name != DELAY:
                p[self.model.places[name]] = z[i]
        return system, q0.astype(np.complex128), p


def apart(
    residual: Callable[[Floats], Floats], x: Floats, J: Floats, i: int, step: float, low: float = -np.inf
) -> float:
    """How far a column of J is from a difference of second order, as a part of its size; 0 where both vanish.

    The difference is central, or forward where x_i - step would be below `low`.
    """
    e = np.zeros(len(x))
    e[i] = step
    if x[i] - step < low:
        difference = (4.0 * residual(x + e) - residual(x + 2.0 * e) - 3.0 * residual(x)) / (2.0 * step)
    else:
        difference = (residual(x + e) - residual(x - e)) / (2.0 * step)
    size = float(np.linalg.norm(J[:, i]))
    off = float(np.linalg.norm(difference - J[:, i]))
    return off / size if size > 0.0 else float(off > 0.0)


def _hermite(t: Floats, y: Array, yd: Array, when: Array) -> Array:
    """Cubic between samples, column by column, in complex arithmetic; the last cubics go on beyond."""
    found = np.empty(when.shape, np.complex128)
    for c in range(when.shape[1]):
        i = np.clip(np.searchsorted(t, when[:, c].real, side="right") - 1, 0, len(t) - 2)
        h = t[i + 1] - t[i]
        s = (when[:, c] - t[i]) / h
        a, b, va, vb = y[i, c], y[i + 1, c], h * yd[i, c], h * yd[i + 1, c]
        found[:, c] = a + s * (va + s * (3.0 * (b - a) - 2.0 * va - vb + s * (2.0 * (a - b) + va + vb)))
    return found
