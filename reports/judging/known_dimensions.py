"""Whether parameters of a case have the units of what they set: in other units of mass, length and time it is the same.

A label is compared with nothing by any run. But where each parameter is larger by what its unit says, as if metres,
seconds and kilograms were others, so must all be that a case makes of them: its start, horizon, laws, masses, inertias,
shapes and what is claimed. What stays as it is was not made of them; so do masses, or lengths, where none is given.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from crossbody import cases
from crossbody.cases import Case, CrossbodyError
from crossbody.cases.errors import InvalidValue
from crossbody.cases.loading import module
from crossbody.reports import metrics
from crossbody.reports.judging.asked import Found, Within, unlike

TIMES = {"m": 1.7, "s": 1.3, "kg": 0.6}
"""By how much the units that others are made of are smaller."""
OF = {"N": "kg m/s^2", "J": "kg m^2/s^2", "W": "kg m^2/s^3", "Hz": "1/s", "rad": "1", "deg": "1", "cm": "m"}
MADE_OF = {"m": {"m", "cm"}, "kg": {"kg", "N", "N m", "N/m", "N s", "kg m^2"}}
"""By parameters of which units a case has lengths and masses that are no constants."""
SAME = 1e-9
"""Part of a number by which sums in another order, and searches, differ."""
CLAIMED = "the claim"
Numbers = Mapping[str, tuple[ArrayLike, list[str]]]
"""Of what, its numbers, and the unit of each, or one of all."""


@cache
def wrong(name: str) -> tuple[Found, ...]:
    """Return which numbers, and of what, are others in other units.

    Args:
        name: of one of crossbody's own cases.
    """
    return unlike((lambda: _scaled(name),), "unit", f"the parameters of {name}, which end in")


def times(unit: str, kept: tuple[str, ...] = ()) -> float:
    """Return by how much numbers of a unit are larger in smaller units of mass, length and time, but for those kept."""
    over, _, under = unit.partition("/")
    found = 1.0
    for words, sign in ((over, 1), (under.strip("()"), -1)):
        for word in words.replace("1", "", words.startswith("1")).split():
            base, _, power = word.partition("^")
            one = 1.0 if base in kept else TIMES[base] if base in TIMES else times(OF.get(base, "1"), kept)
            found *= one ** (sign * int(power or 1))
    return found


def _scaled(name: str) -> Iterator[Within]:
    """Yield 1 for what is another in other units than what it must be, else 0, of every variant."""
    units = {key: one.unit for key, one in module(name).PARAMETERS.items()}
    kept = tuple(base for base, kinds in MADE_OF.items() if not kinds & set(units.values()))
    for variant in cases.variants(name):
        case = cases.load(name, variant)
        larger = {key: value * times(units[key]) for key, value in case.parameters.items()
                  if isinstance(value, float) and units.get(key) and value and times(units[key]) != 1.0}  # fmt: skip
        other = _other(case, larger)
        mine = _numbers(other)
        for what, (values, own) in _numbers(case).items():
            if what.startswith(CLAIMED) and what not in mine:
                continue  # of these parameters alone
            yield "unit", f"{what} of {case.label}", float(not _same(values, own, mine.get(what), kept)), 0.0, 0.0


def _other(case: Case, larger: Mapping[str, float]) -> Case:
    """Return a case with larger parameters, but for those that belong to another variant."""
    try:
        return cases.load(case.name, case.variant, **larger)
    except InvalidValue:
        return cases.load(case.name, case.variant, **{key: x for key, x in larger.items() if _belongs(case, key, x)})


def _belongs(case: Case, key: str, value: float) -> bool:
    try:
        cases.load(case.name, case.variant, **{key: value})
    except CrossbodyError as error:  # by itself it may be out of proportion
        return "has no effect" not in str(error)
    return True


def _same(values: ArrayLike, units: list[str], mine: tuple[ArrayLike, list[str]] | None, kept: tuple[str, ...]) -> bool:
    """Return whether rows of numbers are larger as their units say, but for those that are `kept`, or as before."""
    before, after = (np.asarray(one, dtype=np.float64) for one in (values, np.nan if mine is None else mine[0]))
    if before.shape != after.shape:
        return False
    near = SAME * max(1e-3, float(np.abs(before[np.isfinite(before)]).max(initial=0.0)))
    with np.errstate(invalid="ignore"):  # of bounds that are infinite
        off = [np.abs(after - before * [times(unit, own) for unit in units]) <= near for own in ((), kept)]
    as_was = (after == before) if before.ndim < 2 else (after == before).all(axis=1, keepdims=True)
    return any(bool(np.all(one | (after == before) & (before == 0.0) | as_was)) for one in off)


def _numbers(case: Case) -> Numbers:
    """Return what a case makes of its parameters."""
    found: dict[str, tuple[ArrayLike, list[str]]] = {
        "positions": (case.q0, [one.unit for one in case.coordinates]),
        "velocities": (case.v0, [f"{one.unit}/s" for one in case.velocities]),
        "horizon": (case.t_end, ["s"]), "laws": (_laws(case), ["1/s", "1/s"]),
        "fast laws": (_laws(case, fast=True), ["1/s", "1/s"]),
    }  # fmt: skip
    if case.inputs is not None:
        found["instants of inputs"] = (case.inputs.times, ["s"])
        pushes = 3 * len(case.scene.pushes) if case.scene is not None else 0
        for j, (name, column) in enumerate(zip(case.inputs.names, case.inputs.values.T, strict=True)):
            if "[" in name or j >= len(case.inputs.names) - pushes:
                found[name] = (column, [name.partition("[")[2].strip("]") or "N"])
    known = metrics.of(case)
    for claim in case.claims:
        if math.isfinite(claim.expected):
            found[f"{CLAIMED} {claim.metric}"] = (claim.expected, [known[claim.metric].UNIT])
    return found | dict(_of_scene(case))


def _laws(case: Case, fast: bool = False) -> ArrayLike:
    """Return the root of each row's stiffness, and its damping (nc, 2), 1/s: one does not change without the other."""
    law = case.law
    pairs = (law.b0, law.b1) if fast else (law.a0, law.a1)
    return np.stack([np.sqrt(pairs[0]), pairs[1]], axis=1)


def _of_scene(case: Case) -> Iterator[tuple[str, tuple[ArrayLike, list[str]]]]:
    """Yield what is in a scene."""
    if case.scene is None:
        return
    yield "gravity", (case.scene.gravity, ["m/s^2"])
    for body in case.scene.bodies:
        yield f"mass of {body.name}", (body.mass, ["kg"])
        yield f"centre of {body.name}", (body.com, ["m"])
        yield f"inertia of {body.name}", (body.inertia, ["kg m^2"])
        yield f"place of {body.name}", (body.position, ["m"])
    for joint in case.scene.joints:
        unit, force = ("m", "N") if joint.type == "slide" else ("rad", "N m")
        yield f"range of {joint.name}", (joint.range, [unit])
        yield f"spring of {joint.name}", (joint.stiffness[0], [f"{force}/{unit}"])
        yield f"damper of {joint.name}", (joint.damping[0], [f"{force} s/{unit}"])
        yield f"friction of {joint.name}", (joint.friction_loss, [force])
    for shape in case.scene.shapes:
        yield f"size of {shape.name}", (shape.size, ["m"])
        yield f"place of {shape.name}", (shape.position, ["m"])
    for pair in case.scene.pairs:
        yield f"coefficients of {pair.name}", (pair.friction, ["1"])
