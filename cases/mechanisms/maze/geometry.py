"""Rings, gaps and tips of the ball maze.

Angles count counter-clockwise from +x in the maze's own frame; gravity points along -y. A gap is
a sector between two tips: the ends of a ring's wall are caps of radius w/2, w = outer - inner,
centred on the circle of radius (inner + outer)/2 at the gap's centre -+ he. A face ends where a
cap begins, at he, so gap and normal are continuous.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from crossbody.cases.case import Parameter, Value
from crossbody.cases.errors import InvalidValue

PITCH, THICKNESS = 0.02, 5.2e-3
"""Radial distance and thickness of the rings added outside those of the table, m."""

_DEFAULTS = (
    (16.0e-3, 21.2e-3, 1, 49.0, 180.0),
    (36.0e-3, 41.2e-3, 4, 21.0, 45.0),
    (56.2e-3, 61.3e-3, 4, 14.0, 0.0),
    (76.3e-3, 81.5e-3, 4, 11.0, 45.0),
)
TABLE = len(_DEFAULTS)  # number of rings whose geometry is given by parameters


@dataclass(frozen=True, slots=True, kw_only=True)
class Ring:
    """One ring.

    Attributes:
        inner, outer: radii of its faces, m.
        gaps: how many gaps, equally spaced; 0 for none.
        width: angle of a gap between the flat ends of a wall without caps, rad.
        phase: angle of the centre of gap 0 at theta = 0, rad.
    """

    inner: float
    outer: float
    gaps: int = 0
    width: float = 0.0
    phase: float = 0.0

    @property
    def middle(self) -> float:
        """Radius of the circle on which the caps' centres lie, m."""
        return 0.5 * (self.inner + self.outer)

    @property
    def cap(self) -> float:
        """Radius of a cap, m."""
        return 0.5 * (self.outer - self.inner)

    @property
    def reach(self) -> float:
        """Half the angle he between the centres of a gap's two caps, rad: width/2 + asin(w/(2 middle))."""
        return 0.5 * self.width + math.asin(self.cap / self.middle)

    @property
    def free_width(self) -> float:
        """What passes through a gap, m: 2 middle sin(he) - w."""
        return 2.0 * (self.middle * math.sin(self.reach) - self.cap)

    def centre(self, gap: int) -> float:
        """Angle of a gap's centre in the maze's frame, rad."""
        return self.phase + gap * 2.0 * math.pi / self.gaps

    def tips(self, gap: int) -> tuple[float, float]:
        """Angles of the centres of its two caps, clockwise end first, rad."""
        return self.centre(gap) - self.reach, self.centre(gap) + self.reach


@dataclass(frozen=True, slots=True, kw_only=True)
class Maze:
    """The rings from inside out, the outer wall, and the ball.

    Attributes:
        rings: innermost first.
        wall: radius of the outer wall, m.
        ball: radius of the ball, m.
    """

    rings: tuple[Ring, ...]
    wall: float
    ball: float


def parameters() -> dict[str, Parameter]:
    """Parameters of the geometry: five a ring of the table, their number, the wall."""
    found = {
        "rings": Parameter(
            default=TABLE, doc=f"number of rings; beyond {TABLE} they are added outside", low=1, high=1e4
        )
    }
    for i, (inner, outer, gaps, width, phase) in enumerate(_DEFAULTS):
        found |= {
            f"inner{i}": Parameter(default=inner, unit="m", doc=f"inner radius of ring {i}", low=0.0, open_low=True),
            f"outer{i}": Parameter(default=outer, unit="m", doc=f"outer radius of ring {i}", low=0.0, open_low=True),
            f"gaps{i}": Parameter(default=gaps, doc=f"number of gaps in ring {i}", low=0, high=1e4),
            f"width{i}": Parameter(default=width, unit="deg", doc=f"angle of each gap in ring {i}", low=0.0),
            f"phase{i}": Parameter(default=phase, unit="deg", doc=f"position of gap 0 of ring {i} at theta = 0"),
        }
    return found | {
        "wall": Parameter(default=96.8e-3, unit="m", doc=f"radius of the wall around {TABLE} rings", low=0.0)
    }


def maze_of(p: Mapping[str, Value]) -> Maze:
    """The maze of a scene, checked."""
    count = int(p["rings"])
    rings = [_ring(p, i) for i in range(min(count, TABLE))]
    wall = float(p["wall"]) if count >= TABLE else _ring(p, count).inner
    ball = float(p["ball_radius"])
    for ring in rings:
        _check_ring(ring, rings.index(ring))
    for i in range(TABLE, count):
        rings.append(_added(rings[TABLE - 1], wall, i))
        wall += PITCH
    maze = Maze(rings=tuple(rings), wall=wall, ball=ball)
    _check_channels(maze)
    _check_passages(maze)
    return maze


def _ring(p: Mapping[str, Value], i: int) -> Ring:
    return Ring(
        inner=float(p[f"inner{i}"]),
        outer=float(p[f"outer{i}"]),
        gaps=int(p[f"gaps{i}"]),
        width=math.radians(float(p[f"width{i}"])),
        phase=math.radians(float(p[f"phase{i}"])),
    )


def _added(like: Ring, inner: float, i: int) -> Ring:
    """A ring outside the others whose gaps are as many and as wide as those of `like`, half a spacing on."""
    outer = inner + THICKNESS
    bare = Ring(inner=inner, outer=outer)
    if like.gaps == 0:
        return bare
    reach = math.asin((0.5 * like.free_width + bare.cap) / bare.middle)
    width = 2.0 * (reach - math.asin(bare.cap / bare.middle))
    phase = like.phase + (i - TABLE + 1) * math.pi / like.gaps
    return Ring(inner=inner, outer=outer, gaps=like.gaps, width=width, phase=phase)


def _check_ring(ring: Ring, i: int) -> None:
    if not ring.outer > ring.inner:
        raise InvalidValue(f"Ring {i}: outer{i} is {ring.outer:g} m; it must be above inner{i} = {ring.inner:g} m.")
    room = 2.0 * math.pi / ring.gaps if ring.gaps else math.inf
    if 2.0 * ring.reach >= room:
        raise InvalidValue(
            f"Ring {i}: {ring.gaps} gaps of {math.degrees(ring.width):g} deg with their "
            f"rounded tips cover the whole ring; valid: width{i} below "
            f"{math.degrees(room - 2.0 * math.asin(ring.cap / ring.middle)):.6g} deg."
        )


def _check_channels(maze: Maze) -> None:
    """Faces must not overlap and each channel must hold the ball."""
    outers = [ring.outer for ring in maze.rings]
    inners = [*(ring.inner for ring in maze.rings[1:]), maze.wall]
    for i, (outer, inner) in enumerate(zip(outers, inners, strict=True)):
        outside = f"ring {i + 1}" if i + 1 < len(maze.rings) else "the wall"
        if inner <= outer:
            raise InvalidValue(
                f"Ring {i} and {outside} overlap: the outer radius is {outer:g} m, the next inner one {inner:g} m."
            )
        if inner - outer <= 2.0 * maze.ball:
            raise InvalidValue(
                f"The ball of radius {maze.ball:g} m is wider than the channel between ring "
                f"{i} and {outside}; valid: ball_radius below {0.5 * (inner - outer):g} m."
            )
    if maze.rings[0].inner <= maze.ball:
        raise InvalidValue(
            f"The ball of radius {maze.ball:g} m does not fit into ring 0; valid: below {maze.rings[0].inner:g} m."
        )


def _check_passages(maze: Maze) -> None:
    """A gap that the ball cannot pass would be touched at both tips at once."""
    for i, ring in enumerate(maze.rings):
        if ring.gaps and ring.free_width <= 2.0 * maze.ball:
            raise InvalidValue(
                f"The ball of radius {maze.ball:g} m is wider than the gaps of ring {i}, which "
                f"leave {ring.free_width:g} m; valid: ball_radius below "
                f"{0.5 * ring.free_width:g} m, or a wider gap."
            )


def start(maze: Maze, p: Mapping[str, Value]) -> tuple[float, float]:
    """Ball centre on the face where it starts, m: it touches, at rest."""
    i, angle = int(p["ring"]), float(p["angle"])
    if i >= len(maze.rings):
        raise InvalidValue(f"ball_maze: ring is {i}; valid: 0 to {len(maze.rings) - 1}.")
    ring, outer = maze.rings[i], p["side"] == "outer"
    side, R = (-1.0, ring.outer) if outer else (1.0, ring.inner)
    rho = R - side * maze.ball
    while True:
        x, y = rho * math.sin(angle), -side * rho * math.cos(angle)
        if side * (R - math.sqrt(x * x + y * y)) - maze.ball <= 0.0:
            return x, y
        rho = math.nextafter(rho, math.inf if side > 0.0 else 0.0)  # rounding must not let it fall on the face


def tilted_gravity(p: Mapping[str, Value]) -> float:
    """Gravity in the plane of the maze, m/s^2."""
    return float(p["gravity"]) * math.sin(math.radians(float(p["tip"])))
