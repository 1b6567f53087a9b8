"""Poles over a parameter of a case, and where its equilibria become unstable on the way."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

import numpy as np
import pandas as pd
from scipy.optimize import brentq

from crossbody import cases
from crossbody.cases import InvalidValue, Value
from crossbody.cases.arrays import Floats
from crossbody.reference.linear import LinearModel, locus
from crossbody.reports.analysis.places import Place, places

LIMITS = ("place", "parameter", "value", "unstable", "frequency")
AT_REST = 1e-7
"""Part of the fastest pole below which one stands at 0 and says nothing about stability: what a loop
integrates, and what nothing depends on. Two of them together are scattered by the root of rounding."""


class Family:
    """The equilibria of a case over one of its parameters, from where `places` looks."""

    def __init__(
        self, name: str, variant: str | None, overrides: Mapping[str, Value], at: Mapping[str, float], parameter: str
    ) -> None:
        self.name, self.variant, self.overrides, self.at, self.parameter = name, variant, overrides, at, parameter
        self._found: dict[float, tuple[Place, ...]] = {}

    def places(self, value: float) -> tuple[Place, ...]:
        """Those at one value; kept, because every place is followed by itself."""
        if value not in self._found:
            case = cases.load(self.name, self.variant, **{**self.overrides, self.parameter: value})
            self._found[value] = places(case, self.at)
        return self._found[value]

    def model(self, k: int, value: float) -> LinearModel:
        """Of place k."""
        place = self.places(value)[k]
        if place.model is None:
            raise InvalidValue(f"There is no equilibrium {place.name!r} at {self.parameter} = {value:g}.")
        return place.model


def root_locus(family: Family, values: Sequence[float]) -> pd.DataFrame:
    """Poles of every place, joined to branches: one row a pole."""
    parts = []
    for k, place in enumerate(family.places(values[0])):
        found = locus(lambda value, k=k: family.model(k, value), values)  # type: ignore[misc]
        head = {"place": place.name, "parameter": family.parameter, "value": found.values}
        for branch, line in enumerate(found.poles.T):
            parts.append(pd.DataFrame({**head, "branch": branch, "real": line.real, "imag": line.imag}))
    return pd.concat(parts, ignore_index=True)


def limits(family: Family, values: Sequence[float]) -> pd.DataFrame:
    """Values between the given ones at which a place gains or loses its stability: columns `LIMITS`.

    `unstable` says on which side, `frequency` is that of the pole which crosses, rad/s.
    """
    rows = [row for k in range(len(family.places(values[0]))) for row in _crossings(family, k, values)]
    return pd.DataFrame(rows, columns=list(LIMITS))


def _crossings(family: Family, k: int, values: Sequence[float]) -> Iterator[dict[str, object]]:
    growths = [_rightmost(family.model(k, value)).real for value in values]
    for (low, before), (high, after) in pairwise(zip(values, growths, strict=True)):
        if (before > 0.0) != (after > 0.0):
            at = float(brentq(lambda value: _rightmost(family.model(k, value)).real, low, high))
            yield {
                "place": family.places(values[0])[k].name, "parameter": family.parameter, "value": at,
                "unstable": "above" if after > 0.0 else "below",
                "frequency": abs(_rightmost(family.model(k, at)).imag),
            }  # fmt: skip


def _rightmost(model: LinearModel) -> complex:
    """The pole of the largest real part, without those at rest."""
    poles = model.poles()
    size: Floats = np.abs(poles)
    moving = poles[size > AT_REST * size.max(initial=0.0)]
    return complex(moving[0]) if len(moving) else 0j
