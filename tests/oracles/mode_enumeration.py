"""What is true of a mode problem: every set of modes that contacts could have, solved one by one, in NumPy alone.

Nothing is searched for: of contacts that stand all directions in which they might begin to slide are those in which
their accelerations lie, by a scan of the circle for one, and by Newton's method from all over the torus for several.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from scipy.optimize import brentq, root

OFF, STICK, SLIP = "off", "stick", "slip"
AROUND, STARTS = 180, 8
SAME = 1e-9


@dataclass(frozen=True)
class Contact:
    """Place of a normal row, places of its tangential ones, and the slip velocity there; none of one that stands."""

    normal: int
    along: list[int]
    mu: float
    slip: np.ndarray | None = None


@dataclass(frozen=True)
class Tried:
    """A set of modes.

    Attributes:
        modes: of every contact.
        excess: by how much faster than its law every row moves.
        margin: by how much the least of its conditions is kept, m/s^2; less than 0 if one is not.
        jam: determinant of what the forces do to their rows, of size 1; none go on where it is not positive.
        pressing: how many real eigenvalues of that are negative. Of an even number the determinant tells nothing.
    """

    modes: tuple[str, ...]
    excess: np.ndarray
    margin: float
    jam: float
    pressing: int


def enumerated(G: np.ndarray, bare: np.ndarray, contacts: list[Contact]) -> list[Tried]:
    """Return all sets of modes, of rows with G = H M^-1 H^T that multipliers have to accelerate by `bare`."""
    own = [(OFF, SLIP) if one.slip is not None else (OFF, STICK, SLIP) for one in contacts]
    found = []
    for modes in product(*own):
        for ways in _directions(G, bare, contacts, modes):
            found.append(tried(G, bare, contacts, modes, ways))
    return found


def _solved(
    G: np.ndarray, bare: np.ndarray, contacts: list[Contact], modes: tuple[str, ...], ways: dict[int, np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Multipliers and excess of all rows, and the eigenvalues of what the forces do to their rows."""
    columns, rows, unit = [], list[int](), np.eye(len(G))
    for i, (one, mode) in enumerate(zip(contacts, modes, strict=True)):
        if mode == OFF:
            continue
        column = unit[one.normal].copy()
        if mode == SLIP:
            column[one.along] = -one.mu * ways[i]
        columns.append(column)
        rows.append(one.normal)
        if mode == STICK:
            columns += [unit[k] for k in one.along]
            rows += one.along
    if not rows:
        return np.zeros(len(G)), -bare, np.ones(1)
    W = np.array(columns).T
    A, size = (G @ W)[rows], np.sqrt(np.diag(G)[rows])
    values, vectors = np.linalg.eigh(G[np.ix_(rows, rows)] / np.outer(size, size))
    base = vectors[:, values > 1e-10 * values[-1]]
    jams = np.linalg.eigvals(base.T @ (A / np.outer(size, size)) @ base)
    lam = W @ np.linalg.lstsq(A, bare[rows], rcond=1e-10)[0]
    return lam, G @ lam - bare, jams


def _across(excess: np.ndarray, one: Contact, angle: float) -> float:
    x, y = excess[one.along]
    return float(np.cos(angle) * y - np.sin(angle) * x)


def _directions(
    G: np.ndarray, bare: np.ndarray, contacts: list[Contact], modes: tuple[str, ...]
) -> list[dict[int, np.ndarray]]:
    """Return the directions of slip that are possible at all, of every contact that slides."""
    pairs = zip(contacts, modes, strict=True)
    sliding = {i: one for i, (one, mode) in enumerate(pairs) if mode == SLIP}
    fixed = {i: one.slip / np.linalg.norm(one.slip) for i, one in sliding.items() if one.slip is not None}
    free = [i for i in sliding if i not in fixed]
    lines = [i for i in free if len(contacts[i].along) == 1]
    if lines:
        assert lines == free
        signs = product((1.0, -1.0), repeat=len(free))
        return [fixed | {i: np.array([sign]) for i, sign in zip(free, one, strict=True)} for one in signs]
    if not free:
        return [fixed]

    def facing(angles: Any) -> dict[int, np.ndarray]:
        return fixed | {i: np.array([np.cos(a), np.sin(a)]) for i, a in zip(free, angles, strict=True)}

    def aside(angles: Any) -> list[float]:
        excess = _solved(G, bare, contacts, modes, facing(angles))[1]
        return [_across(excess, contacts[i], a) for i, a in zip(free, angles, strict=True)]

    def alone(angle: float) -> float:
        return aside([angle])[0]

    near, places = 1e-6 * float(np.abs(bare).max()), list[np.ndarray]()
    if len(free) == 1:
        grid = 2.0 * np.pi * np.arange(AROUND + 1) / AROUND
        values = [alone(a) for a in grid]
        for a, b, low, high in zip(grid, grid[1:], values, values[1:], strict=False):
            if low * high <= 0.0:
                places.append(np.array([brentq(alone, a, b, xtol=1e-14)]))
    else:
        for start in product(2.0 * np.pi * np.arange(STARTS) / STARTS, repeat=len(free)):
            places.append(np.asarray(root(aside, start, tol=1e-13).x))
    kept = list[np.ndarray]()
    for place in places:
        ends = np.array([np.cos(place), np.sin(place)])
        if np.abs(aside(place)).max() < near and all(np.abs(ends - other).max() > 1e-6 for other in kept):
            kept.append(ends)
    return [fixed | {i: ends[:, k] for k, i in enumerate(free)} for ends in kept]


def tried(
    G: np.ndarray, bare: np.ndarray, contacts: list[Contact], modes: tuple[str, ...], ways: dict[int, np.ndarray]
) -> Tried:
    """Return one set of modes, of contacts that slide in the given directions."""
    lam, excess, jams = _solved(G, bare, contacts, modes, ways)
    kept = [np.inf]
    for i, (one, mode) in enumerate(zip(contacts, modes, strict=True)):
        heavy = G[one.normal, one.normal]
        if mode == OFF:
            kept.append(float(excess[one.normal]))
            continue
        kept += [float(lam[one.normal]) * heavy, float(SAME * np.abs(bare).max() - abs(excess[one.normal]))]
        if mode == STICK:
            kept.append(float(one.mu * lam[one.normal] - np.linalg.norm(lam[one.along])) * heavy)
            kept.append(float(SAME * np.abs(bare).max() - np.abs(excess[one.along]).max()))
        elif one.slip is None:
            kept.append(float(ways[i] @ excess[one.along]))
    exact = [x for x in kept if not 0.0 <= x <= SAME * float(np.abs(bare).max())]  # laws that are kept are no margin
    pressing = int((jams.real[np.abs(jams.imag) <= SAME * np.abs(jams)] < 0.0).sum())
    return Tried(modes, excess, min(exact), float(np.prod(jams).real), pressing)
