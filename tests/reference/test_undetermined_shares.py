"""What the law leaves open: another share of the load of contacts that slide moves nothing before a run says so.

The second machine takes shares that are not of least norm; nothing of the rule that tells is in it.
"""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from friction_scenes import HALF, Body, G, Joint, RowLaw, Scene, Shape, box_on_floor, pair, run, tipped
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


LIFTED, HALVES = 1e-7, (0.2, 0.15, 0.1)  # m: of feet that bear nothing then, and of a box


def on_feet(mu: float, lifted: tuple[int, ...]) -> Scene:
    """Return a box of 1 kg on four round feet, some of them lifted by so little that only what they bear differs."""
    a, b, c = HALVES
    inertia = ((b * b + c * c) / 3.0, (a * a + c * c) / 3.0, (a * a + b * b) / 3.0, 0.0, 0.0, 0.0)
    feet = tuple(
        Shape(name=f"foot {k}", body="box", size=(0.02, 0.0, 0.0),
              position=(x * a, y * b, 0.02 - c + LIFTED * (k in lifted)))
        for k, (x, y) in enumerate(product((-1, 1), (-1, 1)))
    )  # fmt: skip
    return Scene(
        bodies=(Body(name="box", mass=1.0, inertia=inertia),), joints=(Joint(name="free", body="box", type="free"),),
        shapes=(Shape(name="floor", type="plane"), *feet),
        pairs=tuple(pair("floor", foot.name, mu, RowLaw(a0=1e4, a1=200.0)) for foot in feet),
    )  # fmt: skip


@pytest.mark.parametrize("seed", [*range(4), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(4, 30))])
def test_a_box_that_spins_says_how_far_other_shares_would_move_it(seed: int) -> None:
    """Without one foot, or two, the others bear it all, which is a share too: it stays within what is said."""
    rng = np.random.default_rng(seed)
    mu, v, T = float(rng.uniform(0.05, 0.8)), [*rng.normal(size=2), 0, 0, 0, float(10 ** rng.uniform(-1, 1.2))], 0.4
    q0 = [0.0, 0.0, HALVES[2], 1.0, 0.0, 0.0, 0.0]
    one = run(on_feet(mu, ()), q0, v, T, rtol=1e-8)
    far = one.undetermined_by
    assert (far > 0.0) == (one.determined_until < T)
    assert (f"by up to {far:.2g} m until the end" in one.message) == (far > 0.0)
    for lifted in ((0,), (1,), (3,), (0, 3), (1, 2)):
        other = run(on_feet(mu, lifted), q0, v, T, rtol=1e-8)
        turned = 2.0 * abs(other.q[-1, 6] - one.q[-1, 6])
        apart = np.hypot(*(other.q[-1, :2] - one.q[-1, :2])) + turned * np.hypot(*HALVES[:2])
        assert apart <= far + 1e3 * LIFTED
