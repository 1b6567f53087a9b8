"""What the arithmetic that all numbers go through must give: rotations, splines and roots.

A metric, a truth and an engine's reader all ask for it, so that what is wrong in it is the same on both sides of a
comparison. Its answers come from elsewhere: those of rotations from unit quaternions as complex matrices (2, 2),

    w + x i + y j + z k  =  [[w + i x, y + i z], [-y + i z, w - i x]],

those of splines from the functions that a spline without knots next to its ends is equal to: cubics, and the cube of
the distance behind an inner sample.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np

from crossbody.cases import rotations
from crossbody.cases.arrays import Floats
from crossbody.cases.brent import brent
from crossbody.cases.splines import FEW, spline
from crossbody.reports.judging.asked import Asked, Found, unlike_by

EXACT, STEP, NEAR = 1e-10, 1e-4, 1e-7
"""Part by which an answer may differ; step of rates by differences, s, and what is left of one by four of them."""
SEED, COUNT = 31, 6
AT = (1, 7)
"""Where quaternions stand in positions: behind one coordinate, and behind two more."""
Square = np.ndarray
"""Complex matrices (n, 2, 2)."""


@cache
def wrong() -> tuple[Found, ...]:
    """Return what is another number than it must be, least and most, and of what."""
    kinds = (_turns, _rates, _splines, _roots)
    return unlike_by(kinds, "arithmetic", "what all numbers go through:", EXACT, 1.0)


def _matrix(q: Floats) -> Square:
    """Return quaternions (n, 4) as complex matrices."""
    w, x, y, z = q.T
    rows = [[w + 1j * x, y + 1j * z], [-y + 1j * z, w - 1j * x]]
    return np.moveaxis(np.array(rows), 2, 0)


def _quaternion(A: Square) -> Floats:
    """Return the quaternions (n, 4) of complex matrices."""
    return np.column_stack([A[:, 0, 0].real, A[:, 0, 0].imag, A[:, 0, 1].real, A[:, 0, 1].imag])


def _exp(e: Floats) -> Floats:
    """Return the quaternions (n, 4) of rotation vectors (n, 3), rad."""
    half = 0.5 * np.linalg.norm(e, axis=1, keepdims=True)
    return np.hstack([np.cos(half), 0.5 * e * np.sinc(half / np.pi)])


def _product(q: Floats, other: Floats) -> Floats:
    return _quaternion(_matrix(q) @ _matrix(other))


def _positions(draw: np.random.Generator) -> Floats:
    """Return positions (n, nq) with a quaternion at each of `AT`, and a coordinate behind them."""
    q = draw.normal(size=(COUNT, AT[-1] + 5))
    for at in AT:
        q[:, at : at + 4] /= np.sqrt(np.sum(q[:, at : at + 4] ** 2, axis=1))[:, None]
    return q


def _moved(q: Floats, v: Floats) -> Floats:
    """Return positions that are off by v (n, nv), of quaternions by rotation vectors in body axes."""
    found = np.empty(q.shape)
    turns = [at + k for at in AT for k in range(4)]
    plain = [i for i in range(q.shape[1]) if i not in turns]
    own = [at - k + j for k, at in enumerate(AT) for j in range(3)]
    found[:, plain] = q[:, plain] + v[:, [i for i in range(v.shape[1]) if i not in own]]
    for k, at in enumerate(AT):
        found[:, at : at + 4] = _product(q[:, at : at + 4], _exp(v[:, at - k : at - k + 3]))
    return found


def _apart(found: Floats, wanted: Floats) -> float:
    """Return the largest difference; infinite where sizes differ."""
    return float(np.max(np.abs(found - wanted))) if found.shape == wanted.shape else np.inf


def _turns() -> Iterator[Asked]:
    """Ask by what positions are off others, also where a quaternion stands for the same as its negative."""
    draw = np.random.default_rng(SEED)
    q = _positions(draw)
    for size in (1e-3, 0.1, 1.7):
        off = size * draw.uniform(-1.0, 1.0, (COUNT, q.shape[1] - len(AT)))
        mine = _moved(q, off)
        flipped = mine.copy()
        flipped[::2, AT[0] : AT[0] + 4] *= -1.0
        for said, other in (("positions", mine), ("positions of the other sign", flipped)):
            yield "signed", f"{said} off by {size:g}", _apart(rotations.signed(other, q, AT), off) / size, 0.0
        angles = np.zeros(q.shape)
        for k, at in enumerate(AT):
            angles[:, at] = np.sqrt(np.sum(off[:, at - k : at - k + 3] ** 2, axis=1))
        plain = [i for i in range(q.shape[1]) if not any(at <= i < at + 4 for at in AT)]
        angles[:, plain] = np.abs(mine - q)[:, plain]
        yield (
            "differences",
            f"positions off by {size:g}",
            _apart(rotations.differences(mine, q, AT), angles) / size,
            0.0,
        )
        for row in range(COUNT):
            way = rotations.ways(np.stack([q[row], mine[row]]), AT)[0]
            yield "ways", f"a step of {size:g}", _apart(way, off[row]) / size, 0.0
    turns, vectors = q[:, AT[0] : AT[0] + 4], draw.normal(size=(COUNT, 3))
    pure = _product(_product(turns, np.insert(vectors, 0, 0.0, axis=1)), turns * [1.0, -1.0, -1.0, -1.0])
    for length in (1.0, 2.5):
        found = np.einsum("nij,nj->ni", rotations.matrices(length * turns), vectors)
        yield "matrices", f"quaternions of length {length:g}", _apart(found, pure[:, 1:]), 0.0
    long = q.copy()
    long[:, AT[1] : AT[1] + 4] *= 3.0
    yield "normalised", "quaternions of length 3", _apart(rotations.normalised(long, AT), q), 0.0


def _rates() -> Iterator[Asked]:
    """Ask how positions, and what they are off by, go on: by differences of a step there and back, and of two."""
    draw = np.random.default_rng(SEED + 1)
    q = _positions(draw)
    nv = q.shape[1] - len(AT)
    v, other = draw.normal(size=(2, COUNT, nv))

    def by_differences(at: list[Floats]) -> Floats:
        far, near, ahead, farther = at
        return (8.0 * (ahead - near) - (farther - far)) / (12.0 * STEP)

    steps = [k * STEP for k in (-2, -1, 1, 2)]
    rate = by_differences([_moved(q, s * v) for s in steps])
    yield "rates", "positions", _within(_apart(rotations.rates(q, v, AT), rate)), 0.0
    for size in (1e-5, 0.8):
        off = size * draw.uniform(-1.0, 1.0, (COUNT, nv))
        mine = _moved(q, off)
        drift = by_differences([rotations.signed(_moved(mine, s * v), _moved(q, s * other), AT) for s in steps])
        found = rotations.drifts(off, v, other, AT)
        yield "drifts", f"positions off by {size:g}", _within(_apart(found, drift)), 0.0


def _within(off: float) -> float:
    """Return 0 for what differences leave."""
    return 0.0 if off <= NEAR else off


def _splines() -> Iterator[Asked]:
    """Ask for functions that splines are equal to, of three samples and of more than are solved as a whole."""
    draw = np.random.default_rng(SEED + 2)
    for count in (3, 4, 9, 2 * FEW + 5, 4 * FEW):
        t = np.cumsum(draw.uniform(0.5, 1.5, count)) / count
        times = np.concatenate([t, draw.uniform(t[0] - 0.1, t[-1] + 0.1, 3 * count)])
        values, wanted = (_equal_to_theirs(at, t) for at in (t, times))
        yield "spline", f"{count} samples", _apart(spline(t, values, times), wanted), 0.0


def _equal_to_theirs(at: Floats, t: Floats) -> Floats:
    """Return functions (m, k) that splines through samples at t are equal to: of three samples parabolas alone."""
    inner = range(2, len(t) - 2, 1 + len(t) // 9)
    cubics = [at**3 - 0.4 * at**2, *(np.maximum(at - t[k], 0.0) ** 3 for k in inner)] if len(t) > 3 else []
    return np.column_stack([at**2 - at, 3.0 * at + 2.0, *cubics])


def _roots() -> Iterator[Asked]:
    """Ask for roots of powers, from either end."""

    def power(x: float) -> float:
        return x**degree - root**degree

    for degree, root in ((1, 0.3), (3, 0.7), (9, -0.45)):
        for a, b in ((-1.0, 1.3), (1.3, -1.0)):
            yield "root", f"a power of {degree}", brent(power, a, b, 1e-14, 1e-15), root
