"""Where contacts begin and end in a run, and the state there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from crossbody.cases.arrays import Floats
from crossbody.cases.defaults import shortest
from crossbody.cases.remembered import remembered
from crossbody.cases.trajectory import Event, Mode, Trajectory

CLOSED = (Mode.CONTACT, Mode.COLLISION, Mode.BILATERAL, Mode.STICK, Mode.SLIP)
AT_REST = 1e-10
"""Gap, m or rad (relative to positions above 1), within which a row is at its surface, by errors."""
LIGHT = 1e-12  # multiplier, N or N m (relative to the largest above 1), that rounding makes of none


@dataclass(frozen=True, slots=True)
class Contact:
    """One contact of a row.

    Attributes:
        row: which.
        touch: when it begins, s.
        release: when it ends, s; infinite if it lasts to the end.
        settled: when its COLLISION hands over to CONTACT, s; infinite if it does not.
        free: when the row is FREE behind it, s: at its release or, let go below the surface,
            later; infinite if never.
    """

    row: int
    touch: float
    release: float = np.inf
    settled: float = np.inf
    free: float = np.inf

    def behind(self, event: Event) -> Contact:
        """The contact with a later event of its row."""
        ends = event.before in CLOSED and event.after not in CLOSED
        return replace(
            self,
            release=event.t if ends else self.release,
            settled=event.t if (event.before, event.after) == (Mode.COLLISION, Mode.CONTACT) else self.settled,
            free=event.t if event.after == Mode.FREE else self.free,
        )


@remembered(8)
def contacts(run: Trajectory, touches: NDArray[np.bool_] | None = None, joined: bool = False) -> tuple[Contact, ...]:
    """Every contact in order of its touch; joined, those between which no gap opens are one.

    From the run's events; a run without a notion of mode is read by the sign of its gaps instead.
    Joined, a row that stays at its surface from the start to the end, or from one contact to the next,
    is in contact all along: which of two rows pushes that depend on each other, whether one pushes
    that bears nothing, and what the sign of its gap is, are rounding and no properties of the motion.

    Args:
        run: whose contacts.
        touches (nc,): rows that have some (`Law.touches`); all if not given.
        joined: whether to join them.
    """
    some = np.flatnonzero(np.ones(run.gap.shape[1], dtype=bool) if touches is None else touches).tolist()
    if not run.events and run.mode.size and np.all(run.mode == -1):
        return _by_sign(run, some)
    found: list[Contact] = []
    last: dict[int, int] = {}
    for event in (event for event in run.events if event.contact in some):
        if event.after in CLOSED and event.before not in CLOSED:
            last[event.contact] = len(found)
            found.append(Contact(event.contact, event.t))
        elif event.contact in last:
            found[last[event.contact]] = found[last[event.contact]].behind(event)
    if not joined:
        return tuple(found)
    rests = _Rests(run)
    kept = [c for row in some for c in rests.joined(row, [c for c in found if c.row == row])]
    return tuple(sorted(kept, key=lambda c: c.touch))


class _Rests:
    """Where the rows of a run stay at their surface."""

    def __init__(self, run: Trajectory) -> None:
        self.t, self.v, self.mode, self.lam = run.t, run.v, run.mode, np.abs(run.lam)
        self.gap = np.abs(run.gap)
        self.near = AT_REST * max(1.0, float(np.max(np.abs(run.q), initial=0.0)))
        self.light = LIGHT * max(1.0, float(np.nanmax(self.lam, initial=0.0)))
        self.short = shortest(float(run.t[-1])) if len(run.t) else 0.0

    def joined(self, row: int, own: list[Contact]) -> list[Contact]:
        """Return the contacts of one row less those that bear nothing, and those joined between which no gap opens.

        One that begins where the one before ends is the same, as far as that is known: rows were tried at that instant,
        or two of them switch there in an order that no run tells.
        """
        if (self.mode[:, row] < 0).any():
            return own
        if len(self.t) and self._stays(row, self.t[0], np.inf) and self.mode[0, row] != Mode.BILATERAL:
            return [Contact(row, float(self.t[0]))]
        found: list[Contact] = []
        for c in own:
            if self._bears_nothing(c):
                continue
            short = bool(found) and c.touch - found[-1].release <= self.short
            if short or (found and self._stays(row, found[-1].release, c.touch)):
                found[-1] = replace(c, touch=found[-1].touch, settled=min(found[-1].settled, c.settled))
            else:
                found.append(c)
        if found and self._stays(row, found[-1].release, np.inf):
            found[-1] = replace(found[-1], release=np.inf, free=np.inf)
        return found

    def _stays(self, row: int, start: float, end: float) -> bool:
        """Whether a row is at its surface at all samples from one instant to another."""
        first, last = np.searchsorted(self.t, start, side="left"), np.searchsorted(self.t, end, side="right")
        return bool((self.gap[first:last, row] <= self.near).all())

    def _bears_nothing(self, c: Contact) -> bool:
        """Whether a row at its surface does not push, or was on for no time and has not struck: no velocity jumps."""
        first, last = np.searchsorted(self.t, c.touch, side="left"), np.searchsorted(self.t, c.release, side="right")
        sampled = bool(last > first)
        if c.release == c.touch:
            return not (sampled and np.ptp(self.v[first:last], axis=0).any())
        light = bool((self.lam[first:last, c.row] <= self.light).all())
        return sampled and light and self._stays(c.row, c.touch, c.release)


def _by_sign(run: Trajectory, rows: Sequence[int]) -> tuple[Contact, ...]:
    found = []
    for row in rows:
        gap = run.gap[:, row]
        down, up = (_crossings(run.t, sign * gap) for sign in (1.0, -1.0))
        found += [Contact(row, t, float(min(up[up > t], default=np.inf))) for t in down]
    return tuple(sorted(found, key=lambda c: c.touch))


def _crossings(t: Floats, gap: Floats) -> Floats:
    """Instants at which the gap falls through zero, by a straight line between samples."""
    i = np.flatnonzero((gap[:-1] > 0.0) & (gap[1:] <= 0.0))
    return t[i] + (t[i + 1] - t[i]) * gap[i] / (gap[i] - gap[i + 1])


def at(run: Trajectory, values: Floats, t: float) -> float:
    """One signal (n,) at an instant: the sample there if there is one, else by a straight line."""
    return float(np.interp(t, run.t, values))


def scalar(run: Trajectory) -> bool:
    """Whether the run is one coordinate that is its own gap, so that v is the gap's rate."""
    return run.q.shape[1] == run.v.shape[1] == run.gap.shape[1] == 1 and bool(np.allclose(run.q, run.gap))


def rates(run: Trajectory) -> tuple[tuple[Contact, float, float], ...]:
    """Rate of the gap at touch and at release of every contact that ended, m/s; empty unless `scalar`."""
    if not scalar(run):
        return ()
    v = run.v[:, 0]
    ended = (c for c in contacts(run) if np.isfinite(c.release))
    return tuple((c, at(run, v, c.touch), at(run, v, c.release)) for c in ended)
