"""The bouncing ball to forty digits: Taylor series of the contact, quadratics between, an oracle of its own."""

from functools import cache

from mpmath import mp, mpf

ORDER = 40


def _series(h, hd, a0, a1, a2):
    """Taylor coefficients of the gap in contact: h'' = -a1 h' - a0 h - a2 h^3."""
    c = [h, hd]
    for k in range(ORDER - 1):
        square = [sum(c[i] * c[j - i] for i in range(j + 1)) for j in range(k + 1)]
        cube = sum(square[j] * c[k - j] for j in range(k + 1))
        c.append(-(a1 * (k + 1) * c[k + 1] + a0 * c[k] + a2 * cube) / ((k + 1) * (k + 2)))
    return c


def _at(c, t):
    value = mpf(0)
    for coefficient in reversed(c):
        value = value * t + coefficient
    return value


def _rate(c):
    return [k * c[k] for k in range(1, len(c))]


def _multiplier(c, a0, a1, a2, g):
    """Taylor coefficients of lam / m = g - a1 h' - a0 h - a2 h^3."""
    square = [sum(c[i] * c[j - i] for i in range(j + 1)) for j in range(len(c) - 1)]
    cube = [sum(square[j] * c[k - j] for j in range(k + 1)) for k in range(len(c) - 1)]
    lam = [-a1 * (k + 1) * c[k + 1] - a0 * c[k] - a2 * cube[k] for k in range(len(c) - 1)]
    lam[0] += g
    return lam


def _root(c, low, high):
    """Root of a series that changes sign between low and high."""
    sign = _at(c, low) > 0
    for _ in range(30):
        middle = (low + high) / 2
        if (_at(c, middle) > 0) == sign:
            low = middle
        else:
            high = middle
    t = (low + high) / 2
    slope = _rate(c)
    for _ in range(6):
        t -= _at(c, t) / _at(slope, t)
    return t


def _fall(h, v, g):
    """Time until h + v t - g t^2/2 = 0, moving down there."""
    return (v + (v * v + 2 * g * h) ** mpf("0.5")) / g


@cache
def transitions(a0, a1, a2, g, height, count):
    """The first `count` transitions of the level machine: (time, gap, rate) each, mpf."""
    mp.dps = 40
    a0, a1, a2, g = (mpf(x) for x in (a0, a1, a2, g))
    t, h, v = mpf(0), mpf(height), mpf(0)
    found = []
    while len(found) < count:
        dt = _fall(h, v, g)
        t, h, v = t + dt, mpf(0), v - g * dt
        found.append((t, h, v))
        if len(found) == count:
            break
        step = mpf("0.0005") if a2 > 0 else 1 / (40 * (a0**0.5 + a1))
        while True:
            c = _series(h, v, a0, a1, a2)
            lam = _multiplier(c, a0, a1, a2, g)
            if _at(lam, step) < 0:
                dt = _root(lam, mpf(0), step)
                t, h, v = t + dt, _at(c, dt), _at(_rate(c), dt)
                found.append((t, h, v))
                break
            t, h, v = t + step, _at(c, step), _at(_rate(c), step)
            if t > 1000:
                raise RuntimeError("the ball came to rest before the last transition asked for")
        if h < 0:
            dt = (v - (v * v + 2 * g * h) ** mpf("0.5")) / g
            t, h, v = t + dt, mpf(0), v - g * dt
            found.append((t, h, v))
    return found[:count]
