"""Whether kernels are what they say: one look at a state, by differences and between guard cells.

    gaps      h' = H v, no h of t nor of v;   rows   H = dh/dq N, the same h, H'v = (d/dt H) v
    dynamics  M symmetric and positive definite, no M of v, as constant and as sparse as the system declares
    velocity  q' = N v + r: affine in v, and no gap changes along r
    solve     M v' = f + H^T lam, and the law

Slip rows (`follows`) have no position: their H is no gradient.
"""

from __future__ import annotations

import math
import weakref
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import SceneError
from crossbody.cases.errors import KernelError
from crossbody.reference._differences import AGREE, closest, differs
from crossbody.reference._guarded import GuardedCall, entry
from crossbody.reference._state import NOISE, State, started
from crossbody.reference._system import System
from crossbody.reference.kinds import Floats
from crossbody.reference.systems import absent

ROUNDED = 64 * np.finfo(float).eps  # by which a length of 1 is known
EXACT = 1e-9  # part of the terms by which what is computed twice may differ
NEAR = (1e-2, 1e-4)  # distance of random states, in units of the coordinates; the second where the first is not finite
TIMES = 4  # random instants at which gaps are looked at again, beside those of the random states and the horizon
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
    "velocity": ("t", "q", "v", "p", "qd"),
}


def check_kernels(
    system: System, q0: Floats, v0: Floats, *, t_end: float = 1.0, states: int = 2, seed: int = 0
) -> None:
    """Check a system's kernels at a state, and at random ones near it.

    Args:
        system: with its kernels.
        q0: positions (nq,).
        v0: velocities (n,).
        t_end: times of the random states lie in [0, t_end], s.
        states: number of random states.
        seed: of the random states.

    Raises:
        SceneError: naming the kernel, the entry and both values.
    """
    draw, horizon = np.random.default_rng(seed), t_end if math.isfinite(t_end) else 1.0
    p, _ = started(system, q0, v0)
    _check_filled(system, q0, v0, p)  # before any other call: what is written beyond an array must meet guard cells
    first = State(system, 0.0, q0, v0 + (1.0 + np.abs(v0)) * draw.standard_normal(system.n), p)
    seen = [first]
    for _ in range(states):
        seen += [near for width in NEAR if (near := _near(first, v0, width, horizon, draw)).finite()][:1]
    _check_time(first, [horizon, *(horizon * draw.uniform(size=TIMES)), *(state.t for state in seen[1:])])
    for state in seen if system.velocity is not None else ():
        _check_rates(state, draw)
    for state in seen:
        _check_symmetric(state)
        _check_coupled(state)
        if system.nc:
            _check_rows(state, draw)
    _check_velocity(first, draw)
    if system.nc > 1:
        _check_subsets(first, draw)
    _check_positive(first)
    for state in seen[1:]:
        _check_constant(first, state)
    if system.solve is not None:
        _check_solve(first)


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
    inside = np.array([[a <= c < b for c in range(s.n)] for a, b in np.asarray(s.trees)]).reshape(s.nc, s.n)
    rooms: dict[str, dict[str, Floats]] = {
        "dynamics": {"M": np.full((s.n, s.mass_block), nan), "f": np.full(s.n, nan), "w": np.zeros(s.scratch)},
        "gaps": {"h": np.full(s.nc, nan), "hd": np.full(s.nc, nan)},
        "rows": {"H": np.zeros((s.nc, s.n)), "h": np.full(s.nc, nan), "Hdv": np.full(s.nc, nan)},
        "energy": {"e": np.full(2, nan)}, "power": {"e": np.full(2, nan)},
        "watch": {"g": np.full(s.guards, nan)}, "velocity": {"qd": np.full(s.nq, nan)},
    }  # fmt: skip
    for name, outputs in rooms.items():
        kernel = s.kernels[name]
        if kernel is getattr(absent, name, None) or (name in ("gaps", "rows") and not s.nc):
            continue
        found = GuardedCall(name, kernel, ARGUMENTS[name], given, outputs, HINTS).filled()
        given.setdefault("w", found.get("w"))
        for key, value in found.items():
            if key != "w" and not np.all(np.isfinite(value)):
                where, at = entry(key, ~np.isfinite(value)), f"t = 0 s, q = {q.tolist()}, v = {v.tolist()}"
                raise SceneError(f"Kernel {name} gives {where} = {value[~np.isfinite(value)][0]} at {at}.")
        if name == "rows" and np.any(found["H"][~inside] != 0.0):
            where = entry("H", (found["H"] != 0.0) & ~inside)
            trees = np.asarray(s.trees).tolist()
            raise KernelError(f"Kernel rows gives {where} outside System.span, which is {trees}.")


def _near(first: State, v0: Floats, width: float, horizon: float, draw: Any) -> State:
    system, size = first.system, 1.0 + first.sizes()
    q = first.q + system.displacement(first.q, width * size * draw.standard_normal(system.n), first.p)
    v = v0 + (1.0 + np.abs(v0)) * draw.standard_normal(system.n)
    return State(system, horizon * draw.uniform(), q, v, first.p)


def _check_symmetric(at: State) -> None:
    """M is symmetric, block by block."""
    k = at.system.mass_block
    if k > 1:
        mirrored = np.swapaxes(at.M.reshape(-1, k, k), 1, 2).reshape(at.M.shape)
        _compare(at, "dynamics", "M", at.M, "its mirror image", mirrored, EXACT * np.abs(at.M).max())


def _check_coupled(at: State) -> None:
    """M is zero between coordinates of which neither is above the other: nothing reads it there."""
    apart = ~at.system.coupled() & (at.M != 0.0)
    if np.any(apart):
        where, value = entry("M", apart), at.M[apart][0]
        raise KernelError(
            f"Kernel dynamics gives {where} = {value:.9g}, though by System.above neither "
            f"coordinate is above the other{at.where()}."
        )


def _check_positive(at: State) -> None:
    """M is positive definite; where a motion leads it may become singular, which is an outcome."""
    k = at.system.mass_block
    blocks = at.M.reshape(-1, k, k)
    try:
        np.linalg.cholesky(blocks)
    except np.linalg.LinAlgError:
        least = [float(np.linalg.eigvalsh(block)[0]) for block in blocks]
        block = int(np.argmin(least))
        raise SceneError(
            f"Kernel dynamics gives a mass matrix that is not positive definite: block {block} of "
            f"System.mass_block = {k} has the eigenvalue {least[block]:.9g}{at.where()}."
        ) from None


def _check_rows(at: State, draw: Any) -> None:
    """Rows agree with gaps and with their differences along a random direction and along v."""
    s, q, v, there = at.system, at.q, at.v, at.evaluated()
    if not np.any(there):
        return
    there &= ~_unmoved(at)
    reach, H = at.reach(), np.abs(at.H)
    _compare(at, "rows", "h", at.h, "gaps' h", at.gap, np.where(there, EXACT * (np.abs(at.gap) + reach), np.inf))
    held = (np.asarray(s.follows) < 0) & there
    d = (1.0 + at.sizes()) * draw.standard_normal(s.n)
    way = s.displacement(q, d, at.p)
    wrong = held & differs(
        lambda x: at.gaps(x, v)[0], q, way, at.H @ d, H @ np.abs(d), reach, lambda x: at.rows(x, v)[0] @ d
    )
    if np.any(wrong):
        _name_gradient(at, int(np.flatnonzero(wrong)[0]))
    size = H @ np.abs(v) + np.abs(at.rate)
    bound = np.where(there, EXACT * (size + NOISE * size.max(initial=0.0)), np.inf)
    _compare(at, "gaps", "hd", at.rate, "H v", at.H @ v, bound)

    def turned(x: Floats) -> Floats:
        return at.rows(x, v)[0] @ v

    rates = s.rates(q, v, at.t, at.p)
    wrong = there & differs(turned, q, rates, at.Hdv, np.abs(at.Hdv), reach, lambda x: at.rows(x, v)[2])
    if np.any(wrong):
        i = int(np.flatnonzero(wrong)[0])
        slope = closest(turned, q, rates, at.Hdv)[i]
        _refuse(at, "rows", f"Hdv[{i}]", at.Hdv[i], "(d/dt H) v by differences", slope)


def _unmoved(at: State) -> NDArray[np.bool_]:
    """Return rows whose H and rate are what rounding makes of a length that nothing changes; none may be closed."""
    size = 1.0 + np.abs(at.gap)
    found: NDArray[np.bool_] = np.abs(at.H) @ (1.0 + at.sizes()) <= ROUNDED * size
    found &= np.abs(at.rate) <= ROUNDED * size * (1.0 + np.abs(at.v).sum())
    closed = found & (at.gap < -EXACT * size)
    if np.any(closed):
        i = int(np.flatnonzero(closed)[0])
        raise SceneError(f"Row {i} has the gap {at.gap[i]:.9g}, and no coordinate changes it{at.where()}.")
    return found


def _name_gradient(at: State, i: int) -> None:
    """Raise for the entry of row i of H that is furthest from its difference."""
    slopes = np.array([
        closest(lambda x: at.gaps(x, at.v)[0][i : i + 1], at.q, at.system.displacement(at.q, unit, at.p),
                at.H[i : i + 1, c])[0]
        for c, unit in enumerate(np.eye(at.system.n))
    ])  # fmt: skip
    c = int(np.argmax(np.abs(slopes - at.H[i])))
    by = "dh/dq of gaps" if at.system.velocity is None else f"the rate of gaps along velocity {c}"
    _refuse(at, "rows", f"H[{i}, {c}]", at.H[i, c], f"{by} by differences", slopes[c])


def _check_velocity(at: State, draw: Any) -> None:
    """M, gaps and the rows' H depend on q alone: their second derivatives have no term of v'."""
    s = at.system
    v = at.v + (1.0 + np.abs(at.v)) * draw.standard_normal(s.n)
    text = f"at the same q and v = {v.tolist()} its value, and it must not depend on v: it"
    _compare(at, "dynamics", "M", at.M, text, at.dynamics(at.q, v)[0], EXACT * np.abs(at.M).max())
    there = at.evaluated() & (np.asarray(s.follows) < 0)
    if not np.any(there):
        return
    bound = np.where(there, EXACT * (np.abs(at.gap) + at.reach()), np.inf)
    _compare(at, "gaps", "h", at.gap, text, at.gaps(at.q, v)[0], bound)
    largest = np.abs(at.H).max(axis=1, keepdims=True)
    bound = EXACT * (largest + NOISE * largest.max())  # a row that no motion moves has no size of its own
    whole = np.where(there[:, None], bound, np.inf) + np.zeros_like(at.H)
    _compare(at, "rows", "H", at.H, text, at.rows(at.q, v)[0], whole)


def _check_rates(at: State, draw: Any) -> None:
    """The rates of positions are affine in v, and what is left of them at rest changes no gap."""
    s, q = at.system, at.q
    one, other = (draw.standard_normal(s.n) for _ in range(2))
    rest, both = s.rates(q, np.zeros(s.n), at.t, at.p), s.rates(q, one + other, at.t, at.p)
    first, second = s.rates(q, one, at.t, at.p), s.rates(q, other, at.t, at.p)
    parts, terms = first + second - rest, np.abs(first) + np.abs(second) + np.abs(rest).max()
    text = "the sum of those of two velocities less that at rest, and q' must be N(q) v + r(q): it"
    _compare(at, "velocity", "qd", both, text, parts, EXACT * terms)
    size = float(np.abs(rest).max())
    if s.nc and size > 0.0:
        there, reach = at.evaluated() & (np.asarray(s.follows) < 0), at.reach()
        moved = there & differs(lambda x: at.gaps(x, at.v)[0], q, rest / size, np.zeros(s.nc), reach, reach)
        if np.any(moved):
            i = int(np.flatnonzero(moved)[0])
            raise KernelError(
                f"Kernel velocity gives q' = {rest.tolist()} at v = 0, along which gap {i} "
                f"changes; gaps must stand still there, h' = H v{at.where()}."
            )


def _check_subsets(at: State, draw: Any) -> None:
    """Rows are those that `idx` asks for, in its order: a run asks for the active ones alone."""
    nc, there = at.system.nc, at.evaluated()
    order = draw.permutation(nc)
    for idx in (np.arange(nc)[::-1], order[: nc // 2], order[nc // 2 :][::-1], order[-1:]):
        text = f"row {{}} of all, which idx = {idx.tolist()} asks for in this place,"
        for name, part, whole in zip(("H", "h", "Hdv"), at.rows(at.q, at.v, idx), (at.H, at.h, at.Hdv), strict=True):
            given, wanted = part[: len(idx)], whole[idx]
            wrong = ~(np.abs(given - wanted) <= EXACT * (1.0 + np.abs(whole).max())) & np.isfinite(wanted)
            wrong = (wrong.T & there[idx]).T
            if np.any(wrong):
                place = tuple(np.argwhere(wrong)[0])
                other = text.format(idx[place[0]])
                _refuse(at, "rows", entry(name, wrong), float(given[place]), other, float(wanted[place]))


def _check_solve(at: State) -> None:
    """What `solve` gives obeys the equations of motion and the law of the rows that are always on."""
    s = at.system
    idx = np.flatnonzero(np.asarray(s.unilateral) == 0)
    na, law = len(idx), np.array(s.alpha)
    vd, lam, hd = np.zeros(s.n), np.zeros(max(na, 1)), np.zeros(max(na, 1))
    code = s.solve(at.t, at.q, at.v, at.u, at.p, np.zeros(s.scratch), law, idx, na, vd, lam, hd)
    if code != 0 or not np.all(np.isfinite(vd)):
        return  # ill posed here, which is an outcome
    H, h, a = at.H[idx], at.h[idx], law[idx]
    blocks = at.M.reshape(-1, s.mass_block, s.mass_block)
    moved = np.einsum("bij,bj->bi", blocks, vd.reshape(-1, s.mass_block)).ravel()
    pushed = at.f + lam[:na] @ H
    size = np.abs(at.f) + np.abs(lam[:na]) @ np.abs(H) + np.abs(moved)
    _compare(at, "solve", "M vd", moved, "f + H^T lam", pushed, AGREE * size.max())
    rate, spring = H @ at.v, (a[:, 0] + a[:, 2] * h**2) * h
    wanted = -(at.Hdv[idx] + a[:, 1] * rate + spring)
    size = np.abs(H) @ np.abs(vd) + np.abs(at.Hdv[idx]) + np.abs(a[:, 1] * rate) + np.abs(spring)
    _compare(at, "solve", "H vd", H @ vd, "-(H'v + a1 h' + a0 h + a2 h^3)", wanted, AGREE * (size + 1e-9))
    _compare(at, "solve", "hd", hd[:na], "H v", rate, EXACT * (np.abs(H) @ np.abs(at.v) + 1e-300))


def _check_constant(first: State, other: State) -> None:
    """M, H and f are as constant as the system declares."""
    system = first.system
    if not (system.constant_mass or system.affine):
        return
    text = f"at another state, though System.{'constant_mass' if system.constant_mass else 'affine'} is true, its value"
    _compare(other, "dynamics", "M", other.M, text, first.M, EXACT * np.abs(first.M).max())
    if system.affine:
        text = "at another state, though System.affine is true, its value"
        _compare(other, "rows", "H", other.H, text, first.H, EXACT * (np.abs(first.H).max(initial=0.0) + 1e-300))
        _compare(other, "dynamics", "f", other.f, text, first.f, EXACT * (np.abs(first.f).max() + 1e-300))


def _check_time(first: State, times: list[float]) -> None:
    """Gaps depend on q alone: their second derivative has no term of a wall that moves by itself."""
    bound = EXACT * (np.abs(first.gap) + first.reach())
    for t in times if first.system.nc else []:
        then = first.gaps(first.q, first.v, t)[0]
        moved = ~(np.abs(then - first.gap) <= bound)
        if np.any(moved):
            i = int(np.flatnonzero(moved)[0])
            raise KernelError(
                f"Kernel gaps gives h[{i}] = {first.gap[i]:.9g} at t = 0 and {then[i]:.9g} at "
                f"t = {t:.9g} s at the same q; gaps must not depend on time. Make the wall a "
                "coordinate of its own, which a force moves."
            )


def _compare(at: State, kernel: str, name: str, given: Floats, other: str, wanted: Floats, bound: Any) -> None:
    """Raise for the first entry that is off by more than the bound."""
    wrong = ~(np.abs(given - wanted) <= bound)
    if np.any(wrong) and np.any(wrong := wrong & np.isfinite(wanted) & (bound < np.inf)):
        place = tuple(np.argwhere(wrong)[0])
        _refuse(at, kernel, entry(name, wrong), float(given[place]), other, float(wanted[place]))


def _refuse(at: State, kernel: str, what: str, given: float, other: str, wanted: float) -> None:
    raise KernelError(f"Kernel {kernel} gives {what} = {given:.9g}, but {other} is {wanted:.9g}{at.where()}.")
