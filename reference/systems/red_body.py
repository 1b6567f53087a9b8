"""A box that falls on a slab which rests on two feet: five constraints between two bodies in a plane.

q = (x, y, th, X, Y, Ph): centre and angle of the box, centre and angle of the slab,
counter-clockwise; y is up, the floor is y = 0. With n = (-sin Ph, cos Ph), s = (cos Ph, sin Ph)
and the lower corners r = R(th) (-+a, -b) of the box:

    h1, h2 = Y -+ foot sin Ph - d cos Ph                 feet of the slab on the floor
    h3, h4 = n . d3 - d,  d3 = (x, y) + r - (X, Y)       left and right lower corner of the box on the slab's upper face
    h5     = wall - x - a cos th + b sin th              upper right corner of the box against a wall

Action equals reaction: H3 and H4 act on both bodies. Parameters p as in `PARAMETERS`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from crossbody.reference import System, kernels
from crossbody.reference.kinds import Array, Floats, Index

if TYPE_CHECKING:
    from crossbody.cases import Law

PARAMETERS = (
    "mass", "inertia", "gravity", "half_width", "half_height",
    "slab_mass", "slab_inertia", "slab_half_height", "foot", "wall",
)  # fmt: skip
"""Order of the parameters: a is half_width, b half_height, d slab_half_height; SI units."""
MASS, INERTIA, GRAVITY, WIDTH, HEIGHT, SLAB_MASS, SLAB_INERTIA, THICK, FOOT, WALL = np.arange(10)
SPANS = ((3, 6), (3, 6), (0, 6), (0, 6), (0, 3))  # coordinates that each row may touch


@kernels.dynamics
def dynamics(t: float, q: Array, v: Array, u: Array, p: Array, M: Array, f: Array, w: Array) -> None:
    """M diagonal and constant, f the weights."""
    for k in range(2):
        M[3 * k, 0] = M[3 * k + 1, 0] = p[MASS + (SLAB_MASS - MASS) * k]
        M[3 * k + 2, 0] = p[INERTIA + (SLAB_INERTIA - INERTIA) * k]
        f[3 * k] = f[3 * k + 2] = 0.0
        f[3 * k + 1] = -M[3 * k, 0] * p[GRAVITY]


@kernels.helper
def _side(i: int) -> float:
    """-1 for the left foot or corner, +1 for the right one."""
    return -1.0 if i % 2 == 0 else 1.0


@kernels.helper
def _corner(q: Array, p: Array, i: int) -> Any:
    """Lower corner of row i from the centre of the box, r = R(th) (-+a, -b): its two parts."""
    along, down = _side(i) * p[WIDTH], -p[HEIGHT]
    c, s = np.cos(q[2]), np.sin(q[2])
    return c * along - s * down, s * along + c * down


@kernels.helper
def _foot(q: Array, v: Array, p: Array, i: int, H: Array) -> Any:
    """Fill H of a foot; its gap and H' v."""
    c, s = np.cos(q[5]), np.sin(q[5])
    along = _side(i) * p[FOOT]
    H[4] = 1.0
    H[5] = along * c + p[THICK] * s
    return q[4] + along * s - p[THICK] * c, (p[THICK] * c - along * s) * v[5] * v[5]


@kernels.helper
def _on_slab(q: Array, v: Array, p: Array, i: int, H: Array) -> Any:
    """Fill H of a lower corner; its gap and H' v = -2 Ph' s . (p' - P') - th'^2 n . r - Ph'^2 n . d3.

    p', P' are the velocities of the two bodies at the corner and at the slab's centre.
    """
    c, s = np.cos(q[5]), np.sin(q[5])
    rx, ry = _corner(q, p, i)
    dx, dy = q[0] + rx - q[3], q[1] + ry - q[4]
    height, place = c * dy - s * dx, c * dx + s * dy
    H[0], H[1], H[2] = -s, c, c * rx + s * ry
    H[3], H[4], H[5] = s, -c, -place
    slide = c * (v[0] - ry * v[2] - v[3]) + s * (v[1] + rx * v[2] - v[4])
    bend = -2.0 * v[5] * slide - v[2] * v[2] * (c * ry - s * rx) - v[5] * v[5] * height
    return height - p[THICK], bend


@kernels.helper
def _at_wall(q: Array, v: Array, p: Array, H: Array) -> Any:
    """Fill H of the upper right corner; its gap and H' v."""
    c, s = np.cos(q[2]), np.sin(q[2])
    reach = p[WIDTH] * c - p[HEIGHT] * s
    H[0] = -1.0
    H[2] = p[WIDTH] * s + p[HEIGHT] * c
    return p[WALL] - q[0] - reach, reach * v[2] * v[2]


@kernels.helper
def _row(q: Array, v: Array, p: Array, i: int, H: Array) -> Any:
    """Fill H of row i (6,); its gap and H' v."""
    H[:] = 0.0
    if i < 2:
        return _foot(q, v, p, i, H)
    return _on_slab(q, v, p, i, H) if i < 4 else _at_wall(q, v, p, H)


@kernels.gaps
def gaps(t: float, q: Array, v: Array, p: Array, h: Array, hd: Array) -> None:
    """All five gaps, and h' = H v."""
    H = np.empty_like(q)
    for i in range(5):
        h[i], _ = _row(q, v, p, i, H)
        hd[i] = 0.0
        for k in range(6):
            hd[i] += H[k] * v[k]


@kernels.rows
def rows(t: float, q: Array, v: Array, p: Array, w: Array, idx: Index, na: int, H: Array, h: Array, Hdv: Array) -> None:
    """H, h and H' v of the active rows."""
    for j in range(na):
        h[j], Hdv[j] = _row(q, v, p, idx[j], H[j])


@kernels.energy
def energy(q: Array, v: Array, p: Array, e: Array) -> None:
    """Kinetic energy of both bodies, and their weights' potential above the floor."""
    e[0] = 0.5 * (p[MASS] * (v[0] * v[0] + v[1] * v[1]) + p[INERTIA] * v[2] * v[2])
    e[0] += 0.5 * (p[SLAB_MASS] * (v[3] * v[3] + v[4] * v[4]) + p[SLAB_INERTIA] * v[5] * v[5])
    e[1] = p[GRAVITY] * (p[MASS] * q[1] + p[SLAB_MASS] * q[4])


KERNELS: dict[str, Any] = {"dynamics": dynamics, "gaps": gaps, "rows": rows, "energy": energy}


def box_inertia(mass: float, half_width: float, half_height: float) -> float:
    """Moment of inertia of a uniform box about its centre, m (a^2 + b^2)/3, kg m^2."""
    return mass * (half_width**2 + half_height**2) / 3.0


def table(parameters: Mapping[str, Any]) -> dict[str, float]:
    """The numbers of the kernels from those of the case, in the order of `PARAMETERS`."""
    given = {k: float(parameters[k]) for k in (*PARAMETERS, "slab_half_length") if k in parameters}
    derived = {
        "inertia": box_inertia(given["mass"], given["half_width"], given["half_height"]),
        "slab_inertia": box_inertia(given["slab_mass"], given["slab_half_length"], given["slab_half_height"]),
    }
    return {name: (derived | given)[name] for name in PARAMETERS}


def build(parameters: Mapping[str, Any], law: Law) -> System:
    """The mechanism of a case.

    Args:
        parameters: of the case; all of `PARAMETERS` but the inertias, which follow from
            slab_half_length, m, and the other sizes of two uniform boxes unless they are given.
        law: of the five rows.
    """
    return System(
        n=6, parameters=table(parameters), a0=law.a0, a1=law.a1, a2=law.a2, b0=law.b0, b1=law.b1,
        unilateral=law.unilateral, span=SPANS, mass_block=1, constant_mass=True, **KERNELS,
    )  # fmt: skip


def listed(p: Floats) -> dict[str, Any]:
    """Return what the parity audit lists side by side, read back from the parameter array."""
    return {"masses": p[[MASS, SLAB_MASS]], "gravity": float(p[GRAVITY])}
