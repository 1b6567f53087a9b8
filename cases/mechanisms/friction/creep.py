"""How fast a place that friction holds creeps down a slope in engines, from their own parameters.

Drake's lagged law gives mu N s/sqrt(1 + s^2) at s times its stiction tolerance, TAMSI's mu N s (2
- s); SAP's lets a place slip at sigma times what its inverse mass makes of friction's impulse in
a step; DART adds a part cfm to the diagonal of its problem. With rho = tan(slope)/mu, the
tangential acceleration g_t and the step dt:

    lagged   v = stiction rho/sqrt(1 - rho^2)        tamsi  v = stiction (1 - sqrt(1 - rho))
    sap      v = sigma g_t dt/sqrt(3)                DART   v = cfm g_t dt

MuJoCo's rows are springs and dampers b v + k d r of an impedance d, with R = (1 - d)/d of the
inverse mass between the force and them. A force that holds needs a rate:

    elliptic     v = (1 - d)/d g_t / (impratio b)
    pyramidal    b mu v = 2 rho N0 for rho = tan(slope)/mu <= 1/2, else N0 (3 rho - 1)/(1 - rho),  N0 = k d r

whatever mu below the cone, and whatever the step.
"""

from __future__ import annotations

import math
from typing import NamedTuple

HALVINGS, DEEPEST = 200, 0.1


class Soft(NamedTuple):
    """What MuJoCo has of a contact: solref, solimp (with its middle and power as they are by default) and impratio.

    Attributes:
        constant, ratio: time constant, s, and damping ratio of solref.
        low, high, width: least and largest impedance of solimp, and the depth at which it is the largest, m.
        impratio: of the model.
    """

    constant: float = 0.02
    ratio: float = 1.0
    low: float = 0.9
    high: float = 0.95
    width: float = 0.001
    impratio: float = 1.0

    def impedance(self, depth: float) -> float:
        """Return d at a depth, m."""
        x = min(depth / self.width, 1.0)
        return self.low + (self.high - self.low) * (2.0 * x * x if x < 0.5 else 1.0 - 2.0 * (1.0 - x) ** 2)

    @property
    def damping(self) -> float:
        """Return b, 1/s."""
        return 2.0 / (self.high * self.constant)

    @property
    def stiffness(self) -> float:
        """Return k, 1/s^2."""
        return 1.0 / (self.high * self.constant * self.ratio) ** 2

    def rest(self, pushed: float) -> tuple[float, float]:
        """Return k d r and d at the depth r at which k d r = (1 - d)/d times what pushes, m/s^2."""
        low, high = 0.0, DEEPEST
        for _ in range(HALVINGS):
            depth = 0.5 * (low + high)
            d = self.impedance(depth)
            low, high = (depth, high) if self.stiffness * d * depth < pushed * (1.0 - d) / d else (low, depth)
        return self.stiffness * d * depth, d


def creep(mu: float, slope: float, press: float, soft: Soft, *, elliptic: bool) -> float:
    """Return the speed at which a contact at one place creeps, m/s.

    Args:
        mu: coefficient of friction, above `slope`.
        slope: tangent of the floor's angle.
        press: acceleration towards the floor, m/s^2.
        soft: what MuJoCo has of the contact.
        elliptic: whether its cone is elliptic, or a pyramid along the slope.
    """
    if elliptic:
        _, d = soft.rest(press)
        return (1.0 - d) / d * slope * press / (soft.impratio * soft.damping)
    rho = slope / mu
    edge = 2.0 * mu**2 * (1.0 + mu**2) / soft.impratio * (0.25 if rho <= 0.5 else 0.5 * (1.0 - rho))
    rest, _ = soft.rest(edge * press)
    return rest * (2.0 * rho if rho <= 0.5 else (3.0 * rho - 1.0) / (1.0 - rho)) / (soft.damping * mu)


STICTION, HOLDS = 1e-3, 1e-6  # Drake's stiction tolerance, m/s, and that of its profile matched
CFM, STEP = 1e-5, 1e-3  # DART's constraint force mixing, and the step of both engines, s


def regularised(rho: float) -> dict[tuple[str, str], float]:
    """Return the creep of Drake's profiles, m/s, whose friction is a function of the slip.

    Args:
        rho: tangent of the slope over the coefficient of friction, below 1.
    """
    return {
        ("drake", "default"): STICTION * rho / math.sqrt(1.0 - rho * rho),
        ("drake", "matched"): HOLDS * (1.0 - math.sqrt(1.0 - rho)),
    }


def mixed(pull: float, step: float = STEP) -> float:
    """Return the creep of DART, m/s, from the tangential acceleration, m/s^2, and the step, s."""
    return CFM * pull * step
