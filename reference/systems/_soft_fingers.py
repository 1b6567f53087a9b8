"""Two fingers with soft pads around a block, their sensors and the tactile loop.

Bortoff, Modeling Contact and Collisions for Robotic Assembly Control, American Modelica Conference 2020.
Each pad is a small mass before a spring and a damper on its finger; the faces of the pads and the block
are what touches. With w(t) the offset of the jaw, z a common shift of both fingers and x the flange:

    fL = kp (x + z - w - l/2 - pL) + cp (x' + z' - w' - pL')      mp pL'' = fL - lam_L      hL = b - l/2 - pL
    fR = kp (x + z + w + l/2 - pR) + cp (x' + z' + w' - pR')      mp pR'' = fR + lam_R      hR = pR - b - l/2

A sensor reads y' = ks (lam - y). No force may depend on lam, so the state carried is s_L = y_L + ks mp
pL' and s_R = y_R - ks mp pR', for which the pads' equations of motion give, exactly and in every mode,

    s_L' = ks (fL - y_L)         s_R' = ks (-fR - y_R)

The numbers stand in the parameters p from a place o on, in the order of `NAMES`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from crossbody.reference import kernels
from crossbody.reference.kinds import Array

NAMES = (
    "kp", "cp", "width", "jaw", "squeeze", "close_start", "close_end", "release", "release_time", "pad_mass",
    "block_mass", "bt", "k", "ks", "gain_p", "gain_d", "gain_i",
)  # fmt: skip
SIZE = len(NAMES)
_KP, _CP, _WIDTH, _JAW, _SQUEEZE, _START, _STOP, _RELEASE, _TIME, PAD_MASS, BLOCK_MASS, BT, K, KS, _P, _D, _I = range(
    SIZE
)


@kernels.helper
def smooth(t: float, start: Any, stop: Any) -> Any:
    """Step u^3 (10 - 15 u + 6 u^2) from 0 to 1 between two instants, its rate and its second derivative."""
    if t >= stop.real:
        return 1.0, 0.0, 0.0
    if t <= start.real:
        return 0.0, 0.0, 0.0
    length = stop.real - start.real
    x, y = (t - start.real) / length, (stop.real - t) / length
    return x * x * x * (10 - 15 * x + 6 * x * x), 30 * x * x * y * y / length, 60 * x * y * (y - x) / (length * length)


@kernels.helper
def jaw(t: float, p: Array, o: int) -> Any:
    """Offset w of a finger from the place where it just touches a centred block, m, and its rate."""
    close, rate, _ = smooth(t, p[o + _START], p[o + _STOP])
    if p[o + _RELEASE].real > 0.0:
        opened, back, _ = smooth(t, p[o + _RELEASE], p[o + _RELEASE] + p[o + _TIME])
        close, rate = close - opened, rate - back
    stroke = p[o + _JAW] + p[o + _SQUEEZE]
    return p[o + _JAW] - stroke * close, -stroke * rate


@kernels.helper
def pads(t: float, p: Array, o: int, x: Any, xd: Any, pL: Any, pLd: Any, pR: Any, pRd: Any) -> Any:
    """Forces fL, fR of the fingers on their pads, N; x and xd include the shift of the fingers."""
    w, wd = jaw(t, p, o)
    reach = w + 0.5 * p[o + _WIDTH]
    left = p[o + _KP] * (x - reach - pL) + p[o + _CP] * (xd - wd - pLd)
    return left, p[o + _KP] * (x + reach - pR) + p[o + _CP] * (xd + wd - pRd)


@kernels.helper
def readings(p: Array, o: int, sL: Any, sR: Any, pLd: Any, pRd: Any) -> Any:
    """What the sensors say, y_L and y_R, N."""
    shift = p[o + KS] * p[o + PAD_MASS]
    return sL - shift * pLd, sR + shift * pRd


@kernels.helper
def pid(p: Array, o: int, integral: Any, error: Any, rate: Any) -> Any:
    """Acceleration that the position loop asks for: ki INT e + kp e + kd e', m/s^2."""
    return p[o + _I] * integral + p[o + _P] * error + p[o + _D] * rate


@kernels.helper
def half_width(p: Array, o: int) -> Any:
    """Half the width of the block, m."""
    return 0.5 * p[o + _WIDTH]


def values(parameters: Mapping[str, Any], names: Sequence[str]) -> list[float]:
    """Numbers of a case in the order of `names`; k, (m/s)/N, from kstar, cm/(s N)."""
    given = {"k": 0.01 * float(parameters["kstar"]), **parameters}
    return [float(given[name]) for name in names]
