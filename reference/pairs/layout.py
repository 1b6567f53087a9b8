"""Where each number of a pair of shapes stands in the parameters of a scene's kernels."""

from __future__ import annotations

PLANE, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX = range(6)
# A shape: what it is, the node that carries it (-1: the world), its pose there (rotation by rows, position), its size.
TYPE, NODE, POSE, SIZE, SHAPE = 0, 1, 2, 14, 17
# A pair: two shapes, and the distance at which its rows begin.
FIRST, SECOND, MARGIN, PAIR = 0, SHAPE, 2 * SHAPE, 2 * SHAPE + 1
# A contact row, in the columns behind its kind: which pair, and which of its places.
WHICH, PLACE = 1, 2
