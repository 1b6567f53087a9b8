"""The eight constraint rows of the maze: gap, derivative and drift, in plain Python (Bortoff, AMC 2020).

q = (theta maze, x, y, phi spin). With rho = |(x, y)|, s = -1 outside a face of radius R and +1 inside it:

    face    h = s (R - rho) - r                 H = (0, -s x/rho, -s y/rho, 0)       H' v = -s vt^2/rho
    slip    vt + s r phi' - R theta'            H = (-R, -y/rho, x/rho, s r)         H' v = -vt vr/rho
    tip     h = |p - p_tip(theta)| - cap - r    H = (-n . dp_tip/dtheta, n, 0)

Written apart from the compiled equations, so that each checks the other.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from crossbody.cases.mechanisms.maze.geometry import Ring
from crossbody.engines._maze.edges import SOLID

BELOW, ABOVE, SLIP_BELOW, SLIP_ABOVE = 0, 3, 6, 7
"""Slots of the faces and of the rolling condition on them; the two tips of a gap follow their face."""
NORMALS = range(6)
SLIP_OF = {BELOW: SLIP_BELOW, ABOVE: SLIP_ABOVE}
OUTER, INNER = -1.0, 1.0
"""s of a ball outside a face, or inside it."""

Row = tuple[float, tuple[float, float, float, float], float]
"""H, m (0 for slip, which has no position memory); H (4,); H' v."""
State = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Place:
    """Where the ball is: what of the maze it could touch.

    Attributes:
        channel: rings inside the ball's distance from the axis: 0 in the centre, n between the last ring and the wall.
        below, above: sector of the ring inwards (outwards): `SOLID` or the number of its gap.
    """

    channel: int
    below: int = SOLID
    above: int = SOLID


Formula = Callable[[State, State], Row]


def face(radius: float, s: float, r: float) -> Formula:
    """Normal row of a face."""

    def row(q: State, v: State) -> Row:
        x, y = q[1], q[2]
        rho = math.sqrt(x * x + y * y)
        vt = (x * v[2] - y * v[1]) / rho
        return s * (radius - rho) - r, (0.0, -s * x / rho, -s * y / rho, 0.0), -s * vt * vt / rho

    return row


def slip(radius: float, s: float, r: float) -> Formula:
    """Rolling on a face."""

    def row(q: State, v: State) -> Row:
        x, y = q[1], q[2]
        rho = math.sqrt(x * x + y * y)
        vt, vr = (x * v[2] - y * v[1]) / rho, (x * v[1] + y * v[2]) / rho
        return 0.0, (-radius, -y / rho, x / rho, s * r), -vt * vr / rho

    return row


def cap(ring: Ring, angle: float, r: float) -> Formula:
    """Normal row of the round end of a wall, whose centre stands at `angle` in the maze's frame."""
    middle, reach = ring.middle, ring.cap + r

    def row(q: State, v: State) -> Row:
        px, py = middle * math.cos(q[0] + angle), middle * math.sin(q[0] + angle)
        dx, dy = q[1] - px, q[2] - py
        d = math.sqrt(dx * dx + dy * dy)
        nx, ny = dx / d, dy / d
        across = ny * (v[1] + py * v[0]) - nx * (v[2] - px * v[0])
        turn = across * across / d + v[0] * v[0] * (nx * px + ny * py)
        return d - reach, (nx * py - ny * px, nx, ny, 0.0), turn

    return row


class MazeRows:
    """Finds the formula of every slot at a place; made once for each place and kept.

    Attributes:
        rings: from the centre outwards, the closed wall last.
        r: radius of the ball, m.
        rolling: whether a face holds the ball against slip.
    """

    def __init__(self, rings: tuple[Ring, ...], r: float, rolling: bool) -> None:
        self.rings, self.r, self.rolling = rings, r, rolling
        self._made: dict[Place, dict[int, Formula]] = {}

    def at(self, place: Place) -> dict[int, Formula]:
        """Slot -> formula of every row that can be touched at a place."""
        if place not in self._made:
            self._made[place] = {**self._below(place), **self._above(place)}
        return self._made[place]

    def radius(self, place: Place, slot: int) -> float:
        """Radius of the face in slot `BELOW` or `ABOVE`, m."""
        return self.rings[place.channel - 1].outer if slot == BELOW else self.rings[place.channel].inner

    def tips(self, place: Place) -> list[tuple[int, Ring, float]]:
        """Slot, ring, and angle in the maze's frame of every tip that can be touched at a place."""
        sides = [(ABOVE, self.rings[place.channel], place.above)]
        if place.channel:
            sides.append((BELOW, self.rings[place.channel - 1], place.below))
        return [
            (slot + k, ring, angle)
            for slot, ring, gap in sides if gap != SOLID for k, angle in enumerate(ring.tips(gap), start=1)
        ]  # fmt: skip

    def _below(self, place: Place) -> dict[int, Formula]:
        if place.channel == 0:
            return {}
        return self._ring(self.rings[place.channel - 1], place.below, OUTER, BELOW)

    def _above(self, place: Place) -> dict[int, Formula]:
        return self._ring(self.rings[place.channel], place.above, INNER, ABOVE)

    def _ring(self, ring: Ring, gap: int, s: float, slot: int) -> dict[int, Formula]:
        if gap != SOLID:
            return {slot + k: cap(ring, angle, self.r) for k, angle in enumerate(ring.tips(gap), start=1)}
        radius = ring.outer if s == OUTER else ring.inner
        rows = {slot: face(radius, s, self.r)}
        if self.rolling:
            rows[SLIP_OF[slot]] = slip(radius, s, self.r)
        return rows
