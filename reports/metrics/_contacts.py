"""Where contacts begin and end in a run, and the state there."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from crossbody.cases._arrays import Floats
from crossbody.cases._trajectory import Event, Mode, Trajectory

CLOSED = (Mode.CONTACT, Mode.COLLISION, Mode.BILATERAL)


@dataclass(frozen=True, slots=True)
class Contact:
    """One contact of a row.

    Attributes:
        row: which.
        touch: when it begins, s.
        release: when it ends, s; infinite if it lasts to the end.
        settled: when its COLLISION hands over to CONTACT, s; infinite if it does not.
        free: when the row is FREE behind it, s: at its release or, let go below the surface, later; infinite if never.
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


def contacts(run: Trajectory) -> tuple[Contact, ...]:
    """Every contact in order of its touch.

    From the run's events; a run without a notion of mode is read by the sign of its gaps instead.
    """
    if not run.events and run.mode.size and np.all(run.mode == -1):
        return _by_sign(run)
    found: list[Contact] = []
    last: dict[int, int] = {}
    for event in run.events:
        if event.after in CLOSED and event.before not in CLOSED:
            last[event.contact] = len(found)
            found.append(Contact(event.contact, event.t))
        elif event.contact in last:
            found[last[event.contact]] = found[last[event.contact]].behind(event)
    return tuple(found)


def _by_sign(run: Trajectory) -> tuple[Contact, ...]:
    found = []
    for row in range(run.gap.shape[1]):
        gap = run.gap[:, row]
        down, up = (_crossings(run.t, sign * gap) for sign in (1.0, -1.0))
        found += [Contact(row, t, float(min(up[up > t], default=np.inf))) for t in down]
    return tuple(sorted(found, key=lambda c: c.touch))


def _crossings(t: Floats, gap: Floats) -> Floats:
    """Instants at which the gap falls through zero, by a straight line between samples."""
    i = np.flatnonzero((gap[:-1] > 0.0) & (gap[1:] <= 0.0))
    crossed: Floats = t[i] + (t[i + 1] - t[i]) * gap[i] / (gap[i] - gap[i + 1])
    return crossed


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
