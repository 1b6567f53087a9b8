"""How fast engines creep where friction holds, by their own parameters: what is set holds, then what is usual."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

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
SETTLED = 10.0
"""Time constants of a contact after which it has settled: what is left is (1 + 10) exp(-10)."""


def mixed(pull: float, step: float = STEP) -> float:
    """Return the creep of DART, m/s, from the tangential acceleration, m/s^2, and the step, s."""
    return CFM * pull * step


def regularised(rho: float, approximation: str, stiction: float) -> float:
    """Return the creep of one of Drake's approximations, m/s, whose friction is a function of the slip.

    `rho` is the tangent of the slope over the coefficient of friction, below 1; NaN for one that is none of the two.
    """
    if approximation == "tamsi":
        return stiction * (1.0 - math.sqrt(1.0 - rho))
    return stiction * rho / math.sqrt(1.0 - rho * rho) if approximation in ("lagged", "similar") else math.nan


def softness(settings: Mapping[str, Any]) -> Soft:
    """Return what MuJoCo has of a contact under its settings: no time constant is below two steps."""
    asked = float(settings.get("timeconst", 0.0)) or Soft().constant
    return Soft(
        constant=max(asked, 2.0 * float(settings.get("dt", 0.0))),
        impratio=float(settings.get("impratio", 0.0)) or 1.0,
    )


@dataclass(frozen=True, slots=True)
class OfPoint:
    """Creep of a point that friction holds on a slope, in MuJoCo.

    Attributes:
        mu, slope, press: as of `creep`.
        until: horizon, s.
    """

    mu: float
    slope: float
    press: float
    until: float

    def __call__(self, settings: Mapping[str, Any]) -> float | str:
        """Return the speed at the horizon, m/s, or what it is not predicted for."""
        soft = softness(settings)
        if int(settings.get("noslip", -1)) > 0:
            return f"noslip={settings['noslip']}"
        if soft.constant * SETTLED > self.until:
            return f"a time constant of {soft.constant:g} s within {self.until:g} s"
        return creep(self.mu, self.slope, self.press, soft, elliptic=settings.get("cone") == "elliptic")


@dataclass(frozen=True, slots=True)
class OfGuide:
    """Creep of a mass on a spring that a guide's friction holds, in MuJoCo.

    Its row is a damper b v whose force a softness R = (1 - d)/d of the inverse mass limits, d that
    of no depth: (1 + R) x'' + b x' + R k/m x = 0.

    Attributes:
        rate: k/m, 1/s^2.
        start: where it is at rest, m.
        until: horizon, s.
    """

    rate: float
    start: float
    until: float

    def __call__(self, settings: Mapping[str, Any]) -> float | str:
        """Return the speed at the horizon, m/s, or what it is not predicted for."""
        soft = softness(settings)
        d = soft.impedance(0.0)
        R = (1.0 - d) / d
        slow, fast = sorted(np.roots([1.0 + R, soft.damping, R * self.rate]), key=abs)
        if fast.imag or fast == slow:
            return f"a time constant of {soft.constant:g} s: it swings"
        return float(abs(self.start * slow * fast / (fast - slow) * math.exp(slow.real * self.until)))


@dataclass(frozen=True, slots=True)
class OfMixing:
    """Creep of a point that friction holds, in DART.

    Attributes:
        pull: tangential acceleration, m/s^2.
    """

    pull: float

    def __call__(self, settings: Mapping[str, Any]) -> float | str:
        """Return the speed, m/s, or what it is not predicted for."""
        if settings.get("sleep"):
            return "bodies that are put to sleep"
        return mixed(self.pull, float(settings.get("dt", STEP)))


@dataclass(frozen=True, slots=True)
class OfRegularised:
    """Creep of a point that friction holds, in Drake.

    Attributes:
        rho: tangent of the slope over the coefficient of friction.
        approximation, stiction: the profile's own.
    """

    rho: float
    approximation: str
    stiction: float

    def __call__(self, settings: Mapping[str, Any]) -> float | str:
        """Return the speed, m/s, or what it is not predicted for."""
        kind = str(settings.get("approximation", self.approximation))
        found = regularised(self.rho, kind, float(settings.get("stiction", self.stiction)))
        return f"approximation={kind}" if math.isnan(found) else found
