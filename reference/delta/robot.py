"""The numbers of a delta robot and of its servos, checked once."""

from __future__ import annotations

from dataclasses import dataclass, fields
from types import MappingProxyType

import numpy as np

from crossbody.cases import InvalidValue
from crossbody.cases.entry_points import checked_arguments, checked_fields
from crossbody.reference.delta.kernels import arm as arm
from crossbody.reference.delta.kernels import robot as kernels
from crossbody.reference.kinds import Floats


@checked_fields
@dataclass(frozen=True, slots=True, kw_only=True)
class Robot:
    """Geometry, masses, gravity and friction; the defaults are the `light` set.

    Attributes:
        r_base, r_flange: radii at which the arms are hinged, m.
        l1, l2: lengths of the proximal and of the distal links, m.
        m1: proximal rod, kg. m2: distal rod pair, kg. m3: flange, kg.
        jm: inertia of a rotor, kg m^2.
        g: gravity along +z, m/s^2.
        d1, d2, d3: viscous friction on the three angles of an arm, N m s.
        sign: +1 or -1: arms 2 and 3 are at -120 and +120 degrees times this.
    """

    r_base: float = 0.125
    r_flange: float = 0.03
    l1: float = 0.35
    l2: float = 0.50
    m1: float = 0.20
    m2: float = 0.20
    m3: float = 0.30
    jm: float = 0.0
    g: float = 9.81
    d1: float = 0.05
    d2: float = 0.0125
    d3: float = 0.0125
    sign: float = 1.0

    def __post_init__(self) -> None:
        """Check signs.

        Raises:
            InvalidValue: naming the attribute.
        """
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name in ("l1", "l2") and not value > 0.0:
                raise InvalidValue(f"Robot: {field.name} is {value!r}; it must be above 0 m.")
            if field.name not in ("g", "sign") and not value >= 0.0:
                raise InvalidValue(f"Robot: {field.name} is {value!r}; it must be at least 0.")
        if self.sign not in (1, -1):
            raise InvalidValue(f"Robot: sign is {self.sign!r}; it must be 1 or -1.")
        if self.m2 + self.m3 == 0 or self.m1 + self.m2 + self.jm == 0:
            raise InvalidValue("Robot: m2 + m3 and m1 + m2 + jm must be above 0, or an angle has no inertia.")

    @property
    def offset(self) -> float:
        """R = r_base - r_flange, m."""
        return self.r_base - self.r_flange

    @checked_arguments
    def array(self, servo: Servo | None = None) -> Floats:
        """The parameters p of the kernels (n,)."""
        own = [getattr(self, name) for name in arm.NAMES]
        return np.array(own + (servo or Servo()).values(), dtype=np.float64)


@checked_fields
@dataclass(frozen=True, slots=True, kw_only=True)
class Servo:
    """Continuous PD servos on the motors; without gains they do nothing.

    Attributes:
        kp: N m/rad. kd: N m s/rad.
        start, end: the reference moves between these instants, s.
        y_start, y_end: motor angles (3,) before and after, rad.
        feedforward: add the torque that holds the symmetric pose of the reference.
    """

    kp: float = 0.0
    kd: float = 0.0
    start: float = 0.0
    end: float = 0.0
    y_start: tuple[float, float, float] = (0.0, 0.0, 0.0)
    y_end: tuple[float, float, float] = (0.0, 0.0, 0.0)
    feedforward: bool = False

    def __post_init__(self) -> None:
        """Check signs and lengths.

        Raises:
            InvalidValue: naming the attribute.
        """
        for name in ("kp", "kd"):
            if not getattr(self, name) >= 0.0:
                raise InvalidValue(f"Servo: {name} is {getattr(self, name)!r}; it must be at least 0.")
        if not self.start <= self.end:
            raise InvalidValue(f"Servo: start is {self.start} s and end {self.end} s; end must not be before start.")

    def values(self) -> list[float]:
        """Its part of the parameters, in the order of the kernels."""
        return [self.kp, self.kd, self.start, self.end, float(self.feedforward), *self.y_start, *self.y_end]


LIGHT = Robot()
HEAVY = Robot(m1=2.5, m2=3.0, m3=4.0, g=9.8, d1=0.5, d2=0.125, d3=0.125)
SETS = MappingProxyType({"light": LIGHT, "heavy": HEAVY})

# The order of the numbers is written in two places.
assert len(LIGHT.array()) == kernels.SIZE
