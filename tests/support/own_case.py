"""An oscillator with its equations, its closed form and its limits: a case file as a user keeps it elsewhere.

M q'' = -k q, released at rest: q = q0 cos(w t), w = sqrt(k/M).
"""

from __future__ import annotations

import numpy as np

from crossbody.cases import Case, Claim, Coordinate, Law, Limit, Parameter, Tier, Trajectory
from crossbody.reference import System, kernels

PARAMETERS = {
    "mass": Parameter(default=1.0, unit="kg", low=0.0, open_low=True),
    "stiffness": Parameter(default=4.0, unit="N/m", low=0.0, open_low=True),
    "error": Parameter(default=0.0, unit="1", doc="of the closed form's frequency, to be wrong on purpose"),
}
VARIANTS = {"right": {}, "wrong": {"error": 1e-2}, "known": {"error": 1e-2}}


@kernels.dynamics
def _dynamics(t, q, v, u, p, M, f, w):
    M[0, 0], f[0] = p[0], -p[1] * q[0]


@kernels.energy
def _energy(q, v, p, e):
    e[0], e[1] = 0.5 * p[0] * v[0] ** 2, 0.5 * p[1] * q[0] ** 2


def system(parameters, law):
    """The equations."""
    named = {name: parameters[name] for name in ("mass", "stiffness")}
    return System(n=1, dynamics=_dynamics, energy=_energy, parameters=named, constant_mass=True)


class Motion:
    """The closed form."""

    def __init__(self, p):
        self.p, self.w = p, np.sqrt(p["stiffness"] / p["mass"]) * (1.0 + p["error"])

    def __call__(self, t):
        """The motion at times t (n,)."""
        q, v = np.cos(self.w * t), -self.w * np.sin(self.w * t)
        energy = np.stack([0.5 * self.p["mass"] * v**2, 0.5 * self.p["stiffness"] * q**2], axis=1)
        none = np.zeros((len(t), 0))
        return Trajectory(t=t, q=q[:, None], v=v[:, None], gap=none, lam=none, energy=energy, mode=none.astype(np.int8))


def build(variant, parameters):
    """The scene."""
    none = np.zeros(0)
    known = "The frequency of this closed form is known to be off." if variant == "known" else ""
    return Case(
        name="own_case", variant=variant, title="an oscillator", mechanism=__file__, parameters=parameters,
        coordinates=(Coordinate(name="x", unit="m"),), contacts=(), q0=np.ones(1), v0=np.zeros(1), t_end=3.0,
        law=Law(a0=none, a1=none, a2=none, unilateral=none.astype(bool)), closed_form=Motion(parameters),
        claims=(Claim(metric="contacts", expected=0.0, tier=Tier.A, source="nothing to touch"),),
        limits=(
            Limit(metric="position", value=1e-6, why="tolerance", known=known, known_size=1.0),
            Limit(metric="energy_integrator", value=1e-6, why="tolerance"),
        ),
    )  # fmt: skip
