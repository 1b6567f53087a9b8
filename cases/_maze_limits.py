"""How far each engine may be from the truth of the ball maze, and why."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from crossbody.cases._case import Limit, Value

_TOLERANCE = "a thousand times the default tolerance of 1e-9"
_LOG = "read between the samples of a run"


def limits(variant: str, p: Mapping[str, Value]) -> tuple[Limit, ...]:
    """The limits of one variant."""
    return tuple(_limits(variant))


def _limits(variant: str) -> Iterator[Limit]:
    if variant in ("inside", "free"):
        yield Limit(metric="swing_period", value=1e-6, why=_LOG)
    if variant == "outside":
        yield Limit(metric="unstable_pole", value=1e-6, why=_TOLERANCE)
        yield Limit(metric="leave_angle", value=1e-5, why=_LOG)
    if variant == "solve":
        yield Limit(metric="ring_changes", value=0.0, why="a count")
        yield Limit(metric="contact_loss", value=7e-6, why="1 % of 0.70 mJ")
