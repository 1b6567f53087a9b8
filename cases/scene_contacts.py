"""Which pairs of a scene's shapes have rows, in what order, and how many each has."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from crossbody.cases.scene import Pair, Scene, Shape

PLACES = {
    ("plane", "sphere"): 1, ("plane", "capsule"): 2, ("plane", "cylinder"): 2, ("plane", "box"): 8,
    ("plane", "ellipsoid"): 1, ("sphere", "sphere"): 1, ("sphere", "capsule"): 1, ("sphere", "cylinder"): 1,
    ("sphere", "box"): 1, ("capsule", "capsule"): 1,
}  # fmt: skip
"""Number of places where two shapes may meet: over a plane ends of a capsule, caps of a cylinder, corners of a box."""


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
    def rows(self) -> tuple[str, ...]:
        """Names of its rows."""
        return (self.pair.name,) if self.places == 1 else tuple(f"{self.pair.name} {k}" for k in range(self.places))


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
