"""Sizes of a ball's scene, for guards against divergence and for steps that resolve its law."""

from __future__ import annotations

import math

from crossbody.cases import Case


def fall_depth(case: Case) -> float:
    """How far below its start a ball could be at t_end with nothing in its way, m: |v0| t + g t^2 / 2.

    A contact that only pushes cannot bring it deeper than free fall.
    """
    return abs(float(case.v0[0])) * case.t_end + 0.5 * abs(case.number("gravity")) * case.t_end**2


def energy_per_mass(case: Case) -> float:
    """Energy that the scene starts with, per unit mass, J/kg: motion, height and law (spec 1.4)."""
    h, v = float(case.q0[0]), float(case.v0[0])
    a0, a2 = float(case.law.a0[0]), float(case.law.a2[0])
    stored = 0.5 * a0 * h * h + 0.25 * a2 * h**4 if (h < 0 or not case.law.unilateral[0]) else 0.0
    return 0.5 * v * v + abs(case.number("gravity") * h) + stored


def deepest(case: Case) -> float:
    """Depth at which a0 d^2/2 + a2 d^4/4 holds the energy that the scene starts with, m."""
    e, a0, a2 = energy_per_mass(case), float(case.law.a0[0]), float(case.law.a2[0])
    bounds = [math.sqrt(2 * e / a0)] if a0 > 0 else []
    bounds += [(4 * e / a2) ** 0.25] if a2 > 0 else []
    return min(bounds, default=0.0)


def sizes(case: Case) -> tuple[float, float]:
    """How deep its contact gives, m (or how far it moves), and how fast it moves, m/s."""
    depth = deepest(case) or float(abs(case.q0).max()) or 1.0
    return depth, math.sqrt(2 * energy_per_mass(case)) or 1.0
