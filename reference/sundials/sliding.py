"""Coulomb friction of contacts, dry friction of rows: forces of any set of modes, by singular values (spec 7.1, 7.3).

With G = H M^-1 H^T of all rows in contact and b what their laws ask for, a set of modes has G lam = b in the rows that
are solved for, and lam_t = -mu lam_n s in those that slide. Where these depend on each other the normal rows come
first, with multipliers of least norm, and the sticking ones in what they leave, with least sum |lam_t|^2 / (mu lam_n).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from crossbody.cases import Mode, Outcome
from crossbody.reference._system import System
from crossbody.reference.kinds import Floats
from crossbody.reference.sundials.equations import Ended, Equations

DEPENDENT = 1e-10  # singular value over the largest, below which rows depend on each other
LIGHT, SHARINGS = 1e-12, 3  # least part of the largest bound, and times that loads are shared anew
MOST = 400  # projections between loads that hold and loads that can be borne


@dataclass(frozen=True, slots=True)
class Seen:
    """The rows in contact at one instant.

    Attributes:
        rows: m of them, rising.
        at: place of each.
        G: (m, m) how their multipliers accelerate them, 1/kg.
        bare: (m,) what their multipliers must do, without what pulls sticking rows back, m/s^2.
        pull: (m,) that.
        rate: (m,) their rates against what the surface does by itself, m/s.
        X: (n, m) M^-1 H^T.
        vd: (n,) acceleration without them.
    """

    rows: list[int]
    at: Mapping[int, int]
    G: Floats
    bare: Floats
    pull: Floats
    rate: Floats
    X: Floats
    vd: Floats


class Sliding:
    """Evaluates sets of modes of a system with friction.

    Args:
        system: with rows that have friction, and none that is always on.
        equations: of its run; its counter of evaluations goes on.
    """

    def __init__(self, system: System, equations: Equations) -> None:
        self.equations, self.slow = equations, np.asarray(system.alpha)
        self.mu, self.drift = np.asarray(system.friction), np.asarray(system.drift)
        first, count = np.asarray(system.tangent), np.asarray(system.tangents)
        self.ways = {i: list(range(first[i], first[i] + count[i])) for i in np.flatnonzero(count).tolist()}
        self.normal = {t: i for i, ways in self.ways.items() for t in ways}
        self.dry = set(np.flatnonzero(system.dry).tolist())
        self.tied: dict[int, list[int]] = {}
        for t, i in enumerate(np.asarray(system.follows).tolist()):
            if i >= 0 and t not in self.normal:
                self.tied.setdefault(i, []).append(t)
        self.redundant = 0

    def see(self, t: float, q: Floats, v: Floats, contacts: list[int]) -> Seen:
        """Evaluate the rows of these contacts.

        Raises:
            Ended: NOT_FINITE or ILL_POSED.
        """
        e = self.equations
        rows = sorted({row for i in contacts for row in (i, *self.ways.get(i, ()), *self.tied.get(i, ()))})
        with e._selected(rows):
            M, f = e.terms(t, q, v)
            H, h, Hdv = (a.copy() for a in e.rows(t, q, v))
        try:
            solved = np.linalg.solve(M, np.column_stack([H.T, f]))
        except np.linalg.LinAlgError:
            raise Ended(Outcome.ILL_POSED, rows) from None
        if not np.isfinite(solved).all():
            raise Ended(Outcome.NOT_FINITE)
        X: Floats = np.asarray(solved[:, :-1], dtype=np.float64)
        vd, rate = np.asarray(solved[:, -1], dtype=np.float64), H @ v - self.drift[rows]
        a0, a1, a2 = self.slow[rows].T
        law = a1 * rate + (a0 + a2 * h * h) * h
        slides = np.array([row in self.normal for row in rows], dtype=bool)
        bare = -(H @ vd + Hdv) - np.where(slides, 0.0, law)
        return Seen(rows, {row: k for k, row in enumerate(rows)}, H @ X, bare, np.where(slides, -law, 0.0), rate, X, vd)

    def bound(self, seen: Seen, lam: Floats, i: int) -> float:
        """The most that friction of contact i can be under the multipliers lam (m,), N."""
        return float(self.mu[i] if i in self.dry else self.mu[i] * lam[seen.at[i]])

    def slip(self, seen: Seen, i: int) -> Floats:
        """Slip velocity (1,) or (2,) of contact i, m/s."""
        return seen.rate[[seen.at[t] for t in self.ways[i]]]

    def system_of(
        self, seen: Seen, modes: Mapping[int, Mode], ways: Mapping[int, Floats]
    ) -> tuple[list[int], int, Floats, Floats]:
        """Places of the unknowns, how many of them are no sticking rows, their scaled matrix, and their sizes."""
        columns, first, last = seen.G.copy(), list[int](), list[int]()
        for row, k in seen.at.items():
            i = self.normal.get(row, row)
            if i in self.ways and modes[i] == Mode.SLIP:
                if row == i and i not in self.dry:
                    places = [seen.at[t] for t in self.ways[i]]
                    columns[:, k] -= self.mu[i] * (seen.G[:, places] @ ways[i])
                    first.append(k)
            else:
                (first if row not in self.normal and row == i else last).append(k)
        places = first + last
        own = np.diag(seen.G)
        beside = np.array([seen.at[self.normal.get(seen.rows[k], seen.rows[k])] for k in places], dtype=int)
        size = np.sqrt(np.maximum(np.maximum(own[places], own[beside]), np.finfo(float).tiny))
        return places, len(first), columns[np.ix_(places, places)] / np.outer(size, size), size

    def forces(self, seen: Seen, modes: Mapping[int, Mode], ways: Mapping[int, Floats], pulled: bool = True) -> Floats:
        """Multipliers (m,) of the rows seen.

        Args:
            seen: the rows of these contacts.
            modes: STICK, SLIP, or CONTACT of one without friction, of every contact.
            ways: direction of slip (1,) or (2,) of those that slide.
            pulled: whether sticking rows are pulled back to where they do not slip.
        """
        lam = np.zeros(len(seen.rows))
        if not len(lam):
            return lam
        places, count, A, size = self.system_of(seen, modes, ways)
        for i in (i for i in self.dry & ways.keys() if modes[i] == Mode.SLIP):
            lam[seen.at[i]] = -self.mu[i] * ways[i][0]
        b = ((seen.bare + seen.pull if pulled else seen.bare) - seen.G @ lam)[places] / size
        if not places:  # all that there is slides with a bound of its own
            return lam
        left, values, right = np.linalg.svd(A)
        if values[-1] > DEPENDENT * values[0]:
            x = right.T @ ((left.T @ b) / values)
        else:
            self.redundant = max(self.redundant, int((values <= DEPENDENT * values[0]).sum()))
            x = self._in_turn(seen, places, count, A, b, size)
        lam[places] = x / size
        for i, way in ways.items():
            if modes[i] == Mode.SLIP and i not in self.dry:
                lam[[seen.at[t] for t in self.ways[i]]] = -self.mu[i] * lam[seen.at[i]] * way
        return lam

    def _in_turn(self, seen: Seen, places: list[int], count: int, A: Floats, b: Floats, size: Floats) -> Floats:
        """Solve for the first `count` unknowns, and in what they leave for the others."""
        N, S = slice(0, count), slice(count, None)
        inverse = np.linalg.pinv(A[N, N], rcond=DEPENDENT)
        x = np.zeros(len(b))
        x[N] = inverse @ b[N]
        if len(b) == count:
            return x
        B, rest = A[S, S] - A[S, N] @ inverse @ A[N, S], b[S] - A[S, N] @ x[N]
        pressed, bound = x[N].copy(), np.zeros(len(b) - count)
        for _ in range(SHARINGS):
            for k, place in enumerate(places[count:]):
                i = self.normal.get(seen.rows[place], -1)
                load = x[places.index(seen.at[i])] / size[places.index(seen.at[i])] if i >= 0 else 0.0
                load = 1.0 if i in self.dry else load
                bound[k] = (self.mu[i] if i >= 0 else 1.0) * max(load, 0.0) * size[count + k] ** 2
            most = bound.max()
            weight = np.sqrt(np.maximum(bound, LIGHT * most) if most > 0.0 else np.ones(len(bound)))
            x[S] = weight * (np.linalg.pinv(B * weight, rcond=DEPENDENT) @ rest)
            x[N] = pressed - inverse @ A[N, S] @ x[S]
        borne = self._borne(seen, places, count, pressed, inverse @ A[N, S], B, x, size)
        return x if borne is None else borne

    def _borne(
        self, seen: Seen, places: list[int], count: int, pressed: Floats, beside: Floats, B: Floats, x: Floats,
        size: Floats,
    ) -> Floats | None:  # fmt: skip
        """Share the same load so that no contact bears more than it can, where one would; None if none would, or must.

        By Douglas and Rachford: reflections at the sharings of the load, and at those that contacts can bear.
        """
        owner = [self.normal.get(seen.rows[k], -1) for k in places[count:]]
        groups = {i: [k for k, other in enumerate(owner) if other == i] for i in dict.fromkeys(owner) if i >= 0}
        scale, normals = size[count:], {i: places.index(seen.at[i]) for i in groups if i not in self.dry}

        def bounds(x: Floats) -> dict[int, float]:
            loads = {i: x[normals[i]] / size[normals[i]] if i in normals else 1.0 for i in groups}
            return {i: self.mu[i] * max(load, 0.0) for i, load in loads.items()}

        def within(y: Floats, bound: dict[int, float]) -> Floats:
            y = y / scale
            for i, rows in groups.items():
                force = float(np.linalg.norm(y[rows]))
                y[rows] *= min(1.0, bound[i] / force) if force > 0.0 else 1.0
            return y * scale

        def exceeds(x: Floats) -> bool:
            most = bounds(x)
            return any(float(np.linalg.norm((x[count:] / scale)[rows])) > most[i] for i, rows in groups.items())

        if not exceeds(x):
            return None
        own, least = x[count:].copy(), np.linalg.pinv(B, rcond=DEPENDENT) @ B
        y = own.copy()
        for _ in range(MOST):
            found = np.concatenate([pressed - beside @ (shared := y - least @ (y - own)), shared])
            if not exceeds(found):
                return found
            y = y + within(2.0 * shared - y, bounds(found)) - shared
        return None

    def jam(self, seen: Seen, modes: Mapping[int, Mode], ways: Mapping[int, Floats], i: int) -> Floats:
        """Eigenvalues of what forces of the contacts that contact i bears on do to their rows: none jams, none is < 0.

        Of one contact alone it is Painleve's p. Rows that depend on each other are moved as by springs that are alike,
        so that only what independent ones are moved by counts.
        """
        places, _, A, size = self.system_of(seen, modes, ways)
        owners = [self.normal.get(row, row) for row in seen.rows]
        moved = (seen.G != 0.0) | np.equal.outer(owners, owners)
        reached = moved[seen.at[i]]
        while (more := moved[reached].any(axis=0)).sum() > reached.sum():
            reached = more
        both = np.ix_(reached[places], reached[places])
        A, G = A[both], (seen.G[np.ix_(places, places)] / np.outer(size, size))[both]
        values, vectors = np.linalg.eigh(G)
        base = vectors[:, values > DEPENDENT * values[-1]]
        found: Floats = np.linalg.eigvals(base.T @ A @ base)
        return found
