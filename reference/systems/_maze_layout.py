"""Where the numbers of the ball maze stand in p: constants, the table of rings, discrete variables, latched numbers."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference import kernels

CONSTANTS = (
    "gravity", "ball_mass", "ball_radius", "ball_inertia", "maze_inertia", "rolling_damping", "rings",
    "controller", "a_max", "u_max", "wn", "omega",
    "balance_k2", "balance_k1", "balance_k0", "centre_k2", "centre_k1", "centre_k0",
    "model_gravity", "model_mass", "model_inertia", "delay", "noise", "noise_speed", "seed",
)  # fmt: skip
"""Names of the constants, SI; gravity is that in the plane of the maze, gains and model those of the controller."""
(
    G, MB, RADIUS, JB, JM, DRAG, RINGS, KIND, A_MAX, U_MAX, WN, OMEGA, K2, K1, K0, C2, C1, C0,
    MODEL_G, MODEL_MB, MODEL_JM, DELAY, NOISE, NOISE_SPEED, SEED,
) = range(len(CONSTANTS))  # fmt: skip

TABLE, STRIDE = len(CONSTANTS), 5
INNER, OUTER, GAPS, REACH, PHASE = range(STRIDE)
"""Columns of the table: a ring in a line, innermost first, and the wall as a ring without gaps."""

CHANNEL, BELOW, ABOVE, MODE, TARGET, TOUCHING, ANGLE, FROM_BELOW, FROM_ABOVE = range(-9, 0)
"""Channel i lies outside ring i - 1. Sectors below and above: a gap's number, or SOLID. Mode of
the controller. Latched: the angle of the maze that the snatch aims at; whether the ball touches a
face; the ball's angle when it last entered a sector, and how far it was then from the middles of
the sectors below and above, plus the maze's angle."""
SOLID = -1
DISCRETE, LATCHED = 4, 5

OFF, CONTINUOUS, SAMPLED = range(3)
BALANCE, SNATCH, CENTRE = range(1, 4)  # modes of the controller beside OFF

FACE_BELOW, TIPS_BELOW, FACE_ABOVE, TIPS_ABOVE, SLIP_BELOW, SLIP_ABOVE = 0, 1, 3, 4, 6, 7
"""Rows: tips stand in pairs, the clockwise end of the gap first."""
NORMAL = 6


@kernels.helper
def number(x: Any) -> int:
    """A discrete variable as a whole number."""
    return int(x.real)


@kernels.helper
def below(p: Any) -> int:
    """Line of the ring below in the table; what it points to in channel 0 must not be read."""
    line: int = TABLE + STRIDE * (number(p[CHANNEL]) - 1)
    return line


@kernels.helper
def above(p: Any) -> int:
    """Line of the ring above, or of the wall."""
    line: int = TABLE + STRIDE * number(p[CHANNEL])
    return line


@kernels.helper
def far(p: Any) -> Any:
    """The gap that a row reports which cannot be touched, m: the radius of the wall."""
    return p[TABLE + STRIDE * number(p[RINGS]) + INNER]


@kernels.helper
def polar(x: Any, y: Any) -> Any:
    """Angle of (x, y), rad: its principal value at the real parts and its derivative in the imaginary ones."""
    a, b = x.real, y.real
    return np.arctan2(b, a) + (a * y - b * x) / (a * a + b * b)


@kernels.helper
def limited(x: Any, bound: Any) -> Any:
    """X between -bound and bound; a bound of 0 is none."""
    if bound.real <= 0.0 or -bound.real <= x.real <= bound.real:
        return x
    return bound if x.real > 0.0 else -bound
