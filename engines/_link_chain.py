"""A chain of links as engines of hinges see it: relative angles, the brakes of its joints, and the way back.

Written from the geometry, not from the reference's kernels. r_0 = pi - th_0 and r_i = th_(i-1) - th_i: angles of hinges
that turn clockwise seen with x to the right and z up, from a chain that hangs straight.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from crossbody.cases import Case
from crossbody.cases.arrays import Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Link:
    """One link: mass, kg; pivot to centre and pivot to next pivot, m; inertia, kg m^2; friction, N m s and N m."""

    m: float
    a: float
    length: float
    inertia: float
    k: float
    s: float


@dataclass(slots=True, kw_only=True)
class LinkChain:
    """A case of the mechanism `link_chain`.

    Attributes:
        links: from the pivot on.
        gravity: m/s^2.
        slip: rate over which dry friction is smoothed, rad/s.
        r0, rd0 (n,): start of the hinges, rad, rad/s.
        times (m,), torques (m, n): what acts on the joints from when on, s, N m.
        u (n,): what acts now.
    """

    links: tuple[Link, ...]
    gravity: float
    slip: float
    r0: Floats
    rd0: Floats
    times: Floats
    torques: Floats
    u: Floats = field(init=False)

    def __post_init__(self) -> None:
        """Nothing acts at first."""
        self.u = np.zeros(len(self.links))
        self._k = np.array([link.k for link in self.links])
        self._s = np.array([link.s for link in self.links])

    _k: Floats = field(init=False, repr=False)
    _s: Floats = field(init=False, repr=False)

    def reset(self) -> None:
        """Nothing acts."""
        self.u[:] = 0.0

    def change(self, t: float) -> None:
        """Put in force what acts from t on."""
        self.u[:] = self.torques[np.searchsorted(self.times, t)]

    def torque(self, rd: Floats) -> Floats:
        """Torques on the hinges (n,): a torque that turns a link forward in th turns its hinge back."""
        return -self.u - (self._k + self._s / np.sqrt(rd * rd + self.slip**2)) * rd

    def absolute(self, r: Floats, rd: Floats) -> tuple[Floats, Floats]:
        """Q and v (m, 3 n) of a motion of the hinges (m, n)."""
        th, w = np.pi - np.cumsum(r, axis=-1), -np.cumsum(rd, axis=-1)
        q, v = np.empty((len(r), 3 * len(self.links))), np.empty((len(r), 3 * len(self.links)))
        x, z, xd, zd = (np.zeros(len(r)) for _ in range(4))
        for i, link in enumerate(self.links):
            s, c, rate = np.sin(th[:, i]), np.cos(th[:, i]), w[:, i]
            q[:, 3 * i], q[:, 3 * i + 1], q[:, 3 * i + 2] = x + link.a * s, z + link.a * c, th[:, i]
            v[:, 3 * i], v[:, 3 * i + 1], v[:, 3 * i + 2] = xd + link.a * c * rate, zd - link.a * s * rate, rate
            x, z = x + link.length * s, z + link.length * c
            xd, zd = xd + link.length * c * rate, zd - link.length * s * rate
        return q, v

    def observe(self, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Gaps (m, 2 n), 0 for hinges but for rounding, m, and energies (m, 2), J."""
        gap, energy = np.zeros((len(q), 2 * len(self.links))), np.zeros((len(q), 2))
        for i, link in enumerate(self.links):
            z = q[:, 3 * i + 1]
            xd, zd, w = v[:, 3 * i : 3 * i + 3].T
            energy[:, 0] += 0.5 * (link.m * (xd * xd + zd * zd) + link.inertia * w * w)
            energy[:, 1] += link.m * self.gravity * z
        return gap, energy


def link_chain(case: Case) -> LinkChain:
    """Read a case."""
    n = int(case.parameters["links"])
    links = tuple(Link(**{key: case.number(f"{name}{i + 1}") for key, name in _NAMES.items()}) for i in range(n))
    th, w = case.q0[2::3], case.v0[2::3]
    given = case.inputs
    return LinkChain(
        links=links, gravity=case.number("gravity"), slip=case.number("slip"),
        r0=np.diff(-th, prepend=-np.pi), rd0=np.diff(-w, prepend=0.0),
        times=np.zeros(0) if given is None else given.times,
        torques=np.zeros((0, n)) if given is None else given.values,
    )  # fmt: skip


_NAMES = {"m": "m", "a": "a", "length": "L", "inertia": "I", "k": "k", "s": "s"}
