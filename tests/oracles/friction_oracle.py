"""A second machine for contacts with friction, written apart: one body in a plane, in NumPy and SciPy alone.

The body (x, z, angle about y) has round points over a floor at z = 0. Whole equations of motion with all forces as
unknowns are solved for every set of modes that could be, and the first that agrees with its forces is taken: no
algorithm to find it, no elimination, and SciPy's integrator, interpolant and root finder.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

OFF, STICK, LEFT, RIGHT = "off", "stick", "left", "right"
STILL, NONE = 1e-8, 1e-9


@dataclass
class Body:
    """Mass, inertia about y, points (k, 2) in its axes with radii, law and friction of their contacts, gravity."""

    mass: float
    inertia: float
    points: np.ndarray
    radii: np.ndarray
    a0: float
    a1: float
    mu: float
    gravity: tuple[float, float] = (0.0, -9.81)
    mode: list[str] = field(default_factory=list)
    below: list[bool] = field(default_factory=list)
    kept: tuple[bytes, list[float]] = (b"", [])

    def kinematics(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, ...]:
        """Gaps, their rows and H'v; rows of the slip velocities and their H'v."""
        c, s = np.cos(q[2]), np.sin(q[2])
        x, z = self.points[:, 0] * c + self.points[:, 1] * s, -self.points[:, 0] * s + self.points[:, 1] * c
        one, none = np.ones(len(x)), np.zeros(len(x))
        normal = np.stack([none, one, -x], axis=1)
        slip = np.stack([one, none, z - self.radii], axis=1)
        turn = v[2] ** 2
        return q[1] + z - self.radii, normal, -z * turn, slip, -x * turn

    def solved(self, q: np.ndarray, v: np.ndarray, mode: list[str], pull: bool = True) -> tuple[np.ndarray, ...]:
        """v' and all forces (k,) along the normals and along the floor."""
        h, N, Nd, T, Td = self.kinematics(q, v)
        k = len(h)
        size = 3 + 2 * k
        A, b = np.zeros((size, size)), np.zeros(size)
        A[:3, :3] = np.diag([self.mass, self.mass, self.inertia])
        A[:3, 3 : 3 + k], A[:3, 3 + k :] = -N.T, -T.T
        b[:2] = self.mass * np.array(self.gravity)
        for i in range(k):
            n, t = 3 + i, 3 + k + i
            if mode[i] == OFF:
                A[n, n] = A[t, t] = 1.0
                continue
            A[n, :3], b[n] = N[i], -Nd[i] - self.a1 * (N[i] @ v) - self.a0 * h[i]
            if mode[i] == STICK:
                A[t, :3], b[t] = T[i], -Td[i] - (self.a1 * (T[i] @ v) if pull else 0.0)
            else:
                A[t, t], A[t, n] = 1.0, self.mu * (1.0 if mode[i] == RIGHT else -1.0)
        x = np.linalg.solve(A, b) if mode.count(STICK) < 2 else np.linalg.lstsq(A, b, rcond=1e-12)[0]
        return x[:3], x[3 : 3 + k], x[3 + k :]

    def agrees(self, q: np.ndarray, v: np.ndarray, mode: list[str], touching: list[bool]) -> bool:
        """Whether a set of modes agrees with the forces and accelerations that it leads to."""
        h, N, Nd, T, Td = self.kinematics(q, v)
        vd, force, along = self.solved(q, v, mode, pull=False)
        for i in range(len(h)):
            if mode[i] == OFF:
                rest = N[i] @ vd + Nd[i] + self.a1 * (N[i] @ v) + self.a0 * h[i]
                if touching[i] and rest < -NONE:
                    return False
                continue
            slip, drive = T[i] @ v, T[i] @ vd + Td[i]
            direction = {RIGHT: 1.0, LEFT: -1.0, STICK: 0.0}[mode[i]]
            if not touching[i] or force[i] < -NONE:
                return False
            if abs(slip) > STILL and direction * slip <= 0.0:
                return False
            if abs(slip) <= STILL and mode[i] == STICK and abs(along[i]) > self.mu * force[i] + NONE:
                return False
            if abs(slip) <= STILL and mode[i] != STICK and direction * drive < -NONE:
                return False
        return True

    def decide(self, q: np.ndarray, v: np.ndarray, caught: list[int]) -> None:
        """Take the first set of modes that agrees, those nearest to the present one first.

        Contacts below the surface that are caught press from now on.
        """
        h, N, *_ = self.kinematics(q, v)
        rate = N @ v
        touching = [self.mode[i] != OFF or (abs(h[i]) < 1e-11 and rate[i] < 1e-9) or i in caught for i in range(len(h))]
        sets = sorted(product((STICK, RIGHT, LEFT, OFF), repeat=len(h)), key=lambda one: self._changes(one))
        for found in sets:
            if self.agrees(q, v, list(found), touching) and not any(found[i] == OFF for i in caught):
                self.below = [found[i] == OFF and h[i] < -1e-11 for i in range(len(h))]
                self.mode = list(found)
                return
        raise AssertionError("no set of modes agrees")

    def _changes(self, one: tuple[str, ...]) -> int:
        return sum(a != b for a, b in zip(one, self.mode, strict=True))

    def _guards(self, q: np.ndarray, v: np.ndarray) -> list[float]:
        """Of every contact what falls through zero when it has to switch."""
        h, N, Nd, T, _ = self.kinematics(q, v)
        vd, force, _ = self.solved(q, v, self.mode)
        along = self.solved(q, v, self.mode, pull=False)[2]
        found = []
        for i, mode in enumerate(self.mode):
            direction = {RIGHT: 1.0, LEFT: -1.0}.get(mode, 0.0)
            if mode == OFF:
                rest = N[i] @ vd + Nd[i] + self.a1 * (N[i] @ v) + self.a0 * h[i]
                found += [-h[i], max(N[i] @ v, rest)] if self.below[i] else [h[i], 1.0]
            else:
                found += [force[i], direction * (T[i] @ v) if direction else self.mu * force[i] - abs(along[i])]
        return found

    def _event(self, i: int):  # type: ignore[no-untyped-def]
        """Return one guard as SciPy wants it."""

        def value(_: float, y: np.ndarray) -> float:
            if self.kept[0] != y.tobytes():
                self.kept = y.tobytes(), self._guards(y[:3], y[3:])
            return self.kept[1][i]

        value.terminal, value.direction = True, -1  # type: ignore[attr-defined]
        return value

    def run(self, q: np.ndarray, v: np.ndarray, t_end: float) -> tuple[np.ndarray, np.ndarray, list]:
        """State at the end, and (t, modes) after every change."""
        k = len(self.points)
        self.mode, self.below, t, log = [OFF] * k, [False] * k, 0.0, []
        y, caught = np.concatenate([q, v]), []
        while t < t_end:
            before = list(self.mode)
            self.decide(y[:3], y[3:], caught)
            self.kept = b"", []
            if self.mode != before or not log:
                log.append((t, tuple(self.mode)))

            done = solve_ivp(
                lambda _, y: np.concatenate([y[3:], self.solved(y[:3], y[3:], self.mode)[0]]),
                (t, t_end), y, "DOP853", events=[self._event(i) for i in range(2 * k)], rtol=1e-12, atol=1e-14,
                first_step=min(1e-7, 0.5 * (t_end - t)), max_step=1e-2,
            )  # fmt: skip
            t, y = float(done.t[-1]), done.y[:, -1]
            caught = [i for i in range(k) if self.below[i] and len(done.t_events[2 * i + 1])]
            for i in range(k):  # what fired is applied, never decided again
                if len(done.t_events[2 * i]) and self.mode[i] != OFF:
                    h = self.kinematics(y[:3], y[3:])[0][i]
                    self.mode[i], self.below[i] = OFF, h < 0.0
                elif len(done.t_events[2 * i]) and self.below[i]:
                    self.below[i] = False
                elif len(done.t_events[2 * i + 1]) and self.mode[i] == STICK:
                    self.mode[i] = RIGHT if self.solved(y[:3], y[3:], self.mode)[2][i] < 0.0 else LEFT
        return y[:3], y[3:], log


def tossed_rod(seed: int) -> tuple[tuple[float, float, float, float], np.ndarray, np.ndarray, float, Any]:
    """Return a rod that is tossed onto a floor, and how a second machine moves it.

    Returns:
        (mu, half its length, radius of its ends, a1), its start (x, z, angle) and velocities, the horizon in s, and of
        the second machine positions and velocities at the end and the log of its modes.
    """
    rng = np.random.default_rng(seed)
    mu, half, radius, a1 = rng.uniform(0.1, 0.8), 0.5, 0.05, float(rng.choice([20.0, 100.0, 200.0]))
    th = rng.uniform(-3.0, 3.0)
    q0 = np.array([0.0, abs(half * np.cos(th)) + radius + rng.uniform(0.01, 0.1), th])
    v0 = rng.normal(size=3) * [1.5, 1.0, 3.0]
    other = Body(1.0, half**2 / 3, np.array([[0, -half], [0, half]]), np.full(2, radius), 1e4, a1, mu)
    q, v, log = other.run(q0, v0, 0.35)
    assert all(modes.count(STICK) < 2 for _, modes in log)  # two that stick share a load in many ways
    return (mu, half, radius, a1), q0, v0, 0.35, (q, v, log)


def consistent(
    H: np.ndarray, force: np.ndarray, mu: float, k: int, loops: np.ndarray | None = None
) -> list[np.ndarray]:
    """Return accelerations of every set of modes (off, sticks, slips to either side) that agrees with its forces.

    By whole equations with those of loops. Sets that jam are left out.
    """
    found, E = [], np.zeros((0, len(force))) if loops is None else loops
    for modes in product("FTPM", repeat=k):
        on, held = [i for i in range(k) if modes[i] != "F"], [k + i for i in range(k) if modes[i] == "T"]
        sign = {"P": mu, "M": -mu}
        R = np.vstack([H[on + held], E])
        C = np.array([*(H[i] - sign.get(modes[i], 0.0) * H[k + i] for i in on), *H[held], *E]).reshape(R.shape)
        if not np.linalg.det(R @ C.T) > 0.0:  # they jam
            continue
        x = np.linalg.solve(R @ C.T, -R @ force)
        a = force + C.T @ x
        normal, along = dict(zip(on, x, strict=False)), dict(zip(held, x[len(on) :], strict=False))
        good = all(H[i] @ a >= -1e-9 for i in range(k) if modes[i] == "F") and all(f >= -1e-9 for f in normal.values())
        good = good and all(abs(f) <= mu * normal[i - k] + 1e-9 for i, f in along.items())
        if good and all(np.sign(sign[modes[i]]) * (H[k + i] @ a) >= -1e-9 for i in range(k) if modes[i] in "PM"):
            found.append(a)
    return found
