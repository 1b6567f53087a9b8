"""A ball among concentric rings that turn about their common axis.

q = (theta, x, y, phi): maze, ball centre, spin of the ball. M = diag(Jm, mb, mb, Jb); gravity
along -y; the input is the torque on the maze, N m. With s = 1 for a face that the ball is inside
of, s = -1 for one that it is outside of,

    h_n = s (R - rho) - r          H_n = [0, -s x/rho, -s y/rho, 0]          H_n' v = -s vt^2/rho
    slip = vt + s r phi' - R theta'  H_t = [-R, -y/rho, x/rho, s r]          H_t' v = -vt vr/rho
    tip: h = |p - c(theta)| - w/2 - r

with vt = (x y' - y x')/rho and vr = (x x' + y y')/rho. Eight rows serve any number of rings: see
`_maze_layout`. The slip rows stand last and may be left out; they have no position, so their gap
is 0 and its rate the slip.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from crossbody.cases.mechanisms.maze import claims as cf
from crossbody.cases.mechanisms.maze import geometry
from crossbody.reference import System, kernels
from crossbody.reference.kinds import Array, Floats, Index
from crossbody.reference.systems import _maze_control as control
from crossbody.reference.systems import _maze_layout as layout
from crossbody.reference.systems._maze_control import torque
from crossbody.reference.systems._maze_layout import (
    ABOVE,
    BELOW,
    CHANNEL,
    DRAG,
    FACE_ABOVE,
    FACE_BELOW,
    GAPS,
    INNER,
    JB,
    JM,
    MB,
    NORMAL,
    OUTER,
    PHASE,
    RADIUS,
    REACH,
    SLIP_ABOVE,
    SLIP_BELOW,
    SOLID,
    TIPS_ABOVE,
    TIPS_BELOW,
    TOUCHING,
    G,
    above,
    below,
    far,
    number,
)  # fmt: skip
from crossbody.reference.systems._maze_switch import GUARDS, switch, watch

if TYPE_CHECKING:
    from crossbody.cases import Law

SPHERE = 0.4
"""J/(m r^2) of a solid ball; its own, so that the closed forms, which have theirs, can disagree."""
SCRATCH = 3  # length of w: x/rho, y/rho, rho


@kernels.helper
def _drag(v: Any, p: Any) -> Any:
    """Torque of the rolling damping on the maze, and minus it on the ball."""
    return p[DRAG] * p[TOUCHING] * (v[3] - v[0])


@kernels.dynamics
def dynamics(t: float, q: Array, v: Array, u: Array, p: Array, M: Array, f: Array, w: Array) -> None:
    """Diagonal mass; weight, torque and rolling damping; w receives the ball's direction and distance."""
    rho = np.sqrt(q[1] * q[1] + q[2] * q[2])
    w[0], w[1], w[2] = q[1] / rho, q[2] / rho, rho
    M[0, 0], M[1, 0], M[2, 0], M[3, 0] = p[JM], p[MB], p[MB], p[JB]
    drag = _drag(v, p)
    f[0] = u[0] + torque(q, v, p) + drag
    f[1] = 0.0
    f[2] = -p[MB] * p[G]
    f[3] = -drag


@kernels.helper
def _tip(q: Any, v: Any, p: Any, line: int, sector: int, second: bool) -> Any:
    """Cap of one end of a gap: normal, arm of the maze along it, gap, rate, H' v."""
    middle, cap = 0.5 * (p[line + OUTER] + p[line + INNER]), 0.5 * (p[line + OUTER] - p[line + INNER])
    reach = p[line + REACH] if second else -p[line + REACH]
    angle = q[0] + p[line + PHASE] + 2.0 * np.pi * sector / p[line + GAPS] + reach
    cx, cy = middle * np.cos(angle), middle * np.sin(angle)
    dx, dy = q[1] - cx, q[2] - cy
    ux, uy = v[1] + cy * v[0], v[2] - cx * v[0]
    distance = np.sqrt(dx * dx + dy * dy)
    nx, ny = dx / distance, dy / distance
    rate = nx * ux + ny * uy
    curved = (ux * ux + uy * uy - rate * rate) / distance + (nx * cx + ny * cy) * v[0] * v[0]
    return nx, ny, nx * cy - ny * cx, distance - cap - p[RADIUS], rate, curved


@kernels.helper
def _side(p: Any, i: int) -> Any:
    """Line of the ring that row i belongs to, its sector, and whether the row can be touched at all."""
    under = i in (FACE_BELOW, TIPS_BELOW, TIPS_BELOW + 1, SLIP_BELOW)
    line = below(p) if under else above(p)
    sector = number(p[BELOW]) if under else number(p[ABOVE])
    tip = i in (TIPS_BELOW, TIPS_BELOW + 1, TIPS_ABOVE, TIPS_ABOVE + 1)
    there = not (under and number(p[CHANNEL]) == 0)
    return line, sector, there and tip == (sector != SOLID)


@kernels.helper
def _faces(q: Any, v: Any, p: Any, i: int, h: Any, hd: Any) -> None:
    """Gap of a face, and the slip on it if there is a row for that."""
    rho = np.sqrt(q[1] * q[1] + q[2] * q[2])
    s = -1.0 if i == FACE_BELOW else 1.0
    R = p[below(p) + OUTER] if i == FACE_BELOW else p[above(p) + INNER]
    h[i] = s * (R - rho) - p[RADIUS]
    hd[i] = -s * (q[1] * v[1] + q[2] * v[2]) / rho
    if len(h) > NORMAL:
        j = SLIP_BELOW if i == FACE_BELOW else SLIP_ABOVE
        hd[j] = (q[1] * v[2] - q[2] * v[1]) / rho + s * p[RADIUS] * v[3] - R * v[0]


@kernels.helper
def _pair(q: Any, v: Any, p: Any, i: int, h: Any, hd: Any) -> None:
    """Gaps of the two tips from row i on."""
    line, sector, _ = _side(p, i)
    for k in range(2):
        found = _tip(q, v, p, line, sector, k == 1)
        h[i + k], hd[i + k] = found[3], found[4]


@kernels.gaps
def gaps(t: float, q: Array, v: Array, p: Array, h: Array, hd: Array) -> None:
    """Of the two rings beside the ball: the face, or the two tips of the gap it is in; the rest is far away."""
    for i in range(len(h)):
        h[i], hd[i] = far(p) if i < NORMAL else 0.0 * far(p), 0.0
    if number(p[CHANNEL]) > 0:
        if number(p[BELOW]) == SOLID:
            _faces(q, v, p, FACE_BELOW, h, hd)
        else:
            _pair(q, v, p, TIPS_BELOW, h, hd)
    if number(p[ABOVE]) == SOLID:
        _faces(q, v, p, FACE_ABOVE, h, hd)
    else:
        _pair(q, v, p, TIPS_ABOVE, h, hd)


@kernels.helper
def _row(q: Any, v: Any, p: Any, w: Any, i: int) -> Any:
    """H (4), h and H' v of row i; far away and without direction where it cannot be touched."""
    line, sector, there = _side(p, i)
    zero = 0.0 * q[0]
    if not there:
        return zero, zero, zero, zero, far(p) if i < NORMAL else zero, zero
    if sector != SOLID:
        second = i in (TIPS_BELOW + 1, TIPS_ABOVE + 1)
        nx, ny, arm, gap, _, curved = _tip(q, v, p, line, sector, second)
        return arm, nx, ny, zero, gap, curved
    s, R = (-1.0, p[line + OUTER]) if i in (FACE_BELOW, SLIP_BELOW) else (1.0, p[line + INNER])
    cx, cy, rho = w[0], w[1], w[2]
    vt = cx * v[2] - cy * v[1]
    if i < NORMAL:
        return zero, -s * cx, -s * cy, zero, s * (R - rho) - p[RADIUS], -s * vt * vt / rho
    return -R, -cy, cx, s * p[RADIUS], zero, -vt * (cx * v[1] + cy * v[2]) / rho


@kernels.rows
def rows(t: float, q: Array, v: Array, p: Array, w: Array, idx: Index, na: int, H: Array, h: Array, Hdv: Array) -> None:
    """The rows above; reads the direction and distance that dynamics left in w."""
    for j in range(na):
        H[j, 0], H[j, 1], H[j, 2], H[j, 3], h[j], Hdv[j] = _row(q, v, p, w, idx[j])


@kernels.energy
def energy(q: Array, v: Array, p: Array, e: Array) -> None:
    """T = (Jm theta'^2 + mb (x'^2 + y'^2) + Jb phi'^2)/2, V = mb g y."""
    e[0] = 0.5 * (p[JM] * v[0] * v[0] + p[MB] * (v[1] * v[1] + v[2] * v[2]) + p[JB] * v[3] * v[3])
    e[1] = p[MB] * p[G] * q[2]


@kernels.power
def power(t: float, q: Array, v: Array, u: Array, p: Array, e: Array) -> None:
    """Of the torque on the maze; and of the rolling damping."""
    e[0] = (u[0] + torque(q, v, p)) * v[0]
    e[1] = _drag(v, p) * (v[3] - v[0])


KERNELS: dict[str, Any] = {
    "dynamics": dynamics,
    "gaps": gaps,
    "rows": rows,
    "energy": energy,
    "power": power,
    "watch": watch,
    "switch": switch,
}
FOLLOWS = (-1, -1, -1, -1, -1, -1, FACE_BELOW, FACE_ABOVE)


def constants(p: Mapping[str, Any], maze: geometry.Maze) -> Floats:
    """Constants and table of rings, in the order of `_maze_layout`."""
    g, r = geometry.tilted_gravity(p), maze.ball
    model = float(p["model_gravity"]) * g
    balance = cf.balance_gains(float(p["pole"]))
    centre = cf.centre_gains(model, maze.rings[0].inner - r, float(p["centre_pole"]))
    gains = dict(zip(layout.CONSTANTS[layout.K2 : layout.C0 + 1], balance + centre, strict=True))
    own = {
        "gravity": g, "ball_radius": r, "ball_inertia": SPHERE * float(p["ball_mass"]) * r * r,
        "rings": len(maze.rings), "controller": CONTROLLERS.index(str(p["controller"])), **gains,
    }  # fmt: skip
    head = [float(own[name] if name in own else p[name]) for name in layout.CONSTANTS]
    lines = [[ring.inner, ring.outer, ring.gaps, ring.reach, ring.phase] for ring in maze.rings]
    wall = [maze.wall, maze.wall, 0.0, 0.0, 0.0]
    return np.concatenate([head, *lines, wall])


CONTROLLERS = ("off", "continuous", "sampled")


def start_state(p: Floats, q0: Floats) -> Floats:
    """Discrete variables (4,) at the start."""
    full = np.concatenate([p, np.zeros(layout.DISCRETE + layout.LATCHED)])
    switch(0.0, q0, np.zeros(4), full, np.zeros(NORMAL, np.int8), int(kernels.START))
    return full[layout.CHANNEL : layout.TARGET]


def build(parameters: Mapping[str, Any], law: Law) -> System:
    """The mechanism of a case.

    Args:
        parameters: of the case `ball_maze`.
        law: of six rows without friction, of eight with rolling.

    Raises:
        InvalidValue: for a geometry that contradicts itself.
    """
    maze = geometry.maze_of(parameters)
    p = constants(parameters, maze)
    q0 = np.array([float(parameters["theta"]), *geometry.start(maze, parameters), 0.0])
    sampled: dict[str, Any] = {}
    if parameters["controller"] == "sampled":
        memory = 1 + int(parameters["delay"])
        sampled = {"control": control.sampled, "tick": float(parameters["sample"]), "memory": memory}
    return System(
        n=4, mass_block=1, constant_mass=True, inputs=1, scratch=SCRATCH, parameters=p,
        a0=law.a0, a1=law.a1, a2=law.a2, unilateral=law.unilateral, follows=FOLLOWS[: len(law.a0)],
        discrete=start_state(p, q0), latched=layout.LATCHED, guards=GUARDS, **KERNELS, **sampled,
    )  # fmt: skip


def listed(p: Floats) -> dict[str, Any]:
    """What the parity audit lists side by side, read back from the parameter array; the maze weighs as a disc would."""
    wall = p[layout.TABLE + layout.STRIDE * int(p[layout.RINGS]) + INNER]
    return {"masses": np.array([2.0 * p[JM] / wall**2, p[MB]]), "gravity": float(p[G])}
