"""Whether kernels are what they say: one look at a state, by differences and between guard cells.

    gaps      h' = H v, no h of t;   rows   H = dh/dq, the same h, H'v = (d/dt H) v
    dynamics  M symmetric and positive definite, as constant and as local as the system declares
    solve     M v' = f + H^T lam, and the law

Slip rows (`follows`) have no position: their H is no gradient. Differences are taken at four widths, and a value counts
as wrong only if none of them admits it, nor those of one side alone: a gap may have a kink.
"""

from __future__ import annotations

import math
import weakref
from collections.abc import Callable
from typing import Any

import numpy as np

from crossbody.cases import SceneError
from crossbody.reference import kernels as kernel_types
from crossbody.reference._guarded import GuardedCall, entry
from crossbody.reference._kinds import Bytes, Floats
from crossbody.reference._system import System, initial_modes
from crossbody.reference.systems import _none

WIDTHS = (1e-3, 1e-4, 1e-5, 1e-6)  # of differences, in units of the coordinates
AGREE = 1e-6  # part of the terms by which a difference may be off, beside what its widths tell
EXACT = 1e-9  # part of the terms by which what is computed twice may differ
NEAR = (1e-2, 1e-4)  # distance of random states, in units of the coordinates; the second where the first is not finite
HINTS = {
    "p": "System.parameters has fewer entries than the kernel reads. ",
    "w": "System.scratch is shorter than the kernel needs. ",
    "u": "System.inputs is smaller than the kernel needs. ",
}
ARGUMENTS = {
    "dynamics": ("t", "q", "v", "u", "p", "M", "f", "w"),
    "gaps": ("t", "q", "v", "p", "h", "hd"),
    "rows": ("t", "q", "v", "p", "w", "idx", "na", "H", "h", "Hdv"),
    "energy": ("q", "v", "p", "e"),
    "power": ("t", "q", "v", "u", "p", "e"),
    "watch": ("t", "q", "v", "p", "g"),
}


def check_kernels(
    system: System, q0: Floats, v0: Floats, *, t_end: float = 1.0, states: int = 2, seed: int = 0
) -> None:
    """Check a system's kernels at a state, and at random ones near it.

    Args:
        system: with its kernels.
        q0: positions (n,).
        v0: velocities (n,).
        t_end: times of the random states lie in [0, t_end], s.
        states: number of random states.
        seed: of the random states.

    Raises:
        SceneError: naming the kernel, the entry and both values.
    """
    draw = np.random.default_rng(seed)
    p, _ = started(system, q0, v0)
    _check_filled(system, q0, v0, p)  # before any other call: what is written beyond an array must meet guard cells
    first = State(system, 0.0, q0, v0 + (1.0 + np.abs(v0)) * draw.standard_normal(system.n), p)
    _check_time(system, first, t_end, draw)
    seen = [first]
    for _ in range(states):
        seen += [near for width in NEAR if (near := _near(first, v0, width, t_end, draw)).finite()][:1]
    for state in seen:
        state.check_symmetric()
        state.check_rows(draw)
    first.check_subsets(draw)
    first.check_positive()
    for state in seen[1:]:
        _check_constant(system, first, state)
    if system.solve is not None:
        first.check_solve()


_CHECKED: weakref.WeakSet[System] = weakref.WeakSet()


def check_once(system: System, q0: Floats, v0: Floats, t_end: float) -> None:
    """Check a system that was not checked before, as `check_kernels` does."""
    if system not in _CHECKED:
        with np.errstate(all="ignore"):
            check_kernels(system, q0, v0, t_end=t_end)
        _CHECKED.add(system)


def _check_filled(s: System, q: Floats, v: Floats, p: Floats) -> None:
    """Call every kernel between guard cells; what it fills must be finite (an energy may be unknown)."""
    nan = np.nan
    given = {"t": 0.0, "q": q, "v": v, "u": np.zeros(s.inputs), "p": p, "idx": np.arange(s.nc), "na": s.nc}
    inside = np.array([[a <= c < b for c in range(s.n)] for a, b in np.asarray(s.span)]).reshape(s.nc, s.n)
    rooms: dict[str, dict[str, Floats]] = {
        "dynamics": {"M": np.full((s.n, s.mass_block), nan), "f": np.full(s.n, nan), "w": np.zeros(s.scratch)},
        "gaps": {"h": np.full(s.nc, nan), "hd": np.full(s.nc, nan)},
        "rows": {"H": np.zeros((s.nc, s.n)), "h": np.full(s.nc, nan), "Hdv": np.full(s.nc, nan)},
        "energy": {"e": np.full(2, nan)}, "power": {"e": np.full(2, nan)}, "watch": {"g": np.full(s.guards, nan)},
    }  # fmt: skip
    for name, outputs in rooms.items():
        kernel = s.kernels[name]
        if kernel is getattr(_none, name, None) or (name in ("gaps", "rows") and not s.nc):
            continue
        found = GuardedCall(name, kernel, ARGUMENTS[name], given, outputs, HINTS).filled()
        given.setdefault("w", found.get("w"))
        for key, value in found.items():
            if key != "w" and not np.all(np.isfinite(value)):
                where, at = entry(key, ~np.isfinite(value)), f"t = 0 s, q = {q.tolist()}, v = {v.tolist()}"
                raise SceneError(f"Kernel {name} gives {where} = {value[~np.isfinite(value)][0]} at {at}.")
        if name == "rows" and np.any(found["H"][~inside] != 0.0):
            where = entry("H", (found["H"] != 0.0) & ~inside)
            raise SceneError(f"Kernel rows gives {where} outside System.span, which is {np.asarray(s.span).tolist()}.")


def _near(first: State, v0: Floats, width: float, t_end: float, draw: Any) -> State:
    system, size = first.system, 1.0 + np.abs(first.q)
    q = first.q + width * size * draw.standard_normal(system.n)
    v = v0 + (1.0 + np.abs(v0)) * draw.standard_normal(system.n)
    return State(system, t_end * draw.uniform(), q, v, first.p)


class State:
    """One state of a system and what its kernels give there."""

    def __init__(self, system: System, t: float, q: Floats, v: Floats, p: Floats) -> None:
        self.system, self.t, self.q, self.v = system, t, q, v
        self.p, self.u = p, np.zeros(system.inputs)
        self.M, self.f, self.w = self.dynamics(t, q, v)
        self.H, self.h, self.Hdv = self.rows(t, q, v)
        self.gap, self.rate = self.gaps(t, q, v)

    def dynamics(self, t: float, q: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
        """M, f and the scratch."""
        s = self.system
        M, f, w = np.zeros((s.n, s.mass_block)), np.zeros(s.n), np.zeros(s.scratch)
        s.dynamics(t, q, v, self.u, self.p, M, f, w)
        return M, f, w

    def rows(self, t: float, q: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
        """H, h and H'v of all rows, after dynamics as in a run."""
        s = self.system
        H, h, Hdv = np.zeros((s.nc, s.n)), np.zeros(s.nc), np.zeros(s.nc)
        if s.nc:
            w = self.dynamics(t, q, v)[2] if s.scratch else np.zeros(0)
            s.rows(t, q, v, self.p, w, np.arange(s.nc), s.nc, H, h, Hdv)
        return H, h, Hdv

    def gaps(self, t: float, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Gaps and rates of all rows."""
        h, hd = np.zeros(self.system.nc), np.zeros(self.system.nc)
        self.system.gaps(t, q, v, self.p, h, hd)
        return h, hd

    def mass_matrix(self) -> Floats:
        """M as one matrix (n, n)."""
        k, n = self.system.mass_block, self.system.n
        M = np.zeros((n, n))
        for b in range(0, n, k):
            M[b : b + k, b : b + k] = self.M[b : b + k]
        return M

    def finite(self) -> bool:
        """Whether the state lies where the kernels are defined."""
        return all(
            bool(np.all(np.isfinite(x))) for x in (self.M, self.f, self.H, self.h, self.Hdv, self.gap, self.rate)
        )

    def check_symmetric(self) -> None:
        """M is symmetric, block by block."""
        k = self.system.mass_block
        other = np.swapaxes(self.M.reshape(-1, k, k), 1, 2).reshape(self.M.shape)
        _compare("dynamics", "M", self.M, "its mirror image", other, EXACT * np.abs(self.M).max(), self)

    def check_positive(self) -> None:
        """M is positive definite; where a motion leads it may become singular, which is an outcome."""
        k = self.system.mass_block
        blocks = self.M.reshape(-1, k, k)
        try:
            np.linalg.cholesky(blocks)
        except np.linalg.LinAlgError:
            least = [float(np.linalg.eigvalsh(block)[0]) for block in blocks]
            block = int(np.argmin(least))
            raise SceneError(
                f"Kernel dynamics gives a mass matrix that is not positive definite: block {block} of "
                f"System.mass_block = {k} has the eigenvalue {least[block]:.9g}{self.where()}."
            ) from None

    def check_rows(self, draw: Any) -> None:
        """Rows agree with gaps and with their differences along a random direction and along v."""
        s, q, v = self.system, self.q, self.v
        # A row that cannot be touched in the present discrete state reports a gap and no rate, and is not evaluated.
        there = (self.gap <= 0.0) | (self.rate != 0.0) | (s.switch is None)
        if not np.any(there):
            return
        terms = np.abs(self.H) @ (1.0 + np.abs(q))
        bound = np.where(there, EXACT * (np.abs(self.gap) + terms), np.inf)
        _compare("rows", "h", self.h, "gaps' h", self.gap, bound, self)
        held = (np.asarray(s.follows) < 0) & there
        d = (1.0 + np.abs(q)) * draw.standard_normal(s.n)
        wrong = self._differs(lambda x: self.gaps(self.t, x, v)[0], self.H @ d, d, np.abs(self.H) @ np.abs(d)) & held
        if np.any(wrong):
            self._name_gradient(int(np.flatnonzero(wrong)[0]))
        speed = np.abs(self.H) @ np.abs(v)
        bound = np.where(there, EXACT * (speed + np.abs(self.rate)), np.inf)
        _compare("gaps", "hd", self.rate, "H v", self.H @ v, bound, self)
        curved = there & self._differs(lambda x: self.rows(self.t, x, v)[0] @ v, self.Hdv, v, np.abs(self.Hdv))
        if np.any(curved):
            i = int(np.flatnonzero(curved)[0])
            slope = _best(lambda x: self.rows(self.t, x, v)[0] @ v, q, v, self.Hdv)[i]
            self._wrong("rows", f"Hdv[{i}]", self.Hdv[i], "(d/dt H) v by differences", slope)

    def check_subsets(self, draw: Any) -> None:
        """Rows are those that `idx` asks for, in its order: a run asks for the active ones alone."""
        s = self.system
        if s.nc < 2:
            return
        there = (self.gap <= 0.0) | (self.rate != 0.0) | (s.switch is None)
        for idx in (draw.permutation(s.nc), draw.permutation(s.nc)[: s.nc // 2], *np.arange(min(s.nc, 8))[:, None]):
            na, given = len(idx), np.concatenate([idx, np.zeros(s.nc - len(idx), np.int64)]).astype(np.int64)
            H, h, Hdv = np.zeros((s.nc, s.n)), np.zeros(s.nc), np.zeros(s.nc)
            w = self.dynamics(self.t, self.q, self.v)[2] if s.scratch else np.zeros(0)
            s.rows(self.t, self.q, self.v, self.p, w, given, na, H, h, Hdv)
            ask = f"the same row when idx is {idx.tolist()}, in its place there,"
            for name, alone, all_ in (("H", H, self.H), ("h", h, self.h), ("Hdv", Hdv, self.Hdv)):
                bound = np.where(there, EXACT * (1.0 + np.abs(all_).max()), np.inf)
                bound = bound if all_.ndim == 1 else bound[:, None] + np.zeros_like(all_)
                seen = np.full_like(all_, np.inf)
                seen[idx] = alone[:na]
                bound[np.setdiff1d(np.arange(s.nc), idx)] = np.inf
                _compare("rows", name, all_, ask, seen, bound, self)

    def _differs(self, function: Callable[[Floats], Floats], claimed: Floats, d: Floats, terms: Floats) -> Any:
        """Whether no difference of a function of q along d admits what is claimed for its derivative."""
        q = self.q
        here, size = function(q), np.abs(self.H) @ (1.0 + np.abs(q))
        wrong = np.ones(len(claimed), dtype=bool)
        last = None
        for width in WIDTHS:
            ahead, behind = function(q + width * d), function(q - width * d)
            middle = (ahead - behind) / (2.0 * width)
            noise = 32.0 * np.finfo(float).eps * (np.abs(here) + size + np.abs(ahead)) / width
            bound = AGREE * (terms + np.abs(middle)) + noise
            spread = np.zeros(len(claimed)) if last is None else np.minimum(np.abs(middle - last), AGREE**0.5 * terms)
            wrong &= ~(np.abs(middle - claimed) <= bound + spread)
            for side in ((ahead - here) / width, (here - behind) / width):
                kinked = np.abs(2.0 * here - ahead - behind) > AGREE**0.5 * width * (terms + np.abs(middle))
                bent = kinked & (width == WIDTHS[-1])
                wrong &= ~(bent & (np.abs(side - claimed) <= 1e-3 * (terms + np.abs(side)) + 10.0 * width * size))
            if last is not None:  # the limit that differences of second order tend to
                error = (middle - last) / ((WIDTHS[0] / WIDTHS[1]) ** 2 - 1.0)
                wrong &= ~(np.abs(middle + error - claimed) <= 2.0 * np.abs(error) * AGREE**0.25 + noise)
            last = middle
            wrong &= np.isfinite(middle)  # a state so far out that sums overflow tells nothing
            if not np.any(wrong):
                break
        return wrong

    def _name_gradient(self, i: int) -> None:
        """Raise for the entry of row i of H that is furthest from its difference."""
        slopes = np.array([
            _best(lambda x: self.gaps(self.t, x, self.v)[0][i : i + 1], self.q, unit, self.H[i : i + 1, c])[0]
            for c, unit in enumerate(np.eye(self.system.n))
        ])  # fmt: skip
        c = int(np.argmax(np.abs(slopes - self.H[i])))
        self._wrong("rows", f"H[{i}, {c}]", self.H[i, c], "dh/dq of gaps by differences", slopes[c])

    def check_solve(self) -> None:
        """What `solve` gives obeys the equations of motion and the law of the rows that are always on."""
        s = self.system
        idx = np.flatnonzero(np.asarray(s.unilateral) == 0)
        na, law = len(idx), np.array(s.alpha)
        vd, lam, hd = np.zeros(s.n), np.zeros(max(na, 1)), np.zeros(max(na, 1))
        code = s.solve(self.t, self.q, self.v, self.u, self.p, np.zeros(s.scratch), law, idx, na, vd, lam, hd)
        if code != 0 or not np.all(np.isfinite(vd)):
            return  # ill posed here, which is an outcome
        H, h, a = self.H[idx], self.h[idx], law[idx]
        blocks = self.M.reshape(-1, s.mass_block, s.mass_block)
        moved = np.einsum("bij,bj->bi", blocks, vd.reshape(-1, s.mass_block)).ravel()
        pushed = self.f + lam[:na] @ H
        size = np.abs(self.f) + np.abs(lam[:na]) @ np.abs(H) + np.abs(moved)
        _compare("solve", "M vd", moved, "f + H^T lam", pushed, AGREE * size.max(), self)
        rate, spring = H @ self.v, (a[:, 0] + a[:, 2] * h**2) * h
        wanted = -(self.Hdv[idx] + a[:, 1] * rate + spring)
        size = np.abs(H) @ np.abs(vd) + np.abs(self.Hdv[idx]) + np.abs(a[:, 1] * rate) + np.abs(spring)
        _compare("solve", "H vd", H @ vd, "-(H'v + a1 h' + a0 h + a2 h^3)", wanted, AGREE * (size + 1e-9), self)
        _compare("solve", "hd", hd[:na], "H v", rate, EXACT * (np.abs(H) @ np.abs(self.v) + 1e-300), self)

    def _wrong(self, kernel: str, what: str, given: float, other: str, wanted: float) -> None:
        raise SceneError(f"Kernel {kernel} gives {what} = {given:.9g}, but {other} is {wanted:.9g}{self.where()}.")

    def where(self) -> str:
        """The state, for a message."""
        return f" at t = {self.t:g} s, q = {self.q.tolist()}, v = {self.v.tolist()}"


def started(system: System, q: Floats, v: Floats, given: Floats | None = None) -> tuple[Floats, Bytes]:
    """Return the parameters with their discrete state, and the modes of all rows, as `switch` leaves them at the start.

    Args:
        system: the mechanism.
        q: positions (n,).
        v: velocities (n,).
        given: parameters before that; those of the system if not given.
    """
    p, mode = np.array(system.p if given is None else given), initial_modes(system)
    if system.switch is not None:
        constants = len(p) - np.size(system.discrete) - system.latched
        system.switch(0.0, q, v, p, mode, int(kernel_types.START))
        changed = p[:constants] != np.asarray(system.p if given is None else given)[:constants]
        if np.any(changed):
            raise SceneError(f"Kernel switch writes {entry('p', changed)}, which is no discrete variable.")
    return p, mode


def _compare(kernel: str, name: str, given: Floats, other: str, wanted: Floats, bound: Any, state: State) -> None:
    """Raise for the first entry that is off by more than the bound."""
    wrong = ~(np.abs(given - wanted) <= bound) & np.isfinite(wanted) & (bound < np.inf)
    if np.any(wrong):
        at = tuple(np.argwhere(wrong)[0])
        state._wrong(kernel, entry(name, wrong), float(given[at]), other, float(wanted[at]))


def _best(function: Callable[[Floats], Floats], q: Floats, d: Floats, claimed: Floats) -> Floats:
    """The central difference that comes closest to what is claimed: it is shown to the user."""
    found = np.array([(function(q + width * d) - function(q - width * d)) / (2.0 * width) for width in WIDTHS])
    closest = np.argmin(np.abs(found - claimed), axis=0)
    nearest: Floats = np.take_along_axis(found, closest[None], axis=0)[0]
    return nearest


def _check_constant(system: System, first: State, other: State) -> None:
    """M, H and f are as constant as the system declares."""
    declared = "System.constant_mass" if system.constant_mass else "System.affine"
    if system.constant_mass or system.affine:
        bound = EXACT * np.abs(first.M).max()
        _compare(
            "dynamics", "M", other.M, f"another state, though {declared} is true, its value", first.M, bound, other
        )
    if system.affine:
        text = "at another state, though System.affine is true, its value"
        _compare("rows", "H", other.H, text, first.H, EXACT * (np.abs(first.H).max(initial=0.0) + 1e-300), other)
        _compare("dynamics", "f", other.f, text, first.f, EXACT * (np.abs(first.f).max() + 1e-300), other)


def _check_time(system: System, first: State, t_end: float, draw: Any) -> None:
    """Gaps depend on q alone: their second derivative has no term of a wall that moves by itself."""
    if not system.nc:
        return
    for t in (t_end * draw.uniform(size=2) if math.isfinite(t_end) else draw.uniform(size=2)).tolist():
        then = first.gaps(t, first.q, first.v)[0]
        moved = ~(np.abs(then - first.gap) <= EXACT * (np.abs(first.gap) + np.abs(first.H) @ (1.0 + np.abs(first.q))))
        if np.any(moved):
            i = int(np.flatnonzero(moved)[0])
            raise SceneError(
                f"Kernel gaps gives h[{i}] = {first.gap[i]:.9g} at t = 0 and {then[i]:.9g} at t = {t:.9g} s at the "
                "same q; gaps must not depend on time. Make the wall a coordinate of its own, which a force moves."
            )
