"""What a mechanism's file gives to the profiles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from crossbody.engines._log import Observe
from crossbody.engines.pinocchio._rows import PinRows


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """A model and its rows; the engine's coordinates are the case's.

    Attributes:
        rows: gaps, accelerations and multipliers.
        points: every row as a constraint of Pinocchio with three components, the normal last (profile admm).
        observe: gaps and energies of many states.
    """

    rows: PinRows
    points: list[Any]
    observe: Observe
