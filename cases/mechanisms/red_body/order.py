"""What decides the order of modes of the red body, in closed form, and how much of the order a run shows.

The slab stays still on its feet, so the box moves alone: it falls free, its left corner is
caught, it turns about that corner until it is level, and its right corner strikes. `inequalities`
tells which of the conditions for the order a set of parameters breaks.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from crossbody.cases import closed_forms as cf
from crossbody.cases.brent import brent
from crossbody.cases.closed_forms import LinearArc
from crossbody.cases.trajectory import Event, Mode

SPENT = 0.01  # elastic part of lam at which a COLLISION hands over to CONTACT
LEFT, RIGHT = 2, 3  # rows of the lower corners
_RELEASED = {Mode.FREE, Mode.BALLISTIC, Mode.COLLISION_SEPARATION}
STAGES: tuple[tuple[int, Mode, frozenset[Mode]], ...] = (
    (LEFT, Mode.FREE, frozenset({Mode.COLLISION})),
    (LEFT, Mode.COLLISION, frozenset({Mode.CONTACT})),
    (RIGHT, Mode.FREE, frozenset({Mode.COLLISION})),
    (LEFT, Mode.CONTACT, frozenset(_RELEASED)),
    (RIGHT, Mode.COLLISION, frozenset(_RELEASED)),
)
"""(row, before, any of after), in the order that must appear."""


def stages_in_order(events: Sequence[Event]) -> int:
    """How many of `STAGES` a run makes before its box does anything else; transitions of one instant in any order."""
    done, rest = 0, [e for e in events if e.contact >= LEFT]
    while rest and done < len(STAGES):
        now = [e for e in rest if e.t == rest[0].t]
        row, before, after = STAGES[done]
        found = next((e for e in now if e.contact == row and e.before == before and e.after in after), None)
        if found is not None:
            done += 1
        else:
            # A row that was let go below the surface comes up to it in its own time: nothing new.
            found = next((e for e in now if e.before in _RELEASED - {Mode.FREE} and e.after == Mode.FREE), None)
        if found is None:
            break
        rest.remove(found)
    return done


@dataclass(frozen=True)
class Fall:
    """The motion of the box on a slab that stands still, from its release to the blow of its right corner."""

    p: Mapping[str, float]

    @property
    def inertia(self) -> float:
        """Of the uniform box about its centre, kg m^2."""
        p = self.p
        return p["mass"] * (p["half_width"] ** 2 + p["half_height"] ** 2) / 3.0

    def corner(self, th: float) -> tuple[float, float]:
        """Left lower corner from the centre of the box turned by th, m."""
        a, b = self.p["half_width"], self.p["half_height"]
        return b * math.sin(th) - a * math.cos(th), -a * math.sin(th) - b * math.cos(th)

    def gap(self, t: float) -> float:
        """Gap of the left corner in free fall, m."""
        p = self.p
        start = self.corner(p["tilt"])[1]
        now = self.corner(p["tilt"] + p["spin"] * t)[1]
        return p["drop"] + p["speed_y"] * t - 0.5 * p["gravity"] * t * t + now - start

    @cached_property
    def touch(self) -> float:
        """Instant of the first touch, s: at the latest when the centre has come down to the slab."""
        p = self.p
        high = p["drop"] - self.corner(p["tilt"])[1]
        late = (p["speed_y"] + math.sqrt(max(p["speed_y"] ** 2 + 2.0 * p["gravity"] * high, 0.0))) / p["gravity"]
        if not self.gap(late) < 0.0:  # it has rolled over in the air
            return math.inf
        return brent(self.gap, 0.0, late, xtol=1e-300, rtol=1e-15)

    @cached_property
    def tilt(self) -> float:
        """Angle at the first touch, rad."""
        return self.p["tilt"] + self.p["spin"] * self.touch

    @cached_property
    def speed(self) -> float:
        """Speed at which the left corner comes down, m/s."""
        p = self.p
        return p["gravity"] * self.touch - p["speed_y"] - p["spin"] * self.corner(self.tilt)[0]

    def press(self, th: float, spin: float) -> float:
        """Minus the acceleration of the left corner without its multiplier, m/s^2."""
        return self.p["gravity"] + spin * spin * self.corner(th)[1]

    def delassus(self, th: float) -> float:
        """G33 = 1/m + r_x^2/I of the left corner, 1/kg; the slab is held."""
        return 1.0 / self.p["mass"] + self.corner(th)[0] ** 2 / self.inertia

    @cached_property
    def caught(self) -> float:
        """Impulse that stops the left corner, N s."""
        return self.speed / self.delassus(self.tilt)

    @cached_property
    def spin(self) -> float:
        """Rate of turning behind that impulse, rad/s; negative towards the right corner."""
        return self.p["spin"] + self.caught * self.corner(self.tilt)[0] / self.inertia

    def turning(self, th: float) -> float:
        """Rate at the angle th while the left corner stays on the slab, rad/s: energy is kept."""
        m, g = self.p["mass"], self.p["gravity"]
        (x0, y0), (x, y) = self.corner(self.tilt), self.corner(th)
        twice = (m * x0 * x0 + self.inertia) * self.spin**2 + 2.0 * m * g * (y - y0)
        return -math.sqrt(twice / (m * x * x + self.inertia))

    @cached_property
    def rotation(self) -> float:
        """Time from the first touch until the box is level, s."""
        from scipy.integrate import quad  # which takes longer to import than most runs

        # With th = tilt - s^2, dt/ds is smooth even where the turning starts from rest.
        return quad(
            lambda s: -2.0 * s / self.turning(self.tilt - s * s), 0.0, math.sqrt(self.tilt), epsabs=0.0, epsrel=1e-12
        )[0]

    @cached_property
    def blow(self) -> float:
        """Speed at which the right corner comes down on the level box, m/s."""
        return -2.0 * self.p["half_width"] * self.turning(0.0)

    @property
    def struck(self) -> float:
        """Impulse of the right corner's blow in no time, (1 + e) v/G44 with the left corner let go, N s."""
        bounce = 1.0 + cf.restitution(self.p["zeta4"])
        return bounce * self.blow / (1.0 / self.p["mass"] + self.p["half_width"] ** 2 / self.inertia)

    @property
    def aloft(self) -> float:
        """Time behind that blow for which no lower corner can strike again, s.

        Turning draws what hangs below the centre up, so that a corner falls no faster than freely.
        """
        p, a, b = self.p, self.p["half_width"], self.p["half_height"]
        up = cf.restitution(p["zeta4"]) * self.blow, self.struck * (1.0 / p["mass"] - a * a / self.inertia)
        spin = self.turning(0.0) + self.struck * a / self.inertia
        return min(2.0 * min(up) / p["gravity"], math.atan2(b, a) / abs(spin))

    @cached_property
    def caught_arc(self) -> LinearArc:
        """Gap of the left corner in its COLLISION, from the first touch on."""
        return LinearArc(self.p["b0"], 2.0 * self.p["zeta3"] * math.sqrt(self.p["b0"]), 0.0, -self.speed)

    @cached_property
    def settling(self) -> float:
        """Time from the first touch until the left corner hands over to CONTACT, s; infinite if later than level."""
        arc = self.caught_arc
        t = np.linspace(0.0, self.rotation, 20001)
        damped, sprung = arc.a1 * arc.rate(t), arc.a0 * arc(t)
        press = self.press(self.tilt, self.spin)
        spent = np.abs(damped) + np.abs(sprung) <= SPENT * (press - damped - sprung)
        return float(t[np.argmax(spent)]) if spent.any() else math.inf

    @property
    def rising(self) -> float:
        """Rate of the left corner's gap in CONTACT when the right one lands, m/s."""
        at = self.settling
        arc = LinearArc(self.p["a0"], self.p["a1"], float(self.caught_arc(at)), float(self.caught_arc.rate(at)))
        return float(arc.rate(self.rotation - at))

    @property
    def recoil(self) -> float:
        """Largest acceleration of the right corner in its collision, m/s^2."""
        p = self.p
        w, zeta = math.sqrt(p["b0"]), p["zeta4"]
        a1 = 2.0 * zeta * w
        pulse = LinearArc(p["b0"], a1, a1 * self.blow, (p["b0"] - a1 * a1) * self.blow)
        return float(pulse(pulse.rate.first_zero())) if pulse.x1 > 0.0 else pulse.x0


def inequalities(p: Mapping[str, float], frozen: bool) -> tuple[str, ...]:
    """Which conditions for the order of modes are broken, one sentence part each; empty if all hold.

    Frozen, collisions take no time, so that nothing has to be over before something else begins.
    """
    return tuple(_broken(p, frozen))


def _broken(p: Mapping[str, float], frozen: bool) -> Iterator[str]:
    fall, a = Fall(p), p["half_width"]
    if math.isinf(fall.touch):
        yield "the box rolls over before it touches"
        return
    if not 0.0 < fall.tilt < math.atan2(a, p["half_height"]) or not fall.spin < 0.0:
        yield f"the box must lean on its left corner and turn to the right, but touches at {fall.tilt:.3g} rad"
        return
    # The frozen rule asks for the press in front of the blow; in real time the turning has begun when lam decides.
    press = fall.press(fall.tilt, p["spin"] if frozen else fall.spin)
    threshold = cf.threshold_speed(p["b0"], 2.0 * p["zeta3"] * math.sqrt(p["b0"]), press)
    if not fall.speed < threshold:
        yield f"the left corner bounces: it comes at {fall.speed:.3g} m/s, and below {threshold:.3g} m/s it is caught"
    if not frozen and not fall.settling < fall.rotation:
        yield f"the left corner has not settled when the right one lands {fall.rotation:.3g} s later"
    elif not frozen and fall.rising < 0.0:
        yield "the left corner still comes down when the right one lands: it is struck again, and not let go"
    rest, arm = fall.press(0.0, fall.turning(0.0)), p["mass"] * a * a
    if not rest > 0.0:
        yield "the left corner takes off before the right one lands: the box turns too fast"
    if not fall.inertia > arm:
        yield f"the box is too flat: its inertia {fall.inertia:.3g} kg m^2 must be above m a^2 = {arm:.3g} kg m^2"
    elif not frozen and not 2.0 * arm / (fall.inertia - arm) * rest < fall.recoil:
        yield f"the impact of the right corner, {fall.recoil:.3g} m/s^2, is too weak to lift the left one"
