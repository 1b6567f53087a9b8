"""What metrics must say where an instant stands twice: a row that jumps is sampled on both of its sides."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np

from crossbody.cases import Event, Mode, Switch, Tier, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.reports import metrics
from crossbody.reports.judging.asked import Found
from crossbody.reports.judging.made_up import case_of
from crossbody.reports.measuring.truth import from_run

TOUCH, END = 0.2, 1.0
LATE, HAIR, COARSE, FINE = 1e-3, 1e-13, 0.05, 1e-3
"""By how much a release comes late, and a hand-over is off, s, and steps of a run and of its truth."""
LEFT, DEEP, SAME = 0.3, 0.4, 1e-6
"""Force that a row lets go of, of 1 N, its gap there, of ways of 1 m, and part by which an answer may differ."""
SWITCHES = "lets go as something switches"
"""What a row does whose force may jump through zero."""


@cache
def wrong() -> tuple[Found, ...]:
    """Return metric, number, least and most, and motion, of what is another number than it must be."""
    return tuple(
        (name, found, (wanted, wanted), said)
        for name, found, wanted, said in (*_sides(), *_impulses(), *_hand_overs(), *_choices())
        if not abs(found - wanted) <= SAME * max(wanted, SAME)
    )  # fmt: skip


def sampled(step: float, jump: float, *more: float) -> Floats:
    """Return instants at steps of a run, s, with one at which something jumps, twice, and more."""
    grid = np.arange(0.0, END + 0.5 * step, step)
    return np.sort(np.concatenate([grid[np.abs(grid - jump) > 1e-9], more, [jump] * 2]))


def pressed(release: float, step: float) -> Trajectory:
    """Return a row that bears 1 N from TOUCH on until it lets go, s, at steps of a run; every jump from both sides."""
    t = sampled(step, release, TOUCH)
    order = np.arange(len(t))
    on = (order >= np.searchsorted(t, TOUCH, side="right") - 1) & (order <= np.searchsorted(t, release, side="left"))
    modes = (Mode.FREE, Mode.CONTACT, Mode.FREE)
    events = tuple(
        Event(t=at, contact=0, before=a, after=b) for at, a, b in zip((TOUCH, release), modes, modes[1:], strict=False)
    )
    column = np.linspace(0.0, 1.0, len(t))[:, None]
    return Trajectory(
        t=t, q=column, v=column, gap=column, lam=on[:, None].astype(float), energy=np.hstack([column, column]),
        mode=np.where(on, Mode.CONTACT, Mode.FREE)[:, None].astype(np.int8), events=events,
    )  # fmt: skip


def _sides() -> Iterator[tuple[str, float, float, str]]:
    """Ask for gaps at events of a row whose gap or force jumps to zero there, which it must not."""
    case = case_of(("m",), (True,), 1)
    modes = np.array([Mode.FREE, Mode.CONTACT, Mode.BALLISTIC, Mode.FREE], dtype=np.int8)
    at = (0.3, 0.5, 0.8)
    t = np.array([0.0, 0.1, *np.repeat(at, 2), 0.9, END])
    of = np.array([0, 0, 0, 1, 1, 2, 2, 3, 3, 3])
    events = tuple(
        Event(t=x, contact=0, before=Mode(a), after=Mode(b)) for x, a, b in zip(at, modes[:-1], modes[1:], strict=True)
    )
    switch = Switch(t=at[1], variable=0, before=0, after=1)
    gaps = {"touches": (0, 2), "comes up to it": (2, 6)}
    for said, (_, k) in (("nothing", (0, 0)), *gaps.items(), ("lets go", (1, 4)), (SWITCHES, (1, 4))):
        gap = np.array([1.0, 0.5, 0.0, 0.0, -DEEP, -DEEP, 0.0, 0.0, 0.5, 1.0])
        gap[k] = gap[k] - DEEP * np.sign(gap[k] or 1.0) if said in gaps else gap[k]
        lam = np.array([0.0, 0.0, 0.0, 1.0, LEFT if said in ("lets go", SWITCHES) else 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
        column, switches = gap[:, None], (switch,) if said == SWITCHES else ()
        run = Trajectory(
            t=t, q=column, v=column, gap=column, lam=lam[:, None], energy=np.hstack([column, column]),
            mode=modes[of][:, None], events=events, switches=switches,
        )  # fmt: skip
        yield "event_gap", _measured("event_gap", run, run, case), _way(said, gap, lam, k), f"a row that {said}"


def _way(said: str, gap: np.ndarray, lam: np.ndarray, k: int) -> float:
    ways = [abs(float(signal[k])) / float(np.max(np.abs(np.diff(signal)))) for signal in (gap, lam)]
    return 0.0 if said in ("nothing", SWITCHES) else min(ways) if said == "lets go" else ways[0]


def _impulses() -> Iterator[tuple[str, float, float, str]]:
    """Ask for the impulse of a force that ends late, at steps that are far longer."""
    case = case_of(("m",), (True,), 1)
    release = 0.6
    for late in (-LATE, LATE):
        found = _measured("lam_impulse_path", pressed(release, FINE), pressed(release + late, COARSE), case)
        yield "lam_impulse_path", found, LATE / (release - TOUCH), "a force that ends late"


def handed(at: float, step: float) -> Trajectory:
    """Return a row that bears 2 N in a collision and, from an instant, s, on 1 N in the contact that follows."""
    t = sampled(step, at)
    column, before = np.linspace(0.0, 1.0, len(t))[:, None], np.arange(len(t)) <= np.searchsorted(t, at, side="left")
    ways = ((0.0, Mode.FREE, Mode.COLLISION), (at, Mode.COLLISION, Mode.CONTACT))
    return Trajectory(
        t=t, q=column, v=column, gap=0.0 * column, lam=np.where(before, 2.0, 1.0)[:, None],
        energy=np.hstack([column, column]),
        mode=np.where(before, Mode.COLLISION, Mode.CONTACT)[:, None].astype(np.int8),
        events=tuple(Event(t=t, contact=0, before=mode, after=behind) for t, mode, behind in ways),
    )  # fmt: skip


def _hand_overs() -> Iterator[tuple[str, float, float, str]]:
    """Ask for the impulse of a force that jumps a hair beside where it does so in the truth: nothing is off."""
    case, at = case_of(("m",), (True,), 1), 0.6
    for off in (-HAIR, HAIR):
        found = _measured("lam_impulse", handed(at, FINE), handed(at + off, COARSE), case)
        yield "lam_impulse", found, 0.0, "a force that jumps"


def _choices() -> Iterator[tuple[str, float, float, str]]:
    """Ask for the impulse of rows that depend on each other, of which another run may choose others: there is none."""
    case, exact = case_of(("m",), (True,), 1), pressed(0.6, FINE)
    dependent = replace(exact, counts={"redundant": 1})
    found = metrics.load("lam_impulse_path").measure(from_run(dependent, Tier.A, "made up"), pressed(0.7, FINE), case)
    yield "lam_impulse_path", 0.0 if found is None else np.nan, 0.0, "rows that depend on each other"


def _measured(name: str, exact: Trajectory, run: Trajectory, case: object) -> float:
    value = metrics.load(name).measure(from_run(exact, Tier.A, "made up"), run, case)  # type: ignore[arg-type]
    return np.nan if value is None else value
