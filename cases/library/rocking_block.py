"""A block that stands on an edge falls back on its base: friction keeps the edge in its place until then.

An inverted pendulum in closed form (docs/explanation/contacts.md); the horizon ends just before
the block is flat.
"""

from __future__ import annotations

from collections.abc import Mapping

from crossbody.cases.case import Case, Parameter, Value
from crossbody.cases.errors import InvalidValue
from crossbody.cases.files.case import case_of
from crossbody.cases.mechanisms.friction.limits import limits
from crossbody.cases.mechanisms.friction.rocking import block, flat_at, rocking, start
from crossbody.cases.mechanisms.friction.scene import NUMBERS, block_on_floor

PARAMETERS = {
    **NUMBERS,
    "t_end": Parameter(default=0.34, unit="s", doc="horizon", low=0.0, open_low=True),
    "width": Parameter(default=0.1, unit="m", doc="half of it", low=0.0, open_low=True),
    "height": Parameter(default=0.5, unit="m", doc="half of it", low=0.0, open_low=True),
    "tilt": Parameter(default=0.5, doc="at the start, of that at which it balances", low=0.0, high=1.0, open_low=True),
}

VARIANTS: dict[str, dict[str, Value]] = {"falls": {}}


def build(variant: str, parameters: Mapping[str, Value]) -> Case:
    """The scene with its exact motion, as far as it goes.

    Raises:
        InvalidValue: for a horizon behind the instant at which the block is flat.
    """
    p = {name: float(value) for name, value in parameters.items()}
    if not p["t_end"] < (last := flat_at(p)):
        raise InvalidValue(f"rocking_block: t_end is {p['t_end']:g} s; the block is flat at {last:.6g} s.")
    made = case_of(
        block_on_floor(p, block(p).half, planar=True), name="rocking_block", variant=variant, q0=start(p),
        t_end=p["t_end"], parameters=parameters,
    )  # fmt: skip
    return limits(made, "a block on an edge falls back on its base", PARAMETERS, rocking(p), p)
