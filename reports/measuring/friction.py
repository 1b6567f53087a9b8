"""What contacts with friction do in a motion: how they slip, and what holds them back."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Case, Mode, Trajectory
from crossbody.cases.arrays import Floats, distinct
from crossbody.cases.defaults import TOLERANCE
from crossbody.cases.remembered import remembered
from crossbody.cases.scene_contacts import contacts
from crossbody.reports.measuring.equations import equations
from crossbody.reports.measuring.impulse import stopping
from crossbody.reports.measuring.scale import RESTS

if TYPE_CHECKING:
    from crossbody.reference import System


@dataclass(frozen=True, slots=True, eq=False)
class Rubbing:
    """Places where a motion may slip: m of them, each a normal row with its tangential ones, or one of dry friction.

    Attributes:
        rows (m,): normal rows.
        pair (m,): which pair of shapes each belongs to.
        mu (m,): coefficients of friction; of dry friction its bound.
        slip (n, m, k): velocity of the second shape over the first along the tangential rows, m/s.
        force (n, m, k): of the first on the second, N.
        normal (n, m): N; 1 of dry friction.
        dry (m,): whether it is dry friction.
    """

    rows: NDArray[np.intp]
    pair: NDArray[np.intp]
    mu: Floats
    slip: Floats
    force: Floats
    normal: Floats
    dry: NDArray[np.bool_]

    def of_pairs(self, values: Floats) -> Floats:
        """Return the sums (n, pairs, ...) of values of places (n, m, ...) over those of each pair."""
        return np.stack([values[:, self.pair == k].sum(axis=1) for k in distinct(self.pair)], axis=1)


SLOW = 1e-3  # part of the largest slip, and of the largest force, below which a direction is not looked at
BOUND, SLIP = 1e-6, 1e-5  # of the largest bound and slip: to what limits hold friction and velocities
RUBS = (Mode.STICK, Mode.SLIP)  # modes in which a place touches and is rubbed
SHORT = 1e-6  # m, or rad, to which positions are judged: a slide is not known to be one if it is shorter


@remembered(4)
def rubbing(run: Trajectory, case: Case) -> Rubbing | None:
    """Return where a motion may slip, kept since every metric asks for the same; None without friction."""
    return rubbed(run, case)


def rubbed(run: Trajectory, case: Case) -> Rubbing | None:
    """Return where a motion may slip; None where no contact has friction."""
    system = equations(case)
    if system is None or not system.frictional:
        return None
    rows = np.flatnonzero(system.tangents)
    count = system.tangents[rows][:, None]
    ways = np.arange(count.max())
    there = (ways < count).astype(float)
    tangents = system.tangent[rows][:, None] + np.minimum(ways, count - 1)
    rates = slips(case, run)
    return Rubbing(
        rows=rows, pair=_pairs(case, len(rows)), mu=system.friction[rows], slip=there * rates[:, tangents],
        force=there * run.lam[:, tangents], normal=np.where(system.dry[rows], 1.0, run.lam[:, rows]),
        dry=system.dry[rows],
    )  # fmt: skip


def slips(case: Case, run: Trajectory) -> Floats:
    """Return the rates of all rows (n, nc) against what their surfaces do by themselves."""
    system = equations(case)
    assert system is not None
    return slipped(system, case, run)


def slipped(system: System, case: Case, run: Trajectory) -> Floats:
    """Return the same by equations that are given.

    Where discrete variables choose the places of contacts, those of the case's start count until one of them changes.
    """
    rates: Floats = system.gaps_along(run.q, run.v)[1]
    if system.jumps:
        until = min((one.t for one in run.switches if one.t > 0.0 and not one.smooth), default=np.inf)
        count = int(np.searchsorted(run.t, until, side="right"))
        rates[:count] = system.gaps_along(run.q[:count], run.v[:count], system.begun(case.q0, case.v0))[1]
    return rates - np.asarray(system.drift, dtype=np.float64)


def _pairs(case: Case, count: int) -> NDArray[np.intp]:
    """Return which pair each place belongs to; each by itself in dry friction and in own equations."""
    met = contacts(case.scene) if case.general and case.scene is not None else ()
    found = [k for k, contact in enumerate(met) for _ in range(contact.places if contact.friction > 0.0 else 0)]
    dry = sum(width for _, width in case.scene.dry) if case.scene is not None else 0
    return np.array([*found, *(len(met) + np.arange(dry))]) if len(found) + dry == count else np.arange(count)


def whole(values: Floats, case: Case) -> Floats:
    """Return sizes of values of rows (n, nc): of friction in a plane its length, whichever way its two rows point."""
    found, system = np.abs(values), equations(case)
    if system is not None:
        for row in np.flatnonzero(system.tangents > 1):
            ways = slice(int(system.tangent[row]), int(system.tangent[row] + system.tangents[row]))
            found[:, ways] = np.linalg.norm(values[:, ways], axis=1, keepdims=True)
    return found


def sliding(run: Trajectory, found: Rubbing) -> tuple[NDArray[np.bool_], Floats, Floats]:
    """Return where slip has a direction (n, m), and speeds and forces (n, m), m/s and N.

    None has one where all of it is rounding of what moves and presses: of two places that open at one instant the one
    that opens behind the other has no mode but SLIP there.
    """
    speed, force = np.linalg.norm(found.slip, axis=-1), np.linalg.norm(found.force, axis=-1)
    fastest, most = float(np.max(np.abs(run.v), initial=0.0)), float(np.max(found.mu * found.normal, initial=0.0))
    quick = speed > max(SLOW * float(speed.max()), BOUND * fastest)
    firm = force > max(SLOW * float(force.max()), BOUND * most)
    return (run.mode[:, found.rows] == Mode.SLIP) & quick & firm, speed, force


def least_directed(run: Trajectory) -> float:
    """Return the speed below which a slip has no direction, m/s: ten times what the tolerance of limits leaves of any.

    There the reference takes it for none.
    """
    return 10.0 * TOLERANCE * float(np.max(np.abs(run.v), initial=0.0))


def directed(run: Trajectory, found: Rubbing) -> NDArray[np.bool_]:
    """Samples (n,) at which friction is told by what slips: none stops there, or is too slow to have a direction.

    Friction of one that has none may point anywhere, and what others bear follows it.
    """
    slides = run.mode[:, found.rows] == Mode.SLIP
    slow = slides & (np.linalg.norm(found.slip, axis=-1) < least_directed(run))
    return np.asarray(~(slow.any(axis=1) | stopping(run)))


def off_bound(run: Trajectory, case: Case) -> float:
    """Return how far friction of what slides in some direction is at most from mu lam_n, N; 0 without slides."""
    if (found := rubbing(run, case)) is None:
        return 0.0
    off = np.linalg.norm(found.force, axis=-1) - found.mu * found.normal
    slides = (run.mode[:, found.rows] == Mode.SLIP) & directed(run, found)[:, None]
    return float(np.max(np.abs(off), initial=0.0, where=slides))


def turned(run: Trajectory, case: Case) -> tuple[tuple[int, float, bool], ...]:
    """Return every change of a motion, as `changes` tells them; none without friction."""
    found = rubbing(run, case)
    return () if found is None else tuple(changes(run, found))


def guard(truth: Trajectory, case: Case, pair: int, slides: bool) -> tuple[Callable[[Trajectory], Floats], float]:
    """Return what comes to zero where a pair begins to slide, N, or to hold, m/s or rad/s, and to what it is known.

    The one is what friction that holds is below its bound, the other the slip; infinite where nothing holds or touches.
    """
    exact = rubbing(truth, case)
    assert exact is not None
    own = exact.pair == pair
    if slides:
        known = BOUND * float(np.max(exact.mu * exact.normal * own, initial=0.0))
    else:
        known = SLIP * max(float(np.max(np.linalg.norm(exact.slip, axis=-1) * own, initial=0.0)), RESTS)

    def values(run: Trajectory) -> Floats:
        found = rubbed(run, case)
        assert found is not None
        mode = run.mode[:, found.rows]
        if slides:
            below = found.mu * found.normal - np.linalg.norm(found.force, axis=-1)
            least: Floats = np.where((mode == Mode.STICK) & own, below, np.inf).min(axis=1)
            return least
        touches = np.isin(mode, RUBS) & own
        fastest: Floats = np.where(touches, np.linalg.norm(found.slip, axis=-1), -np.inf).max(axis=1)
        return fastest

    return values, known


def changes(run: Trajectory, found: Rubbing) -> Iterator[tuple[int, float, bool]]:
    """Yield when pairs begin to slide, and when all places that touch hold: pair, instant, and whether it slides.

    What it did when it touched last counts where it comes off in between. A slide shorter than SHORT is none.
    """
    for pair in distinct(found.pair):
        places = np.flatnonzero(found.pair == pair)
        begun = float(run.t[0]) if len(run.t) else 0.0
        pending: list[tuple[int, float, bool]] = []
        for t, slides in _switches(run, found.rows[places].tolist()):
            if slides:
                begun, pending = t, [(pair, t, True)]
            elif _way(run, found, places, begun, t) > SHORT:
                yield from (*pending, (pair, t, False))
                pending = []
        if pending and _way(run, found, places, begun, float(run.t[-1])) > SHORT:
            yield from pending


def _switches(run: Trajectory, rows: list[int]) -> Iterator[tuple[float, bool]]:
    """Yield when rows of a pair begin to slide, and when all of them that touch hold."""
    mode = dict.fromkeys(rows, Mode.FREE)
    slid: bool | None = None
    for t, events in groupby((e for e in run.events if e.contact in mode), key=lambda event: event.t):
        mode |= {event.contact: event.after for event in events}
        slides = Mode.SLIP in mode.values()
        if slid is not None and slid != slides and (slides or Mode.STICK in mode.values()):
            yield t, slides
        slid = slides if slides or Mode.STICK in mode.values() else slid


def _way(run: Trajectory, found: Rubbing, places: NDArray[np.intp], start: float, end: float) -> float:
    """Return how far any of some places slips while it touches from one instant to another, m, of joints rad."""
    inside = (run.t >= start) & (run.t <= end)
    touches = np.isin(run.mode[inside][:, found.rows[places]], RUBS)
    speed = np.where(touches, np.linalg.norm(found.slip[inside][:, places], axis=-1), 0.0)
    return float(np.max(np.trapezoid(speed, run.t[inside], axis=0), initial=0.0))
