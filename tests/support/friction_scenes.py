"""Scenes with friction whose motion is known, or that a second machine can follow."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from crossbody.cases import Case, Trajectory
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, Pair, Push, RowLaw, Scene, Shape, Tendon
from crossbody.cases.scene_contacts import PLACES
from crossbody.reference import System, kernels, simulate
from crossbody.reference.tree.system import system

G = 9.81
LAW = RowLaw(a0=1e4, a1=200.0)
PLANAR = (("x", (1, 0, 0), "slide"), ("z", (0, 0, 1), "slide"), ("turn", (0, 1, 0), "hinge"))
HALF = (0.2, 0.15, 0.1)
ROUND = {"sphere": (0.1, 0.0, 0.0), "ellipsoid": (0.2, 0.15, 0.1)}
EDGED = {"box": (0.2, 0.15, 0.1), "capsule": (0.05, 0.2, 0.0)}
SOLID = {"sphere": (0.1, 0, 0), "box": (0.2, 0.15, 0.1), "cylinder": (0.15, 0.1, 0), "capsule": (0.08, 0.2, 0)}
HEAVIEST = 2.0  # kg


def box_body(name: str, half: tuple[float, ...], mass: float = 1.0) -> Body:
    """Return a homogeneous box."""
    a, b, c = half
    inertia = (b * b + c * c, a * a + c * c, a * a + b * b)
    return Body(name=name, mass=mass, inertia=(*(mass / 3.0 * part for part in inertia), 0.0, 0.0, 0.0))


def pair(first: str, second: str, mu: float, law: RowLaw = LAW) -> Pair:
    """Return a pair that slides with friction."""
    return Pair(
        name=f"{first}:{second}", first=first, second=second, friction=(mu, mu, 0.0, 0.0, 0.0), dimension=3, law=law
    )


def on_floor(body: Body, shape: Shape, mu: float, *, tilt: float = 0.0, planar: bool = False, turn: float = 0.0,
             law: RowLaw = LAW) -> Scene:  # fmt: skip
    """Return a body on a plane that falls in x by `tilt`; the plane's own frame is turned about its normal."""
    free = (Joint(name="free", body=body.name, type="free"),)
    joints = tuple(Joint(name=n, body=body.name, type=kind, axis=axis) for n, axis, kind in PLANAR) if planar else free
    floor = Shape(name="floor", type="plane", orientation=(np.cos(turn / 2), 0.0, 0.0, np.sin(turn / 2)))
    return Scene(
        bodies=(body,), joints=joints, shapes=(floor, shape), pairs=(pair("floor", shape.name, mu, law),),
        gravity=(G * np.sin(tilt), 0.0, -G * np.cos(tilt)),
    )  # fmt: skip


def box_on_floor(mu: float, *, half: tuple[float, ...] = HALF, **given: Any) -> Scene:
    """Return a box on a plane."""
    return on_floor(box_body("box", half), Shape(name="box", body="box", type="box", size=half), mu, **given)


def sphere_on_floor(mu: float, radius: float, **given: Any) -> Scene:
    """Return a homogeneous sphere of 1 kg on a plane."""
    body = Body(name="sphere", mass=1.0, inertia=(0.4 * radius**2,) * 3 + (0.0,) * 3)
    return on_floor(body, Shape(name="sphere", body="sphere", type="sphere", size=(radius, 0, 0)), mu, **given)


def rod_on_floor(mu: float, *, length: float = 0.5, radius: float = 1e-3, law: RowLaw = LAW) -> Scene:
    """Return a rod of half this length with round ends, in a plane."""
    body = Body(name="rod", mass=1.0, inertia=(length**2 / 3, length**2 / 3, 1e-3, 0.0, 0.0, 0.0))
    shape = Shape(name="rod", body="rod", type="capsule", size=(radius, length, 0.0))
    return on_floor(body, shape, mu, planar=True, law=law)


def stack(mu1: float, mu2: float, m1: float = 2.0, m2: float = 1.0) -> Scene:
    """Return a flat block on a floor and one on it, each with a force at its centre of mass."""
    low, high = (0.4, 0.3, 0.1), (0.1, 0.1, 0.1)
    return Scene(
        bodies=(box_body("low", low, m1), box_body("high", high, m2)),
        joints=tuple(Joint(name=name, body=name, type="free") for name in ("low", "high")),
        shapes=(
            Shape(name="floor", type="plane"), Shape(name="low", body="low", type="box", size=low),
            Shape(name="top", body="low", type="plane", position=(0.0, 0.0, 0.1)),
            Shape(name="high", body="high", type="box", size=high),
        ),
        pairs=(pair("floor", "low", mu1), pair("top", "high", mu2)),
        pushes=(Push(name="on low", body="low"), Push(name="on high", body="high")),
    )  # fmt: skip


def standing(bodies: int, feet: int, mu: float = 0.5) -> Scene:
    """Return bodies that stand apart from each other, each on so many round feet."""
    shapes, pairs = [Shape(name="floor", type="plane")], []
    for b in range(bodies):
        for f in range(feet):
            at = 2.0 * np.pi * f / feet
            place = (0.2 * np.cos(at), 0.2 * np.sin(at), -0.1)
            shapes.append(Shape(name=f"s{b}.{f}", body=f"b{b}", type="sphere", size=(0.05, 0, 0), position=place))
            pairs.append(pair("floor", f"s{b}.{f}", mu, LAW))
    return Scene(
        bodies=tuple(box_body(f"b{b}", (0.2, 0.15, 0.1)) for b in range(bodies)),
        joints=tuple(Joint(name=f"j{b}", body=f"b{b}", type="free") for b in range(bodies)),
        shapes=tuple(shapes), pairs=tuple(pairs),
    )  # fmt: skip


def rubbed() -> Iterator[tuple[str, Case]]:
    """Yield a ball on solids, capsules across each other, and a wheel: name and case."""
    turn, aside = Rotation.from_euler("xyz", [0.3, -0.4, 0.2]), (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0)
    ball = sphere_on_floor(0.4, 0.1)
    rod = Shape(
        name="sphere", body="sphere", type="capsule", size=(0.1, 0.2, 0), orientation=(aside[0], aside[0], 0, 0)
    )
    solids = {"box": (0.4, 0.3, 0.2), "cylinder": (0.2, 0.5, 0.0), "capsule": (0.2, 0.5, 0.0)}
    for kind, size in solids.items():
        lies = aside if kind != "box" else (1.0, 0.0, 0.0, 0.0)
        lower = Shape(name="floor", type=kind, size=size, orientation=tuple(
            (turn * Rotation.from_quat(lies, scalar_first=True)).as_quat(scalar_first=True).tolist()))  # fmt: skip
        for upper in (ball.shapes[1], rod) if kind == "capsule" else (ball.shapes[1],):
            q0 = [*turn.apply([0.05, 0.0, 0.2999]), *turn.as_quat(scalar_first=True)]
            case = case_of(ball.replace(shapes=(lower, upper)), q0=q0, v0=[1.0, 0.5, 0, 3, -5, 4], t_end=0.02)
            yield f"{upper.type} on {kind}", case
    can = Shape(name="sphere", body="sphere", type="cylinder", size=(0.1, 0.05, 0.0), orientation=(*rod.orientation,))
    lean = Rotation.from_euler("x", 0.4)  # on a rim, of which the lowest point goes round
    low = 0.1 * np.cos(0.4) + 0.05 * np.sin(0.4)
    wheel = ball.replace(shapes=(ball.shapes[0], can))
    q0 = [0, 0, low, *lean.as_quat(scalar_first=True)]
    yield "wheel on its rim", case_of(wheel, q0=q0, v0=[1.0, 0.5, 0, 0, 8.0, 4.0], t_end=0.02)


def tossed(seed: int, first: Mapping[str, tuple[float, ...]] = ROUND, most: int = 3) -> Any:
    """Return bodies tossed onto a floor, two spheres among them that may meet, their start and mu."""
    sizes = ROUND | first
    rng = np.random.default_rng(seed)
    mu, law = float(rng.uniform(0.0, 1.0)), RowLaw(a0=float(10 ** rng.uniform(3, 4.5)), a1=float(rng.uniform(5, 200)))
    kinds = [str(rng.choice(list(first))), "sphere", "sphere"][: int(rng.integers(1, 1 + most))]
    bodies, shapes, q, v = [], [Shape(name="floor", type="plane")], [], []
    for i, kind in enumerate(kinds):
        bodies.append(box_body(f"b{i}", HALF, float(rng.uniform(0.5, HEAVIEST))))
        shapes.append(Shape(name=f"s{i}", body=f"b{i}", type=kind, size=sizes[kind]))
        turn = rng.normal(size=4)
        q += [0.15 * i, 0.0, 0.3 + 0.25 * i, *(turn / np.linalg.norm(turn))]
        v += [*rng.normal(size=2), -1.0, *(4.0 * rng.normal(size=3))]
    pairs = [pair("floor", f"s{i}", mu, law) for i in range(len(kinds))]
    pairs += [pair(f"s{i}", f"s{i + 1}", mu, law) for i in range(1, len(kinds) - 1)]
    joints = tuple(Joint(name=body.name, body=body.name, type="free") for body in bodies)
    scene = Scene(bodies=tuple(bodies), joints=joints, shapes=tuple(shapes), pairs=tuple(pairs))
    return scene, np.array(q), np.array(v), mu


def piled(seed: int, kinds: tuple[str, str]) -> Any:
    """Return a body that falls onto another one, which falls onto a floor, their start and mu; all rub."""
    rng = np.random.default_rng(seed)
    mu, law = float(rng.uniform(0.0, 1.0)), RowLaw(a0=float(10 ** rng.uniform(3, 4.5)), a1=float(rng.uniform(5, 200)))
    names, q, v = ("up", "low"), list[float](), list[float]()
    for height in (0.75, 0.3):
        turn = rng.normal(size=4)
        q += [*(0.03 * rng.normal(size=2)), height, *(turn / np.linalg.norm(turn))]
        v += [*(0.5 * rng.normal(size=2)), -1.0, *(4.0 * rng.normal(size=3))]
    scene = Scene(
        bodies=tuple(box_body(name, HALF, float(rng.uniform(0.5, HEAVIEST))) for name in names),
        joints=tuple(Joint(name=name, body=name, type="free") for name in names),
        shapes=(Shape(name="floor", type="plane"), *(
            Shape(name=name, body=name, type=kind, size=SOLID[kind]) for name, kind in zip(names, kinds, strict=True)
        )),
        pairs=(pair("floor", "up", mu, law), pair("floor", "low", mu, law), pair("up", "low", mu, law)),
    )  # fmt: skip
    return scene, np.array(q), np.array(v), mu


def chained(seed: int, rng: np.random.Generator) -> Any:
    """Return boxes in a row over a floor, joined by hinges and balls, some of which rub: up to 32 corners."""
    count, size = int(rng.integers(2, 5)), (0.2, 0.15, 0.1)
    bodies, joints, shapes, q = [], [], [Shape(name="floor", type="plane")], list[float]()
    for i in range(count):
        body = box_body(f"b{i}", size, float(rng.uniform(0.5, HEAVIEST)))
        parent, place = (f"b{i - 1}", (0.45, 0.0, 0.0)) if i else ("", (0.0,) * 3)
        bodies.append(dataclasses.replace(body, parent=parent, position=place))
        kind = str(rng.choice(["ball", "hinge"])) if i else "free"
        turn = np.array([1.0, 0.0, 0.0, 0.0]) + 0.15 * rng.normal(size=4)
        turn /= np.linalg.norm(turn)
        q += [0.0, 0.0, 0.2, *turn] if i == 0 else list(turn) if kind == "ball" else [0.15 * float(rng.normal())]
        joints.append(Joint(
            name=f"j{i}", body=body.name, type=kind, axis=(0, 1, 0), anchor=(-0.225, 0.0, 0.0) if i else (0.0,) * 3,
            friction_loss=float(rng.choice([0.0, 0.3])) if i else 0.0,
        ))  # fmt: skip
        shapes.append(Shape(name=f"s{i}", body=body.name, type="box", size=size))
    pairs = tuple(pair("floor", shape.name, 0.5) for shape in shapes[1:])
    scene = Scene(bodies=tuple(bodies), joints=tuple(joints), shapes=tuple(shapes), pairs=pairs)
    return scene, np.array(q), rng.normal(size=scene.nv), 0.5


def drawn(seed: int) -> tuple[Scene, np.ndarray, np.ndarray, float, float]:
    """Return bodies that are tossed, piled or joined, their start, mu from 0 to 2 and a horizon."""
    rng = np.random.default_rng([seed, 77])
    kind = int(rng.integers(0, 5))
    if kind == 0:
        made = tossed(seed)
    elif kind == 1:
        made = tossed(seed, EDGED, int(rng.integers(1, 4)))
    elif kind == 2:
        made = tossed(seed, {"cylinder": [(0.1, 0.15, 0.0), (0.15, 0.02, 0.0)][rng.integers(2)]}, 1)
    elif kind == 3:
        solids = [types for types in PLACES if "plane" not in types]
        made = piled(seed, solids[rng.integers(len(solids))])
    else:
        made = chained(seed, rng)
    scene, q, v, _ = made
    mu = float(rng.choice([0.0, rng.uniform(0.0, 0.3), rng.uniform(0.3, 1.0), rng.uniform(1.0, 2.0)]))
    law = RowLaw(a0=float(10 ** rng.uniform(3.0, 5.0)), a1=float(10 ** rng.uniform(0.5, 2.6)))
    pairs = tuple(dataclasses.replace(one, friction=(mu, mu, 0.0, 0.0, 0.0), law=law) for one in scene.pairs)
    return scene.replace(pairs=pairs), q, v, mu, (0.5, 0.8, 2.0, 0.8, 0.5)[kind]


def tipped(seed: int) -> tuple[Scene, np.ndarray]:
    """A box that falls a little turned onto a slope with much friction: it rocks, slides and comes to rest."""
    rng = np.random.default_rng(seed)
    tilt, mu = float(np.deg2rad(rng.uniform(0.0, 15.0))), float(rng.uniform(0.5, 1.0))
    half = tuple(rng.uniform(0.05, 0.15, 3).tolist())
    law = RowLaw(a0=float(10 ** rng.uniform(3.5, 4.5)), a1=float(rng.uniform(100, 200)))
    turn, high = rng.uniform(-0.05, 0.05), half[2] + 0.02
    return box_on_floor(mu, half=half, tilt=tilt, law=law), np.array(
        [0, 0, high, np.cos(turn / 2), 0, np.sin(turn / 2), 0]
    )


def rubbed_tree(seed: int, *, floor: bool = False) -> tuple[Scene, np.ndarray, np.ndarray]:
    """Return bodies on joints of which most have dry friction, with a tendon that has some, and their start.

    Over a floor the first one is a free box, which lands on it.
    """
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 5))
    bodies, joints, q = [], [], list[float]()
    for i in range(count):
        parent = str(rng.choice([bodies[-1].name, bodies[-1].parent or bodies[-1].name])) if bodies else ""
        made = box_body(f"b{i}", HALF, float(rng.uniform(0.5, HEAVIEST)))
        bodies.append(dataclasses.replace(made, parent=parent, position=(0.1, 0.05, -0.3) if parent else (0.0,) * 3))
        kind = "free" if floor and i == 0 else str(rng.choice(["hinge", "hinge", "slide", "ball"]))
        turn = rng.normal(size=4)
        place = [0.0, 0.0, 0.6, 1.0, 0.0, 0.0, 0.0] if kind == "free" else list(turn / np.linalg.norm(turn))
        q += place if kind in ("free", "ball") else [float(rng.normal())]
        spring = float(rng.choice([0.0, 20.0])) if kind in ("hinge", "slide") else 0.0
        loss = float(rng.choice([0.0, 0.3, 1.0, 4.0])) if kind != "free" else 0.0
        axis, anchor = rng.normal(size=3), rng.normal(size=3) * 0.1
        joints.append(Joint(
            name=f"j{i}", body=f"b{i}", type=kind, axis=tuple(axis), stiffness=(spring, 0.0, 0.0), friction_loss=loss,
            anchor=tuple(anchor) if kind in ("hinge", "ball") else (0.0,) * 3, law=RowLaw(a0=400.0, a1=40.0),
        ))  # fmt: skip
    single = [joint.name for joint in joints if joint.type in ("hinge", "slide")]
    tendons = (Tendon(name="rope", joints=tuple(single), coefficients=tuple(rng.normal(size=len(single))),
                      friction_loss=0.5),) if single else ()  # fmt: skip
    shapes, pairs = (), ()
    if floor:
        shapes = Shape(name="floor", type="plane"), Shape(name="box", body="b0", type="box", size=HALF)
        pairs = (pair("floor", "box", float(rng.uniform(0.1, 0.9))),)
    scene = Scene(bodies=tuple(bodies), joints=tuple(joints), tendons=tendons, shapes=shapes, pairs=pairs)
    return scene, np.array(q), rng.normal(size=scene.nv)


def run(scene: Scene, q0: Any, v0: Any, t_end: float, **options: Any) -> Trajectory:
    """Integrate a scene with its energy account."""
    case = case_of(scene)
    chosen = {"rtol": 1e-11, "ledger": True, **options}
    return simulate(system(scene, case.law), q0, v0, t_end, **chosen)


@kernels.dynamics
def _dynamics(t, q, v, u, p, M, f, w):  # type: ignore[no-untyped-def]
    n = len(q)
    for i in range(n):
        for j in range(n):
            M[i, j] = 1.0 if i == j else 0.0
        f[i] = p[1 + i] - p[1 + n + i] * q[i]


@kernels.gaps
def _gaps(t, q, v, p, h, hd):  # type: ignore[no-untyped-def]
    n, first = len(q), 1 + 2 * len(q)
    for i in range(len(h)):
        h[i], hd[i] = 0.0 * q[0], 0.0 * q[0]
        for c in range(n):
            hd[i] += p[first + n * i + c] * v[c]
            if i < p[0].real or i >= p[len(p) - 1].real:
                h[i] += p[first + n * i + c] * q[c]


@kernels.rows
def _rows(t, q, v, p, w, idx, na, H, h, Hdv):  # type: ignore[no-untyped-def]
    n, first = len(q), 1 + 2 * len(q)
    for j in range(na):
        h[j], Hdv[j] = 0.0 * q[0], 0.0 * q[0]
        for c in range(n):
            H[j, c] = p[first + n * idx[j] + c]
            if idx[j] < p[0].real or idx[j] >= p[len(p) - 1].real:
                h[j] += H[j, c] * q[c]


@kernels.energy
def _energy(q, v, p, e):  # type: ignore[no-untyped-def]
    e[0], e[1] = 0.0 * q[0], 0.0 * q[0]
    for i in range(len(q)):
        e[0] += 0.5 * v[i] * v[i]
        e[1] += 0.5 * p[1 + len(q) + i] * q[i] * q[i] - p[1 + i] * q[i]


def linear(H: Any, force: Any, mu: float, contacts: int, *, spring: Any = None, drift: Any = 0.0,
           a0: float = 1e4, a1: float = 200.0, loops: Any = ()) -> System:  # fmt: skip
    """Return unit masses under constant forces and springs: normal rows of H first, then the tangential ones.

    Rows of `loops` are always on.
    """
    H, force, held = np.atleast_2d(np.array(H, dtype=float)), np.array(force, dtype=float), len(loops)
    nc, ways = len(H), len(H) // contacts - 1
    H = np.vstack([H, *np.atleast_2d(loops)]) if held else H
    springs = np.zeros(len(force)) if spring is None else np.array(spring, dtype=float)
    return System(
        n=len(force), dynamics=_dynamics, gaps=_gaps, rows=_rows, energy=_energy,
        parameters=np.concatenate([[contacts], force, springs, H.ravel(), [nc]]),
        a0=[a0] * contacts + [0.0] * (nc - contacts + held), a1=[a1] * (nc + held),
        follows=[-1] * contacts + [i // ways for i in range(nc - contacts)] + [-1] * held,
        mu=[np.inf] * contacts + [mu] * (nc - contacts) + [np.inf] * held,
        unilateral=[True] * nc + [False] * held,
        drift=np.concatenate([np.zeros(contacts), np.broadcast_to(drift, nc - contacts), np.zeros(held)]),
    )  # fmt: skip


def random_problem(rng: np.random.Generator, most: int, rough: float) -> tuple[Any, Any, float, int]:
    """Return rows H, forces and mu of 1 to `most` contacts in a plane, for `linear`, and their number."""
    k = int(rng.integers(1, most + 1))
    n, mu = 2 * k + int(rng.integers(0, 3)), float(rng.uniform(0.05, rough))
    H = rng.normal(size=(2 * k, n)) * 0.6 + np.eye(2 * k, n)
    return H, rng.normal(size=n) * 2.0 - H[:k].T @ np.abs(rng.normal(size=k)) * 2.0, mu, k


def point(mu: float, alpha: float, *, space: bool = False, **given: Any) -> System:
    """Return a point of 1 kg on a slope that falls in x: (x, y downwards to the slope's normal, and across it)."""
    down, press = G * np.sin(alpha), -G * np.cos(alpha)
    if space:
        return linear([[0, 0, 1], [1, 0, 0], [0, 1, 0]], [down, 0.0, press], mu, 1, **given)
    return linear([[0, 1], [1, 0]], [down, press], mu, 1, **given)


def account(run: Trajectory) -> float:
    """Return by how much the energy account is open at the end, J."""
    assert run.ledger is not None
    done = run.ledger.contact.sum(axis=1) + run.ledger.input - run.ledger.dissipated
    return float(np.abs(run.total_energy - run.total_energy[0] - done).max())


RIDES = {"box": (0.3, 0.5, 0.1), "capsule": (0.1, 0.3, 0.0), "cylinder": (0.3, 0.1, 0.0)}
ON_TOP = (0.0, 0.2)
"""Where a ball stands on top of these solids."""


def ball_on_solid(kind: str, mu: float = 0.0) -> Scene:
    """A ball on a solid, in a plane: behind an end of its face the gap is curved."""
    lying = (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0) if kind == "capsule" else (1.0, 0.0, 0.0, 0.0)
    rails = tuple(Joint(name=name, body="ball", type="slide", axis=axis)
                  for name, axis in (("x", (1.0, 0.0, 0.0)), ("z", (0.0, 0.0, 1.0))))  # fmt: skip
    return Scene(
        bodies=(Body(name="ball", mass=1.0, inertia=(1e-3,) * 3 + (0.0,) * 3),), joints=rails,
        shapes=(Shape(name="solid", type=kind, size=RIDES[kind], orientation=lying),
                Shape(name="round", body="ball", type="sphere", size=(0.1, 0.0, 0.0))),
        pairs=(Pair(name="touch", first="solid", second="round", law=RowLaw(a0=4e4, a1=400.0),
                    friction=(mu, mu, 0.0, 0.0, 0.0), dimension=3 if mu else 1),),
        gravity=(0.0, 0.0, -G),
    )  # fmt: skip
