"""The level machine on M q'' = g - K q with constant rows, without an integrator.

Between two events the motion is linear, x' = F x with x = (q, v, 1): exp(F t) is exact. Every
condition of the machine is linear in x as well. Events are looked for at many places, densely
where two conditions come near to hold at once, and closed in by bisection: nothing of it is
shared with how the integrators find theirs.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.linalg import expm

from crossbody.cases import Event, Mode, Outcome, Trajectory
from crossbody.cases.arrays import Floats

STEPS = 40.0  # places looked at in 1 / (fastest frequency)
BLOCK = 256  # places at a time
FINE = 64  # places in a step where conditions come near to hold at once
CLOSE = 0.05  # of what conditions vary by: how near that is
NOISE = 1e-11  # of their size: what counts as zero at an event
MOST = 20_000  # events
SUMS = 24  # terms of the exponential's series within one step
HALVINGS = 60


@dataclass(slots=True)
class _Conditions:
    """Linear conditions, functionals of x: row `rows[k]` switches where all its `parts[k]` are negative."""

    functionals: Floats
    rows: list[int] = field(default_factory=list)
    after: list[Mode] = field(default_factory=list)
    parts: list[list[int]] = field(default_factory=list)


@dataclass(slots=True)
class _Arc:
    """Start time, state there (2n + 1,), generator, modes."""

    t: float
    x: Floats
    F: Floats
    modes: tuple[Mode, ...]


@dataclass(frozen=True)
class LinearArcs:
    """The motion: callable at nondecreasing times; see the module's docstring. Arguments as in `Numbers`."""

    M: Floats
    K: Floats
    g: Floats
    H: Floats
    c: Floats
    q0: Floats
    v0: Floats
    a0: Floats
    a1: Floats
    t_end: float

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return len(self.M)

    def _free(self) -> Floats:
        """M^-1 (g - K q) as a matrix on x."""
        force = np.hstack([-self.K, np.zeros((self.n, self.n)), self.g[:, None]])
        return np.asarray(np.linalg.solve(self.M, force), dtype=np.float64)

    def _gap(self, i: int) -> Floats:
        return np.concatenate([self.H[i], np.zeros(self.n), self.c[i : i + 1]])

    def _rate(self, i: int) -> Floats:
        return np.concatenate([np.zeros(self.n), self.H[i], [0.0]])

    def _multipliers(self, active: list[int]) -> Floats:
        """Lam of the active rows as a matrix on x: (H M^-1 H') lam = -(H M^-1 f + a1 h' + a0 h)."""
        H = self.H[active]
        law = np.array([self.a1[i] * self._rate(i) + self.a0[i] * self._gap(i) for i in active])
        G = H @ np.linalg.solve(self.M, H.T)
        return -np.linalg.solve(G, H @ self._free() + law)

    def _generator(self, active: list[int]) -> Floats:
        """F of x' = F x."""
        n, F = self.n, np.zeros((2 * self.n + 1, 2 * self.n + 1))
        F[:n, n : 2 * n] = np.eye(n)
        F[n : 2 * n] = self._free()
        if active:
            F[n : 2 * n] += np.linalg.solve(self.M, self.H[active].T) @ self._multipliers(active)
        return F

    def _conditions(self, modes: list[Mode]) -> _Conditions:
        """What switches a row out of its mode."""
        active = [i for i, mode in enumerate(modes) if mode == Mode.CONTACT]
        lam = self._multipliers(active) if active else None
        rows: list[Floats] = []
        found = _Conditions(np.zeros((0, 2 * self.n + 1)))

        def add(i: int, after: Mode, *functionals: Floats) -> None:
            found.rows.append(i)
            found.after.append(after)
            found.parts.append(list(range(len(rows), len(rows) + len(functionals))))
            rows.extend(functionals)

        for i, mode in enumerate(modes):
            if mode == Mode.FREE:
                add(i, Mode.CONTACT, self._gap(i), self._rate(i))
            elif mode == Mode.CONTACT:
                assert lam is not None
                add(i, Mode.BALLISTIC, lam[active.index(i)])
            else:
                both = sorted([*active, i])
                add(i, Mode.FREE, -self._gap(i))
                add(i, Mode.CONTACT, self._rate(i), -self._multipliers(both)[both.index(i)])
        found.functionals = np.array(rows)
        return found

    @cached_property
    def _course(self) -> tuple[list[_Arc], list[Event], Outcome]:
        """All arcs, from event to event."""
        t, x = 0.0, np.concatenate([self.q0, self.v0, [1.0]])
        modes, arcs, events = [Mode.FREE] * len(self.H), list[_Arc](), list[Event]()
        while len(events) < MOST:
            active = [i for i, mode in enumerate(modes) if mode == Mode.CONTACT]
            arcs.append(_Arc(t, x, self._generator(active), tuple(modes)))
            wait, fired = self._next(arcs[-1], self.t_end - t)
            if fired is None:
                return arcs, events, Outcome.FINISHED
            t, x = t + wait, _expm(arcs[-1].F, wait) @ x
            self._switch(t, x, modes, fired, events)
            if not self._settle(t, x, modes, events):
                return arcs, events, Outcome.MODE_CYCLE
        return arcs, events, Outcome.STEP_LIMIT

    def _switch(self, t: float, x: Floats, modes: list[Mode], fired: tuple[int, Mode], events: list[Event]) -> None:
        i, after = fired
        gap = self._gap(i)
        if after == Mode.BALLISTIC and gap @ x > NOISE * (np.abs(gap) @ np.abs(x)):
            after = Mode.FREE  # clearly above: one that is let go at its touch is at the surface but for rounding
        events.append(Event(t=t, contact=i, before=modes[i], after=after))
        modes[i] = after

    def _settle(self, t: float, x: Floats, modes: list[Mode], events: list[Event]) -> bool:
        """Switch what follows at the same instant; False if it never ends."""
        for _ in range(32):
            now = self._conditions(modes)
            noise = NOISE * (np.abs(now.functionals) @ np.abs(x))
            clear = now.functionals @ x < -noise
            if not (fired := [k for k, parts in enumerate(now.parts) if clear[parts].all()]):
                return True
            for k in fired:
                self._switch(t, x, modes, (now.rows[k], now.after[k]), events)
        return False

    def _next(self, arc: _Arc, left: float) -> tuple[float, tuple[int, Mode] | None]:
        """The first event on an arc: after how long, which row goes where."""
        now = self._conditions(list(arc.modes))
        step = 1.0 / (STEPS * max(np.abs(np.linalg.eigvals(arc.F)).max(), 0.25 * np.sqrt(self.a0.max()), 1.0))
        stack, x, begun = _powers(arc.F, step), arc.x, 0.0
        while begun < left:
            states = stack @ x
            values = states @ now.functionals.T
            worst = np.stack([values[:, parts].max(axis=1) for parts in now.parts], axis=1)
            if begun == 0.0:  # what has just switched stands at zero but for rounding
                worst[0] = np.maximum(worst[0], 0.0)
            found = [
                self._fall(arc.F, states, now.functionals[now.parts[j]], worst[:, j], step)
                for j in range(len(now.parts))
            ]
            first = int(np.argmin(found))
            if begun + found[first] < left:
                return begun + found[first], (now.rows[first], now.after[first])
            if np.isfinite(found[first]):
                break
            x, begun = states[BLOCK], begun + BLOCK * step
        return left, None

    def _fall(self, F: Floats, states: Floats, functionals: Floats, worst: Floats, step: float) -> float:
        """Where the largest of these functionals first falls below zero in a block; or infinity."""
        below = np.flatnonzero(worst[1:] < 0.0)
        last = int(below[0]) + 1 if len(below) else BLOCK
        inner = worst[1:last]
        close = CLOSE * np.ptp(worst)
        dips = (
            np.flatnonzero((inner <= worst[:last][: len(inner)]) & (inner <= worst[2 : last + 1]) & (inner < close)) + 1
        )
        for k in dips.tolist():
            for start in (k - 1, k):
                fine = np.array(
                    [(functionals @ _within(F, states[start], f * step / FINE)).max() for f in range(FINE + 1)]
                )
                under = np.flatnonzero(fine < 0.0)
                if len(under):
                    f = int(under[0])
                    return start * step + _bisect(F, states[start], functionals, (f - 1) * step / FINE, f * step / FINE)
        if not len(below):
            return np.inf
        return (last - 1) * step + _bisect(F, states[last - 1], functionals, 0.0, step)

    def __call__(self, t: Floats) -> Trajectory:
        """The motion at nondecreasing times t (m,), s; an event's instant stands for what is after it."""
        arcs, events, outcome = self._course
        times = np.asarray(t, dtype=np.float64)
        piece = np.searchsorted([arc.t for arc in arcs], times, side="right") - 1
        x = np.array([_expm(arcs[k].F, at - arcs[k].t) @ arcs[k].x for k, at in zip(piece, times, strict=True)])
        q, v = x[:, : self.n], x[:, self.n : -1]
        lam = np.zeros((len(times), len(self.H)))
        for j, k in enumerate(piece):
            if active := [i for i, mode in enumerate(arcs[k].modes) if mode == Mode.CONTACT]:
                lam[j, active] = self._multipliers(active) @ x[j]
        energy = [
            0.5 * np.einsum("ti,ij,tj->t", v, self.M, v),
            0.5 * np.einsum("ti,ij,tj->t", q, self.K, q) - q @ self.g,
        ]
        return Trajectory(
            t=times, q=q, v=v, gap=q @ self.H.T + self.c, lam=lam, energy=np.stack(energy, axis=1),
            mode=np.array([arcs[k].modes for k in piece], dtype=np.int8).reshape(lam.shape),
            events=tuple(events), steps=len(arcs), outcome=outcome,
            message="" if outcome.ok else outcome.advice,
        )  # fmt: skip


def _powers(F: Floats, step: float) -> Floats:
    """exp(F step k) for k = 0 .. BLOCK (BLOCK + 1, m, m)."""
    one, found = _expm(F, step), np.zeros((BLOCK + 1, *F.shape))
    found[0], found[1] = np.eye(len(F)), one
    known = 1
    while known < BLOCK:
        more = min(known, BLOCK - known)
        found[known + 1 : known + 1 + more] = found[known] @ found[1 : 1 + more]
        known += more
    return found


def _expm(F: Floats, t: float) -> Floats:
    return expm(F * t)


def _within(F: Floats, x: Floats, t: float) -> Floats:
    """exp(F t) x by its series, for a t within a step; longer ones by scaling."""
    if t * STEPS * np.abs(F).max() > 1e9:  # not met: the series' terms would lose digits
        return _expm(F, t) @ x
    total, term = x.copy(), x.copy()
    for k in range(1, SUMS):
        term = F @ term * (t / k)
        total += term
    return total


def _bisect(F: Floats, x: Floats, functionals: Floats, a: float, b: float) -> float:
    """Where the largest functional falls below zero between a and b."""
    for _ in range(HALVINGS):
        middle = 0.5 * (a + b)
        if not a < middle < b:
            break
        if (functionals @ _within(F, x, middle)).max() < 0.0:
            b = middle
        else:
            a = middle
    return b
