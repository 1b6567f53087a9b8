"""The first place where a guard fires: Chebyshev proxies, roots of their colleague matrices.

A guard is a conjunction of smooth terms and fires where all of them are at or below zero. On each interval every term
is interpolated at Chebyshev points; where the tail of its series says that it is not resolved, the points are doubled,
and then the interval is halved. Between neighbouring roots of the series and of their derivatives no term changes its
sign: a look at each of them and between them finds every window, that of a double root and that of two terms included.
Where the window begins is then located on the guard itself.

The compiled loop searches by another rule; what one of them misses the other has no reason to miss.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from crossbody.cases.brent import brent
from crossbody.reference.kinds import Floats

SCREENING, COARSE, FINE = 4, 8, 16  # degrees tried: the first only to tell that nothing fires
HALVINGS = 6
TAIL = 2  # coefficients taken for what is left out
CAUTION = 8.0  # what is left out, in units of that
AT_START = 1e-6  # part of an interval from whose start a root cannot be told: a row that has just switched is at zero
NEARLY_REAL = 1e-3  # imaginary part, in half intervals, below which a root may be a double one
ULP = float(np.finfo(np.float64).eps)

PLACES = {degree: -np.cos(np.pi * np.arange(degree + 1) / degree) for degree in (SCREENING, COARSE, FINE)}
SERIES = {degree: np.linalg.inv(chebyshev.chebvander(x, degree)) for degree, x in PLACES.items()}

Terms = Callable[[float], Floats]
LARGEST = 1e290
"""Of a term: sums of it are finite."""


class Together:
    """Terms that several instants are asked for at once, and that are kept.

    Args:
        evaluate: terms (n, k) at n instants.
    """

    def __init__(self, evaluate: Callable[[list[float]], Floats]) -> None:
        self._evaluate, self._known = evaluate, dict[float, Floats]()

    def at(self, times: list[float]) -> list[Floats]:
        """Terms (k,) at each of these instants."""
        if missing := [t for t in dict.fromkeys(times) if t not in self._known]:
            self._known.update(zip(missing, self._evaluate(missing), strict=True))
        return [self._known[t] for t in times]

    def __call__(self, t: float) -> Floats:
        """Terms (k,) at an instant."""
        return self.at([t])[0]


def stay_above(terms: Terms, a: float, b: float) -> NDArray[np.bool_]:
    """Return which of the terms (k,) have series on [a, b] that stay above zero; all guards are screened at once."""
    series, tail = _series(terms, a, b, SCREENING)[1:]
    return _least(series) > CAUTION * tail


def first(
    terms: Terms, a: float, b: float, relative: float, absolute: Floats, armed: bool = True, halvings: int = HALVINGS
) -> float | None:
    """The first instant of [a, b] at which a guard is at zero or below, or None.

    Args:
        terms: values (k,) of the guard's terms at an instant; it keeps what it was asked before.
        a: start of the interval.
        b: its end.
        relative: precision of a term in units of its largest value; a smaller window cannot be told from an error.
        absolute: (k,) precision below which a term is noise.
        armed: whether a guard that is not above zero at `a` fires there; else it must rise first.
        halvings: that may still follow.
    """
    middle, half = 0.5 * (a + b), 0.5 * (b - a)
    for degree in (COARSE, FINE):
        (times, values), series, tail = _series(terms, a, b, degree)
        if (_least(series) > CAUTION * tail).any():
            return None
        if (tail <= relative * np.abs(values).max(axis=0) + absolute).all():
            return _inspect(terms, [a, b, *_turns(series, middle, half)], armed)
    if halvings == 0 or not a < middle < b:
        return _inspect(terms, [*times, *_turns(series, middle, half)], armed)
    found = first(terms, a, middle, relative, absolute, armed, halvings - 1)
    return first(terms, middle, b, relative, absolute, armed, halvings - 1) if found is None else found


def _series(terms: Terms, a: float, b: float, degree: int) -> tuple[tuple[list[float], Floats], Floats, Floats]:
    """Return instants with the terms there (degree + 1, k), their series, and what it leaves out (k,)."""
    middle, half = 0.5 * (a + b), 0.5 * (b - a)
    times = [a, *(middle + half * PLACES[degree][1:-1]).tolist(), b]
    found = terms.at(times) if isinstance(terms, Together) else [terms(t) for t in times]
    values = np.clip(found, -LARGEST, LARGEST)  # infinite where nothing fires
    series = SERIES[degree] @ values
    return (times, values), series, np.abs(series[-TAIL:]).sum(axis=0)


def _least(series: Floats) -> Floats:
    """Return a lower bound (k,) of what the series take."""
    bound: Floats = series[0] - np.abs(series[1:]).sum(axis=0)
    return bound


def _turns(series: Floats, middle: float, half: float) -> list[float]:
    """Where the terms have roots and extrema, s; complex roots near the axis may be a double one."""
    places: list[float] = []
    for column in series.T:
        slope = chebyshev.chebder(column)
        monotone = abs(slope[0]) > np.abs(slope[1:]).sum()
        for polynomial in (column,) if monotone else (column, slope):
            if abs(polynomial[0]) > np.abs(polynomial[1:]).sum():
                continue
            used = chebyshev.chebtrim(polynomial, ULP * np.abs(polynomial).max())
            roots = chebyshev.chebroots(used)
            near = roots.real[(np.abs(roots.imag) < NEARLY_REAL) & (np.abs(roots.real) < 1.0)]
            places += (middle + half * near).tolist()
    return places


def _inspect(terms: Terms, marks: list[float], armed: bool) -> float | None:
    """Look at the marks and between them for the first change from above zero; armed, the first mark may be it."""

    def guard(t: float) -> float:
        return float(terms(t).max())

    def fired(t: float) -> bool:
        """Exactly zero is where bodies move together: no row switches; a guard of `watch` counts from there on."""
        return guard(t) < 0.0 if armed else guard(t) <= 0.0

    first_mark, last_mark = min(marks), max(marks)
    near = first_mark + AT_START * (last_mark - first_mark)
    marks = [first_mark, *sorted({t for t in marks if t > near})]
    places = sorted({*marks, *(0.5 * (x + y) for x, y in pairwise(marks))})
    before, above = places[0], not fired(places[0])
    for t in places[1:]:
        if not fired(t):
            above = True
        elif above:
            return _locate(guard, before, t)
        elif armed and t == places[1]:
            return before
        before = t
    return None


def _locate(guard: Callable[[float], float], before: float, fired: float) -> float:
    """The instant at which a guard, above zero before, is so no longer."""
    resolution = 2.0 * ULP * max(abs(before), abs(fired))
    t = float(brent(guard, before, fired, xtol=max(resolution, 1e-300), rtol=4.0 * ULP))
    while guard(t) > 0.0 and t < fired:
        t = min(t + resolution, fired)
    return t
