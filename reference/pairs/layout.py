"""Where each number of a pair of shapes stands in the parameters of a scene's kernels."""

from __future__ import annotations

PLANE, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX, HULL = range(7)
# A shape: what it is, the node that carries it (-1: the world), its pose there (rotation by rows, position), its size.
TYPE, NODE, POSE, SIZE, SHAPE = 0, 1, 2, 14, 17
# A pair: two shapes, and the distance at which its rows begin.
# Then the variable that says how its shapes lie to each other (-1: it is always the same), the sine of the angle at
# which that changes, and where among the variables the angle stands from which points of a cap count; last the number
# of the first of its kinks (-1: it has none).
FIRST, SECOND, MARGIN, LIES, SINE, PHASE, BENDS, PAIR = (0, SHAPE, *range(2 * SHAPE, 2 * SHAPE + 6))
BENDING = {CAPSULE: 1, CYLINDER: 2, BOX: 3}
"""Kinks of a sphere against a solid: where the nearest point comes to an end along an axis, or to a cylinder's side."""
# A contact row, in the columns behind its kind: which pair, and which of its places; over a plane the
# point that the second shape is round there, in its node's frame, and at what radius (0: a corner).
WHICH, PLACE, POINT, RADIUS = 1, 2, 3, 6
ACROSS = 7
"""Of a tangential row, which has those of its contact besides: 0 or 1, by the direction."""
# How two shapes lie to each other: not yet decided, at an angle, or along each other; a cylinder on the one cap or the
# other.
UNDECIDED, CROSSED, ALONG, UPSIDE_DOWN = range(4)
BAND = 1e-6  # of the sine and of the overlap: what has just changed does not change back by rounding
FAR = 1.0  # m: the gap of a row that is none as the shapes lie
