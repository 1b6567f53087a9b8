"""What the maze remembers between events: modes of rows, where the ball is, what the controller does."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from crossbody.cases import Mode
from crossbody.cases.mechanisms.maze.geometry import Ring
from crossbody.engines._log import Modes
from crossbody.engines._maze.edges import SOLID, nearest_gap, sector, wrapped
from crossbody.engines._maze.rows import ABOVE, BELOW, SLIP_OF, Place

FREE, CONTACT, BALLISTIC = int(Mode.FREE), int(Mode.CONTACT), int(Mode.BALLISTIC)
OFF, BALANCE, SNATCH, CENTRE = range(4)
"""Modes of the controller: no torque; on top of a ring; at a gap until the next face; at the bottom of the centre."""
State = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Memory:
    """The discrete state.

    Attributes:
        modes: of the eight rows.
        place: of the ball.
        control: mode of the controller.
        target: angle of the maze that a snatch goes to, rad.
    """

    modes: Modes
    place: Place
    control: int = OFF
    target: float = 0.0

    def active(self) -> tuple[int, ...]:
        """Rows that carry a multiplier."""
        return tuple(i for i, mode in enumerate(self.modes) if mode == CONTACT)


def angle(q: State) -> float:
    """Of the ball in the maze's frame, rad."""
    return math.atan2(q[2], q[1]) - q[0]


def place_of(rings: tuple[Ring, ...], q: State) -> Place:
    """Where a ball is that was put there.

    Args:
        rings: from the centre outwards, the closed wall last.
        q: theta, x, y, phi.
    """
    rho, at = math.hypot(q[1], q[2]), angle(q)
    channel = sum(rho > ring.middle for ring in rings[:-1])
    return Place(channel, sector(rings[channel - 1], at) if channel else SOLID, sector(rings[channel], at))


def over_edge(memory: Memory, rings: tuple[Ring, ...], slot: int, q: State) -> Memory:
    """The ball passes an edge of the ring below or above: face and tip hand over what they were doing.

    Args:
        memory: before.
        rings: from the centre outwards.
        slot: `BELOW` or `ABOVE`.
        q: theta, x, y, phi.
    """
    place, modes = memory.place, list(memory.modes)
    ring = rings[place.channel - 1 if slot == BELOW else place.channel]
    before = place.below if slot == BELOW else place.above
    opened = before != SOLID
    k = before if opened else nearest_gap(ring, angle(q))
    tip = slot + 1 + (wrapped(angle(q) - ring.centre(k)) > 0.0)
    if opened:
        modes[slot], modes[slot + 1], modes[slot + 2] = modes[tip], FREE, FREE
    else:
        modes[tip], modes[slot] = modes[slot], FREE
    after = SOLID if opened else k
    place = replace(place, below=after) if slot == BELOW else replace(place, above=after)
    return replace(memory, modes=tuple(modes), place=place)


def through_gap(memory: Memory, rings: tuple[Ring, ...], inwards: bool, q: State) -> Memory:
    """The ball's centre passes the middle of a ring: its tips keep what they were doing on the ring's other side."""
    place, modes = memory.place, [FREE] * len(memory.modes)
    source, aim = (BELOW, ABOVE) if inwards else (ABOVE, BELOW)
    modes[aim + 1 : aim + 3] = memory.modes[source + 1 : source + 3]
    channel = place.channel + (-1 if inwards else 1)
    far = channel - 1 if inwards else channel
    new = sector(rings[far], angle(q)) if far >= 0 else SOLID
    place = Place(channel, new, place.below) if inwards else Place(channel, place.above, new)
    return replace(memory, modes=tuple(modes), place=place)


def rolling(memory: Memory, on: bool) -> Memory:
    """Every face in contact holds the ball against slip."""
    modes = list(memory.modes)
    for face, slip in SLIP_OF.items() if on else ():
        modes[slip] = CONTACT if modes[face] == CONTACT else FREE
    return replace(memory, modes=tuple(modes))
