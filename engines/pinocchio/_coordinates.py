"""A scene's coordinates and Pinocchio's.

    scene      free: q = (p, w x y z), v = (p', angular in body axes);            ball: q = (w x y z), v in body axes
    Pinocchio  free: q = (p, x y z w), v = (R^T p', angular), both in body axes;  ball: q = (x y z w), v in body axes

With v = J v_e: tau_e = J^T tau, M_e = J^T M J, b_e = J^T (b + M J' v_e). J is R on the linear
velocity of a free joint and 1 elsewhere; there J' v_e = R (w x v_lin), and 0 elsewhere. Slides
and hinges count from their reference.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.rotations import matrices
from crossbody.cases.scene import Scene
from crossbody.engines._acting import Acting
from crossbody.engines._log import Chart, Observe
from crossbody.engines._scene import places
from crossbody.engines.pinocchio._contacts import Points
from crossbody.engines.pinocchio._rows import PinRows

PULL = 0.1  # 1/s, of a quaternion to length 1


class Coordinates:
    """The map of one scene; `same` says whether the coordinates are the same in both."""

    def __init__(self, scene: Scene) -> None:
        self.nq, self.nv = scene.nq, scene.nv
        at, place = places(scene)
        self.reference: Floats = np.zeros(self.nq)
        self.frees: list[tuple[int, int]] = []
        self.turns: list[tuple[int, int]] = []  # first entry of a quaternion, first of its angular velocity
        single = []
        for joint in scene.joints:
            q, v = at[joint.name], place[joint.name]
            if joint.type in ("slide", "hinge"):
                self.reference[q] = joint.reference
                single.append((q, v))
            elif joint.type == "free":
                self.frees.append((q, v))
            if joint.type in ("free", "ball"):
                self.turns.append((q + 3, v + 3) if joint.type == "free" else (q, v))
        self.same = not self.turns and not self.reference.any()
        self._last: Floats = np.zeros(0)
        self._blocks: list[tuple[int, Floats]] = []
        self._theirs, self._ours = np.arange(self.nq), np.arange(self.nq)  # where each entry stands in the other's
        for first, _ in self.turns:
            self._theirs[first : first + 4] = [first + 1, first + 2, first + 3, first]
            self._ours[first : first + 4] = [first + 3, first, first + 1, first + 2]
        self.single = np.array(single, dtype=int).reshape(-1, 2).T

    def theirs(self, q: Floats) -> Floats:
        """Return Pinocchio's positions (..., nq)."""
        return (q - self.reference)[..., self._theirs]

    def ours(self, q: Floats) -> Floats:
        """Return the scene's positions (..., nq)."""
        return (q + self.reference)[..., self._ours]

    def blocks(self, q: Floats) -> list[tuple[int, Floats]]:
        """Return for every free joint its first velocity and R (..., 3, 3), at Pinocchio's positions."""
        if self.frees and not np.array_equal(q, self._last):  # a step asks several times at one place
            self._last = np.array(q)
            self._blocks = [(v, matrices(q[..., [at + 6, at + 3, at + 4, at + 5]])) for at, v in self.frees]
        return self._blocks

    def velocities(self, q: Floats, v: Floats) -> Floats:
        """Return J v, the scene's velocities (..., nv), at Pinocchio's positions."""
        found: Floats = np.array(v)
        for first, R in self.blocks(q):
            found[..., first : first + 3] = np.einsum("...ij,...j->...i", R, v[..., first : first + 3])
        return found

    def back(self, q: Floats, x: Floats) -> Floats:
        """Return J^T x: Pinocchio's velocities, or forces, of the scene's (..., nv)."""
        found: Floats = np.array(x)
        for first, R in self.blocks(q):
            found[..., first : first + 3] = np.einsum("...ji,...j->...i", R, x[..., first : first + 3])
        return found

    def bend(self, q: Floats, v: Floats) -> Floats:
        """Return J' v_e (nv,) at Pinocchio's positions and velocities."""
        found: Floats = np.zeros(self.nv)
        for first, R in self.blocks(q):
            found[first : first + 3] = R @ np.cross(v[first + 3 : first + 6], v[first : first + 3])
        return found

    def rates(self, q: Floats, v: Floats) -> Floats:
        """Return q' (nq,) in Pinocchio's coordinates; of a quaternion with a pull to length 1."""
        found: Floats = np.empty(self.nq)
        found[self.single[0]] = v[self.single[1]]
        for (at, first), (_, R) in zip(self.frees, self.blocks(q), strict=True):
            found[at : at + 3] = R @ v[first : first + 3]
        for at, first in self.turns:
            (x, y, z, w), (a, b, c) = q[at : at + 4].tolist(), v[first : first + 3].tolist()  # arrays cost ten times it
            pull = PULL * (1.0 - (x * x + y * y + z * z + w * w))
            found[at] = 0.5 * (w * a + y * c - z * b) + pull * x
            found[at + 1] = 0.5 * (w * b + z * a - x * c) + pull * y
            found[at + 2] = 0.5 * (w * c + x * b - y * a) + pull * z
            found[at + 3] = -0.5 * (x * a + y * b + z * c) + pull * w
        return found

    def normalise(self, q: Floats) -> None:
        """Bring every quaternion of Pinocchio's positions (nq,) to length 1, in place."""
        for at, _ in self.turns:
            q[at : at + 4] /= np.sqrt(q[at : at + 4] @ q[at : at + 4])


@dataclass(frozen=True, slots=True, kw_only=True)
class World:
    """What acts on the rows from outside, in the engine's coordinates.

    Attributes:
        instants: when the inputs change, s, increasing.
        change: (t, q, v) puts in force what acts from such an instant on.
        reset: back to the start: no input, no memory.
        clock: is told the time of all that is asked next, s; None where nothing depends on it.
        acting: what acts on a case's scene from outside, controllers included; None elsewhere.
        safe: (q, v) -> whether the state is one that the scene can reach.
    """

    instants: Sequence[float] = ()
    change: Callable[[float, Floats, Floats], None] = lambda _t, _q, _v: None
    reset: Callable[[], None] = lambda: None
    clock: Callable[[float], None] | None = None
    acting: Acting | None = None
    safe: Callable[[Floats, Floats], bool] = lambda q, v: math.isfinite(q.sum() + v.sum())  # faster than each


@dataclass(frozen=True, slots=True, kw_only=True)
class Prepared:
    """A model and its rows.

    Attributes:
        rows: gaps, accelerations and multipliers.
        points: rows as Pinocchio's constraints (profile admm); None where no contact can be stepped.
        observe: gaps and energies of many states of the model.
        sizes: how far the coordinates move (or how deep contacts give), and how fast: numbers, or
            one a coordinate (n,). Times rtol they are the absolute tolerances.
        start: q and v at the start in the engine's coordinates; None where they are the case's.
        chart: positions and velocities of the engine -> those of the case; None where they are the same.
        world: what acts from outside.
        coordinates: rates of the positions, where they are not v; None where they are.
        audit: more for the parity audit, or instead of what is read from `rows`.
    """

    rows: PinRows
    points: Points | None = None
    observe: Observe
    sizes: tuple[float | Floats, float | Floats]
    start: tuple[Floats, Floats] | None = None
    chart: Chart | None = None
    world: World = field(default_factory=World)
    coordinates: Coordinates | None = None
    audit: dict[str, Any] = field(default_factory=dict)
