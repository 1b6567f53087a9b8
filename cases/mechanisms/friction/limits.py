"""What cases with friction share: exact motion as the truth, limits, how far engines creep."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

from crossbody.cases.case import Case, Limit, Parameter
from crossbody.cases.mechanisms.friction.motions import Motion

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

    `rho` is the tangent of the slope over the coefficient of friction, below 1.
    """
    return {
        ("drake", "default"): STICTION * rho / math.sqrt(1.0 - rho * rho),
        ("drake", "matched"): HOLDS * (1.0 - math.sqrt(1.0 - rho)),
    }


def mixed(pull: float, step: float = STEP) -> float:
    """Return the creep of DART, m/s, from the tangential acceleration, m/s^2, and the step, s."""
    return CFM * pull * step


CREEPS = (
    "it creeps at the speed that its parameters predict: its friction is a function of the slip, so there is "
    "no force without slip"
)
NEAR = 0.05  # part of a predicted creep by which the measured one may be off
NOTHING: Mapping[tuple[str, str], float] = MappingProxyType({})
SOFT = Limit(
    metric="*", engine="mujoco", profile="default", covers_none=True, known="MuJoCo's own soft contacts and step"
)  # fmt: skip
"""What takes it outside where nothing rubs: where something does, that of every case with friction stands."""
HELD = "friction sticks: the remaining slip decays as a gap does"


def limits(
    case: Case, title: str, parameters: Mapping[str, Parameter], motion: Motion | None,
    p: Mapping[str, float], creeps: Mapping[tuple[str, str], float] = NOTHING,
) -> Case:  # fmt: skip
    """Return a case with its title, its exact motion and the limits of all cases with friction.

    `creeps` tells engine and profile -> speed at which its own parameters have it creep, m/s.
    """
    held = 1e-9 * max(1.0, p.get("speed", 0.0))
    return replace(
        case, title=title, closed_form=motion if motion is not None and motion.presses else None,
        units={name: one.unit for name, one in parameters.items()},
        limits=(
            *case.limits, Limit(metric="creep_speed", value=held, why=HELD), *_predicted(creeps, held),
            *(() if case.rubs else (SOFT,)),
        ),
    )  # fmt: skip


def _predicted(creeps: Mapping[tuple[str, str], float], held: float) -> Iterator[Limit]:
    for (engine, profile), speed in creeps.items():
        yield Limit(
            metric="creep_speed", value=held, engine=engine, profile=profile, known=CREEPS,
            known_least=speed * (1.0 - NEAR), known_size=speed * (1.0 + NEAR),
        )  # fmt: skip
