"""Where the derivatives of a mechanism's residual differ from zero, and which columns may be stepped together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crossbody.cases.arrays import Bytes
from crossbody.reference.kinds import Floats, Index
from crossbody.reference.linear._derivatives import residual
from crossbody.reference.linear._point import STEP, Point

SEED = 20
LOOKS = 2  # points at which the pattern is looked for
PROBE = 0.6180339887498949


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pattern:
    """A sparse derivative in few steps.

    Attributes:
        nonzero (rows, columns): where it may differ from 0.
        colours (columns,): the step that each column belongs to.
        probe (columns,): a direction in which all columns differ.
    """

    nonzero: Bytes
    colours: Index
    probe: Floats

    @property
    def count(self) -> int:
        """Number of steps."""
        return int(self.colours.max(initial=-1)) + 1


def dense(rows: int, columns: int) -> Pattern:
    """Every entry, one step a column."""
    return _with(np.ones((rows, columns), dtype=np.int8), np.arange(columns))


def coloured(nonzero: Bytes) -> Pattern:
    """Steps for a pattern: the fullest columns first, each into the first step in which it meets no other."""
    full = np.asarray(nonzero, dtype=bool)
    meets = full.T @ full
    colours = np.full(full.shape[1], -1)
    for column in np.argsort(-full.sum(axis=0), kind="stable"):
        taken = set(colours[meets[column]].tolist())
        colours[column] = next(c for c in range(full.shape[1] + 1) if c not in taken)
    return _with(full.astype(np.int8), colours)


def _with(nonzero: Bytes, colours: Index) -> Pattern:
    probe = 1.0 + np.mod(PROBE * np.arange(1, nonzero.shape[1] + 1), 1.0)
    return Pattern(nonzero=nonzero, colours=colours.astype(np.int64), probe=probe)


def observed(at: Point) -> Bytes:
    """Where dr/d(q, v, u) differs from 0 beside a point, at any accelerations and multipliers (n + na, 2 n + nu)."""
    n, na, random = at.system.n, len(at.active), np.random.default_rng(SEED)
    x = np.concatenate([at.q, at.v, at.u])
    found = np.zeros((n + na, len(x)), dtype=bool)
    for _ in range(LOOKS):
        near = x + 1e-3 * random.uniform(0.5, 1.0, len(x)) * np.where(x == 0.0, 1.0, np.abs(x))
        vd, lam = random.uniform(0.5, 1.0, n), random.uniform(0.5, 1.0, na)
        for k in range(len(x)):
            moved = near.astype(complex)
            moved[k] += 1j * STEP
            q, v, u = np.split(moved, [n, 2 * n])
            found[:, k] |= residual(at, q, v, u, vd, lam).imag != 0.0
    return found.astype(np.int8)
