"""The soft contact on an axis as engines see it: sliders, forces written out once more, and a clock.

The engine's coordinates are those of the case and one more, a slider of unit mass and unit speed whose position is the
time: what the jaws and the probe do is then a force that depends on the state.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from crossbody.cases import Case
from crossbody.cases.arrays import Floats
from crossbody.cases.mechanisms.soft.scene import numbers

NAMES = ("flange", "left pad", "right pad", "block", "error", "left sensor", "right sensor", "shift", "clock")
CLOCK = len(NAMES) - 1
Numbers = Mapping[str, float]
Motion = tuple[float, float]
"""Place, m, and velocity, m/s."""


def smooth(t: float, start: float, stop: float) -> tuple[float, float, float]:
    """Step u^3 (10 - 15 u + 6 u^2) from 0 to 1 between two instants, s, its rate and its second derivative."""
    length = stop - start
    u = min(max((t - start) / length, 0.0), 1.0)
    rate, bend = 30.0 * (u * (1.0 - u)) ** 2, 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u * u), rate / length, bend / length**2


def jaw(p: Numbers, t: float) -> tuple[float, float]:
    """Offset of a finger from the place where it just touches a centred block, m, and its rate."""
    close, rate, _ = smooth(t, p["close_start"], p["close_end"])
    if p["release"]:
        opened, back, _ = smooth(t, p["release"], p["release"] + p["release_time"])
        close, rate = close - opened, rate - back
    stroke = p["jaw"] + p["squeeze"]
    return p["jaw"] - stroke * close, -stroke * rate


def fingers(p: Numbers, t: float, middle: Motion, left: Motion, right: Motion) -> tuple[float, float]:
    """Forces of both fingers on their pads, N, from place and velocity of the middle between them and of the pads."""
    w, wd = jaw(p, t)
    reach, kp, cp, (x, xd) = w + 0.5 * p["width"], p["kp"], p["cp"], middle
    return (
        kp * (x - reach - left[0]) + cp * (xd - wd - left[1]),
        kp * (x + reach - right[0]) + cp * (xd + wd - right[1]),
    )


def instants(p: Numbers, t_end: float) -> tuple[float, ...]:
    """Where the third derivative of the jaws' motion jumps, s: no step of Runge-Kutta crosses one."""
    ends = {p["close_start"], p["close_end"]}
    if p["release"]:
        ends |= {p["release"], p["release"] + p["release_time"]}
    return tuple(sorted(t for t in ends if 0.0 < t < t_end))


def fastest(p: Numbers, flange_mass: float) -> float:
    """Fastest rate of both pads against the flange, the loop, the sensors and the rows, 1/s."""
    mass = 1.0 / (1.0 / p["pad_mass"] + 2.0 / flange_mass)
    pad = (p["cp"] + math.sqrt(max(p["cp"] ** 2 - 4.0 * p["kp"] * mass, 0.0))) / (2.0 * mass)
    return max(
        pad, math.sqrt(p["kp"] / mass), p["bt"] / p["block_mass"], p["ks"], p["gain_d"], p["a1"], math.sqrt(p["a0"])
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SoftContact:
    """The numbers of a case and its equations.

    Attributes:
        p: parameters, SI.
        masses (9,): of the sliders, kg; 1 for those that carry the controller, the sensors and the time.
        H (2, 9): dh/dq.
    """

    p: dict[str, float]
    masses: Floats
    H: Floats

    def forces(self, q: Floats, v: Floats, tau: Floats) -> None:
        """Write the force on every slider (9,), N."""
        p = self.p
        x, pl, pr, _, integral, _, _, _, t = q.tolist()
        xd, pld, prd, bd, error, sl, sr, z, _ = v.tolist()
        u, shift = p["probe"] * math.sin(p["probe_rate"] * t), p["ks"] * p["pad_mass"]
        left, right = fingers(p, t, (x + z, xd + u), (pl, pld), (pr, prd))
        yl, yr = sl - shift * pld, sr + shift * prd
        moved = p["k"] * (yr - yl)
        asked = p["gain_i"] * integral + p["gain_p"] * error + p["gain_d"] * (p["rate_share"] * moved - xd)
        tau[:] = (
            p["flange_mass"] * asked - left - right, left, right, -p["bt"] * bd, moved - xd,
            p["ks"] * (left - yl), p["ks"] * (-right - yr), u, 0.0,
        )  # fmt: skip

    def heights(self, q: Floats) -> Floats:
        """Gaps (2,), m."""
        gaps: Floats = self.H @ q - 0.5 * self.p["width"]
        return gaps

    def observe(self, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Gaps (n, 2), m, and energies (n, 2), J, of many states of the case (n, 8)."""
        gaps = q @ self.H[:, :CLOCK].T - 0.5 * self.p["width"]
        kinetic = 0.5 * v[:, :4] ** 2 @ self.masses[:4]
        return gaps, np.column_stack((kinetic, np.zeros(len(q))))

    def start(self, case: Case) -> tuple[Floats, Floats]:
        """Positions and velocities (9,) at the start: the clock stands at 0 and runs."""
        return np.append(case.q0, 0.0), np.append(case.v0, 1.0)

    @property
    def sizes(self) -> tuple[Floats, Floats]:
        """How far and how fast the sliders move (9,), for absolute tolerances."""
        p = self.p
        reach, force = p["jaw"] + p["squeeze"], p["kp"] * max(p["squeeze"], 1e-3 * p["jaw"])
        time = p["close_end"] - p["close_start"]
        far = [reach] * 4 + [reach * time, force * time, force * time, reach * time, time]
        fast = [reach / time] * 4 + [reach, force, force, reach, 1.0]
        return np.array(far), np.array(fast)


def soft_contact(case: Case) -> SoftContact:
    """The equations of a case."""
    p = numbers(case.parameters)
    masses, H = np.ones(len(NAMES)), np.zeros((2, len(NAMES)))
    masses[:4] = p["flange_mass"], p["pad_mass"], p["pad_mass"], p["block_mass"]
    H[0, [1, 3]] = -1.0, 1.0
    H[1, [2, 3]] = 1.0, -1.0
    return SoftContact(p=p, masses=masses, H=H)


def chart(q: Floats, v: Floats) -> tuple[Floats, Floats]:
    """The case's coordinates (n, 8) of the engine's (n, 9)."""
    return q[:, :CLOCK], v[:, :CLOCK]
