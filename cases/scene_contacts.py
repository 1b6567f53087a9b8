"""Which pairs of a scene's shapes have rows, in what order, and how many each has."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from crossbody.cases.scene import Pair, Scene, Shape

PLACES = {
    ("plane", "sphere"): 1, ("plane", "capsule"): 2, ("plane", "cylinder"): 4, ("plane", "box"): 8,
    ("plane", "ellipsoid"): 1, ("sphere", "sphere"): 1, ("sphere", "capsule"): 1, ("sphere", "cylinder"): 1,
    ("sphere", "box"): 1, ("capsule", "capsule"): 2,
}  # fmt: skip
"""Number of places where two shapes may meet: over a plane ends of a capsule, corners of a box, lowest and highest
points of a cylinder's caps, or where it stands four points of its rim;
of two capsules one, or where they end if they lie along each other."""
WIDEST, SAG, LEVEL = 1e-2, 1e-8, 1e-6
"""Largest sine at which capsules lie along each other; and of the sum of two capsules' radii, by how much their gap may
be too large that is taken where they end. Last, the largest tilt with which a cylinder stands."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact:
    """A pair with rows.

    Attributes:
        pair: whose.
        first, second: its shapes, in the order in which the rows are written: the normal leads from first to second.
        places: number of its rows.
    """

    pair: Pair
    first: Shape
    second: Shape
    places: int

    @property
    def parallel(self) -> float:
        """Sine of the angle below which capsules lie along each other, or a cylinder stands; 0 of other shapes."""
        return parallel(self.first, self.second)

    @property
    def rows(self) -> tuple[str, ...]:
        """Names of its rows."""
        return (self.pair.name,) if self.places == 1 else tuple(f"{self.pair.name} {k}" for k in range(self.places))


def parallel(first: Shape, second: Shape) -> float:
    """Return the sine of the angle below which two capsules lie along each other, or a cylinder stands on a plane.

    Axes a distance d apart that cross in the middle of a length L at an angle a are L^2 a^2 / 8d further apart where it
    ends. It is 0 for other shapes.
    """
    if first.type == "plane" and second.type == "cylinder":
        return LEVEL
    if first.type != "capsule" or second.type != "capsule":
        return 0.0
    length, apart = 2.0 * min(first.size[1], second.size[1]), first.size[0] + second.size[0]
    return float(min(WIDEST, np.sqrt(8.0 * SAG) * apart / length)) if length > 0.0 else WIDEST


def contacts(scene: Scene) -> tuple[Contact, ...]:
    """Return the pairs that have rows: without friction, of shapes whose gap is known in closed form."""
    return tuple(found for found in _all(scene) if isinstance(found, Contact))


def watched(scene: Scene) -> tuple[Pair, ...]:
    """Return the pairs that have no rows: a motion in which they meet is not the scene's."""
    return tuple(found for found in _all(scene) if isinstance(found, Pair))


def _all(scene: Scene) -> Iterator[Contact | Pair]:
    shapes = {shape.name: shape for shape in scene.shapes}
    for pair in scene.pairs:
        one, two = shapes[pair.first], shapes[pair.second]
        if (one.type, two.type) not in PLACES:
            one, two = two, one
        places = PLACES.get((one.type, two.type))
        without = places is None or pair.dimension > 1
        yield pair if without else Contact(pair=pair, first=one, second=two, places=int(places or 0))
