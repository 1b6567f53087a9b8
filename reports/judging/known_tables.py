"""Coefficients of the reference's integrators against the conditions of their order: sums that need no motion.

A motion whose equations do not depend on time asks for no instant of a stage, and one at a loose tolerance for no last
digits. For a method of order p with stages c = A 1, and of an estimate of order q,

    b c^k = 1 / (k + 1),    b (c^m * (A c^k)) = 1 / ((k + 1) (k + m + 2)),    e c^k = 0

for k + 1 <= p, k + m + 2 <= p and k < q (Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.2).
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.reference.core import bogacki, dop853_table, esdirk
from crossbody.reports.judging.asked import Found

ROUNDED = 1e-14
"""What sums of coefficients of some tens, given to 16 digits, may be off by."""
STAGES = dop853_table.STAGES
DIAGONAL = esdirk.GAMMA * np.diag([0.0, *np.ones(esdirk.STAGES - 1)])
METHODS: tuple[tuple[str, Floats, Floats, Floats, int], ...] = (
    ("explicit", dop853_table.A[:STAGES, :STAGES], dop853_table.A[STAGES, :STAGES], dop853_table.C[:STAGES], 8),
    ("implicit", esdirk.A + DIAGONAL, esdirk.B, esdirk.C, 4),
    ("between ticks", np.pad(bogacki._A, ((0, 0), (0, 1))), bogacki.B, bogacki.C, 3),
)
"""Name, stages, weights, instants and order."""
ESTIMATES: tuple[tuple[str, Floats, Floats, int], ...] = (
    ("explicit", dop853_table.E5, dop853_table.C[: STAGES + 1], 5),
    ("explicit", dop853_table.E3, dop853_table.C[: STAGES + 1], 3),
    ("implicit", esdirk.E, esdirk.C, 3), ("between ticks", bogacki._E, bogacki.C, 2),
)  # fmt: skip


@cache
def wrong() -> tuple[Found, ...]:
    """Return the integrator, number, least and most, and condition, of what does not hold."""
    return tuple(
        (f"reference {name} (table)", off, (0.0, ROUNDED), what)
        for name, off, what in (*_orders(), *_estimates()) if not abs(off) <= ROUNDED
    )  # fmt: skip


def _orders() -> Iterator[tuple[str, float, str]]:
    dense = dop853_table.A.sum(axis=1) - dop853_table.C
    yield "explicit", float(np.max(np.abs(dense))), "instants of its stages between"
    for name, A, b, c, order in METHODS:
        yield name, float(np.max(np.abs(A.sum(axis=1) - c))), "instants of its stages"
        for k in range(order):
            yield name, float(b @ c**k) - 1.0 / (k + 1), f"c^{k}"
        for k in range(order - 1):
            for m in range(order - 1 - k):
                yield name, float(b @ (c**m * (A @ c**k))) - 1.0 / ((k + 1) * (k + m + 2)), f"c^{m} A c^{k}"


def _estimates() -> Iterator[tuple[str, float, str]]:
    for name, e, c, order in ESTIMATES:
        for k in range(order):
            yield name, float(e @ c**k), f"an estimate of c^{k}"
