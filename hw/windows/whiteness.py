"""Is what the model leaves over noise? Autocorrelation of residuals and their correlation with the inputs.

For white residuals of n samples that do not depend on the input each correlation is normal with
variance 1/n at every lag, so that 99 of 100 lie within +-2.576/sqrt(n) (Ljung, System
Identification, 2nd ed., 16.6).

Sampled much faster than anything moves, every residual fails that test: n is large, the lags span a
fraction of the motion, and an error of the model far below the noise still shows. So residuals are
averaged over as many samples as the motion allows (`stride`), and the band is widened by what an
error as large as the noise of one sample (`floor`) would give: floor^2/c0 for a residual with
itself, floor/sqrt(c0) with an input, c0 the variance of the averages. Inside then means: what the
model leaves unexplained is not larger than the noise of a sample. Products never cross two windows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crossbody.cases.arrays import Floats

BAND = 2.5758293035489004  # quantile of the normal distribution for 99 %, two-sided
LAGS = 25
ORDER = 5  # of the autoregression that whitens an input
OVERSAMPLED = 12.0
"""Averages of a residual a period of the motion's mean frequency: harmonics up to the sixth are told."""
FEWEST = 8  # averages of a window
BLOCK = 50  # samples over which the noise is looked at together
FOURTH = np.sqrt(70.0)  # size of the fourth differences of white noise of size 1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Correlation:
    """Correlations at lags, beside their 99 % band.

    Attributes:
        lags (m,): in averages of `stride` samples; of a residual behind an input, or behind itself.
        values (m,): at most 1 in size.
        band: 99 of 100 lie within +-band if what is left is white noise and an error as large as `floor`.
        stride: samples that were averaged.
        floor: error that the band admits, in the unit of the residual.
    """

    lags: NDArray[np.int64]
    values: Floats
    band: float
    stride: int = 1
    floor: float = 0.0

    @property
    def inside(self) -> float:
        """Part of the lags, 0 to 1, within the band; lag 0 of a residual with itself not counted."""
        own = np.abs(self.values[self.lags != 0]) if self.values[self.lags == 0].tolist() == [1.0] else self.values
        return float(np.mean(np.abs(own) <= self.band))


def autocorrelation(
    residual: Floats | Sequence[Floats], most: int = LAGS, stride: int = 1, floor: float = 0.0
) -> Correlation:
    """Of a residual (n,), or one array a window, with itself, lags 0 to `most` in means of `stride` samples.

    An error below `floor` is not worth telling.
    """
    pieces = [averaged(piece, stride) for piece in _pieces(residual)]
    found = _correlation(pieces, pieces, min(most, max(map(len, pieces)) - 1))
    middle = len(found.lags) // 2
    values = found.values[middle:]
    values[0] = 1.0
    admitted = floor**2 / max(_variance(pieces), 1e-300) if floor else 0.0
    return Correlation(
        lags=found.lags[middle:], values=values, band=found.band + admitted, stride=stride, floor=floor
    )  # fmt: skip


def crosscorrelation(
    residual: Floats | Sequence[Floats], u: Floats | Sequence[Floats], most: int = LAGS, stride: int = 1,
    floor: float = 0.0,
) -> Correlation:  # fmt: skip
    """Of a residual with an input, lags -most to most; beyond white noise of either it needs whitening.

    Both pass the filter that whitens the input (autoregressive, of order 5, by least squares): a slow input
    alone would widen the scatter beyond the band. Args as for `autocorrelation`; u like the residual.
    """
    left, inputs = ([averaged(piece, stride) for piece in _pieces(x)] for x in (residual, u))
    taps = _whitener(inputs)
    if not (pairs := [(r, x) for r, x in zip(left, inputs, strict=True) if len(r) > len(taps)]):
        return Correlation(lags=np.zeros(1, np.int64), values=np.zeros(1), band=1.0, stride=stride, floor=floor)
    a, b = ([np.convolve(x, taps, "valid") for x in side] for side in zip(*pairs, strict=True))
    found = _correlation(a, b, min(most, max(map(len, a)) - 1))
    admitted = floor * float(np.linalg.norm(taps)) / max(np.sqrt(_variance(a)), 1e-300) if floor else 0.0
    return Correlation(lags=found.lags, values=found.values, band=found.band + admitted, stride=stride, floor=floor)


def stride_of(y: Floats | Sequence[Floats], noise: float) -> int:
    """Samples that a residual may be averaged over without losing what moves.

    The mean frequency of the motion is that of its zero crossings (Rice 1944), |y'|/(2 pi |y -
    mean|), the noise of the differences taken off.

    Args:
        y: measured (n,), or one array a window.
        noise: of its samples.
    """
    pieces = _pieces(y)
    steps = sum(float(np.sum(np.diff(piece) ** 2)) for piece in pieces) / max(sum(len(p) - 1 for p in pieces), 1)
    power = sum(float(np.sum((piece - piece.mean()) ** 2)) for piece in pieces) / sum(map(len, pieces))
    moved = steps - 2.0 * noise**2
    if not moved > 0.0 or not power > 0.0:
        return 1
    period = 2.0 * np.pi * np.sqrt(power / moved)
    return max(1, min(int(period / OVERSAMPLED), min(map(len, pieces)) // FEWEST))


def noise_level(y: Floats | Sequence[Floats]) -> float:
    """Size of the white noise (or of the rounding) of samples: of their fourth differences, the median of blocks.

    What moves smoothly leaves no fourth difference; impacts are in few blocks.
    """
    found = []
    for piece in _pieces(y):
        fourth = np.diff(piece, 4) / FOURTH
        found += [float(np.sqrt(np.mean(b**2))) for b in np.array_split(fourth, max(1, len(fourth) // BLOCK)) if len(b)]
    return float(np.median(found)) if found else 0.0


def averaged(x: Floats, stride: int) -> Floats:
    """Means of `stride` samples each; what is left over at the end is dropped."""
    if stride == 1:
        return x
    count = len(x) // stride
    means: Floats = x[: count * stride].reshape(count, stride).mean(axis=1)
    return means


def _pieces(x: Floats | Sequence[Floats]) -> list[Floats]:
    return [x] if isinstance(x, np.ndarray) else list(x)


def _variance(pieces: Sequence[Floats]) -> float:
    return float(np.var(np.concatenate(pieces)))


def _correlation(a: Sequence[Floats], b: Sequence[Floats], most: int) -> Correlation:
    n = sum(map(len, a))
    mean_a, mean_b = (float(np.mean(np.concatenate(x))) for x in (a, b))
    lags, cross, norm_a, norm_b = np.arange(-most, most + 1), np.zeros(2 * most + 1), 0.0, 0.0
    for x, y in ((x - mean_a, y - mean_b) for x, y in zip(a, b, strict=True)):
        cross += products(x, y, lags)
        norm_a, norm_b = norm_a + float(x @ x), norm_b + float(y @ y)
    norm = float(np.sqrt(norm_a * norm_b))
    values = cross / norm if norm > 0.0 else np.zeros(len(lags))
    return Correlation(lags=lags, values=values, band=BAND / np.sqrt(n))


def products(x: Floats, y: Floats, lags: NDArray[np.int64]) -> Floats:
    """Sums of x[i + lag] y[i] at lags, by FFT; 0 where they do not overlap."""
    size = 1 << (2 * max(len(x), int(np.max(np.abs(lags))) + 1) - 1).bit_length()
    return np.fft.irfft(np.fft.rfft(x, size) * np.conj(np.fft.rfft(y, size)), size)[lags]


def _whitener(pieces: Sequence[Floats]) -> Floats:
    """Taps of 1 - sum a_k z^-k."""
    mean = float(np.mean(np.concatenate(pieces)))
    rows, now = [np.zeros((0, ORDER))], [np.zeros(0)]
    for u in pieces:
        centred = u - mean
        if len(u) > ORDER:
            rows.append(np.column_stack([centred[ORDER - k - 1 : len(u) - k - 1] for k in range(ORDER)]))
            now.append(centred[ORDER:])
    solution = np.linalg.lstsq(np.concatenate(rows), np.concatenate(now), rcond=1e-10)[0]
    return np.concatenate(([1.0], -solution))
