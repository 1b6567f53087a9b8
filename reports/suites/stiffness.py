"""Stiffness from 1 to 1e12 1/s^2 against damping, tolerance and step: the stability map of every engine."""

from __future__ import annotations

from crossbody.reports.suites._axis import Levels, decades
from crossbody.reports.suites._contract import Family, Ladder, Suite
from crossbody.reports.suites._scenes import damped

LADDER = Ladder(rtol=(1e-4, 1e-6, 1e-8, 1e-10, 1e-12), dt=(1e-2, 3e-3, 1e-3, 3e-4, 1e-4))

SUITE = Suite(
    families=(
        Family(
            case="bouncing_ball", variant="linear", scene=damped, ladder=LADDER, fixed={"t_end": 1.0, "height": 0.3},
            grid={"a0": decades(0, 12), "zeta": Levels((0.0, 0.1, 1.0, 10.0))}, max_steps=20_000,
        ),
    ),
    engines=("reference:compiled", "mujoco:matched", "mujoco:default", "pinocchio:law"),
    runs=260,
)  # fmt: skip
