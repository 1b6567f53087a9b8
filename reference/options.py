"""What may be asked of a run, checked once."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from typing import Any, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from crossbody.cases import InvalidValue, SceneError, UnknownName
from crossbody.cases.arguments import flag, real, shown
from crossbody.cases.arrays import frozen
from crossbody.cases.control import Control
from crossbody.reference._system import System
from crossbody.reference.kinds import Floats

FSMS = ("level", "edge", "memoryless")
COLLISIONS = ("sequential", "simultaneous", "resolved")
SOLVERS = ("compiled", "ida", "cvode")
TOLERANCES = (1e-14, 1e-1)
LARGEST_ATOL = 1e100  # its square is still a number
MOST_SETS = (1, 4**12)
ATOL_PART = 1e-3  # default absolute tolerance in units of rtol: gaps are small against heights


class Chosen(TypedDict, total=False):
    """Options of a run by name, for editors and type checkers; what each means stands in `Options`."""

    rtol: float
    atol: float | None
    fsm: str
    collisions: str
    solver: str
    samples: ArrayLike | None
    dense: bool
    inputs: tuple[ArrayLike, ArrayLike] | None
    consistent: bool
    ledger: bool
    events: bool
    shortcuts: bool
    implicit: bool
    index: int
    max_step: float
    max_steps: int
    most_sets: int
    time_limit: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """Everything of a run that is not the mechanism or its start.

    Attributes:
        t_end: horizon, s.
        rtol: relative tolerance in [1e-14, 0.1].
        atol: absolute tolerance; rtol/1000 if not given.
        fsm: "level", "edge" or "memoryless" (docs/explanation/model.md).
        collisions: how rows with fast constants collide: at one instant, "sequential" or
            "simultaneous", or "resolved" in real time (docs/explanation/model.md). Rows with one
            set of constants are always resolved.
        solver: "compiled", "ida" or "cvode".
        samples: times of the rows; None for every step and both sides of every event.
        dense: give the motion `sol`, q and v at any instant of it by the integrator's own dense
            output. The run keeps what it needs to go on from the ends of its steps, 64 MB of it
            at most (beyond that of every second step, of every fourth, ..., which are taken again
            when they are asked for; where a controller in Python gives inputs, of every step).
        inputs: (times, values) held from each time on; None for zero.
        consistent: the start stands on the rows that are always on, h = 0 and H v = 0, up to 1000
            times the tolerance and rounding; one that does not is refused, and the nearest that
            does is offered (`System.project`). False admits a start off its rows, which the law
            then brings back: h'' + a1 h' + a0 h + a2 h^3 = 0.
        ledger: keep the energy account.
        events: keep every event; without them (and with `samples`) memory does not grow with the
            number of bounces.
        shortcuts: closed-form arcs if the scene is affine.
        implicit: the implicit method where the explicit one is bound by stability.
        index: 1, or 3 for bilateral rows under "ida".
        max_step: longest step, s.
        max_steps: bound on steps.
        most_sets: sets of modes of contacts with friction up to which, at an instant at which some
            change, all are tried to see whether a second motion keeps the law (`searched_until`);
            of `compiled`.
        time_limit: bound on processor time, s, and ten times as long by the clock; looked at
            between slices of steps. It does not end a kernel that never returns: only its process
            can be ended, as the command line does.
    """

    t_end: float
    rtol: float = 1e-9
    atol: float | None = None
    fsm: str = "level"
    collisions: str = "sequential"
    solver: str = "compiled"
    samples: ArrayLike | None = None
    dense: bool = False
    inputs: tuple[ArrayLike, ArrayLike] | None = None
    consistent: bool = True
    ledger: bool = False
    events: bool = True
    shortcuts: bool = True
    implicit: bool = True
    index: int = 1
    max_step: float = math.inf
    max_steps: int = 1_000_000
    most_sets: int = 64
    time_limit: float = math.inf

    def __post_init__(self) -> None:
        """Check every option.

        Raises:
            UnknownName: for a word that is not among the valid ones.
            InvalidValue: for a number outside its range.
        """
        known("machine (fsm)", self.fsm, FSMS)
        known("collision rule", self.collisions, COLLISIONS)
        known("solver", self.solver, SOLVERS)
        within("rtol", self.rtol, *TOLERANCES)
        if self.atol is not None:
            within("atol", self.atol, 0.0, LARGEST_ATOL, open_low=True)
        within("t_end", self.t_end, 0.0, math.inf, open_low=True)
        within("max_step", self.max_step, 0.0, math.inf, open_low=True, infinite=True)
        within("max_steps", self.max_steps, 1, math.inf, infinite=True)
        within("most_sets", self.most_sets, *MOST_SETS)
        if math.isfinite(self.max_steps) and self.max_steps != int(self.max_steps):
            raise InvalidValue(f"max_steps is {self.max_steps!r}; it must be a whole number, or infinite.")
        within("time_limit", self.time_limit, 0.0, math.inf, open_low=True, infinite=True)
        for name in ("consistent", "ledger", "events", "shortcuts", "implicit", "dense"):
            object.__setattr__(self, name, flag(name, getattr(self, name)))
        for name in ("t_end", "rtol", "max_step", "time_limit"):
            object.__setattr__(self, name, float(getattr(self, name)))
        if self.dense and self.solver != "compiled":
            raise InvalidValue(f"dense is True with solver {self.solver!r}; valid: with 'compiled', or samples.")
        if (
            not isinstance(self.index, (int, np.integer))
            or self.index not in (1, 3)
            or (self.index == 3 and self.solver != "ida")
        ):
            raise InvalidValue(f"index is {shown(self.index)} with solver {self.solver!r}; valid: 1, or 3 with 'ida'.")

    @property
    def tolerance(self) -> float:
        """The absolute tolerance in force."""
        return ATOL_PART * self.rtol if self.atol is None else self.atol

    def absolute(self, system: System) -> Floats:
        """Absolute tolerances of q and v (nq + n,).

        A quaternion's entries are measured by its length, 1, however small they are; half of it,
        since an angle is twice their change.
        """
        found: Floats = np.full(system.nq + system.n, self.tolerance, dtype=np.float64)
        found[system.quaternion_entries] += 0.5 * self.rtol
        return found

    def grid(self) -> Floats:
        """The sample times, checked: increasing, inside [0, t_end]."""
        times: Floats = frozen("simulate", "samples", () if self.samples is None else self.samples, (None,))
        if len(times) and not (np.all(np.diff(times) >= 0) and times[0] >= 0 and times[-1] <= self.t_end):
            raise InvalidValue(f"samples must increase inside [0, {self.t_end:g}] s.")
        return times

    def freezes(self, system: System) -> bool:
        """Whether any row of the system collides at one instant.

        Raises:
            InvalidValue: for frozen collisions of another machine than level, or of a row whose
                fast law is not linear.
        """
        fast = np.asarray(system.b0) > 0.0
        if self.collisions == "resolved" or not np.any(fast):
            return False
        asked = f"collisions={self.collisions!r}"
        if self.fsm != "level":
            raise InvalidValue(f"{asked} needs fsm='level', not {self.fsm!r}, which uses real time; use 'resolved'.")
        cubic = np.flatnonzero(fast & (np.asarray(system.b2) > 0.0))
        if len(cubic):
            raise InvalidValue(
                f"{asked} maps a collision by a linear law, but row {cubic[0]} has b2 > 0; valid: b2 = 0 or 'resolved'."
            )
        return True

    def check_friction(self, system: System) -> None:
        """Refuse what contacts with friction do not have.

        Raises:
            InvalidValue: for another machine or solver.
            SceneError: for a system with fast constants or an algebra of its own.
        """
        if not system.frictional:
            return
        why = "the system has contacts with friction (System.mu)"
        if self.fsm != "level":
            raise InvalidValue(f"fsm is {self.fsm!r}, and {why}; valid: 'level'.")
        if self.solver == "ida":
            raise InvalidValue(f"solver is {self.solver!r}, and {why}; valid: 'compiled', 'cvode'.")
        if np.any(np.asarray(system.b0) > 0.0) or np.any(np.asarray(system.b1) > 0.0):
            raise SceneError(f"System.b0, b1 are given, and {why}: collisions with friction are not supported.")
        if system.solve is not None:
            raise SceneError(f"System.solve is given, and {why}: they are solved by the general algebra.")

    def schedule(self, system: System, *, played: bool = False) -> tuple[Floats, Floats]:
        """Times (m,) and values (m, nu) of the inputs, checked, with those that stand for activations.

        A controller in Python puts these itself, unless what it gave is `played`.
        """
        behind = system.activations
        count = system.inputs - (behind.width if behind is not None else 0)
        times, values = self._given(count)
        if behind is None:
            return times, values
        if isinstance(system.control, Control) and not played:
            return times, np.hstack([values, np.zeros((len(times), behind.width))])
        return behind.columns(times, values)

    def _given(self, count: int) -> tuple[Floats, Floats]:
        if self.inputs is None:
            return np.zeros(0), np.zeros((0, count))
        if not isinstance(self.inputs, (tuple, list)) or len(self.inputs) != 2:
            raise InvalidValue(f"inputs is {shown(self.inputs)}; it must be a pair: times (m,) and values (m, nu).")
        times: Floats = frozen("inputs", "times", self.inputs[0], (None,))
        values: Floats = frozen("inputs", "values", self.inputs[1], (len(times), count))
        if not (np.all(np.isfinite(times)) and np.all(np.diff(times) > 0) and np.all(np.isfinite(values))):
            raise InvalidValue("inputs must be finite and their times strictly increasing.")
        return times, values


def known(kind: str, name: str, names: Iterable[str]) -> None:
    """Raise UnknownName unless `name` is among `names`."""
    if not isinstance(name, str) or name not in names:
        raise UnknownName(kind, name, names)


def checked(t_end: float, given: Mapping[str, Any]) -> Options:
    """Options by their names.

    Raises:
        UnknownName: for one that does not exist.
        InvalidValue: as `Options`.
    """
    for name in given:
        known("option", name, [field.name for field in fields(Options) if field.name != "t_end"])
    return Options(t_end=t_end, **given)


def within(name: str, value: float, low: float, high: float, *, open_low: bool = False, infinite: bool = False) -> None:
    """Raise InvalidValue unless low <= value <= high (low itself excluded if open) and value is finite."""
    number = real(name, value)
    good = low <= number <= high and not (open_low and number == low) and (infinite or math.isfinite(number))
    if not good:
        raise InvalidValue(f"{name} is {shown(value)}; valid: {'(' if open_low else '['}{low:g}, {high:g}].")
