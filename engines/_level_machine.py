"""The level machine (docs/explanation/model.md), in plain Python: independent of the compiled core.

    FREE -> active        h <= 0 and (h' < 0 or h < 0); at rest on the surface if it would press
    active -> BALLISTIC   lam < 0 and h <= 0            active -> FREE        lam < 0 and h > 0
    BALLISTIC -> FREE     h > 0                         BALLISTIC -> active   h <= 0, h' < 0, lam would be > 0
    COLLISION -> CONTACT  max(b1, sqrt(b0)) |h'| + b0 |h| <= eps lam_i / (G_A^-1)_ii and lam_i > 0

active is COLLISION for a row with two sets of constants, else CONTACT; out of COLLISION, BALLISTIC is
COLLISION_SEPARATION. Velocities are continuous: every row follows its law in real time (the rule `resolved`).

h' counts as zero below 1e-9 of the largest rate seen, lam as zero below what rounding makes of
it. A gap below -1e-9 m that does not close was started in penetration: it is active if it would
press, else BALLISTIC.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Mode
from crossbody.cases.arrays import Floats
from crossbody.engines._log import Modes
from crossbody.engines._machines import ACTIVE, WATCHED, Fired, Passed, Rows, Settled, active, shared, switched

FREE, CONTACT, BALLISTIC = int(Mode.FREE), int(Mode.CONTACT), int(Mode.BALLISTIC)
COLLISION, SEPARATED = int(Mode.COLLISION), int(Mode.COLLISION_SEPARATION)
GAP, PUSH, SPENT = 0, 1, 2
"""The functions watched of a row: touch or leave; turn, release or catch; hand-over."""
SLOW, DEEP, EPS = 1e-9, 1e-9, 0.01
NOISE = 1e-13  # part of the terms of a row's acceleration that `Rows.pressure` says is their rounding
PUSHES, ULP = 1e-9, float(np.finfo(float).eps)  # part of the largest multiplier below which one is rounding
UNMET = 1e-6
"""Of what makes up a row's acceleration: by so much more than its law asks does it part where it
depends on others that contradict it, as of a sphere within another: no multipliers let both
follow their laws, and it would have to pull."""
UNMOVED = 1e-24
"""Of the largest diagonal entry of H M^-1 H^T: the rate of a row that nothing moves is rounding."""


@dataclass(slots=True)
class View:
    """One instant under one set of modes; all (nc,)."""

    h: Floats
    hd: Floats
    lam: Floats
    noise: Floats
    presses: NDArray[np.bool_]
    parts: NDArray[np.bool_]
    lags: NDArray[np.bool_]


def least_push(G: Floats, demand: Floats) -> Floats:
    """Return multipliers lam >= 0 (n,) with G lam >= demand and the least lam.G lam, by least distance programming.

    G (n, n) may be singular; where nothing fulfils the demand they are what comes nearest (Lawson
    and Hanson 1974, 23).
    """
    values, ways = np.linalg.eigh(G)
    size = float(np.abs(demand).max(initial=0.0)) or 1.0
    E = np.vstack([(ways * np.sqrt(np.maximum(values, 0.0))).T, demand / size])
    goal = np.zeros(len(E))
    goal[-1] = 1.0
    from scipy.optimize import nnls  # which takes longer to import than most runs

    found, _ = nnls(E, goal)
    return size * found / max(1.0 - float(E[-1] @ found), ULP)


class LevelMachine:
    """Guards on levels, evaluated until nothing changes.

    One run uses one machine: it remembers the largest rate that it saw, and which free gaps are closed.

    Args:
        rows: of the mechanism.
        rtol: to which positions are known; rows that close touch together where it cannot tell
            which comes first.
        fast: rate that counts as seen from the start, of bodies that move along their rows and not against
            them: what is let go there, as far as positions are known, does not touch before it closes.
    """

    def __init__(self, rows: Rows, rtol: float = 0.0, fast: float = 0.0) -> None:
        self.rows, self.rtol = rows, rtol
        self.own = switched(rows)
        self.slow, self.along = SLOW * fast, fast > 0.0
        self._closed: set[int] = set()
        self._unmoved: set[int] = set()
        self._order: dict[Modes, tuple[NDArray[np.intp], list[int]]] = {}

    def watch(self, q: Floats, v: Floats, modes: Modes, out: NDArray[Any]) -> None:
        """FREE: h and h' (zero where a dip is deepest); active: lam; BALLISTIC: -h, and the catch."""
        rows = self.rows
        h, hd = rows.gaps(q, v)
        free, others = self._sorted(modes)
        vd, lam = rows.accelerate(q, v, modes) if others and any(modes) else (None, None)
        out[:] = 1.0
        out[WATCHED * free + GAP] = h[free]
        out[WATCHED * free + PUSH] = np.maximum(hd[free], h[free] - rows.near[free])
        for i in self._closed.intersection(free.tolist()):
            out[WATCHED * i + GAP] = max(h[i], hd[i] + self.slow)
        out[WATCHED * np.array([*self._unmoved], dtype=int) + PUSH] = 1.0
        below = [i for i in others if modes[i] not in ACTIVE]
        pressure = dict(zip(below, rows.pressure(q, v, vd, below)[0], strict=True)) if vd is not None and below else {}
        for i in others:
            mode, at = modes[i], WATCHED * i
            if mode in ACTIVE and lam is not None:
                out[at + PUSH] = lam[i]
                out[at + SPENT] = self._left(q, v, modes, lam, i) if mode == COLLISION else 1.0
            elif vd is not None:
                out[at + GAP] = -h[i]
                out[at + PUSH] = max(hd[i] + self.slow, -pressure[i])

    def _sorted(self, modes: Modes) -> tuple[NDArray[np.intp], list[int]]:
        """The rows that a machine decides about: free ones, and others; found once a set of modes."""
        if modes not in self._order:
            free = [i for i in self.own if modes[i] == FREE]
            self._order[modes] = np.array(free, dtype=np.intp), [i for i in self.own if modes[i] != FREE]
        return self._order[modes]

    def settle(self, q: Floats, v: Floats, modes: Modes, fired: Fired = frozenset()) -> Settled:
        """See `crossbody.engines._machines.Machine`."""
        h, hd = (x.copy() for x in self.rows.gaps(q, v))
        self.slow = max(self.slow, SLOW * float(np.abs(hd[list(self.own)]).max(initial=0.0)))
        fired |= self._touching_too(q, h, hd, modes, fired) | self._catching_too(q, v, h, hd, modes, fired)
        modes, passed = self._fire(h, modes, fired)
        h[[i for i, which in fired if which == GAP]] = 0.0
        modes, more, cycle = self._iterate(q, v, h, hd, modes)
        near = self._closed | {i for i, before, after, _ in (*passed, *more) if before != FREE == after}
        known = self._known(q) if self.along else 0.0  # just above its surface or just below is rounding
        self._closed = {i for i in self.own if h[i] <= 0.0 or (i in near and h[i] <= known)}
        return Settled(modes, v, (*passed, *more), cycle=cycle)

    def _fire(self, h: Floats, modes: Modes, fired: Fired) -> tuple[Modes, list[Passed]]:
        """Make the transitions that were located, never deciding them again from a value at round-off."""
        after, passed = list(modes), []
        for i, which in sorted(fired):
            mode = modes[i]
            if mode in ACTIVE:
                after[i] = CONTACT if which == SPENT else self._released(mode, float(h[i]))
            elif mode == FREE:
                after[i] = self._activated(i) if which == GAP else FREE
            else:
                after[i] = FREE if which == GAP else self._activated(i)
            if after[i] != mode:
                passed.append((i, mode, after[i], 0.0))
        return shared(self.rows, after), passed

    def _known(self, q: Floats) -> float:
        """Return to what gaps are known, as far as the tolerance of the positions tells."""
        return self.rtol * float(np.abs(q).max())

    def _touching_too(self, q: Floats, h: Floats, hd: Floats, modes: Modes, fired: Fired) -> Fired:
        """The free rows that touch together with one that was located to."""
        if not any(modes[i] == FREE and which == GAP for i, which in fired):
            return frozenset()
        closing = (np.abs(h) <= self._known(q)) & (hd < -self.slow)
        return frozenset((i, GAP) for i in self.own if modes[i] == FREE and closing[i])

    def _catching_too(self, q: Floats, v: Floats, h: Floats, hd: Floats, modes: Modes, fired: Fired) -> Fired:
        """The rows below the surface that would press as one is caught, and whose rates are zero as well.

        Of rows that one motion moves alike the one that was located first need not be the one
        that bears: the law of another may ask for more.
        """
        below = [i for i in self.own if modes[i] != FREE and modes[i] not in ACTIVE]
        if not any(i in below and which == PUSH for i, which in fired):
            return frozenset()
        still = [i for i in below if h[i] <= 0.0 and hd[i] <= self.slow]
        if not still:  # each of them lifts, but for rounding
            return frozenset()
        press, noise = self.rows.pressure(q, v, self.rows.accelerate(q, v, modes)[0], still)
        return frozenset((i, PUSH) for i, one, rounding in zip(still, press, noise, strict=True) if one > rounding)

    def _iterate(self, q: Floats, v: Floats, h: Floats, hd: Floats, modes: Modes) -> tuple[Modes, list[Passed], bool]:
        """All rows together; one at a time once a set of modes has repeated; a cycle if that repeats too.

        Then the set of the least motion, if it is consistent: many rows of one body, of which few
        can follow their law. It is taken too where rows that contradict each other push, and one
        of them lags behind its law.
        """
        seen, passed, one_by_one = {modes}, list[Passed](), False
        deep = max(DEEP, self._known(q))
        while True:
            view = self._look(q, v, h, hd, modes)
            wanted = self._wanted(view, modes, deep)
            moved = [i for i in self.own if wanted[i] != modes[i]][: 1 if one_by_one else None]
            lags = not moved and bool(view.lags[list(self.own)].any())
            if not moved and not lags:
                return modes, passed, False
            passed += [(i, modes[i], wanted[i], 0.0) for i in moved]
            modes = shared(self.rows, [wanted[i] if i in moved else mode for i, mode in enumerate(modes)])
            if lags or modes in seen:
                if lags or one_by_one:
                    found = self._least(q, v, h, hd, modes)
                    moved = [i for i in self.own if found[i] != modes[i]]
                    passed += [(i, modes[i], found[i], 0.0) for i in moved]
                    return found, passed, self._wanted(self._look(q, v, h, hd, found), found, deep) != list(found)
                one_by_one = True
                seen.clear()
            seen.add(modes)

    def _least(self, q: Floats, v: Floats, h: Floats, hd: Floats, modes: Modes) -> Modes:
        """Return the modes in which rows that close or are active push, and none falls behind its law, least of all.

        Gauss's principle: of the accelerations that no such row forbids the one nearest to that without them.
        """
        tried = [i for i in self.own if modes[i] in ACTIVE or (h[i] <= 0.0 and hd[i] <= self.slow)]
        found = list(modes)
        for i in tried:
            found[i] = self._released(modes[i], float(h[i]))
        off = shared(self.rows, found)
        demand = self.rows.pressure(q, v, self.rows.accelerate(q, v, off)[0])[0]
        G, on = self.rows.delassus(q), list(active(off))
        if on:
            G = G - G[:, on] @ np.linalg.pinv(G[np.ix_(on, on)], hermitian=True) @ G[on]
        pushing = least_push(G[np.ix_(tried, tried)], demand[tried])
        for i, push in zip(tried, pushing, strict=True):
            if push > PUSHES * pushing.max():
                found[i] = modes[i] if modes[i] in ACTIVE else self._activated(i)
        return shared(self.rows, found)

    def _look(self, q: Floats, v: Floats, h: Floats, hd: Floats, modes: Modes) -> View:
        """Only of what is held or may come to be does it count how it presses."""
        vd, lam = self.rows.accelerate(q, v, modes)
        asked = [i for i in self.own if modes[i] in ACTIVE or h[i] <= 0.0]
        press, noise = np.zeros(len(h)), np.zeros(len(h))
        if asked:
            press[asked], noise[asked] = self.rows.pressure(q, v, vd, asked)
        G = np.diag(self.rows.delassus(q))
        # What is zero by symmetry is so but for rounding of what the others push with.
        noise[asked] += NOISE * np.sqrt(G[asked]) * float(np.sqrt(G) @ np.abs(lam))
        self._unmoved = set(np.flatnonzero(UNMOVED * G.max(initial=0.0) >= G).tolist())
        allowed = np.divide(noise, G, out=np.full_like(noise, np.inf), where=G > 0.0)  # none moves a row: any
        two = np.array(self.rows.fast, dtype=bool)  # sets of constants: what its law asks depends on the mode
        unmet = UNMET * (noise / NOISE + np.abs(lam) * G)
        on = np.isin(modes, ACTIVE)
        return View(h, hd, lam, allowed, press > noise, ~two & (press < -unmet), on & ~two & (press > unmet))

    def _wanted(self, view: View, modes: Modes, deep: float) -> list[int]:
        """Where every row belongs by the guards that hold now."""
        after = list(modes)
        for i in self.own:
            if modes[i] in ACTIVE:
                pulls = view.lam[i] < -view.noise[i] or view.parts[i]
                after[i] = self._released(modes[i], float(view.h[i])) if pulls else modes[i]
            else:
                after[i] = self._inactive(view, modes[i], i, deep)
        return after

    def _inactive(self, view: View, mode: int, i: int, deep: float) -> int:
        h, hd, presses = view.h[i], view.hd[i], view.presses[i]
        if h > 0.0:
            return FREE
        closing = hd < -self.slow
        if mode != FREE:
            return self._activated(i) if closing and presses else mode
        if closing:
            return self._activated(i)
        if h < -deep:
            return self._activated(i) if presses else BALLISTIC
        return self._activated(i) if hd <= self.slow and presses else FREE

    def _activated(self, i: int) -> int:
        return COLLISION if self.rows.fast[i] else CONTACT

    def _released(self, mode: int, h: float) -> int:
        if h > 0.0:
            return FREE
        return SEPARATED if mode == COLLISION else BALLISTIC

    def _left(self, q: Floats, v: Floats, modes: Modes, lam: Floats, i: int) -> float:
        """What is left of the elastic part of lam before COLLISION hands over to CONTACT, m/s^2."""
        on = active(modes)
        inverse = np.linalg.inv(self.rows.delassus(q)[np.ix_(on, on)])
        j = on.index(i)
        return float(self.rows.elastic(q, v)[i] - EPS * max(lam[i], 0.0) / inverse[j, j])
