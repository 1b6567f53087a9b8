"""Friction on the way of a motion's derivatives: directions of slip, what is grazed, and which events have a cause.

Where a contact comes to slide out of sticking nothing jumps, and its saltation matrix is the
identity. Where a slip stops, the force along it jumps; what lies across it has died out by then,
since friction turns a slip at a rate of mu lam_n/(m |v_t|). Deviations by which a contact that
sticks would slip die out within times of their own size.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Event, Mode, SceneError, Trajectory
from crossbody.reference._system import System
from crossbody.reference.kinds import Floats
from crossbody.reference.linear._derivatives import saddle
from crossbody.reference.linear._emerging import emerges, emerging
from crossbody.reference.linear._point import Point, gaps
from crossbody.reference.linear._rubbing import NoDirectionError, given_way, independent
from crossbody.reference.linear._variation import (
    Theta,
    cone_gradient,
    gap_gradient,
    lam_gradient,
    rates,
    slip_gradient,
    slips,
    slopes,
    timed,
)

ACTIVE = (Mode.CONTACT, Mode.COLLISION, Mode.BILATERAL, Mode.STICK, Mode.SLIP)
STILL = 1e-7  # part of the largest slip, below which one in space has the direction that it had last, or has next
NOISE = 1e2  # times the tolerance, where this is more: a slower slip has no direction that is known
SHORT = 1e-2  # part of the largest slip from its start to its end, where this is less: direction turns in that time
FLEETING = 1e-11  # part of the largest slip in a motion below which one that is larger nowhere has no direction
ROUNDED = 1e-14  # part of its terms to which a slip velocity is rounded off, many times over
FAST = 1e-2  # part of the largest slip, below which one that grows in space turns too fast for an explicit method
SLOWER = 0.5  # of that: an arc that ends at it leaves the next one above, however the end was rounded
NONE = 1e-6  # part of its size below which what is looked at at an event counts as what fell to zero
GRAZED = 1e-8  # part of the largest slip, or of a bound, to which a contact may come without an event
EDGE = 1e-6  # part of an arc at its start at which nothing is grazed yet
ALIKE = 1e-6  # part of the shifts of two events by which they may differ and still be one
AS_ONE = (
    "sensitivity: several rows switch simultaneously at t = {t:.9g} s; a deviation separates them, and "
    "the motion then depends on which comes first, so there is no derivative."
)
TURNS_BACK = (
    "sensitivity: the slip of row {i} turns back through zero at t = {t:.9g} s; in neighbouring "
    "motions it turns round in space instead, so that there is no derivative."
)
TOO_SHORT = (
    "sensitivity: row {i} slides at t = {t:.9g} s for so short a time that the direction of "
    "its slip, and how it changes with the motion, is lost in rounding."
)
SHARED = (
    "sensitivity: row {i} slides at t = {t:.9g} s while it shares a load, and the law does not determine "
    "how a deviation changes its share (indeterminate)."
)
Place = Callable[[Point, float, Floats], Point]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Slipping:
    """Contacts with friction along a motion.

    Attributes:
        system: the mechanism. over: parameters. run: the motion. place: a point moved to a time and a state.
        slipped: speed at which every contact slips (samples, nc). speed: the largest, 1 if there is none.
        still: part of it below which a slip in space is given its direction.
    """

    system: System
    over: Theta
    run: Trajectory
    place: Place
    slipped: Floats
    speed: float
    still: float

    def directed(self, at: Point, modes: Sequence[int], k: int) -> Point:
        """The point with what slides there: in a plane, or without speed, in the direction that sample k has."""
        sliding = [i for i, mode in enumerate(modes) if mode == Mode.SLIP and self.system.tangents[i] > 0]
        way = np.full(self.system.nc, np.nan)
        for i in sliding:
            rows, slip = self._rows(i), slips(at, at.q, at.v, i)
            size = float(np.linalg.norm(slip))
            if len(rows) == 1 or size <= 0.5 * self.band(i, k):
                way[rows] = self._way(i, k)
            elif size <= 1.5 * self.band(i, k):
                way[rows] = slip / size
        at = independent(replace(at, sliding=np.array(sliding, dtype=np.int64), way=way, slow=ROUNDED))
        still = [i for i in sliding if self.system.tangents[i] > 1 and not np.isnan(way[self._rows(i)]).any()]
        slow = [i for i in still if np.linalg.norm(slips(at, at.q, at.v, i)) <= 0.5 * self.band(i, k)]
        return emerging(at, [i for i in slow if emerges(at, i)])

    def band(self, i: int, k: int) -> float:
        """Slip of contact i, in space, below which it is given its direction while it slides at sample k.

        Raises:
            SceneError: if it slides for too short a time for its slip to have a direction at all.
        """
        off = np.flatnonzero(self.run.mode[:, i] != Mode.SLIP)
        first, last = np.append(off[off < k], -1).max() + 1, np.append(off[off > k], len(self.slipped)).min()
        peak = float(self.slipped[first:last, i].max(initial=0.0))
        if peak < FLEETING * self.speed:
            raise SceneError(TOO_SHORT.format(i=i, t=float(self.run.t[k])))
        return min(self.still * self.speed, SHORT * peak)

    def _rows(self, i: int) -> Any:
        return int(self.system.tangent[i]) + np.arange(int(self.system.tangents[i]))

    def _way(self, i: int, k: int) -> Floats:
        """Direction in which contact i slides at a sample: against its friction; NaN where that has none."""
        force = self.run.lam[k, self._rows(i)]
        size = float(np.linalg.norm(force))
        return np.asarray(-force / size if size > 0.0 else np.full(len(force), np.nan))

    def turns(self, here: Point) -> tuple[list[Any], bool]:
        """Where slips in space come to have a direction, lose it, or turn slowly at last; and whether one turns fast.

        Args:
            here: the point at which an arc begins.

        Returns:
            Conditions that end an arc, for `scipy.integrate.solve_ivp`.
        """
        ends, stiff = list[Any](), False
        for i in [i for i in here.sliding.tolist() if self.system.tangents[i] > 1]:
            f, slip = rates(here), slips(here, here.q, here.v, i)
            size, fast = float(np.linalg.norm(slip)), FAST * self.speed
            band = self.band(i, int(np.searchsorted(self.run.t, here.t, "right")) - 1)
            limits = [(band, -1.0) if given_way(here, self._rows(i)) is None else (2.0 * band, 1.0)]
            grows = float(slip @ (slip_gradient(here, self.over, i)[:, : len(f)] @ f)) >= 0.0
            if size < SLOWER * fast and (grows or size < 0.1 * band):
                stiff = True
                limits.append((fast, 1.0))
            ends += [self._crossing(here, i, limit, way) for limit, way in limits]
        return ends, stiff

    def _crossing(self, here: Point, i: int, limit: float, way: float) -> Any:
        def crossed(t: float, y: Floats) -> float:
            moved = self.place(here, t, y)
            return float(np.linalg.norm(slips(moved, moved.q, moved.v, i)) - limit)

        crossed.terminal, crossed.direction = True, way  # type: ignore[attr-defined]
        return crossed

    def watches(self, here: Point) -> list[tuple[int, Callable[[Point], float], Any]]:
        """Contacts; how far each is from its next event, as a part of what may be, and where that is least."""
        found = list[tuple[int, Callable[[Point], float], Any]]()
        for i in np.flatnonzero(np.asarray(self.system.tangents)).tolist():
            if i in here.sliding:
                found.append((i, *self._watch(here, lambda at, i=i: self._slip_left(at, i))))  # type: ignore[misc]
            elif len(here.tangents(i)) and not self._shares(here, i):
                found.append((i, *self._watch(here, lambda at, i=i: self._cone_left(at, i))))  # type: ignore[misc]
        return found

    def _watch(self, here: Point, left: Callable[[Point], tuple[float, float]]) -> tuple[Callable[[Point], float], Any]:
        last = -1.0

        def slope(t: float, y: Floats) -> float:
            nonlocal last
            with suppress(NoDirectionError):  # a slip has come to zero, where the arc ends: nothing comes nearer there
                last = left(self.place(here, t, y))[1]
            return last

        slope.terminal, slope.direction = False, 1.0  # type: ignore[attr-defined]
        return lambda at: left(at)[0], slope

    def _slip_left(self, at: Point, i: int) -> tuple[float, float]:
        """Slip of contact i along its direction over the largest one, and its rate."""
        slip, f = slips(at, at.q, at.v, i), rates(at)
        given = given_way(at, self._rows(i))
        way = slip / np.linalg.norm(slip) if given is None else given
        change = slip_gradient(at, self.over, i)[:, : len(f)] @ f
        return float(way @ slip) / self.speed, float(way @ change) / self.speed

    def _cone_left(self, at: Point, i: int) -> tuple[float, float]:
        """By how much contact i is below its bound, over that, and its rate."""
        value, gradient, bound = cone_gradient(at, self.over, i)
        f = rates(at)
        return value / bound, float(gradient[: len(f)] @ f + gradient[-1]) / bound

    def _shares(self, here: Point, i: int) -> bool:
        return bool(np.isin([i, *here.active[here.tangents(i)]], here.sharing).any())

    def reached(self, e: Event, here: Point, k: int) -> Floats | None:
        """Gradient, by (dq, v, theta, t), of what fell to zero at an event; None if it follows from another.

        Args:
            e: the event.
            here: the point before it.
            k: the last sample before it.

        Raises:
            SceneError: where the event has no derivative.
        """
        i = e.contact
        if e.before is Mode.STICK and e.after is Mode.SLIP:
            if self._shares(here, i):
                raise SceneError(SHARED.format(i=i, t=e.t))
            value, gradient, size = cone_gradient(here, self.over, i)
            size = max(size, 0.0 if self.system.dry[i] else float(self.system.friction[i]) * self._load())
        elif e.before is Mode.SLIP and e.after in (Mode.STICK, Mode.SLIP):
            slip, size = slips(here, here.q, here.v, i), self.speed
            all_ways, n = slip_gradient(here, self.over, i), self.system.n
            value, gradient = float(np.linalg.norm(slip)), timed(self._way(i, k) @ all_ways)
            in_space = np.linalg.matrix_rank(all_ways[:, n : 2 * n]) > 1
            if value <= NONE * size and e.after is Mode.SLIP and in_space:
                raise SceneError(TURNS_BACK.format(i=i, t=e.t))
        elif e.before in ACTIVE:
            lam = slopes(here, self.over)[1]
            value, size = lam[here.active.tolist().index(i)], self._load()
            gradient = lam_gradient(here, self.over, i)
        else:
            rate = e.before is not Mode.FREE
            value = gaps(here, here.q, here.v)[i + self.system.nc * rate]
            size, gradient = (
                float(np.abs(here.v if rate else here.q).max()),
                timed(gap_gradient(here, self.over, i, rate=rate)),
            )
        return gradient if abs(value) <= NONE * abs(size) else None

    def _load(self) -> float:
        """Largest multiplier of the motion."""
        return float(np.abs(self.run.lam).max())

    def begun(self, here: Point, S: Floats, rows: Sequence[int]) -> tuple[list[int], NDArray[np.bool_]]:
        """Contacts among these that begin to slide from no slip, and the variables (2 n + k,) that give them one.

        By these the motion has one-sided derivatives at most: friction is against whatever slip there is.
        """
        n, found, lost = self.system.n, list[int](), np.zeros(S.shape[1], dtype=bool)
        for i in rows:
            if i not in here.sliding or np.linalg.norm(slips(here, here.q, here.v, i)) > GRAZED * self.speed:
                continue
            gradient = slip_gradient(here, self.over, i)
            change = gradient[:, : 2 * n] @ S
            change[:, 2 * n :] += gradient[:, 2 * n :]
            lost |= (np.abs(change) > NONE * np.abs(gradient).max()).any(axis=0)
            found.append(i)
        return found, lost

    def hold(self, here: Point, S: Floats) -> Floats:
        """Let deviations S (2 n, ...) by which contacts that stick would slip die out, in place; the velocity (n,).

        So does what is left of the velocity of a slip that has stopped: another one is to begin from none.
        """
        n, K, v = self.system.n, None, here.v.copy()
        for i in np.flatnonzero(np.asarray(self.system.tangents)).tolist():
            if i in here.sliding or not len(here.tangents(i)):
                continue
            K = saddle(here)[0] if K is None else K
            gradient, slip = slip_gradient(here, self.over, i), slips(here, here.q, v, i)
            left = slip if np.linalg.norm(slip) <= self.still * self.speed else np.zeros(len(slip))
            for place, row, part in zip(here.tangents(i), gradient, left, strict=True):
                unit = np.zeros(len(K))
                if place in here.solved:
                    unit[n + here.solved.tolist().index(place)] = 1.0
                    change, way = row[: 2 * n] @ S, np.linalg.solve(K, unit)[:n]
                    change[2 * n :] += row[2 * n :]
                    S[n:] -= np.outer(way, change)
                    v -= way * part
        return v
