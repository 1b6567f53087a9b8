"""What a mechanism looks like: a module here, named like the mechanism, draws its motion.

A module has a docstring whose first line says what is drawn, and the public names

    stage(p)                        a `Stage`: shapes that stand still and shapes of bodies, from the parameters
    poses(q, p)                     planar: x, y, angle of bodies (n, bodies, 3); spatial: points (n, points, 3), or
                                    where the stage has frames origin and first two axes of each
                                    (n, frames, 9)
    arrows(q, lam, p)               point and force of every arrow (n, arrows, 2 * dimensions), m and N

p holds the case's parameters, and for a case that is a scene the scene as plain values (`scene`).
A module knows neither numba nor an engine: a picture is made from stored coordinates alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol, cast

import numpy as np

from crossbody.cases import Value
from crossbody.cases.arrays import Floats
from crossbody.cases.registry import Registry

Parameters = Mapping[str, Value]
Shape = Mapping[str, Any]
"""`points` [[x, y], ...] with `closed`, or `circle` [x, y, r]; `fill` for what is solid."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stage:
    """What does not move, and what moves with every body.

    Attributes:
        still: shapes at rest (planar), or lines of points in space (spatial).
        bodies: shapes of every body in its own frame, about its origin (planar).
        threads: (x, y, body): a line from a fixed point to a body's origin (planar).
        lines: indices of points joined by one line (spatial); dimensions are 3 where there are any.
        down: whether the third axis points down (spatial).
        solids: of bodies (-1: the world) in space, in their frames: `points` that a sphere of
            `radius` is swept over, with the `faces` that have edges (indices of points) and, of what is
            round, `marks`: lines of points with the normals there; or a `plane`: origin and two axes.
        bones: pairs of bodies whose origins are joined by a line.
        frames: number of bodies that solids and bones speak of.
    """

    still: tuple[Shape, ...] = ()
    bodies: tuple[tuple[Shape, ...], ...] = ()
    threads: tuple[tuple[float, float, int], ...] = ()
    lines: tuple[tuple[int, ...], ...] = ()
    down: bool = False
    solids: tuple[Shape, ...] = ()
    bones: tuple[tuple[int, int], ...] = ()
    frames: int = 0

    @property
    def dimensions(self) -> int:
        """2 or 3."""
        return 3 if self.lines or self.frames else 2


class Scene(Protocol):
    """What every module offers."""

    def stage(self, p: Parameters) -> Stage:
        """What is drawn."""
        ...

    def poses(self, q: Floats, p: Parameters) -> Floats:
        """Where it is."""
        ...

    def arrows(self, q: Floats, lam: Floats, p: Parameters) -> Floats:
        """Contact forces."""
        ...


_REGISTRY = Registry("picture of a mechanism", __name__)
names = _REGISTRY.names  # of mechanisms that can be drawn


def load(name: str) -> Scene:
    """Import a mechanism's picture.

    Raises:
        UnknownName: if there is none; the message lists the names.
    """
    return cast("Scene", _REGISTRY.load(name))


def circle(x: float, y: float, r: float, *, fill: bool = True) -> Shape:
    """A disc or a ring."""
    return {"circle": [x, y, r], "fill": fill}


def box(x: float, y: float, width: float, height: float) -> Shape:
    """A rectangle about (x, y)."""
    a, b = width / 2, height / 2
    return path([(x - a, y - b), (x + a, y - b), (x + a, y + b), (x - a, y + b)], closed=True)


def path(points: Any, *, closed: bool = False) -> Shape:
    """A line, or a solid if closed."""
    return {"points": [[float(c) for c in point] for point in points], "closed": closed, "fill": closed}


def pushes(centres: Floats, lam: Floats, radius: float) -> Floats:
    """Both arrows of every pair of neighbours: on the left ball and on the right one (centres in m, lam in N).

    Returns:
        Point and force (n, 2 (balls - 1), 4), m and N.
    """
    apart = np.diff(centres, axis=1)
    along = apart / np.maximum(np.linalg.norm(apart, axis=2, keepdims=True), 1e-300)
    force = along * lam[:, :, None]
    left = np.concatenate([centres[:, :-1] + radius * along, -force], axis=2)
    right = np.concatenate([centres[:, 1:] - radius * along, force], axis=2)
    return np.concatenate([left, right], axis=1)
