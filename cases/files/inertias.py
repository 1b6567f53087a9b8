"""Mass, centre and inertia of solids in closed form, and of what is made of several."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.files.warned import captured
from crossbody.cases.rotations import matrices
from crossbody.cases.scene import Vector


class Inertia(NamedTuple):
    """Mass, kg, centre (3,), m, and inertia about the centre (3, 3), kg m^2."""

    mass: float
    com: Floats
    about: Floats


def solid(kind: str, size: Sequence[float]) -> tuple[float, Floats]:
    """Return volume, m^3, and inertia about the centre over the mass (3, 3), m^2, of a solid.

    Args:
        kind: sphere, capsule, cylinder, box or ellipsoid.
        size: as MuJoCo's: radius; radius and half length along z; half sides; semi-axes, m.
    """
    a, b, c = (*size, 0.0, 0.0)[:3]
    if kind == "box":
        return 8.0 * a * b * c, np.diag([b * b + c * c, a * a + c * c, a * a + b * b]) / 3.0
    if kind == "ellipsoid":
        return 4.0 / 3.0 * math.pi * a * b * c, np.diag([b * b + c * c, a * a + c * c, a * a + b * b]) / 5.0
    if kind == "sphere":
        return 4.0 / 3.0 * math.pi * a**3, np.eye(3) * 0.4 * a * a
    tube = 2.0 * math.pi * a * a * b
    across, along = a * a / 4.0 + b * b / 3.0, a * a / 2.0
    if kind == "cylinder":
        return tube, np.diag([across, across, along])
    balls = 4.0 / 3.0 * math.pi * a**3  # both ends of a capsule; of a half ball the centre lies 3/8 a from its face
    out = balls * (0.4 * a * a + b * b + 0.75 * a * b)
    whole = tube + balls
    side, axis = (tube * across + out) / whole, (tube * along + balls * 0.4 * a * a) / whole
    return whole, np.diag([side, side, axis])


def placed(mass: float, unit: Floats, position: Sequence[float] = (0.0,) * 3, R: Floats | None = None) -> Inertia:
    """Return a solid of a mass that stands somewhere, by its inertia over the mass."""
    turn = np.eye(3) if R is None else R
    return Inertia(mass, np.array(position, dtype=float), mass * turn @ unit @ turn.T)


def together(parts: Sequence[Inertia]) -> Inertia:
    """Return what several parts that are fixed to each other are."""
    mass = sum(part.mass for part in parts)
    com = sum((part.mass * part.com for part in parts), np.zeros(3)) / mass
    about = np.zeros((3, 3))
    for part in parts:
        d = part.com - com
        about = about + part.about + part.mass * (d @ d * np.eye(3) - np.outer(d, d))
    return Inertia(mass, com, about)


def six(about: Floats) -> Vector:
    """Return xx, yy, zz, xy, xz, yz."""
    return tuple(about[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].tolist())


SOLIDS = {2: "sphere", 3: "capsule", 4: "ellipsoid", 5: "cylinder", 6: "box"}
"""MuJoCo's number of a type -> ours."""
CHANGING = ("settotalmass", "boundmass", "boundinertia", "balanceinertia", "fusestatic")
"""What a compiler may be told to do with inertias behind their computation."""


MESH = 7


def of_shapes(path: Path) -> dict[str, Inertia | None]:
    """Return the inertias of the named bodies of an MJCF that are those of their shapes alone, in closed form.

    Of one with a mesh, which a compiler has in single precision, there is None. Bodies with a shape that is none of
    `SOLIDS`, or a shell, are left to the compiler; so is a file of which meshes
    that are only drawn are not there.
    """
    import mujoco

    try:
        with captured():
            spec = mujoco.MjSpec.from_file(str(path))
            model = spec.compile()
    except ValueError:
        return {}
    compiler = spec.compiler
    if any(getattr(compiler, name) > 0 for name in CHANGING):
        return {}
    always = int(compiler.inertiafromgeom) == int(mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE)
    never = int(compiler.inertiafromgeom) == int(mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE)
    first, last = compiler.inertiagrouprange
    found: dict[str, Inertia | None] = {}
    for body in spec.bodies:
        geoms = [geom for geom in body.geoms if first <= geom.group <= last]
        if body.name and geoms and not never and (always or not body.explicitinertial):
            parts = [_of_geom(model, geom) for geom in geoms]
            if any(model.geom_type[geom.id] == MESH for geom in geoms):
                found[body.name] = None
            if None not in parts and any(part and part.mass > 0.0 for part in parts):
                found[body.name] = together([part for part in parts if part])
    return found


def _of_geom(model: Any, geom: Any) -> Inertia | None:
    kind = SOLIDS.get(int(model.geom_type[geom.id]))
    if kind is None or int(geom.typeinertia) != 0:
        return None
    volume, unit = solid(kind, model.geom_size[geom.id])
    mass = geom.density * volume if math.isnan(geom.mass) else geom.mass
    return placed(float(mass), unit, model.geom_pos[geom.id], matrices(np.array(model.geom_quat[geom.id])))
