"""What a mechanism's file gives to the profiles."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from crossbody.cases.arrays import Floats
from crossbody.engines._acting import Acting
from crossbody.engines._log import Chart, Observe
from crossbody.engines.pinocchio._contacts import Points
from crossbody.engines.pinocchio._coordinates import Coordinates
from crossbody.engines.pinocchio._rows import PinRows


@dataclass(frozen=True, slots=True, kw_only=True)
class World:
    """What acts on the rows from outside, in the engine's coordinates.

    Attributes:
        instants: when the inputs change, s, increasing.
        change: (t, q, v) puts in force what acts from such an instant on.
        reset: back to the start: no input, no memory.
        clock: is told the time of all that is asked next, s; None where nothing depends on it.
        acting: what acts on a case's scene from outside, controllers included; None elsewhere.
        safe: (q, v) -> whether the state is one that the scene can reach.
    """

    instants: Sequence[float] = ()
    change: Callable[[float, Floats, Floats], None] = lambda _t, _q, _v: None
    reset: Callable[[], None] = lambda: None
    clock: Callable[[float], None] | None = None
    acting: Acting | None = None
    safe: Callable[[Floats, Floats], bool] = lambda q, v: math.isfinite(q.sum() + v.sum())  # faster than each


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """A model and its rows.

    Attributes:
        rows: gaps, accelerations and multipliers.
        points: rows as Pinocchio's constraints (profile admm); None where no contact can be stepped.
        observe: gaps and energies of many states of the model.
        sizes: how far the coordinates move (or how deep contacts give), and how fast: numbers, or
            one a coordinate (n,). Times rtol they are the absolute tolerances.
        start: q and v at the start in the engine's coordinates; None where they are the case's.
        chart: positions and velocities of the engine -> those of the case; None where they are the same.
        world: what acts from outside.
        coordinates: rates of the positions, where they are not v; None where they are.
        audit: more for the parity audit, or instead of what is read from `rows`.
    """

    rows: PinRows
    points: Points | None = None
    observe: Observe
    sizes: tuple[float | Floats, float | Floats]
    start: tuple[Floats, Floats] | None = None
    chart: Chart | None = None
    world: World = field(default_factory=World)
    coordinates: Coordinates | None = None
    audit: dict[str, Any] = field(default_factory=dict)
