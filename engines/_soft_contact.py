"""The soft contact on an axis as engines see it: sliders, forces written out once more, and a clock.

The engine's coordinates are those of the case and one more, a slider of unit mass and unit speed whose position is the
time: what the jaws and the probe do is then a force that depends on the state.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from crossbody.cases import Case
from crossbody.cases._arrays import Floats
from crossbody.cases._soft.scene import numbers

NAMES = ("flange", "left pad", "right pad", "block", "error", "left sensor", "right sensor", "shift", "clock")
CLOCK = len(NAMES) - 1


def smooth(t: float, start: float, stop: float) -> tuple[float, float]:
    """Step u^3 (10 - 15 u + 6 u^2) from 0 to 1 between two instants, s, and its rate."""
    u = min(max((t - start) / (stop - start), 0.0), 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u * u), 30.0 * (u * (1.0 - u)) ** 2 / (stop - start)


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

    def jaw(self, t: float) -> tuple[float, float]:
        """Offset of a finger, m, and its rate."""
        p = self.p
        close, rate = smooth(t, p["close_start"], p["close_end"])
        if p["release"]:
            opened, back = smooth(t, p["release"], p["release"] + p["release_time"])
            close, rate = close - opened, rate - back
        stroke = p["jaw"] + p["squeeze"]
        return p["jaw"] - stroke * close, -stroke * rate

    def forces(self, q: Floats, v: Floats, tau: Floats) -> None:
        """Write the force on every slider (9,), N."""
        p = self.p
        x, pl, pr, _, integral, _, _, _, t = q.tolist()
        xd, pld, prd, bd, error, sl, sr, z, _ = v.tolist()
        w, wd = self.jaw(t)
        u = p["probe"] * math.sin(p["probe_rate"] * t)
        reach, kp, cp, shift = w + 0.5 * p["width"], p["kp"], p["cp"], p["ks"] * p["pad_mass"]
        left = kp * (x + z - reach - pl) + cp * (xd + u - wd - pld)
        right = kp * (x + z + reach - pr) + cp * (xd + u + wd - prd)
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
