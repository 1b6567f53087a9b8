"""What is asked of a state alone: gaps, energy and power. They find the poses themselves, in arrays of their own."""

from __future__ import annotations

from functools import cache
from types import FunctionType
from typing import Any

import numpy as np

from crossbody.reference import kernels
from crossbody.reference.kinds import Array
from crossbody.reference.tree import forces, layout, loops, strings, sweeps
from crossbody.reference.tree import pair_slip as slip
from crossbody.reference.tree.mechanism import contact, dynamics, has_partner, joint_row, pushed, rows, slip_of

PAIRED = True  # as in `mechanism`


@kernels.helper
def posed(q: Array, v: Array, p: Array) -> Array:
    """Return the scratch of the outward sweep, filled."""
    w = np.empty(layout.NODE_SCRATCH * int(p[layout.NODES].real) + layout.DOF_SCRATCH * len(v), dtype=q.dtype)
    sweeps.outwards(q, v, p, w)
    return w


def gaps(t: float, q: Array, v: Array, p: Array, h: Array, hd: Array) -> None:
    """Of every row; where points or shapes of bodies are to meet their poses are computed first."""
    w = posed(q, v, p) if p[layout.POSED].real > 0.0 else np.empty(0, dtype=q.dtype)
    paired = -1
    for i in range(len(h)):
        if i == paired:
            continue
        kind = int(p[int(p[layout.AT_ROW].real) + layout.ROW * i].real)
        if kind == layout.CONNECT:
            h[i], hd[i], _ = loops.connect(p, i, w)
        elif kind == layout.TURN:
            h[i], hd[i], _ = loops.turn(p, i, w)
        elif kind in (layout.STRING, layout.DRY_STRING):
            h[i], hd[i], _ = strings.string(p, i, w)
            if kind == layout.DRY_STRING:
                h[i] = 0.0 * w[0]
        elif PAIRED and kind == layout.CONTACT:
            found = contact(p, w, i)[1][0]
            h[i], hd[i] = found[0], found[1]
        elif PAIRED and kind == layout.TANGENT:
            at, x, way, other = slip_of(p, w, i)
            V, A = slip.apart(p, w, at, x)
            h[i], hd[i] = 0.0 * w[0], slip.velocity(V, A, way)[0]
            if i + 1 < len(h) and has_partner(p, i, i + 1):
                paired = i + 1
                h[paired], hd[paired] = 0.0 * w[0], slip.velocity(V, A, other)[0]
        else:
            h[i], hd[i], _ = joint_row(q, v, p, i)


@kernels.helper
def _stored(q: Array, p: Array, o: int) -> Any:
    """Return the energy of the spring of the node at p[o:]."""
    at, k = int(p[o + layout.Q].real), o + layout.STIFFNESS
    if p[k] == 0.0 and p[k + 1] == 0.0 and p[k + 2] == 0.0:
        return 0.0 * q[0]
    if p[o + layout.TYPE].real >= layout.SLIDE:
        return forces.stored(p, k, q[at] - p[o + layout.REST])
    x, y, z = forces.turn(q, at + 3 if p[o + layout.TYPE].real == layout.FREE else at, p, o + layout.REST)
    return forces.stored(p, k, np.sqrt(x * x + y * y + z * z))


@kernels.energy
def energy(q: Array, v: Array, p: Array, e: Array) -> None:
    """T = sum of V.IV/2 over the nodes and of armatures; V of weight, of what is spared of it, and of springs."""
    nodes = int(p[layout.NODES].real)
    w = posed(q, v, p)
    kinetic, potential = 0.0 * q[0], p[layout.RESTING] + 0.0 * q[0]
    for i in range(nodes):
        o, x = int(p[layout.AT_NODE].real) + layout.NODE * i, layout.NODE_SCRATCH * i
        root = layout.NODE_SCRATCH * int(p[o + layout.ROOT].real) + layout.ORIGIN_AT
        sweeps.inertia(p, p[o:], w[x:])
        y, at = x + layout.V_AT, x + layout.I_AT
        n, f = sweeps.times(w, at, w[y], w[y + 1], w[y + 2], w[y + 3], w[y + 4], w[y + 5])
        kinetic += w[y] * n[0] + w[y + 1] * n[1] + w[y + 2] * n[2] + w[y + 3] * f[0] + w[y + 4] * f[1] + w[y + 5] * f[2]
        m = p[o + layout.MASS]
        lifted = o + layout.LIFT  # what its parts are spared: sum of c m, and of c m times their centres
        c0 = m * p[o + layout.COM] - p[lifted + 1]
        c1 = m * p[o + layout.COM + 1] - p[lifted + 2]
        c2 = m * p[o + layout.COM + 2] - p[lifted + 3]
        moment = sweeps.turned(w, x, c0, c1, c2)
        for k in range(3):
            potential -= p[layout.GRAVITY + k] * (moment[k] + (m - p[lifted]) * (w[root + k] + w[x + 9 + k]))
        potential += _stored(q, p, o)
    for j in range(len(v)):
        kinetic += p[int(p[layout.AT_DOF].real) + layout.DOF * j + layout.ARMATURE] * v[j] * v[j]
    for i in range(int(p[layout.TENDONS].real)):
        o = forces.tendon(p, i)
        k = o + layout.STIFF
        if p[k] != 0.0 or p[k + 1] != 0.0 or p[k + 2] != 0.0:  # points of a string may meet, where it has no direction
            potential += forces.stored(p, k, forces.slack(p, o, forces.measured(q, v, p, w, o)[0]))
    e[0], e[1] = 0.5 * kinetic, potential


@kernels.power
def power(t: float, q: Array, v: Array, u: Array, p: Array, e: Array) -> None:
    """Of the actuators and pushes, and what dampers take."""
    n, at_dof = len(v), int(p[layout.AT_DOF].real)
    given, taken = 0.0 * v[0], 0.0 * v[0]
    needed = p[layout.PUSHES].real > 0.0 or p[layout.SPANNED].real > 0.0
    w = posed(q, v, p) if needed else np.empty(0, dtype=q.dtype)
    if len(u) > 0 and (p[layout.BOUNDED].real > 0.0 or p[layout.EXERTING].real > 0.0):
        sums = np.empty(n, dtype=q.dtype)
        forces.driven(t, q, v, u, p, w, sums)
        for j in range(n):
            given += v[j] * sums[j]
    for j in range(n):
        taken += v[j] * forces.damper(p, at_dof + layout.DOF * j + layout.DAMPING, v[j])
    for i in range(int(p[layout.TENDONS].real)):
        o = forces.tendon(p, i)
        if p[o + layout.COUNT].real > 0.0 or p[layout.SPANNED].real > 0.0:
            speed = forces.measured(q, v, p, w, o)[1]
            taken += speed * forces.damper(p, o + layout.DAMP, speed)
    for i in range(int(p[layout.PUSHES].real)):
        _, x, force = pushed(u, p, w, i)
        given += force[0] * x[0][1] + force[1] * x[1][1] + force[2] * x[2][1]
    e[0], e[1] = given, taken


KERNELS: dict[str, Any] = {"dynamics": dynamics, "energy": energy, "power": power}
"""Those of every scene; it has those of `row_kernels` beside them."""


@cache
def row_kernels(paired: bool) -> dict[str, Any]:
    """Return the kernels of rows, of a scene whose shapes may meet or of another, which takes half as long to compile.

    Args:
        paired: whether rows of contacts are among them.
    """
    return declared((gaps, rows), paired)


def declared(functions: tuple[Any, ...], paired: bool) -> dict[str, Any]:
    """Return functions as the kernels that they are named after, which read PAIRED as given.

    Where it is False what stands behind it is not compiled.
    """
    made = functions if paired else map(_without_pairs, functions)
    return {one.__name__: getattr(kernels, one.__name__)(one) for one in made}


def _without_pairs(function: Any) -> Any:
    return FunctionType(function.__code__, {**function.__globals__, "PAIRED": False})
