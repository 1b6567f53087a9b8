"""Bodies without friction that lie on a floor on more places than hold them."""

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
