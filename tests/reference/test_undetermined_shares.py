"""What the law leaves open: another share of the load of contacts that slide moves nothing before a run says so.

The second machine takes shares that are not of least norm; nothing of the rule that tells is in it.
"""

from __future__ import annotations

import numpy as np
import pytest
from friction_scenes import HALF, G, box_on_floor, run, tipped
from scipy.optimize import linprog

from crossbody.reference.kinds import Floats
from crossbody.reference.sundials.balance import Balance

PARTED = 1e-6  # m and rad
T_END, NUDGED = 0.12, 1e-9  # s, and m and rad
REACHED = 0.1  # s, behind the first impacts: from there on the second machine may crawl
OPEN = 1e-8  # part of the terms of an acceleration, squared, above which it is none of rounding


def share_otherwise(monkeypatch: pytest.MonkeyPatch, part: float) -> None:
    """Let contacts that slide share their load by this part of the way to where one of them would pull; its sign says
    to which end.
    """
    least_norm = Balance.forces

    def forces(self: Balance, pulled: bool = True) -> Floats:
        lam, (seen, places, rows) = least_norm(self, pulled), (self.seen, self.unknowns.places, self.sliding)
        if not self.unknowns.slides:
            return lam
        if lam.ndim > 1:
            return np.array([self.one(k).forces(pulled) for k in range(len(lam))])
        _, values, right = np.linalg.svd(self.A)
        for z in right[values < 1e-10 * values[0]]:
            other = np.zeros(len(lam))
            other[places] = z / self.size
            for i, k, along in self.unknowns.slides:
                other[along] = -rows.mu[i] * other[k] * self.ways[i]
            if not other @ seen.G @ other > OPEN * (other**2 @ np.diag(seen.G)):
                continue
            other *= np.sign(np.cos(np.arange(len(other))) @ other) * np.sign(part)
            falling = [k for i in rows.ways if i in seen.at and other[k := seen.at[i]] < 0.0]
            lam = lam + abs(part) * min((max(lam[k], 0.0) / -other[k] for k in falling), default=0.0) * other
        return lam

    monkeypatch.setattr(Balance, "forces", forces)


@pytest.mark.parametrize("part", [0.5, pytest.param(-0.5, marks=pytest.mark.slow)])
@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2, 3, 4, 5, 7))])
def test_another_share_moves_nothing_while_a_motion_is_determined(
    seed: int, part: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene, q0 = tipped(seed)
    at = np.linspace(0.0, T_END, 121)
    one = run(scene, q0, np.zeros(6), T_END, rtol=1e-9, samples=at)
    near = run(scene, q0 + NUDGED, np.zeros(6), T_END, rtol=1e-9, samples=at)
    share_otherwise(monkeypatch, part)
    other = run(scene, q0, np.zeros(6), T_END, rtol=1e-8, samples=at, solver="cvode", max_steps=4000)
    count = min(len(one.t), len(near.t), len(other.t))
    apart = np.abs(one.q[:count] - other.q[:count]).max(axis=1)
    grown = np.maximum.accumulate(np.abs(one.q[:count] - near.q[:count]).max(axis=1)) / NUDGED
    determined = at[:count] < one.determined_until
    assert at[count - 1] >= min(one.determined_until, REACHED), other.message
    assert (apart <= PARTED * np.maximum(grown, 1.0))[determined].all()


@pytest.mark.parametrize("part", [0.5, -0.5])
def test_another_share_moves_a_box_that_spins_and_slides(part: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """So much that the run says it is not determined, from the start on."""
    start = [0, 0, 0.1, 1, 0, 0, 0], [1.0, 0.3, 0, 0, 0, 2.0], 0.1
    one = run(box_on_floor(0.3), *start, rtol=1e-9)
    share_otherwise(monkeypatch, part)
    other = run(box_on_floor(0.3), *start, rtol=1e-8, solver="cvode")
    assert np.abs(one.q[-1] - other.q[-1]).max() > 1e-3
    assert 0.0 < one.determined_until < 1e-3


def _open_accelerations(speed: float, spin: float, mu: float) -> float:
    """By how much the acceleration across its way of a box that slides and spins flat is open, m/s^2: all shares that
    hold it up and upright.
    """
    x, y = np.array([[i * HALF[0], j * HALF[1]] for i in (-1, 1) for j in (-1, 1)]).T
    slip = np.array([speed - spin * y, spin * x])
    push = -mu * slip / np.linalg.norm(slip, axis=0)
    equal = np.array([np.ones(4), y + HALF[2] * push[1], x + HALF[2] * push[0]])
    least, most = (sign * linprog(sign * push[1], A_eq=equal, b_eq=[G, 0, 0]).fun for sign in (1.0, -1.0))
    return float(most - least)


@pytest.mark.parametrize("spin", [0.01, 0.03, 0.1, 0.3, 1.0])
def test_no_motion_is_determined_for_longer_than_shares_move_nothing(spin: float) -> None:
    one = run(box_on_floor(0.3), [0, 0, HALF[2], 1, 0, 0, 0], [1.0, 0, 0, 0, 0, spin], 0.2, rtol=1e-9)
    until = min(one.determined_until, one.t[-1])
    assert until > 0.0
    assert 0.5 * _open_accelerations(1.0, spin, 0.3) * until**2 <= PARTED
