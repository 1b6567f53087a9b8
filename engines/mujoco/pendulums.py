"""Pendulums in a row in MuJoCo: spheres on hinges, counter-clockwise seen with x to the right and z up."""

from __future__ import annotations

import mujoco

from crossbody.cases import Case
from crossbody.engines._cradle import in_real_time, pendulums
from crossbody.engines.mujoco import _cradle
from crossbody.engines.mujoco._scene import Scene

POINT = 1e-13
"""Moment of inertia of a point mass over m L^2; MuJoCo admits no 0."""
LEAST = 2e-15
"""The smallest moment of inertia that MuJoCo admits, kg m^2 (twice mjMINVAL)."""


def default_step(case: Case, profile: str) -> float:
    """Time step when none is given, s."""
    return _cradle.default_step(pendulums(case), case, profile)


def build(case: Case, profile: str, dt: float) -> Scene:
    """Compile the model of one profile: point masses (matched), or spheres as they are (default).

    Raises:
        ValueError: MuJoCo's own, for a model that it refuses.
    """
    chain, spec = pendulums(case), mujoco.MjSpec()
    hanging = (0.0, 0.0, -chain.length)
    for i, mass in enumerate(chain.masses):
        name = f"ball {i}"
        body = spec.worldbody.add_body(name=name, pos=(i * chain.spacing, 0.0, 0.0))
        body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=(0.0, -1.0, 0.0))
        sphere = {"type": mujoco.mjtGeom.mjGEOM_SPHERE, "size": (chain.radius, 0.0, 0.0), "pos": hanging}
        if profile == "matched":
            body.explicitinertial = True
            body.mass, body.ipos = mass, hanging
            body.inertia = (max(POINT * mass * chain.length**2, LEAST),) * 3
        body.add_geom(name=name, mass=mass, **sphere)
    return _cradle.build(case, chain, spec, profile, dt)


def followed(case: Case, profile: str) -> Case | None:
    """The case whose equations the profile integrates; None where the engine has constants of its own."""
    return in_real_time(case, "memoryless") if profile == "matched" else None
