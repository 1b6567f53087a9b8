"""The same linear models by engines: what each way of an engine makes of an equilibrium, beside the reference's.

Two numbers judge a way. The slope: the largest difference of d(v')/d(q, v), row by row, as a part
of the row. The poles: of the model without the rows that are held, matched to the reference's and
compared as a part of their modulus; of poles that nearly coincide the mean, which is well
conditioned where each alone is not (Kato 1966, II.2).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from crossbody import engines
from crossbody.cases import CrossbodyError
from crossbody.cases.arrays import Floats
from crossbody.engines.linear import Tangent
from crossbody.reference.kinds import Array
from crossbody.reports.analysis.places import Place
from crossbody.reports.judging.verdict import Word

COLUMNS = ("place", "engine", "way", "slope", "poles", "unexplained", "limit", "verdict", "why")
POLE_COLUMNS = ("place", "engine", "way", "real", "imag", "reference_real", "reference_imag")
ENGINES = ("mujoco", "pinocchio")
SLOPE, POLES = 1e-7, 1e-6
"""Limits of a way that should be right: the ways difference something, to ten digits at best."""
EXPLAINED = 1e-4
"""What a known property may leave unexplained of the slope: one-sided differences have six digits or five."""
TOGETHER = 1e-2  # distance of poles that count as one cluster, as a part of their modulus
SLOW = 1e-3
"""Part of the fastest pole below which a modulus does not count as a scale; and part of the largest row."""


NO_ACTIVATIONS = {
    "verdict": Word.SKIPPED.value,
    "why": "Activations are states of the reference's model, which the linear models of engines leave out.",
}
NO_FRICTION = {
    "verdict": Word.SKIPPED.value,
    "why": ("Friction is compared by motions: its law near zero slip has no derivative that could be compared "
        "with Coulomb's."),
}  # fmt: skip


def counterparts(found: Sequence[Place], names: Sequence[str] = ENGINES) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Every way of every engine at every equilibrium: one row a way, and one row a pole, 1/s.

    What an engine cannot do is a row with its sentence.
    """
    rows: list[dict[str, Any]] = []
    poles: list[dict[str, Any]] = []
    for place in found:
        if place.spot is None:
            if place.model is not None and place.system.frictional:
                rows += [{"place": place.name, "engine": name, **NO_FRICTION} for name in names]
            continue
        if place.system.activations is not None:
            rows += [{"place": place.name, "engine": name, **NO_ACTIVATIONS} for name in names]
            continue
        for name in names:
            about = {"place": place.name, "engine": name}
            try:
                ways = engines.load(name).linearise(place.case, place.spot)
            except CrossbodyError as error:
                rows.append({**about, "verdict": Word.SKIPPED.value, "why": str(error)})
                continue
            for way in ways:
                row, pairs = compared(place, way)
                rows.append({**about, **row})
                poles += [{**about, "way": way.way, **pair} for pair in pairs]
    return pd.DataFrame(rows, columns=list(COLUMNS)), pd.DataFrame(poles, columns=list(POLE_COLUMNS))


def compared(place: Place, way: Tangent) -> tuple[dict[str, Any], list[dict[str, float]]]:
    """One way beside the reference: its row, and its poles."""
    n = len(place.trim.v)
    full = place.linearised(reduce=False).A
    expected, own = (_poles(place, A) for A in (full, np.vstack([np.eye(n, 2 * n, n), way.slope])))
    own = own[_nearest(expected, own)]
    slope, poles = _distance(way.slope, full[n:]), _clusters_apart(expected, own)
    rest = np.nan if way.explained is None else _distance(way.slope, way.explained)
    row = {
        "way": way.way, "slope": slope, "poles": poles, "unexplained": rest, "limit": SLOPE,
        "verdict": _word(slope, poles, rest).value, "why": way.known,
    }  # fmt: skip
    pairs = [
        {"real": a.real, "imag": a.imag, "reference_real": b.real, "reference_imag": b.imag}
        for a, b in zip(own.tolist(), expected.tolist(), strict=True)
    ]
    return row, pairs


def _word(slope: float, poles: float, rest: float) -> Word:
    if slope <= SLOPE and poles <= POLES:
        return Word.WITHIN
    return Word.EXPECTED if rest <= EXPLAINED else Word.OUTSIDE


def _distance(found: Floats, expected: Floats) -> float:
    """Largest difference in a row, as a part of the row's largest entry."""
    size = np.abs(expected).max(axis=1)
    floor = 1e-9 * float(size.max(initial=0.0)) or 1.0
    return float((np.abs(found - expected).max(axis=1) / np.maximum(size, floor)).max(initial=0.0))


def _poles(place: Place, A: Floats) -> Array:
    """Eigenvalues of a matrix of all states, on the states that the rows leave."""
    if place.held and len(place.trim.active):
        minimal = place.linearised(reduce=True)
        names = place.linearised(reduce=False).states
        A = (A @ minimal.C)[[names.index(state) for state in minimal.states]]
    return np.linalg.eigvals(A).astype(complex)


def _nearest(expected: Array, own: Array) -> Array:
    """Which of one's own poles stands for each expected one."""
    from scipy.optimize import linear_sum_assignment

    return linear_sum_assignment(np.abs(expected[:, None] - own[None, :]))[1]


def _clusters_apart(expected: Array, own: Array) -> float:
    """Largest distance of the means of a cluster, as a part of its modulus."""
    from scipy.sparse.csgraph import connected_components

    size = np.maximum(np.abs(expected), SLOW * np.abs(expected).max(initial=0.0) or 1.0)
    near = np.abs(expected[:, None] - expected[None, :]) <= TOGETHER * np.maximum(size[:, None], size[None, :])
    count, label = connected_components(near, directed=False)
    apart = [abs((own - expected)[label == k].mean()) / size[label == k].max() for k in range(count)]
    return float(max(apart, default=0.0))
