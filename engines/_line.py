"""Bodies that slide along one line, as engines need them that know forces between coordinates, or shapes and impacts.

    h = H q + h0,    every row alone: lam = m (w - a1 h' - a0 h - a2 h^3),    1/m = diag(H M^-1 H^T),

w = -H M^-1 f: what presses without the row, m/s^2. A row is a coordinate or a difference of two.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Case, Mode
from crossbody.cases.arrays import Bytes, Floats
from crossbody.cases.rotations import matrices
from crossbody.cases.scene import Joint, Loop, Scene, Shape, Tendon
from crossbody.cases.scene_contacts import by_shapes
from crossbody.engines._real_time import in_real_time, one_set

FREE, CONTACT, BALLISTIC = int(Mode.FREE), int(Mode.CONTACT), int(Mode.BALLISTIC)

ROUNDED = 64.0 * float(np.finfo(np.float64).eps)
"""Part of the length of a scene that rounding of its places makes of a zero gap, and of its motion."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Line:
    """A scene on a line.

    Attributes:
        axis (3,): the line, in the world.
        places (n, 3): where the bodies are at q = 0, m.
        bodies: names. masses (n,): kg.
        gravity: towards smaller q, m/s^2.
        shapes: what may touch: spheres of the bodies, and planes of the world.
        H (nc, n), h0 (nc,): of the rows.
        q0, v0 (n,): start.
        a0, a1, a2 (nc,): constants of each row: the fast ones where it has two sets.
        unilateral (nc,): rows that can open.
        fastest: about the speed that the scene can have, m/s.
    """

    axis: Floats
    places: Floats
    bodies: tuple[str, ...]
    masses: Floats
    gravity: float
    shapes: tuple[Shape, ...]
    H: Floats
    h0: Floats
    q0: Floats
    v0: Floats
    a0: Floats
    a1: Floats
    a2: Floats
    unilateral: NDArray[np.bool_]
    fastest: float

    @property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """(left, right) of every row, h = q_right - q_left + h0; what stands still is -1."""
        return tuple((_first(row == -1.0), _first(row == 1.0)) for row in self.H)

    @property
    def alone(self) -> bool:
        """Whether no two rows have a body in common: then the law of each is that of all."""
        return bool((np.count_nonzero(self.H, axis=0) <= 1).all())

    @cached_property
    def reduced(self) -> Floats:
        """M of every row (nc,), kg."""
        return 1.0 / (self.H**2 @ (1.0 / self.masses))

    @cached_property
    def presses(self) -> Floats:
        """W of every row (nc,), m/s^2."""
        found: Floats = self.gravity * self.H.sum(axis=1)
        return found

    @cached_property
    def _balance(self) -> Floats:
        """What gives lam (nc,) of the generalised forces that the rows exert (n,)."""
        return np.asarray(np.linalg.pinv(self.H.T), dtype=np.float64)

    def spring(self, q: Floats, v: Floats) -> Floats:
        """Lam of every row as if it were alone and active (..., nc), N."""
        h = self.gaps(q)
        return self.reduced * (self.presses - self.a1 * self.rates(v) - self.a0 * h - self.a2 * h**3)

    @cached_property
    def _rounding(self) -> float:
        """Gap that no engine tells from zero, m: touching shapes may be apart, or push, by it."""
        return ROUNDED * float(np.abs(self.places).max() + np.abs(self.h0).max(initial=0.0))

    def gaps(self, q: Floats) -> Floats:
        """Gaps (..., nc), m; of what is apart by rounding, zero."""
        found: Floats = q @ self.H.T + self.h0
        return np.where(np.abs(found) <= self._rounding, 0.0, found)

    def rates(self, v: Floats) -> Floats:
        """H v (..., nc), m/s."""
        return v @ self.H.T

    def acceleration(self, q: Floats, v: Floats) -> Floats:
        """V' under `memoryless` (n,), m/s^2."""
        return self.memoryless(q, v) @ self.H / self.masses - self.gravity

    def transmitted(self, change: Floats) -> Floats:
        """What each row passes on (..., nc), from change (..., n) of velocity (or of it a second) beside gravity's."""
        return (self.masses * change) @ self._balance.T

    def memoryless(self, q: Floats, v: Floats, h: Floats | None = None) -> Floats:
        """max(0, lam) of rows whose gap h, of q if not given, is closed, lam if always on (..., nc), N."""
        lam = self.spring(q, v)
        closed = np.where((self.gaps(q) if h is None else h) <= 0.0, np.maximum(lam, 0.0), 0.0)
        return np.where(self.unilateral, closed, lam)

    def modes(self, h: Floats, rates: Floats, lam: Floats) -> Bytes:
        """Free above; below in contact while it pushes, or as it touches (..., nc)."""
        below = np.where((lam > 0.0) | ((h == 0.0) & (rates < 0.0)), CONTACT, BALLISTIC)
        return np.where(self.unilateral, np.where(h > 0.0, FREE, below), int(Mode.BILATERAL)).astype(np.int8)

    def observe(self, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Gaps (m, nc), m, and energies (m, 2), J, of m states."""
        return self.gaps(q), np.column_stack((0.5 * v**2 @ self.masses, self.gravity * q @ self.masses))


def _first(there: NDArray[np.bool_]) -> int:
    return int(np.argmax(there)) if there.any() else -1


def why_no_line(case: Case) -> str | None:
    """Return why a case is not of bodies on one line, in words that go on from "It"; None if it is."""
    if (scene := case.scene) is None:
        return f"has no scene, but the mechanism {case.mechanism!r}."
    if scene.actuators or scene.pushes or scene.pairs or any(loop.in_space for loop in scene.loops):
        return "has loops in space, actuators, pushes or pairs of shapes."
    if [joint.body for joint in scene.joints] != [body.name for body in scene.bodies]:
        return "has bodies without a joint, or with several."
    bodies = zip(scene.bodies, scene.joints, strict=True)
    axes = [matrices(np.array(body.orientation)) @ joint.axis for body, joint in bodies]
    slides = all(joint.type == "slide" for joint in scene.joints) and not any(body.parent for body in scene.bodies)
    if not (slides and scene.joints and np.ptp(axes, axis=0).max() == 0.0):
        return "has bodies that do not slide along one line."
    if np.linalg.norm(np.cross(axes[0], scene.gravity)) > 0.0:
        return "has gravity across its line."
    own = _rows(scene) is not None
    return None if own else "has springs, dampers, or rows that are not a coordinate or a difference of two."


def line(case: Case) -> Line:
    """Read a case of bodies on a line."""
    assert case.scene is not None
    scene, law = case.scene, one_set(case.law)
    rows = _rows(scene)
    assert rows is not None
    H, h0 = rows
    axis = matrices(np.array(scene.bodies[0].orientation)) @ scene.joints[0].axis
    gravity = -float(axis @ scene.gravity)
    reference = np.array([joint.reference for joint in scene.joints])
    met = {name for pair in by_shapes(scene).pairs for name in (pair.first, pair.second)}
    stored = float(np.max(np.sqrt(law.a0) * np.abs(H @ case.q0 + h0), initial=0.0))
    return Line(
        axis=axis, places=np.array([body.position for body in scene.bodies]) - np.outer(reference, axis),
        bodies=tuple(body.name for body in scene.bodies),
        masses=np.array([body.mass for body in scene.bodies]), gravity=gravity,
        shapes=tuple(shape for shape in scene.shapes if shape.name in met), H=H, h0=h0, q0=case.q0,
        v0=case.v0, a0=law.a0, a1=law.a1, a2=law.a2, unilateral=law.unilateral,
        fastest=float(np.max(np.abs(case.v0))) + abs(gravity) * case.t_end + stored or 1.0,
    )  # fmt: skip


def _rows(scene: Scene) -> tuple[Floats, Floats] | None:
    """Return H (nc, n) and h0 (nc,); None where a row or a force is none of a line's."""
    unit = dict(zip((joint.name for joint in scene.joints), np.eye(len(scene.joints)), strict=True))
    found = [*(_loop(loop, scene, unit) for loop in scene.loops), *(_bound(part, unit) for part in scene.bounded)]
    if any(one is None for one in found) or any(map(scene.acts_along, scene.tendons)):
        return None
    rows = [row for part in found if part for row in part]
    H = np.array([row for row, _ in rows]).reshape(-1, len(unit))
    return (H, np.array([offset for _, offset in rows])) if ((H == 0) | (np.abs(H) == 1)).all() else None


Row = tuple[Floats, float]


def _bound(part: Joint | Tendon, unit: dict[str, Floats]) -> list[Row] | None:
    if isinstance(part, Joint):
        plain = not (any(part.stiffness) or any(part.damping) or part.armature or part.margin)
        row = unit[part.name]
    else:
        plain = not part.bodies and part.margin == 0.0 and len(part.joints) <= 2 and abs(sum(part.coefficients)) < 2.0
        row = sum((c * unit[name] for name, c in zip(part.joints, part.coefficients, strict=True)), np.zeros(len(unit)))
    bounds = zip((1.0, -1.0), part.range, strict=True)
    return [(sign * row, -sign * bound) for sign, bound in bounds if np.isfinite(bound)] if plain else None


def _loop(loop: Loop, scene: Scene, unit: dict[str, Floats]) -> list[Row] | None:
    """Return a coordinate that is held, from its value."""
    if loop.type != "joint" or loop.second or any(loop.polynomial[1:]):
        return None
    reference = next(joint.reference for joint in scene.joints if joint.name == loop.first)
    return [(unit[loop.first], -reference - loop.polynomial[0])]


def followed(case: Case, scene: Line) -> Case | None:
    """The same rows without ballistic memory; None where several rows are not those of the law (`spring`)."""
    return in_real_time(case, "memoryless") if scene.alone and case.law.unilateral.all() else None


def law_name(scene: Line) -> str:
    """What `Line.memoryless` is: the machine of that name for rows of their own, else a chain of springs."""
    return "memoryless" if scene.alone else "springs"
