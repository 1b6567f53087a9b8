"""A suite of a case or robot's file: other laws of its rows, pushes on its bodies, other numbers of its own."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from crossbody import cases
from crossbody.cases import Case, Parameter, Value
from crossbody.cases.loading import module
from crossbody.reports.suites.axis import Axis, Levels, Linear, Log
from crossbody.reports.suites.contract import USUAL, Family, Suite

LAW: Mapping[str, Axis] = {"a0": Log(1e2, 1e6), "a1": Log(1.0, 1e3)}
SHORT = 0.5  # horizon of a file's runs, s
SPREAD = 2.0  # times and part of its default that a number without bounds is drawn between
VARIANTS = 4
OF_FILES = ("reference:compiled", "mujoco:matched", "mujoco:as_is", "pinocchio:law")
"""Who runs a file: MuJoCo with its own contacts, too, for it is the one that has friction."""


def suite_of(name: str, fixed: Mapping[str, Value]) -> Suite:
    """Return the suite of a case, of the library or a file, with parameters that are the same in every run."""
    families = []
    for variant in cases.variants(name)[:VARIANTS]:
        case = cases.load(name, variant, **fixed)
        same = {"t_end": min(SHORT, case.t_end), **fixed} if case.file else dict(fixed)
        axes = {key: axis for key, axis in _axes(name, case).items() if key not in same}
        families.append(Family(
            case=name, variant=variant, axes=axes, fixed=same, second=5, finishes=False, time_limit=30.0,
        ))  # fmt: skip
    return Suite(families=tuple(families), runs=40, engines=OF_FILES if case.file else USUAL)


def _axes(name: str, case: Case) -> dict[str, Axis]:
    if not case.file:
        known = module(name).PARAMETERS.items()
        return {key: axis for key, one in known if key != "t_end" and (axis := _axis(one)) is not None}
    found: dict[str, Axis] = dict(LAW) if len(case.law.a0) else {}
    return found | {"push": Levels(("", *_pushes(case)))}


def _axis(parameter: Parameter) -> Axis | None:
    """Return between which values a number is drawn; None of a text or a switch."""
    default: Any = parameter.default
    if isinstance(default, (str, bool)) or parameter.choices or not default:
        return None
    low, high = parameter.low, parameter.high
    if math.isfinite(low) and math.isfinite(high) and not parameter.open_low:
        return Linear(low, high)
    ends = sorted((float(default) / SPREAD, float(default) * SPREAD))
    return Linear(max(ends[0], low), min(ends[1], high))


def _pushes(case: Case) -> list[str]:
    """Return a push of the weight for a twentieth of a second on each body, in a direction of its own."""
    assert case.scene is not None
    rng, found = np.random.default_rng(0), []
    weight = 9.81 * sum(body.mass for body in case.scene.bodies)
    for body in case.scene.bodies:
        direction = rng.normal(size=3)
        fx, fy, fz = weight * direction / np.linalg.norm(direction)
        found.append(f"{body.name} {fx:.6g} {fy:.6g} {fz:.6g} 0 .05")
    return found
