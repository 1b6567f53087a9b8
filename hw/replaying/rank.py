"""Can what acts be told from what moves? Rank and condition of the map from inputs to generalised forces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import SceneError

Floats = NDArray[np.float64]
SINGULAR = 1e9
"""Condition from which on a combination of inputs is lost in rounding."""
PART = 0.1
"""Of the largest weight of a direction: what belongs to it."""


def conditions(t: Floats, B: Floats, rows: tuple[str, ...], names: tuple[str, ...], model: str) -> Floats:
    """Conditions (n,) of B (n, k, m), inputs of size 1 each, which must be square and regular.

    Args:
        t: times (n,), s.
        B: forces in the k measured coordinates by m inputs.
        rows: names of the coordinates.
        names: of the inputs.
        model: whose they are.

    Raises:
        SceneError: naming inputs that cannot be told apart, coordinates that none of them moves, rank and condition.
    """
    k, m = B.shape[1:]
    if not m:
        raise SceneError(f"{model} has no inputs: nothing acts on {', '.join(rows)} that could be told.")
    size = np.linalg.norm(B, axis=1, keepdims=True)
    U, s, Vt = np.linalg.svd(B / np.where(size > 0.0, size, 1.0))
    with np.errstate(divide="ignore"):
        condition: Floats = s[:, 0] / s[:, -1]
    rank = np.sum(s > s[:, :1] / SINGULAR, axis=1)
    bad = np.flatnonzero(rank < max(k, m))
    if not len(bad):
        return condition
    at = int(bad[0])
    r = int(rank[at])
    where = "everywhere" if len(bad) == len(t) else f"at {len(bad)} of {len(t)} instants, first at t = {t[at]:.6g} s"
    apart, idle = _named(Vt[at, r:], names), _named(U[at, :, r:].T, rows)
    told = [f"they cannot tell {' from '.join(apart)} (only a combination of them shows)"] if len(apart) > 1 else []
    told += [f"{apart[0]} does nothing"] if len(apart) == 1 else []
    told += [f"no input balances {', '.join(idle)}"] if idle else []
    raise SceneError(
        f"{model}: {m} inputs ({', '.join(names)}) and {k} measured coordinates ({', '.join(rows)}), rank {r} {where}, "
        f"condition {condition[at]:.2g}: {'; '.join(told)}. What is needed is one input for each coordinate, away from "
        "singular poses."
    )


def _named(directions: Floats, names: tuple[str, ...]) -> list[str]:
    """Names of what belongs to any of some directions."""
    if not len(directions):
        return []
    weight = np.max(np.abs(directions), axis=0)
    return [name for name, w in zip(names, weight, strict=True) if w > PART * np.max(weight)]
