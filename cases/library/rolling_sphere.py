"""A homogeneous sphere is thrown along a floor: it slides, and then rolls.

The slip of its lowest point falls at 7 mu g/2 along itself, so that a sphere with a spin goes on
a parabola until it rolls, and straight from there (docs/explanation/contacts.md).
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.case import Case, Parameter, Value
from crossbody.cases.files.case import case_of
from crossbody.cases.mechanisms.friction.limits import limits
from crossbody.cases.mechanisms.friction.motions import Motion, Rows, Stage
from crossbody.cases.mechanisms.friction.scene import MASS, NUMBERS, sphere_on_floor
from crossbody.cases.rotations import matrices
from crossbody.cases.trajectory import Mode

TIGHT, TINY = 1e-13, 1e-15  # relative and absolute tolerance of an attitude that is integrated
FARTHEST = 1e4  # angle through which an attitude is integrated at most, rad
REACH = 0.4  # moment of inertia over m r^2


def product(a: Floats, b: Floats) -> Floats:
    """Return the products (n, 4) of quaternions, w first."""
    w = a[..., :1] * b[..., :1] - np.sum(a[..., 1:] * b[..., 1:], axis=-1, keepdims=True)
    return np.concatenate(
        [w, a[..., :1] * b[..., 1:] + b[..., :1] * a[..., 1:] + np.cross(a[..., 1:], b[..., 1:])], axis=-1
    )


def turned(vector: Floats) -> Floats:
    """Return the quaternions (n, 4) of rotation vectors (n, 3), rad."""
    half = 0.5 * np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.concatenate([np.cos(half), 0.5 * np.sinc(half / np.pi) * vector], axis=-1)


def attitude(s: Floats, spin: Floats, rate: Floats) -> Floats:
    """Return quaternions (n, 4) at times s (n,) from the unit one, with angular velocity spin + rate s in the world."""
    if not np.cross(spin, rate).any():
        return turned(s[:, None] * spin + 0.5 * s[:, None] ** 2 * rate)
    from scipy.integrate import solve_ivp  # which takes longer to import than most runs

    times, back = np.unique(np.append(0.0, s), return_inverse=True)
    found = solve_ivp(
        lambda t, q: 0.5 * product(np.append(0.0, spin + t * rate), q), (0.0, max(times[-1], TINY)),
        np.array([1.0, 0.0, 0.0, 0.0]), "DOP853", t_eval=times, rtol=TIGHT, atol=TINY,
    )  # fmt: skip
    q: Floats = (found.y / np.linalg.norm(found.y, axis=0)).T[back[1:]]
    return q


def sphere(p: Mapping[str, float]) -> Motion | None:
    """Return the motion: q = (x, y, z, quaternion), rows (n, t1, t2); None where it turns too often."""
    r, press = p["radius"], p["mu"] * p["gravity"]
    v0, spin = np.array([p["speed"], 0.0]), np.array([p["spin_x"], p["spin_y"], p["spin_z"]])
    u0 = v0 + r * np.array([-spin[1], spin[0]])
    slip = float(np.linalg.norm(u0))
    stop, push = 2.0 * slip / (7.0 * press), -press * u0 / slip if slip > 0.0 else np.zeros(2)
    rate = np.array([push[1], -push[0], 0.0]) / (REACH * r)  # of -r z x push

    until = min(stop, p["t_end"])
    if np.cross(spin, rate).any() and not (np.linalg.norm(spin) + until * np.linalg.norm(rate)) * until < FARTHEST:
        return None

    def state(s: Floats, place: Floats, v: Floats, a: Floats, turn: Floats, w: Floats) -> Rows:
        q = np.concatenate([place, np.full((len(s), 1), r), turn], axis=1)
        own = np.einsum("nij,ni->nj", matrices(turn), w)
        lam = np.broadcast_to(MASS * np.array([p["gravity"], *a]), (len(s), 3))
        return q, np.concatenate([v, np.zeros((len(s), 1)), own], axis=1), np.zeros((len(s), 3)), lam

    def slides(s: Floats) -> Rows:
        t = s[:, None]
        return state(s, t * v0 + 0.5 * t**2 * push, v0 + t * push, push, attitude(s, spin, rate), spin + t * rate)

    @cache
    def end() -> Floats:
        found: Floats = slides(np.array([stop]))[0][0]
        return found

    v1, w1 = v0 + stop * push, spin + stop * rate

    def rolls(s: Floats) -> Rows:
        t = s[:, None]
        turn = product(turned(t * w1), np.broadcast_to(end()[3:], (len(s), 4)))
        v = np.broadcast_to(v1, (len(s), 2))
        return state(s, end()[:2] + t * v1, v, np.zeros(2), turn, np.broadcast_to(w1, (len(s), 3)))

    def energy(q: Floats, v: Floats) -> Floats:
        moving = 0.5 * MASS * np.sum(v[:, :3] ** 2, axis=1) + 0.5 * REACH * MASS * r**2 * np.sum(v[:, 3:] ** 2, axis=1)
        return np.stack([moving, MASS * p["gravity"] * q[:, 2]], axis=1)

    stages = [Stage(0.0, (int(Mode.SLIP),) * 3, slides)] if slip > 0.0 else []
    return Motion([*stages, Stage(stop, (int(Mode.STICK),) * 3, rolls)], 1, energy, p["t_end"])


PARAMETERS = {
    **NUMBERS,
    "mu": Parameter(default=0.2, doc="coefficient of friction", low=0.0, open_low=True),
    "speed": Parameter(default=2.0, unit="m/s", doc="along x at the start"),
    "spin_x": Parameter(default=0.0, unit="rad/s", doc="about x at the start"),
    "spin_y": Parameter(default=0.0, unit="rad/s", doc="about y at the start"),
    "spin_z": Parameter(default=0.0, unit="rad/s", doc="about the vertical at the start"),
    "radius": Parameter(default=0.1, unit="m", doc="of the sphere", low=0.0, open_low=True),
}

VARIANTS: dict[str, dict[str, Value]] = {
    "straight": {},
    "side_spin": {"spin_x": 3.0, "spin_y": -5.0, "spin_z": 4.0},
}

_TITLES = {
    "straight": "a sphere slides until it rolls",
    "side_spin": "a sphere with side spin moves on a parabola until it rolls",
}


def build(variant: str, parameters: Mapping[str, Value]) -> Case:
    """The scene with its exact motion."""
    p = {name: float(value) for name, value in parameters.items()}
    made = case_of(
        sphere_on_floor(p), name="rolling_sphere", variant=variant, t_end=p["t_end"], parameters=parameters,
        v0=[p["speed"], 0.0, 0.0, p["spin_x"], p["spin_y"], p["spin_z"]],
    )  # fmt: skip
    return limits(made, _TITLES[variant], PARAMETERS, sphere(p), p)
