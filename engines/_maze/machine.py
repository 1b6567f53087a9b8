"""The maze's own event machine: the level machine on its rows, gated by where the ball is, and the controller's modes.

    rows       FREE, CONTACT, BALLISTIC by the guards of spec 1.2; slip follows its face; tips are frictionless
    place      an edge passed: face and tip hand over; the middle of a ring passed: the channel changes
    controller BALANCE -> SNATCH when the ring below opens; SNATCH -> BALANCE or CENTRE at the next touch of a face

In plain Python and apart from the compiled machine, so that each checks the other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace

from crossbody.cases import Event, Mode, Switch
from crossbody.cases.arrays import Floats
from crossbody.engines._maze.edges import DEAD_BAND, SOLID, to_edge, wrapped
from crossbody.engines._maze.memory import (
    BALANCE,
    BALLISTIC,
    CENTRE,
    CONTACT,
    FREE,
    OFF,
    SNATCH,
    Memory,
    angle,
    over_edge,
    place_of,
    rolling,
    through_gap,
)  # fmt: skip
from crossbody.engines._maze.rows import ABOVE, BELOW, NORMALS, Formula
from crossbody.engines._maze.scene import BallMaze

State = tuple[float, ...]
Accelerate = Callable[[State, State, Memory], tuple[Floats, Floats]]
"""(q, v, memory) -> v' (4,) and lam (nc,), 0 where not active, with the torque of the controller's mode."""
EDGE_BELOW, EDGE_ABOVE, MIDDLE, LOST = 12, 13, 14, 15
NG = 16
"""Watched functions: gap and push of each normal row, then these."""
ROUNDING = 1e-15
"""Gap that is none, m: rounding of a radius."""
SLOW = 1e-8
"""Rate of a gap that stands still, m/s: what an integrator makes of it where a ball leaves a face."""
OVERRUN = 1e-9
"""Depth at which a free row counts as closed though its touch was not found, m."""
GIVEN_UP = math.radians(60.0)
"""Angle from the top beyond which the controller has no way back, rad."""


@dataclass(frozen=True, slots=True)
class Settled:
    """What the machine made of an instant.

    Attributes:
        memory: behind it.
        events, switches: what changed, at that time.
        lost: whether the ball left the region in which the controller holds.
        cycle: whether the modes repeat: they never settle.
    """

    memory: Memory
    events: tuple[Event, ...] = ()
    switches: tuple[Switch, ...] = ()
    lost: bool = False
    cycle: bool = False

    @property
    def changed(self) -> bool:
        """Whether anything switched."""
        return bool(self.events or self.switches)


class MazeMachine:
    """Switches rows, place and controller of one maze.

    Args:
        maze: geometry, masses and controller.
        accelerate: the engine's own equations of motion.
    """

    def __init__(self, maze: BallMaze, accelerate: Accelerate) -> None:
        self.maze, self.rings, self.accelerate = maze, maze.rings, accelerate

    def watch(self, q: State, v: State, memory: Memory, lam: Floats | None = None) -> list[float]:
        """The (16,) functions whose zeros are where the machine must look, positive until then where it matters.

        Args:
            q: theta, x, y, phi.
            v: their rates.
            memory: discrete state.
            lam: multipliers there (nc,), if they are known.
        """
        out = [1.0] * NG
        if lam is None and CONTACT in memory.modes:
            lam = self.accelerate(q, v, memory)[1]
        for i, formula in self.maze.rows.at(memory.place).items():
            if i in NORMALS:
                out[2 * i], out[2 * i + 1] = self._pair(i, formula, q, v, memory, lam)
        out[EDGE_BELOW:] = self._places(q, memory)
        return out

    def untouched(self, q: State) -> Memory:
        """Where a ball is that was put there, and what the controller does with it, before any row is on."""
        memory = Memory(modes=(FREE,) * self.maze.nc, place=place_of(self.rings, q))
        if not self.maze.driver.on:
            return memory
        return self.controlled(replace(memory, control=BALANCE if memory.place.channel else CENTRE), q, touched=False)

    def first(self, q: State, v: State) -> Settled:
        """The memory at the start, settled."""
        memory = self.untouched(q)
        return replace(self.settle(0.0, q, v, memory), switches=(), lost=self.strayed(q, memory))

    def strayed(self, q: State, memory: Memory) -> bool:
        """Whether the ball is where the controller cannot bring it back from."""
        return self._places(q, memory)[-1] <= 0.0

    def seen(self, memory: Memory, q: State) -> Memory:
        """Place and controller of a ball that is looked at now and then, instead of at its events."""
        place = place_of(self.rings, q)
        moved = place.channel != memory.place.channel and memory.control != OFF
        memory = replace(memory, place=place, control=SNATCH if moved else memory.control)
        return self.controlled(memory, q, touched=False)

    def settle(self, t: float, q: State, v: State, memory: Memory, fired: Collection[int] = ()) -> Settled:
        """Switch until nothing changes.

        Args:
            t: instant, s.
            q: theta, x, y, phi.
            v: their rates.
            memory: before.
            fired: indices of the watched functions that reached zero here.
        """
        if LOST in fired:
            return Settled(memory, lost=True)
        start, events = memory, []
        memory = self._moved(memory, q, fired)
        events += _transitions(t, start, memory)
        seen, switched = {memory.modes}, set[int]()
        while True:
            after = self._rows(q, v, memory, fired, switched)
            new = _transitions(t, memory, after)
            events += new
            switched.update(e.contact for e in new)
            memory = after
            if not new:
                return Settled(memory, tuple(events), switches(t, start, memory))
            if memory.modes in seen:
                return Settled(memory, tuple(events), switches(t, start, memory), cycle=True)
            seen.add(memory.modes)

    def _pair(
        self, i: int, formula: Formula, q: State, v: State, memory: Memory, lam: Floats | None
    ) -> tuple[float, float]:
        """FREE: h and h', whose zero is where a dip is deepest; CONTACT: lam; BALLISTIC: h and max(h', -lam)."""
        mode = memory.modes[i]
        if mode == CONTACT:
            return 1.0, float(lam[i]) if lam is not None else 1.0
        h, H, _ = formula(q, v)
        hd = _dot(H, v)
        if mode == FREE:
            return h, hd
        return h, max(hd, -self._would_push(q, v, memory, i))

    def _places(self, q: State, memory: Memory) -> tuple[float, float, float, float]:
        place, rings, at = memory.place, self.rings, angle(q)
        below = to_edge(rings[place.channel - 1], place.below, at) if place.channel else 1.0
        above = to_edge(rings[place.channel], place.above, at)
        rho, middle = math.sqrt(q[1] * q[1] + q[2] * q[2]), 1.0
        if place.below != SOLID:
            middle = rho / rings[place.channel - 1].middle - 1.0 + DEAD_BAND
        if place.above != SOLID:
            middle = min(middle, 1.0 - rho / rings[place.channel].middle + DEAD_BAND)
        lost = 1.0
        if memory.control != OFF and place.channel:
            lost = GIVEN_UP - abs(wrapped(at + q[0] - 0.5 * math.pi))
        return below, above, middle, lost

    def _moved(self, memory: Memory, q: State, fired: Collection[int]) -> Memory:
        """Place and controller behind the edges and middles that were passed."""
        before = memory
        if EDGE_BELOW in fired:
            memory = over_edge(memory, self.rings, BELOW, q)
        if EDGE_ABOVE in fired:
            memory = over_edge(memory, self.rings, ABOVE, q)
        if MIDDLE in fired:
            place, rho = memory.place, math.hypot(q[1], q[2])
            inwards = place.below != SOLID and abs(rho - self.rings[place.channel - 1].middle) < 1e-9
            memory = through_gap(memory, self.rings, inwards, q)
            memory = replace(memory, control=SNATCH if self.maze.driver.on else OFF)
        if memory is before:
            return memory
        return rolling(self.controlled(memory, q, touched=False), self.maze.rows.rolling)

    def controlled(self, memory: Memory, q: State, touched: bool) -> Memory:
        """The controller's mode: a gap below is snatched, the touch of a face ends that."""
        place = memory.place
        if memory.control == BALANCE and place.below != SOLID:
            off = angle(q) - self.rings[place.channel - 1].centre(place.below)
            return replace(memory, control=SNATCH, target=q[0] + wrapped(off))
        if memory.control == SNATCH and touched and place.below == SOLID:
            return replace(memory, control=BALANCE if place.channel else CENTRE)
        return memory

    def _rows(self, q: State, v: State, memory: Memory, fired: Collection[int], switched: set[int]) -> Memory:
        """Every normal row switched once by the guards that hold now; slip rows follow."""
        vd, lam = self.accelerate(q, v, memory)
        modes = list(memory.modes)
        for i, formula in self.maze.rows.at(memory.place).items():
            if i not in NORMALS:
                continue
            h, H, Hdv = formula(q, v)
            near = 0.0 if 2 * i in fired or abs(h) < ROUNDING else h
            hd, mode = _dot(H, v), modes[i]
            if mode == FREE and i not in switched and _touches(near, hd, lambda H=H, Hdv=Hdv: _dot(H, vd) + Hdv):  # type: ignore[misc]
                modes[i] = CONTACT
            elif mode == CONTACT and _released(float(lam[i]), hd, i in switched, 2 * i + 1 in fired):
                modes[i] = FREE if h > 0.0 else BALLISTIC
            elif mode == BALLISTIC:
                modes[i] = self._from_ballistic(q, v, memory, i, (h, hd), fired, i in switched)
        after = replace(memory, modes=tuple(modes))
        touched = CONTACT in (modes[BELOW], modes[ABOVE])
        return rolling(self.controlled(after, q, touched), self.maze.rows.rolling)

    def _from_ballistic(
        self, q: State, v: State, memory: Memory, i: int, at: tuple[float, float], fired: Collection[int], now: bool
    ) -> int:
        h, hd = at
        if h > 0.0 or (2 * i in fired and hd >= 0.0):
            return FREE
        if now:
            return BALLISTIC
        returns = 2 * i + 1 in fired or (hd < 0.0 and self._would_push(q, v, memory, i) > 0.0)
        return CONTACT if returns else BALLISTIC

    def _would_push(self, q: State, v: State, memory: Memory, i: int) -> float:
        """Multiplier that a row would have with the others and the torque as they are, N."""
        modes = list(memory.modes)
        modes[i] = CONTACT
        return float(self.accelerate(q, v, replace(memory, modes=tuple(modes)))[1][i])


def _dot(H: State, v: State | Floats) -> float:
    return float(H[0] * v[0] + H[1] * v[1] + H[2] * v[2] + H[3] * v[3])


def _touches(h: float, hd: float, gap_acceleration: Callable[[], float]) -> bool:
    if h == 0.0 and abs(hd) < SLOW:
        return gap_acceleration() < 0.0
    return h < -OVERRUN or (h <= 0.0 and hd < 0.0)


def _released(lam: float, hd: float, now: bool, fired: bool) -> bool:
    """A row that was switched on at this very instant while closing is not let go on rounding."""
    return lam < 0.0 and hd >= 0.0 if now else lam < 0.0 or fired


def _transitions(t: float, before: Memory, after: Memory) -> list[Event]:
    """Of the rows that decide for themselves: slip follows its face without an event of its own."""
    return [
        Event(t=t, contact=i, before=Mode(b), after=Mode(a))
        for i, (b, a) in enumerate(zip(before.modes, after.modes, strict=True))
        if b != a and i in NORMALS
    ]


def switches(t: float, before: Memory, after: Memory) -> tuple[Switch, ...]:
    """Channel, sectors below and above, mode of the controller."""
    pairs = zip(_discrete(before), _discrete(after), strict=True)
    return tuple(Switch(t=t, variable=i, before=b, after=a) for i, (b, a) in enumerate(pairs) if a != b)


def _discrete(memory: Memory) -> tuple[int, ...]:
    return memory.place.channel, memory.place.below, memory.place.above, memory.control
