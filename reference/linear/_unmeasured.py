"""Forces that were not measured: which are looked for, in what record, and how they are given back.

Unknown forces F are inputs of the mechanism (a force on the flange) or multipliers of rows whose
law is not trusted:

    M v' = f(q, v, u + F) + H_A^T lam_A + H_F^T F        lam_A from the laws of the active rows
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from crossbody.cases.arrays import frozen
from crossbody.cases.entry_points import wholes
from crossbody.reference._indices import different
from crossbody.reference._system import System
from crossbody.reference.kinds import Floats, Index
from crossbody.reference.linear._point import STEP, Point, check_coordinates, terms

LARGEST = 1e100  # of a deviation: its square is still a number


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Estimate:
    """Forces with their covariance.

    Attributes:
        t (N,): s.
        force (N, k): the inputs asked for, then the multipliers asked for.
        covariance (N, k, k): of the force.
        q, v (N, n): the motion that goes with it.
        innovation (N, ny): measurement minus its prediction over the deviation expected; white
            and of unit size where model and noise are right. Empty for `balanced`.
    """

    t: Floats
    force: Floats
    covariance: Floats
    q: Floats
    v: Floats
    innovation: Floats

    @property
    def std(self) -> Floats:
        """Standard deviations (N, k); 1.96 of them hold 95 % of the errors of a Gaussian."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Unknown:
    """Which forces are looked for.

    Attributes:
        inputs: inputs of the mechanism to which an unknown part is added.
        rows: rows whose multipliers are unknown; their law is not used.
    """

    inputs: tuple[int, ...] = ()
    rows: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        """Check that both name whole numbers."""
        for name in ("inputs", "rows"):
            object.__setattr__(self, name, wholes(f"Unknown.{name}", getattr(self, name)))

    def __len__(self) -> int:
        """Number of forces."""
        return len(self.inputs) + len(self.rows)


class Record:
    """Instants and inputs of a record, and which forces are unknown in it."""

    def __init__(
        self, system: System, t: ArrayLike, u: ArrayLike | None, unknown: Unknown, active: Sequence[int] | None
    ) -> None:
        check_coordinates(system)
        self.system, self.unknown = system, unknown
        self.t = frozen("estimate", "t", t, (None,))
        given = np.zeros((len(self.t), system.inputs)) if u is None else u
        self.u = frozen("estimate", "u", given, (len(self.t), system.inputs))
        on = np.flatnonzero(np.asarray(system.unilateral) == 0).tolist() if active is None else active
        different("active", on, system.nc)
        different("unknown.rows", unknown.rows, system.nc)
        different("unknown.inputs", unknown.inputs, system.inputs)
        self.held: Index = np.array([i for i in on if i not in unknown.rows], dtype=np.int64)
        self.all: Index = np.concatenate([self.held, np.array(unknown.rows, dtype=np.int64)])

    def at(self, k: int, q: Floats, v: Floats) -> Point:
        """Sample k with all rows, held ones first."""
        return Point(
            system=self.system, t=float(self.t[k]), q=np.array(q), v=np.array(v), u=np.array(self.u[k]), active=self.all
        )  # fmt: skip

    def pushed(self, at: Point, force: Floats) -> Point:
        """With the unknown part of the inputs added."""
        u = at.u.copy()
        u[list(self.unknown.inputs)] += force[: len(self.unknown.inputs)]
        return replace(at, u=u)


def input_columns(at: Point, columns: Sequence[int]) -> Floats:
    """The columns (n, ...) of df/du."""
    found = np.zeros((at.system.n, len(columns)))
    for j, i in enumerate(columns):
        u = at.u.astype(complex)
        u[i] += 1j * STEP
        found[:, j] = terms(at, at.q, at.v, u)[1].imag / STEP
    return found
