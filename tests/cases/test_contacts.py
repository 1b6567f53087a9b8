"""Contacts of made-up rows against a second reading of the same story, drawn at random."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from known_errors import right

from crossbody.cases import Event, Mode, Trajectory
from crossbody.cases.contacts import Contact, contacts, rates

INSIDE = 4
"""Samples of a part from its beginning to its end."""


@dataclass(frozen=True)
class Part:
    """What a row does for a while: OPEN, at its surface and FREE (FLUSH), or in contact, deep or flush, loaded or not.

    Of no length it is a contact that begins and ends at one instant: one that strikes changes the velocity. Halfway a
    contact that `turns` hands over from COLLISION to CONTACT, and a row that was let go below its surface is free.
    """

    closed: bool
    gap: float
    lam: float = 0.0
    length: float = 1.0
    strikes: bool = False
    turns: bool = False


OPEN, FLUSH = Part(False, 0.1), Part(False, 0.0)
SINKS = Part(False, -0.01, turns=True)
DEEP, FIRM, IDLE, SUNK = Part(True, -0.01, 2.0), Part(True, 0.0, 2.0), Part(True, 0.0), Part(True, -0.01)
STRUCK, BUMPED = replace(DEEP, turns=True), replace(FIRM, turns=True)
BLINK, BLOW = Part(True, 0.0, length=0.0), Part(True, 0.0, length=0.0, strikes=True)
RETRY = Part(False, -0.01, length=0.0)
"""Let go and caught again at one instant, below the surface."""
BEARING = (DEEP, FIRM, STRUCK, BUMPED)


def story(rng: np.random.Generator) -> list[Part]:
    """Parts that are free and in contact by turns."""
    parts: list[Part] = []
    for k in range(int(rng.integers(1, 9)) + 1):
        free = [OPEN, FLUSH] + ([RETRY, SINKS] if parts and parts[-1] in BEARING else [])
        after = [*BEARING] if parts and parts[-1] is RETRY else [*BEARING, IDLE, SUNK, BLINK, BLOW]
        among = after if (k + int(parts[0].closed if parts else 0)) % 2 and parts else free
        parts.append(among[int(rng.integers(len(among)))])
    if parts[-1].length == 0.0:
        parts.append(DEEP if not parts[-1].closed else OPEN)
    return parts


def tried(parts: list[Part], k: int) -> float:
    """1 where deep contacts meet at an instant at which a row was let go and caught again; else gaps meet at 0."""
    inside = 0 < k < len(parts) - 1 and parts[k] is RETRY
    return float(inside and parts[k - 1].gap < 0.0 and parts[k + 1].gap < 0.0)


def told(parts: list[Part]) -> Trajectory:
    """The run: at every event the instant stands twice."""
    rows: list[tuple[float, float, float, float, int]] = []
    events, t, v = list[Event](), 0.0, 1.0
    before = Mode.FREE
    for k, part in enumerate(parts):
        modes = [Mode.CONTACT if part.closed else Mode.FREE] * 2
        if part.turns:
            modes[0] = Mode.COLLISION if part.closed else Mode.BALLISTIC
        for late, mode in enumerate(modes):
            if mode != before:
                events.append(Event(t=t + 0.5 * late, contact=0, before=before, after=mode))
            before = mode
        v += float(part.strikes)
        if part.length > 0.0:
            shape = [tried(parts, k - 1), *[1.0] * (INSIDE - 2), tried(parts, k + 1)]
            times = np.linspace(t, t + part.length, INSIDE)
            rows += [(s, part.gap * x, part.lam, v, modes[int(s - t > 0.5)]) for s, x in zip(times, shape, strict=True)]
        t += part.length
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    gap, lam, v_, mode_ = (column[:, None] for column in columns[1:])
    return Trajectory(
        t=columns[0], q=np.ones_like(gap), v=v_, gap=gap, lam=lam, energy=np.zeros((len(gap), 2)),
        mode=mode_.astype(np.int8), events=tuple(events),
    )  # fmt: skip


def joined(parts: list[Part]) -> list[Contact]:
    """Where the row is held by what it carries, from part to part: none opens where it stays at its surface."""
    begins = np.concatenate([[0.0], np.cumsum([part.length for part in parts])])
    if all(part.gap == 0.0 for part in parts if part is not RETRY):
        return [Contact(0, 0.0)]
    bears = [part.closed and part not in (IDLE, BLINK) for part in parts]
    found: list[Contact] = []
    held = False  # since the last contact nothing opened
    for k, part in enumerate(parts):
        if bears[k]:
            ends = float(begins[k + 1]) if k + 1 < len(parts) else np.inf
            free = ends + 0.5 if k + 1 < len(parts) and parts[k + 1] is SINKS else ends
            settled = float(begins[k]) + 0.5 if part.turns else np.inf
            now = Contact(0, float(begins[k]), release=ends, settled=settled, free=free)
            if held:
                before = found.pop()
                now = replace(now, touch=before.touch, settled=min(before.settled, settled))
            found.append(now)
            held = True
        elif part is not RETRY:
            held = held and part.gap == 0.0
    if held and found:
        found[-1] = replace(found[-1], release=np.inf, free=np.inf)
    return found


@pytest.mark.parametrize("seed", range(8))
def test_contacts_that_are_joined_are_what_the_row_bears_while_it_never_opens(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(50):
        parts = story(rng)
        assert list(contacts(told(parts), joined=True)) == joined(parts), parts


@pytest.mark.parametrize("joined", [False, True])
@pytest.mark.parametrize("told_too", [False, True])
def test_a_row_of_friction_has_no_contacts_of_its_own(joined: bool, told_too: bool) -> None:
    """Its gap is always zero, and engines may tell of it what the row does that it follows, or nothing."""
    for seed in range(50):
        one = told(story(np.random.default_rng(seed)))
        pair = {name: np.repeat(getattr(one, name), 2, axis=1) for name in ("gap", "lam", "mode")}
        pair["gap"][:, 1] = 0.0
        rows = (0, 1) if told_too else (0,)
        both = replace(one, **pair, events=tuple(replace(e, contact=row) for e in one.events for row in rows))
        assert contacts(both, np.array([True, False]), joined) == contacts(one, joined=joined), seed


def test_a_row_that_rests_has_a_contact_though_its_gap_is_never_other_than_zero() -> None:
    """What touches is told by the law: by its gap a resting row is as one of friction."""
    rests = told([FIRM, FIRM])
    assert contacts(rests, np.array([True]), joined=True) == (Contact(0, 0.0),)
    assert contacts(rests, np.array([False]), joined=True) == ()


def test_a_row_that_is_always_on_is_no_contact() -> None:
    run = told([FLUSH, FLUSH])
    assert contacts(run, joined=True) == (Contact(0, 0.0),)
    assert contacts(replace(run, mode=np.full_like(run.mode, Mode.BILATERAL)), joined=True) == ()


@pytest.mark.parametrize("seed", range(8))
def test_what_comes_later_changes_nothing_that_is_said_of_contacts_before(seed: int) -> None:
    """A run that ends earlier has the contacts and rates that it had, but what ends later has not ended."""
    run = right("linear ball")[1].trajectory
    below = np.flatnonzero(run.mode[:, 0] == Mode.BALLISTIC) + 1
    k = int(np.random.default_rng(seed).choice(below if seed % 2 else np.arange(1, len(run.t))))
    t = run.t[k - 1]
    rows = {name: getattr(run, name)[:k] for name in ("t", "q", "v", "gap", "lam", "energy", "mode")}
    cut = replace(run, **rows, ledger=None, events=tuple(e for e in run.events if e.t <= t))
    signs = [(replace(each, events=(), mode=np.full_like(each.mode, -1))) for each in (run, cut)]
    for whole, part in ((run, cut), signs):
        known = [c for c in contacts(whole) if c.touch <= t]
        wanted = [
            replace(c, **{end: np.inf for end in ("release", "settled", "free") if getattr(c, end) > t}) for c in known
        ]
        assert list(contacts(part)) == wanted
        assert [each[1:] for each in rates(part)] == [each[1:] for each in rates(whole) if each[0].release <= t]


@pytest.mark.parametrize("seed", range(8))
def test_gaps_that_are_straight_between_samples_touch_and_part_where_they_vanish(seed: int) -> None:
    """A run that knows no modes: gap = slope (t - zero) at the samples on either side of every zero."""
    rng = np.random.default_rng(seed)
    zeros = np.cumsum(rng.uniform(1.0, 3.0, 6))
    t = (zeros[:, None] + rng.uniform(0.05, 0.45, (6, 2)) * [-1.0, 1.0]).ravel()
    gap = np.repeat(rng.uniform(0.1, 10.0, 6) * np.tile([-1.0, 1.0], 3), 2) * (t - np.repeat(zeros, 2))
    one = told([OPEN, FLUSH])
    rows = {name: np.zeros((len(t), *getattr(one, name).shape[1:])) for name in ("q", "v", "lam", "energy")}
    mode = np.full((len(t), 1), -1, dtype=one.mode.dtype)
    run = replace(one, t=t, gap=gap[:, None], mode=mode, events=(), ledger=None, **rows)
    found = np.array([(c.touch, c.release) for c in contacts(run)])
    np.testing.assert_allclose(found.ravel(), zeros, rtol=1e-14)


@pytest.mark.parametrize(("gap", "count"), [(1e-6, 2), (1e-9, 2), (1e-11, 1), (0.0, 1)])
def test_contacts_are_one_where_nothing_opens_between_them_but_rounding(gap: float, count: int) -> None:
    """A hop of a nanometre is one; what rounding leaves of the place of a row at rest is none."""
    assert len(contacts(told([OPEN, DEEP, replace(OPEN, gap=gap), DEEP, OPEN]), joined=True)) == count
