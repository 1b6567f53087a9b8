"""Mechanisms at an instant at which many of their feet touch something: what a mode problem of a scene is made of."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from friction_scenes import PLANAR, box_body, pair
from mode_enumeration import Contact
from scipy.linalg import null_space

from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, Pair, RowLaw, Scene, Shape
from crossbody.reference import System
from crossbody.reference.tree.system import system

DEEP, CLOSING = 1e-13, 1e-3  # m, m/s: no foot lands before or after another
RADIUS, LINK = 0.03, (0.4, 0.1, -0.05)
SLIDES = 1e-3  # of the largest velocity
LAW = RowLaw(a0=1e4, a1=200.0)


@dataclass(frozen=True)
class Start:
    """A scene, its start (q0 (nq,), v0 (nv,)), and the mode problem there: G, `bare` of `mode_enumeration`, contacts.

    Attributes:
        made: the system of the scene.
        rows: H (nc, nv).
        moved: M^-1 H^T (nv, nc).
        free: v' without any contact (nv,).
    """

    scene: Scene
    made: System
    q0: np.ndarray
    v0: np.ndarray
    rows: np.ndarray
    moved: np.ndarray
    free: np.ndarray
    bare: np.ndarray
    contacts: list[Contact]

    @property
    def is_clear(self) -> bool:
        """Whether every foot either stands or slides, whatever a machine takes for a slip."""
        least = SLIDES * float(np.abs(self.v0).max())
        return all(one.slip is None or float(np.linalg.norm(one.slip)) > least for one in self.contacts)

    @property
    def G(self) -> np.ndarray:
        return self.rows @ self.moved


def _tree(rng: np.random.Generator, count: int, planar: bool) -> tuple[list[Body], list[Joint], list[float]]:
    """Draw bodies on each other, all in the world's axes at the start; the first is free or turns on the world."""
    bodies, joints, q = list[Body](), list[Joint](), list[float]()
    free = rng.random() < 0.6
    for i in range(count):
        parent = str(rng.choice([bodies[-1].name, bodies[-1].parent or "b0"])) if i else ""
        place = tuple((np.array(LINK) * rng.uniform(-1.0, 1.0, 3)).tolist()) if i else (0.0, 0.0, 0.0)
        made = replace(box_body(f"b{i}", (0.2, 0.15, 0.1), float(rng.uniform(0.3, 2.0))), parent=parent, position=place)
        bodies.append(made)
        anchor = tuple((0.2 * rng.normal(size=3)).tolist())
        if i == 0 and free and planar:
            joints += [Joint(name=name, body="b0", type=kind, axis=axis) for name, axis, kind in PLANAR]
            q += [0.0] * 3
        elif i == 0 and free:
            joints.append(Joint(name="j0", body="b0", type="free"))
            q += [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
        else:
            kind = "hinge" if planar else str(rng.choice(["hinge", "hinge", "slide", "ball"]))
            axis = (0.0, 1.0, 0.0) if planar else tuple(rng.normal(size=3).tolist())
            where = anchor if kind in ("hinge", "ball") else (0.0, 0.0, 0.0)
            joints.append(Joint(name=f"j{i}", body=made.name, type=kind, axis=axis, anchor=where))
            q += [1.0, 0.0, 0.0, 0.0] if kind == "ball" else [0.0]
    return bodies, joints, q


def _upright(n: np.ndarray) -> tuple[float, ...]:
    """Quaternion that turns z into the unit vector n."""
    turn = np.array([1.0 + n[2], -n[1], n[0], 0.0]) if n[2] > -0.999 else np.array([0.0, 1.0, 0.0, 0.0])
    return tuple((turn / np.linalg.norm(turn)).tolist())


def _feet(
    rng: np.random.Generator, bodies: list[Body], count: int, planar: bool, mu: float
) -> tuple[list[Shape], list[Pair]]:
    """Draw feet, each upon a plane of its own, of the world or of another body; some planes are those of others."""
    places, up = dict[str, np.ndarray](), np.array([0.0, 0.0, 1.0])
    for one in bodies:
        places[one.name] = places.get(one.parent, np.zeros(3)) + np.array(one.position)
    shapes, pairs = list[Shape](), list[Pair]()
    rough, last = rng.uniform(0.0, 1.0), up
    flat = 0.2 * float(rng.normal())
    for k in range(count):
        body = str(rng.choice(list(places)))
        at = 0.25 * rng.normal(size=3) * ([1.0, 0.0, 1.0] if planar else 1.0)
        last = last if rng.random() < 0.5 else up + rough * rng.normal(size=3) * ([1.0, 0.0, 1.0] if planar else 1.0)
        n = last / np.linalg.norm(last)
        if rng.random() < 0.5:  # of one floor
            n, at[2] = up, flat - places[body][2]
        centre = places[body] + at
        others = [name for name in places if name != body]
        ground = str(rng.choice(others)) if others and rng.random() < 0.2 else ""
        below = centre - (RADIUS - DEEP) * n - places.get(ground, np.zeros(3))
        shapes += [
            Shape(name=f"f{k}", body=body, type="sphere", size=(RADIUS, 0.0, 0.0), position=tuple(at.tolist())),
            Shape(name=f"g{k}", body=ground, type="plane", position=tuple(below.tolist()), orientation=_upright(n)),
        ]
        pairs.append(pair(f"g{k}", f"f{k}", mu, LAW))
    return shapes, pairs


def _velocities(rng: np.random.Generator, made: System, q0: np.ndarray) -> np.ndarray | None:
    """Draw a start at which all feet close alike and some stand; None if not all can close."""
    H, follows = made.constraint(q0)[0], np.asarray(made.follows)
    first = np.flatnonzero(follows < 0)
    stands = first[rng.random(len(first)) < rng.choice([1.0, 0.7, 0.3, 0.0])]
    held = np.flatnonzero((follows < 0) | np.isin(follows, stands))
    asked = np.where(follows[held] < 0, -CLOSING, 0.0)
    v = np.linalg.lstsq(H[held], asked, rcond=1e-10)[0]
    if np.abs(H[held] @ v - asked).max() > 1e-12:
        return None
    beside = null_space(H[held], rcond=1e-10)
    return v + beside @ rng.normal(size=beside.shape[1])


def touching(seed: int, most: int, planar: bool) -> Start:
    """Draw a mechanism with at most `most` feet in contact, all of one mu, some of which stand."""
    rng, shapes, pairs = np.random.default_rng([seed, most, planar]), list[Shape](), list[Pair]()
    while True:
        if not pairs:
            count, slight = int(rng.integers(1, most + 1)), rng.random() < 0.5
            mu = float(rng.uniform(0.05, 0.8) if slight else rng.uniform(0.3, 2.0))
            bodies, joints, q = _tree(rng, int(rng.integers(1, 2 + min(count, 4))), planar)
            shapes, pairs = _feet(rng, bodies, count, planar, mu)
        scene = Scene(bodies=tuple(bodies), joints=tuple(joints), shapes=tuple(shapes), pairs=tuple(pairs))
        made, q0 = system(scene, case_of(scene).law), np.array(q)
        v0 = _velocities(rng, made, q0)
        if v0 is not None:
            return start(scene, made, q0, v0, mu)
        del shapes[-2:], pairs[-1]


def start(scene: Scene, made: System, q0: np.ndarray, v0: np.ndarray, mu: float) -> Start:
    """State the mode problem of a start from the system's mass matrix, forces and rows alone.

    Tangential rows that say the same, as of motions in a plane, are one.
    """
    H, gap, Hdv = made.constraint(q0, v0)
    M, f = made.terms(q0, v0)[:2]
    follows = np.asarray(made.follows)
    asked = -Hdv - np.where(follows < 0, made.a0 * gap + made.a1 * (H @ v0), 0.0)
    rows, wanted, contacts = list[np.ndarray](), list[float](), list[Contact]()
    for i in np.flatnonzero(follows < 0):
        along = np.flatnonzero(follows == i)
        axes, sizes, _ = np.linalg.svd(H[along])
        axes = axes[:, : int((sizes > 1e-9).sum())].T
        slip, place = axes @ H[along] @ v0, len(rows)
        rows += [H[i], *(axes @ H[along])]
        wanted += [asked[i], *(axes @ asked[along])]
        stands = not np.linalg.norm(slip) > 1e-10
        contacts.append(Contact(place, list(range(place + 1, len(rows))), mu, None if stands else slip))
    own = np.array(rows)
    moved, free = np.linalg.solve(M, own.T), np.linalg.solve(M, f)
    return Start(scene, made, q0, v0, own, moved, free, np.array(wanted) - own @ free, contacts)
