"""A ball with an input force."""

from __future__ import annotations

from crossbody.reference import System, kernels
from crossbody.reference.systems import ball as ball_kernels


@kernels.dynamics
def _gust(t, q, v, u, p, M, f, w):
    M[0, 0] = p[0]
    f[0] = u[0] - p[0] * p[1]


def gusty(a0=1e4, a1=1.0):
    """A ball with an input force."""
    return System(
        n=1, inputs=1, parameters=[1.0, 9.81], a0=[a0], a1=[a1], dynamics=_gust,
        gaps=ball_kernels.gaps, rows=ball_kernels.rows, energy=ball_kernels.energy,
    )  # fmt: skip
