"""Balls on a line in MuJoCo: spheres on slide joints, whose positions are their displacements."""

from __future__ import annotations

import mujoco

from crossbody.cases import Case
from crossbody.engines._cradle import in_real_time, sliders
from crossbody.engines.mujoco import _cradle
from crossbody.engines.mujoco._scene import Scene


def default_step(case: Case, profile: str) -> float:
    """Time step when none is given, s."""
    return _cradle.default_step(sliders(case), case, profile)


def build(case: Case, profile: str, dt: float) -> Scene:
    """Compile the model of one profile.

    Raises:
        ValueError: MuJoCo's own, for a model that it refuses.
    """
    chain, spec = sliders(case), mujoco.MjSpec()
    for i, mass in enumerate(chain.masses):
        name = f"ball {i}"
        body = spec.worldbody.add_body(name=name, pos=(i * chain.spacing, 0.0, 0.0))
        body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=(1.0, 0.0, 0.0))
        body.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(chain.radius, 0.0, 0.0), mass=mass)
    return _cradle.build(case, chain, spec, profile, dt)


def followed(case: Case, profile: str) -> Case | None:
    """The case whose equations the profile integrates; None where the engine has constants of its own."""
    return in_real_time(case, "memoryless") if profile == "matched" else None
