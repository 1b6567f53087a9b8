"""The system of a scene, ready for the integrators."""

from __future__ import annotations

from crossbody.cases import Law
from crossbody.cases.scene import Scene
from crossbody.reference import System
from crossbody.reference.tree.mechanism import KERNELS, velocity
from crossbody.reference.tree.table import tabulate


def system(scene: Scene, law: Law) -> System:
    """Return the equations of a scene; nothing is compiled for it.

    Raises:
        SceneError: for a scene that the kernels cannot do.
    """
    table = tabulate(scene)
    turning = {"velocity": velocity, "quaternions": table.quaternions} if table.quaternions else {}
    return System(
        n=scene.nv, nq=scene.nq, parameters=table.p, **turning,
        a0=law.a0, a1=law.a1, a2=law.a2, unilateral=law.unilateral,
        inputs=len(scene.actuators), scratch=table.scratch, **KERNELS,
    )  # fmt: skip
