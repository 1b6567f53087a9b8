"""The one type for a motion, whether an engine computed it or a rig measured it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum, StrEnum
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from crossbody.cases.arguments import instance
from crossbody.cases.arrays import Bytes, Floats, frozen
from crossbody.cases.entry_points import checked_arguments
from crossbody.cases.errors import Outcome

if TYPE_CHECKING:
    from crossbody.cases.case import Inputs


class Mode(IntEnum):
    """State of one constraint row (docs/explanation/model.md)."""

    FREE = 0
    CONTACT = 1
    BALLISTIC = 2
    """Separated below the surface (CONTACT_SEPARATION of the general machine)."""
    COLLISION = 3
    COLLISION_SEPARATION = 4
    BILATERAL = 5
    """Always on."""
    STICK = 6
    """In contact with friction, and held by it."""
    SLIP = 7
    """In contact with friction, and sliding."""


class Acts(StrEnum):
    """When what a sample tells of multipliers acts."""

    AT = "at"
    """At its instant; samples tell both sides of every jump."""
    GRID = "grid"
    """At its instant; between samples multipliers may jump."""
    BEFORE = "before"
    """Over the step that ends there, as its mean: an impulse of a time step over its length."""
    BEHIND = "behind"
    """Over the step that begins there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """One transition of one contact.

    Attributes:
        t: instant, s.
        contact: index of the constraint row.
        before: mode before.
        after: mode after.
        impulse: impulse of a frozen collision (docs/explanation/model.md) at its end, N s; 0
            where lam is finite.
    """

    t: float
    contact: int
    before: Mode
    after: Mode
    impulse: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Switch:
    """One change of a discrete variable of the mechanism or of its controller (a ring change, a controller's mode).

    Attributes:
        t: instant, s.
        variable: index in `Case.discrete`.
        before, after: its values.
        smooth: the motion has no jump there; a force may, as the curvature of a gap beside an edge.
    """

    t: float
    variable: int
    before: int
    after: int
    smooth: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Ledger:
    """The energy account: E(t) - E(0) = input - dissipated + sum of contact work + residual.

    Attributes:
        contact (n, nc): work done by each row's multiplier since the start, J.
        input (n,): work of the inputs, J.
        dissipated (n,): energy lost in the mechanism's own damping, J.
    """

    contact: Floats
    input: Floats
    dissipated: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Trajectory:
    """A motion in the case's own coordinates.

    At an event the instant stands twice: before and after (q and v are continuous, lam jumps).

    Attributes:
        t (n,): time, s, never decreasing.
        q (n, nq): positions.
        v (n, nv): velocities.
        gap (n, nc): signed gaps, m; negative penetrates.
        lam (n, nc): multipliers, N; positive pushes apart. NaN where the engine cannot tell.
        acts: when lam of a sample acts, so that its impulse is known.
        energy (n, 2): kinetic and potential energy, J.
        mode (n, nc): `Mode` of every row; -1 where the engine has no such notion.
        events: transitions in order of time.
        switches: changes of the discrete variables in order of time.
        outcome: how the run ended.
        message: where and why, if it did not finish.
        steps: steps accepted.
        wall_s: time of the run itself, s (no preparation).
        counts: further counters of the solver (right-hand sides, rejections, ...).
        ledger: work of every row, if it was asked for.
        inputs: what acted on it, where a controller of the user's own gave some of it; None where
            the case says it.
        sol: sol(t) gives q (..., nq) and v (..., nv) at instants t (...), s, between the samples
            too, and sol(t, side="left") what they are before an event there; None where not asked
            for, by `dense=True`.
        determined_until: until when the law determines the motion, s; finite where contacts that
            slide share a load as no law says (the message names it `indeterminate`).
        undetermined_by: by how much other such shares would have moved a contact until the end, m, to first
            order along this motion; only `compiled` tells.
        unique_until: until when one motion alone keeps the law, s; finite where more than one set
            of sticking, sliding and open contacts does (`modes_not_unique`), or none that was found
            (`sticks_contradict`).
        searched_until: until when no other motion can keep the law, or was searched for, s; finite
            where too many contacts could change at one instant to try all their sets
            (`not_searched`): what follows may be one motion of several. A truth tries more than a run.
        energy_gained: what touches with friction gave out beyond what they had taken in, J
            (`touches_that_gained`); of the reference, other engines tell nothing.
        energy_handed: what contacts with friction gave out that began below their surface, J
            (`starts_inside`); likewise.
        control_s: part of `wall_s` that was spent in that controller, s.
    """

    t: Floats
    q: Floats
    v: Floats
    gap: Floats
    lam: Floats
    energy: Floats
    mode: Bytes
    acts: Acts = Acts.AT
    events: tuple[Event, ...] = ()
    switches: tuple[Switch, ...] = ()
    outcome: Outcome = Outcome.FINISHED
    message: str = ""
    steps: int = 0
    wall_s: float = 0.0
    counts: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))
    ledger: Ledger | None = None
    inputs: Inputs | None = None
    control_s: float = 0.0
    determined_until: float = math.inf
    undetermined_by: float = 0.0
    unique_until: float = math.inf
    searched_until: float = math.inf
    energy_gained: float = 0.0
    energy_handed: float = 0.0
    sol: Callable[..., tuple[Floats, Floats]] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        """Check every shape once and make every array read-only."""
        instance("Trajectory.outcome", self.outcome, Outcome, "an Outcome")
        instance("Trajectory.acts", self.acts, Acts, "an Acts")
        object.__setattr__(self, "t", frozen("Trajectory", "t", self.t, (None,)))
        n = len(self.t)
        object.__setattr__(self, "gap", frozen("Trajectory", "gap", self.gap, (n, None)))
        nc = self.gap.shape[1]
        shapes = {"q": (n, None), "v": (n, None), "lam": (n, nc), "energy": (n, 2)}
        for name, shape in shapes.items():
            object.__setattr__(self, name, frozen("Trajectory", name, getattr(self, name), shape))
        object.__setattr__(self, "mode", frozen("Trajectory", "mode", self.mode, (n, nc), np.int8))

    @property
    def total_energy(self) -> Floats:
        """Kinetic plus potential energy (n,), J."""
        total: Floats = self.energy.sum(axis=1)
        return total

    @checked_arguments
    def transitions(self, contact: int | None = None) -> tuple[Event, ...]:
        """The events of one contact, or all."""
        return tuple(e for e in self.events if contact is None or e.contact == contact)
