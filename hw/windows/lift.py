"""The whole state of a mechanism from the coordinates that a rig measures, and its derivatives."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import SceneError
from crossbody.reference import System

Array = NDArray[np.complex128]
SINGULAR = 1e-12  # singular value of the rows, over the largest, that holds nothing
POLISH = 2
"""Newton steps from a closed start: one carries a complex step on, the other rounding of the real part."""


def check_measured(system: System, seen: tuple[int, ...], name: str) -> None:
    """Raise SceneError unless the rows are always on and leave just the measured coordinates free."""
    if np.any(np.asarray(system.unilateral)) or system.n - system.nc != len(seen):
        raise SceneError(
            f"{name}: {system.nc} rows leave {system.n - system.nc} of {system.n} coordinates "
            f"free and {len(seen)} are measured; both must be the same, and no row may open."
        )


def rows_at(system: System, q: Array, v: Array, p: Array) -> tuple[Array, Array, Array]:
    """H (nc, n), h and H' v (nc,) of all rows, in complex arithmetic."""
    nc, n = system.nc, system.n
    H, h, drift, w = (np.zeros(s, np.complex128) for s in ((nc, n), nc, nc, system.scratch))
    M, f, u = (np.zeros(s, np.complex128) for s in ((n, system.mass_block), n, system.inputs))
    system.dynamics(0.0, q, v, u, p, M, f, w)
    system.rows(0.0, q, v, p, w, np.arange(nc), nc, H, h, drift)
    return H, h, drift


def closed_by(H: NDArray[Any], others: NDArray[np.int64], right: NDArray[Any]) -> NDArray[Any]:
    """What the coordinates that are not measured must do so that rows close: the solution of H[:, others] x = right."""
    block = H[:, others]
    try:
        return np.linalg.solve(block, right)
    except np.linalg.LinAlgError:
        _, s, Vt = np.linalg.svd(block.real)
        rank = int(np.sum(s > SINGULAR * s[0]))
        free = [int(i) for i in others[np.abs(Vt[-1]) > 0.1 * np.max(np.abs(Vt[-1]))]]
        raise SceneError(
            f"A singular pose: the {len(block)} rows have rank {rank} in the coordinates that are not "
            f"measured, and leave coordinates {free} free; the measured ones do not determine the pose there."
        ) from None


def lift(system: System, seen: tuple[int, ...], q: Array, y: Array, yd: Array, p: Array) -> Array:
    """State (2 n,) that closes all rows, h = 0 and H v = 0, with the measured coordinates as given.

    Args:
        system: the mechanism; all its rows are always on.
        seen: indices of the measured coordinates.
        q: a closed state nearby (n,).
        y: measured coordinates (k,).
        yd: measured rates (k,).
        p: parameters of the kernels.
    """
    n = system.n
    own = np.array(seen)
    others = np.setdiff1d(np.arange(n), own)
    x, v = q.astype(np.complex128), np.zeros(n, np.complex128)
    x[own], v[own] = y, yd
    for _ in range(POLISH):
        H, h, _ = rows_at(system, x, v, p)
        x[others] -= closed_by(H, others, h)
    H, _, _ = rows_at(system, x, v, p)
    v[others] = -closed_by(H, others, H[:, own] @ v[own])
    return np.concatenate([x, v])
