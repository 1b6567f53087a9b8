"""Rows in contact where some have Coulomb friction, as they stand at one instant (docs/explanation/contacts.md)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from crossbody.cases import Mode, Outcome
from crossbody.reference._system import System
from crossbody.reference.kinds import Floats
from crossbody.reference.sundials.balance import Balance, Unknowns
from crossbody.reference.sundials.equations import Ended, Equations
from crossbody.reference.sundials.sharing import CONSISTENT, STATE

DRIFT = 1e-6  # part of positions and velocities by which loops may hold a contact off its surface
HELD = 1e-10  # part of what moves a row without loops, below which it is rounding


@dataclass(frozen=True, slots=True)
class Seen:
    """The rows in contact at one instant, or at b instants: then all arrays have that many before their own shape.

    Attributes:
        rows: m of them, rising.
        at: place of each.
        G: (m, m) how their multipliers accelerate them, 1/kg.
        bare: (m,) what their multipliers must do, without what pulls sticking rows back, m/s^2.
        pull: (m,) that.
        rate: (m,) their rates against what the surface does by itself, m/s.
        X: (n, m) what their multipliers do to v', M^-1 H^T where no loops are.
        vd: (n,) acceleration without them.
        borne: (l, m) what their multipliers do to those of loops.
        own: (l,) these without them.
        allowed: (m,) by how much a row may be off what it must do where rows depend on each other, m/s^2.
    """

    rows: list[int]
    at: Mapping[int, int]
    G: Floats
    bare: Floats
    pull: Floats
    rate: Floats
    X: Floats
    vd: Floats
    borne: Floats
    own: Floats
    allowed: Floats

    def part(self, rows: list[int]) -> Seen:
        """Only some of the rows."""
        if rows == self.rows:
            return self
        keep = [self.at[row] for row in rows]
        at = {row: k for k, row in enumerate(rows)}
        G, X, (a, b) = self.G, self.X[..., keep], np.ix_(keep, keep)
        return Seen(
            rows, at, G[..., a, b], self.bare[..., keep], self.pull[..., keep], self.rate[..., keep], X, self.vd,
            self.borne[..., keep], self.own, self.allowed[..., keep],
        )  # fmt: skip

    def one(self, k: int) -> Seen:
        """Of several instants one."""
        own = self.G, self.bare, self.pull, self.rate, self.X, self.vd, self.borne, self.own, self.allowed
        return Seen(self.rows, self.at, *(x[k] for x in own))


class Sliding:
    """Evaluates rows in contact, and sets of modes of theirs.

    Args:
        system: with rows that have friction.
        equations: of its run; its counter of evaluations goes on.
        rtol: relative tolerance of the run.

    Attributes:
        ways: tangential rows of every contact with friction.
        normal: its contact, of every tangential row.
        dry: rows with dry friction of their own, which are their own contacts.
        tied: other rows that follow each contact.
        owner: the contact of any row.
        loops: rows that are always on.
    """

    def __init__(self, system: System, equations: Equations, rtol: float) -> None:
        self.part, self.equations, self.slow = max(CONSISTENT, rtol), equations, np.asarray(system.alpha)
        self.mu, self.drift = np.asarray(system.friction), np.asarray(system.drift)
        first, count = np.asarray(system.tangent), np.asarray(system.tangents)
        self.ways = {i: list(range(first[i], first[i] + count[i])) for i in np.flatnonzero(count).tolist()}
        self.normal = {t: i for i, ways in self.ways.items() for t in ways}
        self.dry = set(np.flatnonzero(system.dry).tolist())
        self.tied: dict[int, list[int]] = {}
        follows = np.asarray(system.follows).tolist()
        for t, i in enumerate(follows):
            if i >= 0 and t not in self.normal:
                self.tied.setdefault(i, []).append(t)
        self.owner = {row: self.normal.get(row, i if i >= 0 else row) for row, i in enumerate(follows)}
        self.loops: list[int] = [row for row, own in self.owner.items() if system.held[own]]
        self.redundant = 0
        self._unknowns: dict[tuple[tuple[int, ...], tuple[Mode, ...]], Unknowns] = {}

    def rows(self, contacts: list[int]) -> list[int]:
        """All rows of these contacts, rising."""
        return sorted({row for i in contacts for row in (i, *self.ways.get(i, ()), *self.tied.get(i, ()))})

    def see(self, t: float, q: Floats, v: Floats, contacts: list[int]) -> Seen:
        """Evaluate the rows of these contacts.

        Raises:
            Ended: NOT_FINITE or ILL_POSED.
        """
        return self.see_all([t], q[None], v[None], contacts).one(0)

    def see_all(self, times: list[float], q: Floats, v: Floats, contacts: list[int]) -> Seen:
        """Evaluate them at b instants, positions (b, nq) and velocities (b, n); see `see`."""
        e, rows, found = self.equations, self.rows(contacts), list[tuple[Floats, ...]]()
        every, count = [*rows, *self.loops], len(rows)
        with e._selected(every):
            for t, one, its in zip(times, q, v, strict=True):
                M, f = (a.copy() for a in e.terms(t, one, its))
                found.append((M, f, *(a.copy() for a in e.rows(t, one, its))))
        M, f, H, h, Hdv = (np.array(a) for a in zip(*found, strict=True))
        rate = _times(H, v) - self.drift[every]
        a0, a1, a2 = self.slow[every].T
        law = a1 * rate + (a0 + a2 * h * h) * h
        solved = self._solved(M, f, H, -(Hdv + law)[..., count:], rows)
        H, Hdv, law, n = H[..., :count, :], Hdv[..., :count], law[..., :count], M.shape[-1]
        X: Floats = solved[..., :n, :-1]
        vd, G = solved[..., :n, -1], H @ X
        slides = np.array([row in self.normal for row in rows], dtype=bool)
        bare = -(_times(H, vd) + Hdv) - np.where(slides, 0.0, law)
        terms = np.abs(_times(H, vd)) + np.abs(Hdv) + np.abs(law)
        moved = a0[:count] * np.abs(q).max() + a1[:count] * np.abs(v).max()
        if self.loops:
            near = DRIFT * (a0[:count] + moved)
            self._leave_held(M, H, G, bare, near + HELD * terms, rows)
        at = {row: k for k, row in enumerate(rows)}
        return Seen(
            rows, at, G, bare, np.where(slides, -law, 0.0), rate[..., :count], X, vd, solved[..., n:, :-1],
            solved[..., n:, -1], self.part * terms + STATE * moved,
        )  # fmt: skip

    def _solved(self, M: Floats, f: Floats, H: Floats, asked: Floats, rows: list[int]) -> Floats:
        """What unit multipliers of rows, and all forces at last, do to v' and multipliers of loops (b, n + l, m + 1).

        The equations of motion are solved together with those of the loops, which accelerate as `asked`.
        """
        n, held = M.shape[-1], len(self.loops)
        right = np.zeros((len(M), n + held, len(rows) + 1))
        right[:, :n, :-1], right[:, :n, -1] = H[:, : len(rows)].swapaxes(1, 2), f
        whole: Floats = M
        if held:
            whole = np.zeros((len(M), n + held, n + held))
            whole[:, :n, :n], whole[:, n:, :n] = M, H[:, len(rows) :]
            whole[:, :n, n:], right[:, n:, -1] = -H[:, len(rows) :].swapaxes(1, 2), asked
        try:
            solved = np.asarray(np.linalg.solve(whole, right), dtype=np.float64)
        except np.linalg.LinAlgError:
            raise Ended(Outcome.ILL_POSED, [*rows, *self.loops]) from None
        if not np.isfinite(solved).all():
            raise Ended(Outcome.NOT_FINITE)
        return solved

    def _leave_held(self, M: Floats, H: Floats, G: Floats, bare: Floats, least: Floats, rows: list[int]) -> None:
        """Put zeros for rows that loops hold, so that nothing moves them but rounding: they bear nothing.

        A tangential one keeps what it is asked for beyond `least`: loops move it on, so that it cannot stick.

        Raises:
            Ended: ILL_POSED for a contact that should rise by more than `least` (b, m): no push can make it.
        """
        free = (H * np.linalg.solve(M, H.swapaxes(1, 2)).swapaxes(1, 2)).sum(axis=-1)
        idle = np.diagonal(G, axis1=1, axis2=2) <= HELD * free
        for b, k in np.argwhere(idle).tolist():
            if rows[k] not in self.normal and bare[b, k] > least[b, k]:
                raise Ended(Outcome.ILL_POSED, [rows[k]])
            G[b, k], G[b, :, k] = 0.0, 0.0
            if rows[k] not in self.normal or abs(bare[b, k]) <= least[b, k]:
                bare[b, k] = 0.0

    def bound(self, seen: Seen, lam: Floats, i: int) -> float:
        """The most that friction of contact i can be under the multipliers lam (m,), N."""
        return float(self.mu[i] if i in self.dry else self.mu[i] * lam[seen.at[i]])

    def slip(self, seen: Seen, i: int) -> Floats:
        """Slip velocity (1,) or (2,) of contact i, m/s."""
        return seen.rate[..., [seen.at[t] for t in self.ways[i]]]

    def balance(self, seen: Seen, modes: Mapping[int, Mode], ways: Mapping[int, Floats]) -> Balance:
        """Weigh a set of modes.

        Args:
            seen: the rows of these contacts.
            modes: STICK, SLIP, or CONTACT of one without friction, of every contact.
            ways: direction of slip (1,) or (2,) of those that slide.
        """
        key = tuple(seen.rows), tuple(modes[self.owner[row]] for row in seen.rows)
        if key not in self._unknowns:
            self._unknowns[key] = Unknowns(self, seen, modes)
        return Balance(self, seen, ways, self._unknowns[key])


def _times(A: Floats, x: Floats) -> Floats:
    product: Floats = (A @ x[..., None])[..., 0]
    return product
