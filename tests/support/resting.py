"""Bodies without friction that lie or stand on a floor on more places than hold them."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody import cases, engines
from crossbody.cases import Case, Outcome, Trajectory
from crossbody.cases.rotations import differences
from crossbody.cases.scene import Body, Joint, Pair, RowLaw, Scene, Shape

LAW = RowLaw(a0=4e4, a1=60.0)
FLOOR = Shape(name="floor", type="plane", size=(9.0, 9.0, 0.1))


def quaternion(turn: Any) -> np.ndarray:
    """Return the quaternion, w first, of a rotation vector."""
    angle = float(np.linalg.norm(turn))
    return np.array([np.cos(angle / 2), *(np.sin(angle / 2) * np.asarray(turn) / max(angle, 1e-300))])


def plate(
    points: Any, com: Any = (0.0, 0.0, 0.05), *, height: float = 0.0, turn: Any = (0.0, 0.0, 0.0), v: Any = None,
    t_end: float = 1.0, law: RowLaw = LAW, inertia: Any = (0.004, 0.006, 0.008),
) -> Case:  # fmt: skip
    """Return a body on feet: small spheres about points (k, 3) of its frame.

    Args:
        points: of the feet, m.
        com: its centre of mass, m.
        height: of the lowest foot over the floor, m.
        turn: rotation vector of the body.
        v: its velocities at the start.
        t_end: horizon, s.
        law: of every foot.
        inertia: about its axes, kg m^2.
    """
    points, radius = np.asarray(points, dtype=float), 0.01
    feet = tuple(
        Shape(name=f"foot {k}", body="plate", type="sphere", size=(radius, 0.0, 0.0), position=tuple(x))
        for k, x in enumerate(points.tolist())
    )
    pairs = tuple(Pair(name=foot.name, first="floor", second=foot.name, law=law) for foot in feet)
    body = Body(name="plate", mass=1.0, com=tuple(com), inertia=(*inertia, 0.0, 0.0, 0.0))
    scene = Scene(bodies=(body,), joints=(Joint(name="free", body="plate", type="free"),), shapes=(FLOOR, *feet),
                  pairs=pairs)  # fmt: skip
    q = quaternion(turn)
    w, u = q[0], q[1:]
    lowest = min(x[2] + 2.0 * (w * np.cross(u, x) + np.cross(u, np.cross(u, x)))[2] for x in points)
    return cases.from_scene(scene, q0=[0.0, 0.0, height + radius - lowest, *q], v0=v, t_end=t_end)


def run(case: Case, profile: str = "compiled", engine: str = "reference", **settings: Any) -> Trajectory:
    """Return the motion of a case to its horizon."""
    found = engines.load(engine).prepare(case, profile, **settings).run()
    assert found.outcome is Outcome.FINISHED, found.message
    return found


def apart(case: Case, one: Trajectory, other: Trajectory) -> float:
    """Return by how much two motions of a case differ at their ends."""
    return float(differences(one.q[-1:], other.q[-1:], case.quaternions).max())


def standing(seed: int, *, t_end: float = 0.1) -> Case:
    """Return a torso in a plane on one to three straight legs with feet of two spheres, every joint at a bound or free.

    Legs are upright, whatever direction is up, and each foot bears what is over it: nothing presses a bound, and what
    legs carry together is not determined.
    """
    rng = np.random.default_rng(seed)
    armature, damping = float(rng.choice([0.0, 0.01])), (float(rng.choice([0.0, 0.1])), 0.0, 0.0)
    law = RowLaw(a0=float(10 ** rng.uniform(3, 5)), a1=float(10 ** rng.uniform(1, 2.5)))
    legs, height = int(rng.integers(1, 4)), rng.uniform(0.5, 1.5)
    tilt = rng.uniform(-3.0, 3.0) if rng.random() < 0.5 else 0.0
    up, side = np.array([np.sin(tilt), 0.0, np.cos(tilt)]), np.array([np.cos(tilt), 0.0, -np.sin(tilt)])

    def body(name: str, parent: str, position: Any) -> Body:
        mass = float(10 ** rng.uniform(-0.5, 1.0))
        return Body(name=name, parent=parent, position=tuple(position), mass=mass,
                    inertia=(*(0.01 * mass,) * 3, 0.0, 0.0, 0.0))  # fmt: skip

    bodies = [body("torso", "", up * height)]
    joints = [
        Joint(name="rise", body="torso", type="slide", axis=tuple(up)),
        Joint(name="drift", body="torso", type="slide", axis=tuple(side)),
        Joint(name="tip", body="torso", type="hinge", axis=(0.0, 1.0, 0.0)),
    ]
    floor = Shape(name="floor", type="plane", size=FLOOR.size, orientation=tuple(quaternion([0.0, tilt, 0.0])))
    feet, pairs = [], []
    for leg in range(legs):
        cuts = np.sort(rng.uniform(0.0, height, int(rng.integers(0, 3))))
        drops = [0.0, *np.diff([0.0, *cuts, height])]
        parent = "torso"
        for i, drop in enumerate(drops):
            bodies.append(body(f"link {leg} {i}", parent, -up * drop + [0.0, 0.1 * (leg + 1) * (i == 0), 0.0]))
            parent, axis = bodies[-1].name, (0.0, float(rng.choice([-1.0, 1.0])), 0.0)
            span = ((0.0, 1.0), (-1.0, 0.0), (-0.5, 0.5))[int(rng.integers(3))]
            joints.append(Joint(name=f"joint {leg} {i}", body=parent, type="hinge", axis=axis, range=span,
                                armature=armature, damping=damping, law=law))  # fmt: skip
        for end in (-1.0, 1.0):
            at = side * end * rng.uniform(0.05, 0.2) + 0.02 * up
            feet.append(Shape(name=f"foot {leg} {end}", body=parent, type="sphere", size=(0.02, 0.0, 0.0),
                              position=tuple(at)))  # fmt: skip
            pairs.append(Pair(name=feet[-1].name, first="floor", second=feet[-1].name, law=law))
    scene = Scene(bodies=tuple(bodies), joints=tuple(joints), shapes=(floor, *feet), pairs=tuple(pairs),
                  gravity=tuple(-9.81 * up))  # fmt: skip
    return cases.from_scene(scene, t_end=t_end)
