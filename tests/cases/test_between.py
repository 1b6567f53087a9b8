"""A recorded motion between its samples: smooth pieces are told exactly, and no piece knows what is behind an event."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from crossbody.cases import Mode, Trajectory
from crossbody.cases.between import between


def pieces(rng: np.random.Generator, twice: bool) -> tuple[Trajectory, np.ndarray, list[np.ndarray]]:
    """A cubic of every signal on each piece; where an event's instant stands `twice` they jump, else they bend there.

    Returns:
        the record, the instants of its events with start and end, and the coefficients (4, columns) of each piece.
    """
    ends = np.concatenate([[0.0], np.cumsum(rng.uniform(0.2, 1.0, 4))])
    times, rows, modes, made = [], [], [], list[np.ndarray]()
    for i, (a, b) in enumerate(itertools.pairwise(ends)):
        made.append(rng.normal(size=(4, 7)))
        if not twice and i:
            made[-1][0] = at(made[-2], ends[i - 1], a)[0]
        inner = np.sort(rng.uniform(a, b, int(rng.integers(4, 9))))
        t = np.concatenate([[a], inner, [b] if twice or i == 3 else []])
        times.append(t)
        rows.append(at(made[-1], a, t))
        modes.append(np.full(len(t), i % 2 * Mode.CONTACT))
    t, all_ = np.concatenate(times), np.concatenate(rows)
    q, v, gap, lam, energy = np.split(all_, [2, 3, 4, 5], axis=1)
    return Trajectory(t=t, q=q, v=v, gap=gap, lam=lam, energy=energy, mode=np.concatenate(modes)[:, None]), ends, made


def at(c: np.ndarray, start: float, t: float | np.ndarray) -> np.ndarray:
    """A cubic (4, columns) from `start` on, at instants (n,)."""
    return np.vander(np.atleast_1d(np.asarray(t)) - start, 4, increasing=True) @ c


@pytest.mark.parametrize("twice", [True, False])
@pytest.mark.parametrize("seed", range(10))
def test_cubic_pieces_are_told_exactly(seed: int, twice: bool) -> None:
    rng = np.random.default_rng(seed)
    run, ends, made = pieces(rng, twice)
    times = np.sort(rng.uniform(0.0, ends[-1], 60))
    found = between(run)(times)
    which = np.searchsorted(ends, times) - 1
    wanted = np.array([at(made[i], ends[i], t)[0] for i, t in zip(which, times, strict=True)])
    told = np.concatenate([found.q, found.v, found.gap, found.lam, found.energy], axis=1)
    np.testing.assert_allclose(told, wanted, rtol=0.0, atol=1e-9 * np.abs(wanted).max())
    assert np.array_equal(found.mode[:, 0], which % 2 * Mode.CONTACT)


@pytest.mark.parametrize("seed", range(10))
def test_an_instant_asked_for_twice_has_both_sides(seed: int) -> None:
    run, ends, made = pieces(np.random.default_rng(seed), twice=True)
    found = between(run)(np.repeat(ends[1:-1], 2))
    for i, t in enumerate(ends[1:-1]):
        np.testing.assert_allclose(found.q[2 * i], at(made[i], ends[i], t)[0, :2], rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(found.q[2 * i + 1], at(made[i + 1], t, t)[0, :2], rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_a_run_that_knows_neither_events_nor_modes_is_joined_by_straight_lines(seed: int) -> None:
    rng = np.random.default_rng(seed)
    run, ends, _ = pieces(rng, twice=False)
    blind = Trajectory(
        t=run.t, q=run.q, v=run.v, gap=run.gap, lam=run.lam, energy=run.energy, mode=np.full_like(run.mode, -1)
    )
    times = np.sort(rng.uniform(0.0, ends[-1], 20))
    found = between(blind)(times)
    np.testing.assert_allclose(found.q[:, 0], np.interp(times, run.t, run.q[:, 0]), rtol=0.0, atol=1e-12)
