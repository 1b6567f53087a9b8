"""Forces of one set of modes, of contacts with Coulomb friction and rows with dry friction.

With G = H M^-1 H^T of all rows in contact and b what their laws ask for, a set of modes has G lam = b in the rows that
are solved for, and lam_t = -mu lam_n s in those that slide. Where these depend on each other the normal rows come
first, with multipliers of least norm, and the sticking ones in what they leave, with least sum |lam_t|^2 / (mu lam_n).
Ranks are told by singular values.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Mode
from crossbody.reference.kinds import Floats, Index

if TYPE_CHECKING:
    from crossbody.reference.sundials.sliding import Seen, Sliding

DEPENDENT = 1e-10  # singular value over the largest, below which rows depend on each other
Flags = NDArray[np.bool_]
ROUNDED = 1e-13  # part of its largest terms by which a sum of what multipliers do to a row may be off
LIGHT, SHARINGS = 1e-12, 3  # least part of the largest bound, and times that loads are shared anew
MOST = 400  # projections between loads that hold and loads that can be borne


class Unknowns:
    """What a set of modes solves for, by the places of the rows seen.

    Attributes:
        places: of the unknowns, sticking rows last.
        count: how many are no sticking rows.
        slides: contacts that slide, with the places of their normal row and of their tangential ones.
        dry: rows that slide with a bound of their own, with their places.
        own: contact of each sticking row, by its number among those with friction; one beyond if it has none.
        bears: (sticking rows, contacts) 1 where a row is that contact's.
        loads: unknown that is the normal row of each such contact, itself where its bound is its own.
        free: whether it is.
        mu: its coefficient, or its bound.
    """

    def __init__(self, sliding: Sliding, seen: Seen, modes: Mapping[int, Mode]) -> None:
        first, last = list[int](), list[int]()
        self.slides, self.dry = list[tuple[int, int, list[int]]](), list[tuple[int, int]]()
        for row, k in seen.at.items():
            i = sliding.normal.get(row, row)
            if i in sliding.ways and modes[i] == Mode.SLIP:
                if i in sliding.dry:
                    self.dry.append((i, k))
                elif row == i:
                    self.slides.append((i, k, [seen.at[t] for t in sliding.ways[i]]))
                    first.append(k)
            else:
                (first if row not in sliding.normal and row == i else last).append(k)
        self.places, self.count = first + last, len(first)
        self.grid = np.ix_(self.places, self.places)
        beside = [seen.at[sliding.normal.get(seen.rows[k], seen.rows[k])] for k in self.places]
        self.beside = np.array(beside, dtype=int)
        owners = [sliding.normal.get(seen.rows[k], -1) for k in last]
        bearing = [i for i in dict.fromkeys(owners) if i >= 0]
        self.own = np.array([bearing.index(i) if i >= 0 else len(bearing) for i in owners], dtype=int)
        self.loads = np.array([self.places.index(seen.at[i]) for i in bearing], dtype=int)
        self.free = np.array([i in sliding.dry for i in bearing], dtype=bool)
        self.mu = sliding.mu[bearing]
        self.bears = (self.own[:, None] == np.arange(len(bearing))).astype(float)


class Balance:
    """Multipliers of a set of modes at one instant, or at several; see `Sliding.balance`.

    Attributes:
        A: matrix of the unknowns, scaled by their sizes.
        size: these.
    """

    def __init__(self, sliding: Sliding, seen: Seen, ways: Mapping[int, Floats], unknowns: Unknowns) -> None:
        self.sliding, self.seen, self.ways, self.unknowns = sliding, seen, ways, unknowns
        columns, own = seen.G.copy(), np.diagonal(seen.G, axis1=-2, axis2=-1)
        for i, k, places in unknowns.slides:
            columns[..., k] -= sliding.mu[i] * _times(seen.G[..., places], ways[i])
        largest = np.maximum(own[..., unknowns.places], own[..., unknowns.beside])
        self.size = np.sqrt(np.maximum(largest, np.finfo(float).tiny))
        self._scale = self.size[..., :, None] * self.size[..., None, :]
        self.A: Floats = _block(columns, *unknowns.grid) / self._scale
        self._jams: dict[bytes, Floats] = {}

    def one(self, k: int) -> Balance:
        """Of several instants one."""
        return Balance(self.sliding, self.seen.one(k), {i: way[k] for i, way in self.ways.items()}, self.unknowns)

    def forces(self, pulled: bool = True) -> Floats:
        """Multipliers (m,) of the rows seen; sticking ones may be `pulled` back to where they do not slip."""
        seen, known = self.seen, self.unknowns
        lam = np.zeros(seen.bare.shape)
        b = seen.bare + seen.pull if pulled else seen.bare
        if known.dry:
            for i, k in known.dry:
                lam[..., k] = -self.sliding.mu[i] * self.ways[i][..., 0]
            b = b - _times(seen.G, lam)
        if not known.places:  # all that there is slides with a bound of its own
            return lam
        lam[..., known.places] = self._solve(b[..., known.places] / self.size) / self.size
        for i, k, places in known.slides:
            lam[..., places] = -self.sliding.mu[i] * lam[..., k, None] * self.ways[i]
        return lam

    @cached_property
    def _factors(self) -> Any:
        return np.linalg.svd(self.A)

    def _solve(self, b: Floats) -> Floats:
        left, values, right = self._factors
        small = values <= DEPENDENT * values[..., :1]
        dependent = small[..., -1]
        if not dependent.any():
            return _times(right.swapaxes(-1, -2), _times(left.swapaxes(-1, -2), b) / values)
        self.sliding.redundant = max(self.sliding.redundant, int(small.sum(axis=-1).max()))
        if dependent.all():
            return self._in_turn(b)
        return np.array([self.one(k)._solve(b[k]) for k in range(len(b))])

    @cached_property
    def _turns(self) -> tuple[Floats, Floats, Floats]:
        """Inverse of the normal rows' part, what they have of the sticking ones, and what they leave of these."""
        N, S, A = slice(0, self.unknowns.count), slice(self.unknowns.count, None), self.A
        inverse = np.asarray(np.linalg.pinv(A[..., N, N], rcond=DEPENDENT), dtype=np.float64)
        held = inverse @ A[..., N, S]
        left, values, right = np.linalg.svd(A[..., S, S] - A[..., S, N] @ held)
        values[values <= DEPENDENT * self._factors[1][..., :1]] = 0.0  # rounding of rows that the normal ones move
        return inverse, held, (left * values[..., None, :]) @ right

    def _in_turn(self, b: Floats) -> Floats:
        """Solve for the normal rows, and in what they leave for the others."""
        count = self.unknowns.count
        inverse, held, B = self._turns
        pressed = _times(inverse, b[..., :count])
        x = np.concatenate([pressed, np.zeros_like(b[..., count:])], axis=-1)
        if not len(self.unknowns.own):
            return x
        rest = b[..., count:] - _times(self.A[..., count:, :count], pressed)
        for _ in range(SHARINGS):
            bound = self._spread(self._bounds(x), 0.0) * self.size[..., count:] ** 2
            most = bound.max(axis=-1, keepdims=True)
            weight = np.sqrt(np.where(most > 0.0, np.maximum(bound, LIGHT * most), 1.0))
            if x.ndim == 1:
                x[count:] = weight * np.linalg.lstsq(B * weight, rest, rcond=DEPENDENT)[0]
            else:
                least = np.asarray(np.linalg.pinv(B * weight[..., None, :], rcond=DEPENDENT))
                x[..., count:] = weight * _times(least, rest)
            x[..., :count] = pressed - _times(held, x[..., count:])
        if x.ndim == 1:
            return self._borne(pressed, x)
        for k in np.flatnonzero(self._exceeds(x)):
            x[k] = self.one(int(k))._borne(pressed[k], x[k])
        return x

    def _bounds(self, x: Floats) -> Floats:
        """The most that friction of each contact that sticks can be, N."""
        known = self.unknowns
        loads = np.maximum(x[..., known.loads] / self.size[..., known.loads], 0.0)
        most: Floats = known.mu * np.where(known.free, 1.0, loads)
        return most

    def _spread(self, values: Floats, other: float) -> Floats:
        """What belongs to a contact, by its sticking rows; `other` where they have no friction."""
        every = np.concatenate([values, np.full((*values.shape[:-1], 1), other)], axis=-1)
        return every[..., self.unknowns.own]

    def _force(self, y: Floats) -> Floats:
        """Friction of each contact that sticks, by the unknowns of its rows, N."""
        known = self.unknowns
        size: Floats = np.sqrt((y / self.size[..., known.count :]) ** 2 @ known.bears)
        return size

    def contradiction(self, lam: Floats) -> Floats:
        """By how many times what is allowed the normal rows that are solved for are off their laws under lam (m,)."""
        places = self.unknowns.places[: self.unknowns.count]
        off = np.abs(_times(self.seen.G, lam) - self.seen.bare - self.seen.pull)
        known = self.seen.allowed + ROUNDED * _times(np.abs(self.seen.G), np.abs(lam)) + np.finfo(float).tiny
        most: Floats = (off / known)[..., places].max(axis=-1, initial=0.0)
        return most

    def _exceeds(self, x: Floats) -> Flags:
        return np.asarray((self._force(x[..., self.unknowns.count :]) > self._bounds(x)).any(axis=-1))

    def _borne(self, pressed: Floats, x: Floats) -> Floats:
        """Share the same load so that no contact bears more than it can, where one would; as it is if one has to.

        By Douglas and Rachford: reflections at the sharings of the load, and at those that contacts can bear.
        """
        if not self._exceeds(x):
            return x
        _, held, B = self._turns
        own, least = x[self.unknowns.count :], np.linalg.pinv(B, rcond=DEPENDENT) @ B
        y = own.copy()
        for _ in range(MOST):
            shared = y - least @ (y - own)
            found = np.concatenate([pressed - held @ shared, shared])
            if not self._exceeds(found):
                return found
            back, most = 2.0 * shared - y, self._bounds(found)
            force = self._force(back)
            within = np.where(force > most, most / np.where(force > 0.0, force, 1.0), 1.0)
            y = y + back * self._spread(within, 1.0) - shared
        return x

    def jam(self, i: int) -> Floats:
        """Eigenvalues of what forces of the contacts that contact i bears on do to their rows: none jams, none is < 0.

        Of one contact alone it is Painleve's p. Rows that depend on each other are moved as by springs that are alike,
        so that only what independent ones are moved by counts.
        """
        seen, places = self.seen, self.unknowns.places
        owners = [self.sliding.normal.get(row, row) for row in seen.rows]
        moved = (seen.G != 0.0).reshape(-1, *seen.G.shape[-2:]).any(axis=0) | np.equal.outer(owners, owners)
        reached = moved[seen.at[i]]
        while (more := moved[reached].any(axis=0)).sum() > reached.sum():
            reached = more
        if (key := reached.tobytes()) not in self._jams:
            self._jams[key] = self._eigenvalues(np.flatnonzero(reached[places]))
        return self._jams[key]

    def _eigenvalues(self, of: Index) -> Floats:
        a, b = np.ix_(of, of)
        values, vectors = np.linalg.eigh(_block(_block(self.seen.G, *self.unknowns.grid) / self._scale, a, b))
        ranks = (values > DEPENDENT * values[..., -1:]).sum(axis=-1)
        if (rank := int(ranks.min())) < ranks.max():
            few = [np.prod(self.one(k)._eigenvalues(of)) for k in range(len(ranks))]
            return np.array(few)[:, None]
        base = vectors[..., len(of) - rank :]
        found: Floats = np.linalg.eigvals(base.swapaxes(-1, -2) @ self.A[..., a, b] @ base)
        return found


def _times(A: Floats, x: Floats) -> Floats:
    product: Floats = (A @ x[..., None])[..., 0]
    return product


def _block(A: Floats, rows: Index, columns: Index) -> Floats:
    block: Floats = A[..., rows, columns]
    return block
