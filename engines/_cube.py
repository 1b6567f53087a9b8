"""A cube above a table as engines see it: quaternions there, a rotation vector here, corners for its gap.

Case: q = (x, y, z, r_x, r_y, r_z) with the centre in m and the rotation body to world as exp([r]x), rad; velocities are
those of the centre in the world's axes, m/s, and the angular velocity in the body's, rad/s: v is not q'.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from crossbody.cases import Case
from crossbody.cases.arrays import Floats

CORNERS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


@dataclass(frozen=True, slots=True, kw_only=True)
class Cube:
    """A case of the mechanism `cube_toss`: half of a side, m; mass, kg; inertia, kg m^2; friction; gravity, m/s^2."""

    half: float
    mass: float
    inertia: float
    friction: float
    gravity: float

    def observe(self, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Height of the lowest corner (n, 1), m, and energies (n, 2), J."""
        corners = Rotation.from_rotvec(np.array(q[:, 3:])).as_matrix() @ (self.half * CORNERS.T)
        lowest = q[:, 2:3] + corners[:, 2].min(axis=1)[:, None]
        kinetic = 0.5 * (self.mass * np.sum(v[:, :3] ** 2, axis=1) + self.inertia * np.sum(v[:, 3:] ** 2, axis=1))
        return lowest, np.column_stack((kinetic, self.mass * self.gravity * q[:, 2]))


def cube(case: Case) -> Cube:
    """Read a case."""
    return Cube(
        half=0.5 * case.number("side"), mass=case.number("mass"), inertia=case.number("inertia"),
        friction=case.number("friction"), gravity=case.number("gravity"),
    )  # fmt: skip


def quaternion(r: Floats) -> Floats:
    """(w, x, y, z) of rotation vectors (..., 3)."""
    return np.asarray(Rotation.from_rotvec(np.array(r)).as_quat(scalar_first=True))


def rotation_vector(w: Floats) -> Floats:
    """Rotation vectors (n, 3) of quaternions (n, 4), scalar first; each within pi of no rotation."""
    return np.asarray(Rotation.from_quat(np.array(w), scalar_first=True).as_rotvec())
