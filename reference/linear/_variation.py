"""The right-hand side in one mode set with its derivatives by the state and by parameters, and what happens at events.

At an event g(x, theta) = 0 with x+ = R(x-, theta) the derivative S of the motion jumps (Leine and
Nijmeijer 2004, chapter 7; R is the identity except at a frozen collision):

    S+ = R_x S- + R_theta + (R_x f- - f+) dtau        dtau = -(g_x S- + g_theta)/(g_x f- + g_t)
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from crossbody.cases import Trajectory, UnknownName
from crossbody.cases.closed_forms import damping_ratio, restitution
from crossbody.reference._system import System
from crossbody.reference.kinds import Array, Floats
from crossbody.reference.linear._derivatives import implied, residual, saddle
from crossbody.reference.linear._emerging import accelerations_by_turns, by_turns, slip_accelerations, with_turns
from crossbody.reference.linear._point import STEP, Point, dense, directions, force_rate, gaps, rubbing, terms
from crossbody.reference.linear._rubbing import borne, loads

HANDOVER = 0.01  # elastic part of lam at which COLLISION becomes CONTACT (docs/explanation/model.md)


@dataclass(frozen=True, slots=True, kw_only=True)
class Theta:
    """Parameters that a motion is differentiated by: of which field of a `Point`, and where in it."""

    names: tuple[str, ...]
    places: tuple[tuple[str, int | tuple[int, int]], ...]

    def moved(self, at: Point, k: int) -> Point:
        """The point with an imaginary step in parameter k."""
        name, place = self.places[k]
        moved = at.given(name).astype(complex)
        moved[place] += 1j * STEP
        changed: dict[str, Any] = {name: moved}
        return replace(at, **changed)


def theta(system: System, names: Sequence[str]) -> Theta:
    """Find parameters by name: those of the system, p[3], a0[0], a1[0], a2[0] of row 0's law, mu[0] of its friction.

    Raises:
        UnknownName: for one that is not there.
    """
    own = list(system.parameters) if isinstance(system.parameters, Mapping) else []
    places: list[tuple[str, int | tuple[int, int]]] = []
    for name in names:
        part = re.fullmatch(r"(p|a0|a1|a2|mu|drift)\[(\d+)\]", name)
        field, i = ("", 0) if part is None else (part[1], int(part[2]))
        if name in own:
            places.append(("p", own.index(name)))
        elif field == "p" and i < len(system.p):
            places.append(("p", i))
        elif field in ("a0", "a1", "a2") and i < system.nc:
            places.append(("alpha", (i, int(field[1]))))
        elif field == "mu" and i < system.nc and system.tangents[i] > 0:
            places.append(("friction", i))
        elif field == "drift" and i < system.nc and i in rubbing(system):
            places.append(("drift", i))
        else:
            valid = [*own, "p[k]", "a0[i]", "a1[i]", "a2[i]", "mu[i]", "drift[i]"]
            raise UnknownName("parameter of the sensitivity", name, valid)
    return Theta(names=tuple(names), places=tuple(places))


def gradient(function: Callable[[Point, Array, Array], Array], at: Point, over: Theta) -> Floats:
    """Derivative of function(at, q, v) by (dq, v, theta), by complex step; the last axis is that of the variables."""
    n, columns = at.system.n, []
    N = directions(at.system, at.q)
    for step in 1j * STEP * np.eye(2 * n):
        columns.append(function(at, at.q + N @ step[:n], at.v + step[n:]).imag / STEP)
    for k in range(len(over.places)):
        q, v = at.q.astype(complex), at.v.astype(complex)
        columns.append(np.asarray(function(over.moved(at, k), q, v)).imag / STEP)
    return np.stack(columns, axis=-1)


def rates(at: Point) -> Floats:
    """Rates (v, v') (2 n,)."""
    return np.concatenate([at.v, saddle(at)[1]])


def flow(at: Point, over: Theta) -> tuple[Floats, Floats]:
    """Rates (v, v') (2 n,), and the derivative of v' by (dq, v, theta).

    Raises:
        SceneError: as `slopes`.
    """
    K, vd, lam = saddle(at)
    columns = gradient(lambda here, q, v: residual(here, q, v, at.u, vd, lam), at, over)
    solved = -np.asarray(np.linalg.solve(K, columns[: len(K)]), dtype=np.float64)[: at.system.n]
    return np.concatenate([at.v, vd]), _turning(at, over, vd, solved, accelerations_by_turns(at, K, vd, lam))


def _turning(at: Point, over: Theta, vd: Floats, found: Floats, turn: Floats) -> Floats:
    """Derivatives of (v', ...) with the directions of slips that emerge turning, by `with_turns`."""
    if not len(at.emerging):
        return found
    moved = gradient(lambda here, q, v: slip_accelerations(here, q, v, vd), at, over)
    return with_turns(at, vd, found, turn, np.pad(moved, ((0, 0), (0, found.shape[1] - moved.shape[1]))))


def slopes(at: Point, over: Theta) -> tuple[Floats, Floats, Floats]:
    """Rates (v, v') (2 n,), multipliers (na,), and the derivatives of (v', lam) by (dq, v, theta, t).

    Raises:
        SceneError: where the active rows are redundant or a value is not finite.
    """
    K, vd, lam = saddle(at)
    columns = gradient(lambda here, q, v: residual(here, q, v, at.u, vd, lam), at, over)
    bearing = timed(gradient(lambda here, q, v: loads(here, q, v, at.u, lam), at, over))
    columns = timed(columns)
    columns[: at.system.n, -1] = -force_rate(at)
    every = borne(at, terms(at, at.q, at.v, at.u)[2], at.v, lam)
    found = np.vstack(implied(at, K, columns, bearing))
    columns = by_turns(lambda here: residual(here, at.q, at.v, at.u, vd, lam), at)
    turn = np.vstack(implied(at, K, columns, by_turns(lambda here: loads(here, at.q, at.v, at.u, lam), at)))
    return np.concatenate([at.v, vd]), every, _turning(at, over, vd, found, turn)


def timed(found: Floats) -> Floats:
    """Append to derivatives by (dq, v, theta) that by the time itself of what does not read it."""
    return np.concatenate([found, np.zeros((*found.shape[:-1], 1))], axis=-1)


def rate_slopes(at: Point, over: Theta) -> Floats:
    """Derivative (n, k) of dq' by the parameters at fixed q and v, where the kernel `velocity` reads them."""
    system, columns = at.system, [np.zeros(at.system.nq)]
    for k in range(len(over.places)):
        p, out = over.moved(at, k).p, np.zeros(system.nq, complex)
        if p is not None:  # else it is none that the kernel reads
            system.velocity(at.t, at.q.astype(complex), at.v.astype(complex), p, out)
        columns.append(out.imag / STEP)
    found = np.linalg.lstsq(directions(system, at.q), np.stack(columns, axis=-1), rcond=None)[0]
    return np.asarray(found[:, 1:], dtype=np.float64)


def gap_gradient(at: Point, over: Theta, i: int, *, rate: bool = False) -> Floats:
    """Of gap i, or of its rate."""
    place = i + at.system.nc * rate
    return gradient(lambda here, q, v: gaps(here, q, v)[place], at, over)


def slips(at: Point, q: Array, v: Array, i: int) -> Array:
    """Slip velocity (1,) or (2,) of contact i."""
    rows = int(at.system.tangent[i]) + np.arange(int(at.system.tangents[i]))
    return gaps(at, q, v)[at.system.nc + rows] - at.given("drift")[rows]


def slip_speeds(at: Point, run: Trajectory) -> Floats:
    """Speed at which every contact slips at every sample of a motion (samples, nc); 0 of what is no contact."""
    found = np.zeros(run.mode.shape)
    for k, (q, v) in enumerate(zip(run.q, run.v, strict=True)):
        for i in set(rubbing(at.system).values()):
            found[k, i] = np.linalg.norm(slips(at, q.copy(), v.copy(), i))
    return found


def slip_gradient(at: Point, over: Theta, i: int) -> Floats:
    """Of the slip velocity of contact i (1 or 2, ...)."""
    return gradient(lambda here, q, v: slips(here, q, v, i), at, over)


def cone_gradient(at: Point, over: Theta, i: int) -> tuple[float, Floats, float]:
    """By how much contact i, which sticks, is below its bound: value, gradient by (dq, v, theta, t), and the bound."""
    _, lam, slope = slopes(at, over)
    n, places, mu = at.system.n, at.tangents(i), at.system.friction[i]
    changed = timed(gradient(lambda here, q, v: here.given("friction")[i : i + 1], at, over)[0])
    size, lam_x = float(np.linalg.norm(lam[places])), slope[n:]
    rate = lam[places] @ lam_x[places] / size if size > 0.0 else np.zeros(lam_x.shape[1])
    if at.system.dry[i]:
        return float(mu) - size, changed - rate, float(mu)
    j = at.active.tolist().index(i)
    return float(mu * lam[j]) - size, mu * lam_x[j] + lam[j] * changed - rate, float(mu * lam[j])


def lam_gradient(at: Point, over: Theta, i: int) -> Floats:
    """Of the multiplier of row i, which is active, by (dq, v, theta, t)."""
    found: Floats = slopes(at, over)[2][at.system.n + at.active.tolist().index(i)]
    return found


def handover_gradient(at: Point, over: Theta, i: int) -> Floats:
    """Of max(b1, sqrt(b0)) |h'| + b0 |h| - HANDOVER lam_i/(G^-1)_ii, where a collision is spent; t the last."""
    j, n = at.active.tolist().index(i), at.system.n
    _, lam, slope = slopes(at, over)
    b0, b1, _ = at.system.beta[i]
    speed = max(b1, b0**0.5)
    signs = np.sign(gaps(at, at.q, at.v)[[i, i + at.system.nc]])

    def elastic(here: Point, q: Array, v: Array) -> Array:
        h = gaps(here, q, v)[[i, i + at.system.nc]]
        part: Array = b0 * signs[0] * h[:1] + speed * signs[1] * h[1:]
        return part

    def mobility(here: Point, q: Array, v: Array) -> Array:
        blocks, _, H, _, _ = terms(here, q, v, at.u)
        G = H @ np.linalg.solve(dense(blocks), H.T)
        return 1.0 / np.linalg.inv(G)[j, j : j + 1]

    share = mobility(at, at.q, at.v)[0].real
    change = timed(gradient(elastic, at, over)[0] - HANDOVER * lam[j] * gradient(mobility, at, over)[0])
    found: Floats = change - HANDOVER * share * slope[n + j]
    return found


def bounced(at: Point, i: int, captured: bool) -> Callable[[Point, Array, Array], Array]:
    """The map (q, v) -> v+ of a frozen collision of row i while the other active rows stay held."""
    j = at.active.tolist().index(i)
    b0, b1, _ = at.system.beta[i]
    share = 1.0 if captured else 1.0 + restitution(damping_ratio(float(b0), float(b1)))

    def after(here: Point, q: Array, v: Array) -> Array:
        blocks, _, H, _, _ = terms(here, q, v, at.u)
        X = np.linalg.solve(dense(blocks), H.T)
        impulse = np.linalg.solve(H @ X, np.eye(len(H))[j])
        after: Array = v - share * (H[j] @ v) * (X @ impulse)
        return after

    return after
