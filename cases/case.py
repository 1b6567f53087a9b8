"""A case: one scene with its numbers, what is true about it, and how far an engine may be from that."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from crossbody.cases.arguments import real, shown
from crossbody.cases.arrays import Floats, frozen, numbers
from crossbody.cases.entry_points import checked_arguments, checked_fields
from crossbody.cases.errors import InvalidValue, SceneError, UnknownName
from crossbody.cases.trajectory import Trajectory

if TYPE_CHECKING:
    from crossbody.cases.control import Control
    from crossbody.cases.form import Form
    from crossbody.cases.gates import Gates
    from crossbody.cases.scene import Scene
    from crossbody.cases.trajectory import Trajectory


Value = float | int | str | bool
SWITCH = {"True": True, "False": False}
"""Words of a parameter that is true or false, as they are shown."""


class Tier(StrEnum):
    """How a truth is known (docs/explanation/verdicts.md)."""

    A = "A closed form"
    B = "B published digits"
    C = "C two independent integrators that agree"
    D = "D self-consistency"


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """One number or word of a case that a user may change.

    Attributes:
        default: value when nothing is said.
        unit: SI unit, empty for a word or a count.
        doc: what it is.
        low, high: bounds of a number.
        open_low: whether `low` itself is excluded.
        choices: the words admitted, for a word; any text if there are none.
    """

    default: Value
    unit: str = ""
    doc: str = ""
    low: float = -math.inf
    high: float = math.inf
    open_low: bool = False
    choices: tuple[str, ...] = ()

    @property
    def valid(self) -> str:
        """Its words or its interval; empty for any text."""
        if isinstance(self.default, str):
            return ", ".join(self.choices)
        if isinstance(self.default, bool):
            return ", ".join(SWITCH)
        opens = "(" if self.open_low or math.isinf(self.low) else "["
        return f"{opens}{self.low:g}, {self.high:g}{')' if math.isinf(self.high) else ']'}"

    def checked(self, where: str, value: Value) -> Value:
        """Return `value` in the type of the default.

        Raises:
            InvalidValue: if it has another type, is not finite or lies outside the bounds.
        """
        if isinstance(self.default, str):
            if not isinstance(value, str) or (self.choices and value not in self.choices):
                raise InvalidValue(f"{where} is {shown(value)}; valid: {self.valid or f'a text ({self.doc})'}.")
            return value
        try:
            if not isinstance(value, (int, float, str, np.number, np.bool_)):
                raise TypeError
            number = float(SWITCH.get(str(value), value) if isinstance(self.default, bool) else value)
        except (TypeError, ValueError, OverflowError):
            wanted = "True or False" if isinstance(self.default, bool) else f"a number{self.unit and f' [{self.unit}]'}"
            raise InvalidValue(f"{where} is {shown(value)}; it must be {wanted}.") from None
        if not math.isfinite(number) or not self.low <= number <= self.high or (self.open_low and number == self.low):
            raise InvalidValue(f"{where} is {number:g}; valid: {f'{self.valid} {self.unit}'.rstrip()}.")
        if isinstance(self.default, int) and number != int(number):
            raise InvalidValue(f"{where} is {number:g}; it must be a whole number.")
        return int(number) if isinstance(self.default, int) and not isinstance(self.default, bool) else number


@dataclass(frozen=True, slots=True, kw_only=True)
class Coordinate:
    """Name and unit of one generalised coordinate; its velocity has the unit per second.

    Attributes:
        name, unit: what it is called, and in which SI unit it counts.
        size, rate: what it and its rate are at least when they do something, in that unit; a
            motion that stays below is judged by these. 0 where the scene knows none.
    """

    name: str
    unit: str
    size: float = 0.0
    rate: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Law:
    """Constants of h'' + a1 h' + a0 h + a2 h^3 = 0, one row a constraint (docs/explanation/model.md).

    Attributes:
        a0 (nc,): 1/s^2.
        a1 (nc,): 1/s.
        a2 (nc,): 1/(m^2 s^2).
        b0, b1 (nc,): fast constants of COLLISION in the units of a0, a1; zero where a row has one set.
        unilateral (nc,): False for a constraint that is always on.
        touches (nc,): which rows begin and end contacts: those that can open, if not given. False for what has
            no gap of its own: rows of friction, which hold while another row presses, or always.
    """

    a0: Floats
    a1: Floats
    a2: Floats
    unilateral: NDArray[np.bool_]
    b0: Floats = field(default_factory=lambda: np.zeros(0))
    b1: Floats = field(default_factory=lambda: np.zeros(0))
    touches: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))

    def __post_init__(self) -> None:
        """Check shapes and signs."""
        nc = np.size(numbers("Law", "a0", self.a0))
        for name in ("a0", "a1", "a2", "b0", "b1"):
            given = getattr(self, name)
            array = frozen("Law", name, np.zeros(nc) if name[0] == "b" and np.size(given) == 0 else given, (nc,))
            if not np.all(np.isfinite(array)) or np.any(array < 0):
                raise SceneError(f"Law.{name} is {array.tolist()}; it must be finite and at least 0.")
            object.__setattr__(self, name, array)
        slower = (self.b0 > 0.0) & (self.b0 <= self.a0)
        if np.any(slower):
            i = int(np.flatnonzero(slower)[0])
            raise SceneError(
                f"Law.b0[{i}] is {self.b0[i]:g}, not above a0[{i}] = {self.a0[i]:g}: "
                "the constants of COLLISION must be faster than those of CONTACT, or 0 for one set."
            )
        object.__setattr__(self, "unilateral", frozen("Law", "unilateral", self.unilateral, (nc,), np.bool_))
        touches = self.touches if np.size(self.touches) else self.unilateral
        object.__setattr__(self, "touches", frozen("Law", "touches", touches, (nc,), np.bool_))
        if wrong := np.flatnonzero(self.touches & ~self.unilateral).tolist():
            raise SceneError(f"Law.touches names rows {wrong}, which are always on; valid: rows that can open.")

    @property
    def linear(self) -> bool:
        """Whether every row is linear (a2 = 0)."""
        return not self.a2.any()


@checked_fields
@dataclass(frozen=True, slots=True, kw_only=True)
class Inputs:
    """What acts on a mechanism from outside: each row of values holds from its time on, zero before the first.

    Attributes:
        names: names of the inputs, with their units, in the order of the mechanism's u.
        times (m,): s, increasing.
        values (m, nu): in the inputs' own units.
    """

    names: tuple[str, ...]
    times: Floats
    values: Floats

    def __post_init__(self) -> None:
        """Check shapes, and that times increase."""
        times = frozen("Inputs", "times", self.times, (None,))
        values = frozen("Inputs", "values", self.values, (len(times), len(self.names)))
        if not (np.all(np.isfinite(times)) and np.all(np.diff(times) > 0) and np.all(times >= 0)):
            raise SceneError(f"Inputs.times is {times.tolist()}; they must be finite, at least 0 and increasing.")
        if not np.all(np.isfinite(values)):
            raise SceneError("Inputs.values holds a value that is not finite.")
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "values", values)

    def at(self, t: float | Floats) -> Floats:
        """Return the values (..., nu) that hold at instants t, s."""
        last = np.asarray(np.searchsorted(self.times, t, side="right")) - 1
        found: Floats = np.zeros((*last.shape, len(self.names)))
        found[last >= 0] = self.values[last[last >= 0]]
        return found


@dataclass(frozen=True, slots=True, kw_only=True)
class Force:
    """What acts on a scene beside its parts, as a function of time and state that engines compile once.

    Attributes:
        function: (t, q (nq,), v (nv,), numbers, out (nv,)) in the scene's coordinates: writes the
            generalised forces. It keeps nothing, is written in the Python that numba compiles,
            and so is every function that it calls.
        numbers: that it reads.
        breaks: instants between which it is smooth, s, increasing: no step crosses one.
        rate: fastest with which bodies answer to it, 1/s; 0 where nothing but rows is fast.
        states: bodies on slides that carry states of a controller or a sensor: their mass is 1,
            and no energy counts.
        far, fast (nv,): how far and how fast the joints move, in their units, for absolute
            tolerances; empty where what drives the start tells.
    """

    function: Callable[[float, Floats, Floats, Floats, Floats], None]
    numbers: Floats = field(default_factory=lambda: np.zeros(0))
    breaks: tuple[float, ...] = ()
    rate: float = 0.0
    states: tuple[str, ...] = ()
    far: tuple[float, ...] = ()
    fast: tuple[float, ...] = ()


Prediction = Callable[[Mapping[str, Any]], float | str]
"""Settings of an engine, none of them for its defaults -> what it is predicted to give, or what nothing predicts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """How large one metric may be for one engine and profile, and why.

    Attributes:
        metric: name of a metric of every case (reports/metrics) or of this one; "*" for a known
            property that shows in any of them, with no value of its own.
        value: the largest absolute value that is still within, in the metric's unit.
        engine, profile: which runs it judges; "*" is any.
        why: the reason for the number.
        known: a known property of the engine that takes it outside; empty if it should be within.
        known_size: how far that property may take it; beyond, it is outside like any other. Where
            it is infinite, the size is that of a stored run; without one, what lies beyond the
            limit is not judged.
        known_least: how far it takes it at least, where that is known beforehand; 0 where it is not.
        covers_none: whether the property explains too that a run has no such number where the truth has one.
        predicts: how far it takes it by the engine's settings (`under`); None where they do not matter.
        near: part of what is predicted by which a run may be off.
    """

    metric: str
    value: float = 0.0
    engine: str = "*"
    profile: str = "*"
    why: str = ""
    known: str = ""
    known_size: float = math.inf
    known_least: float = 0.0
    covers_none: bool = False
    predicts: Prediction | None = None
    near: float = 0.0

    def under(self, settings: Mapping[str, Any]) -> Limit:
        """Return the limit of a run with these settings; they have no size where nothing predicts one."""
        if self.predicts is None:
            return self
        size = self.predicts(settings)
        if isinstance(size, str):
            known = f"{self.known}; no prediction for {size}"
            return replace(self, known=known, known_least=0.0, known_size=math.inf)
        return replace(self, known_least=size * (1.0 - self.near), known_size=size * (1.0 + self.near))

    def covers(self, engine: str, profile: str) -> bool:
        """Whether this limit judges that run."""
        return self.engine in ("*", engine) and self.profile in ("*", profile)


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """One number that must come out, for example 7 transitions.

    Attributes:
        metric: the metric that counts or measures it.
        expected: the number, in the metric's unit.
        tier: how it is known.
        source: where it comes from.
    """

    metric: str
    expected: float
    tier: Tier
    source: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Chaos:
    """That neighbouring motions of a case part, so that no integrator can be trusted to its horizon.

    Attributes:
        until: up to when two independent integrators must agree all the same, s.
        why: what multiplies differences.
    """

    until: float
    why: str


@checked_fields
@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A scene, complete: any engine can build its own model from it.

    Attributes:
        name, variant: which case; `title` says it in words.
        mechanism: name of the equations in crossbody.reference.systems, or the path of a file of
            one's own with them; "scene" where they are those of every scene.
        parameters: every parameter of the case, resolved, SI.
        coordinates: names and units of q.
        contacts: names of the constraint rows.
        q0 (nq,), v0 (nv,): start.
        velocities: names and units of v, as of positions; those of q where v = q'.
        quaternions: index in q of the first of the four entries of every quaternion, w first.
        t_end: horizon, s.
        law: constants of every row.
        real_time: those of an engine that integrates collisions which take no time in the case;
            None for `law`.
        fsm: machine that switches the rows: "level", "edge" or "memoryless".
        collisions: rule for several contacts: "sequential", "simultaneous" or "resolved".
        closed_form: the exact motion at given times, where one exists (tier A).
        inputs: what acts from outside; None for nothing.
        control: a callable of the user's own that gives a scene's controls at its ticks, beside the inputs.
        claims: numbers that must come out.
        metrics: numbers that runs of this case show beside those that every case has, by name.
        limits: how far engines may be from the truth.
        act0 (na,): activations at the start, of those actuators of the scene that have one; 0 if not given.
        rank: how many rows of a scene's loops hold; below 0 those that surely do (a loop may be
            near dependent).
        scene: bodies, joints and what acts between them, of which engines build their models; the
            reference takes the kernels of `mechanism` where there are some. `file` is where it
            was read from, `findings` what is strange.
        force: what acts on the scene beside its parts; the kernels of `mechanism` have it.
        gates: rows beside those of the scene, and what opens and closes them; the kernels of
            `mechanism` have theirs.
        form: (case, whether servos act, whether inputs stand for a sampled controller) -> the
            case on a scene, for engines, where its own coordinates are others.
        consistent: whether the start stands on the rows that are always on; False where it is off
            them on purpose, to show how the law brings it back.
        controls: names, with units, of the inputs that a controller among the equations of `mechanism` sets.
        discrete: names of the discrete variables that `Trajectory.switches` counts by index.
        tight: tolerance at which the reference stands for the truth; larger where a stiff spring on a
            small mass makes rounding count before that (kp eps |q|/m against the tolerance of a velocity).
        chaos: declared where the truth cannot be trusted to the horizon; None where it must be.
    """

    name: str
    variant: str
    title: str
    mechanism: str
    parameters: Mapping[str, Value]
    coordinates: tuple[Coordinate, ...]
    contacts: tuple[str, ...]
    q0: Floats
    v0: Floats
    t_end: float
    law: Law
    real_time: Law | None = None
    fsm: str = "level"
    collisions: str = "sequential"
    closed_form: Callable[[Floats], Trajectory] | None = None
    inputs: Inputs | None = None
    control: Control | None = None
    claims: tuple[Claim, ...] = ()
    metrics: Mapping[str, CaseMetric] = field(default_factory=lambda: MappingProxyType({}))
    limits: tuple[Limit, ...] = ()
    controls: tuple[str, ...] = ()
    discrete: tuple[str, ...] = ()
    tight: float = 1e-13
    chaos: Chaos | None = None
    consistent: bool = True
    scene: Scene | None = None
    force: Force | None = None
    gates: Gates | None = None
    form: Callable[..., Form] | None = None
    rank: int = -1
    act0: Floats = field(default_factory=lambda: np.zeros(0))
    velocities: tuple[Coordinate, ...] = ()
    quaternions: tuple[int, ...] = ()
    file: str = ""
    findings: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))

    def __post_init__(self) -> None:
        """Check shapes against each other and freeze the mappings."""
        object.__setattr__(self, "velocities", self.velocities or self.coordinates)
        for name, of in (("q0", self.coordinates), ("v0", self.velocities)):
            object.__setattr__(self, name, frozen(f"Case {self.name}", name, getattr(self, name), (len(of),)))
        count = len(self.scene.activated) if self.scene is not None else 0
        act0 = np.zeros(count) if np.size(self.act0) == 0 else self.act0
        object.__setattr__(self, "act0", frozen(f"Case {self.name}", "act0", act0, (count,)))
        for name in ("q0", "v0", "act0"):
            if not np.isfinite(start := getattr(self, name)).all():
                raise SceneError(f"Case {self.name}: {name} is {start.tolist()}; it must be finite.")
        if len(self.law.a0) != len(self.contacts):
            raise SceneError(
                f"Case {self.name} names {len(self.contacts)} contacts but its law has {len(self.law.a0)} rows."
            )
        if not (math.isfinite(self.t_end) and self.t_end > 0):
            raise InvalidValue(f"Case {self.name}: t_end is {self.t_end}; it must be finite and above 0 s.")
        for name, part in (("a force", self.force), ("gates", self.gates)):
            if part is not None and (self.general or self.scene is None):
                what = "is no scene" if self.scene is None else "has no kernels of its own"
                raise SceneError(f"Case {self.name} has {name} but {what}.")
        self._put_control()
        object.__setattr__(self, "parameters", MappingProxyType(dict(self.parameters)))
        object.__setattr__(self, "units", MappingProxyType(dict(self.units)))
        object.__setattr__(self, "metrics", MappingProxyType(dict(self.metrics)))

    def _put_control(self) -> None:
        """Tell a controller its inputs; bring its ticks to the horizon and to instants of other inputs."""
        control, scene, inputs = self.control, self.scene, self.inputs
        if control is None:
            return
        if scene is None or not scene.actuators:
            what = "is not a scene" if scene is None else "has no actuators"
            raise SceneError(f"Case {self.name} has a control but {what}.")
        if inputs is not None and inputs.values[:, : len(scene.actuators)].any():
            raise SceneError(f"Case {self.name}: inputs hold controls, and there is a control; valid: one of them.")
        control = replace(control, names=scene.inputs, width=len(scene.actuators)).fitted(self.t_end)
        object.__setattr__(self, "control", control)
        if inputs is not None:
            object.__setattr__(self, "inputs", replace(inputs, times=control.on_ticks(inputs.times)))

    @property
    def general(self) -> bool:
        """Whether its equations are those of every scene: a robot's file, a scene without own kernels."""
        return self.mechanism == "scene"

    @property
    def rubs(self) -> bool:
        """Whether contacts, joints or tendons of its scene have friction."""
        from crossbody.cases.scene_contacts import frictional  # which needs scenes, and these this module's errors

        return self.general and self.scene is not None and frictional(self.scene) is not None

    @property
    def label(self) -> str:
        """Name and variant in one word."""
        return f"{self.name}:{self.variant}"

    @checked_arguments
    def number(self, parameter: str) -> float:
        """One parameter as a float.

        Raises:
            UnknownName: if the case does not have it.
            InvalidValue: if it is a word.
        """
        if parameter not in self.parameters:
            raise UnknownName(f"parameter of {self.label}", parameter, self.parameters)
        return real(f"{self.label}: {parameter}", self.parameters[parameter])


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseMetric:
    """How a case measures one number; its name is its key in `Case.metrics`. One of the three functions is given.

    Attributes:
        doc: what it measures, one line.
        unit: SI unit, "1" for a ratio or a count.
        number: of (run, case), the number itself; None where there is none, NaN where the run
            does not show it.
        signal: of (run, case), values (n, k) at the run's samples: the number is their largest
            difference from the truth's, on arcs between matched events; None where there are none.
        instants: of (run, case), times (m,), s, in order: the number is their largest difference
            from the truth's, None where the truth has none or another number of them.
        always: whether every run is measured; else where the case claims or limits it.
    """

    doc: str
    unit: str = "1"
    number: Callable[[Trajectory, Case], float | None] | None = None
    signal: Callable[[Trajectory, Case], Floats | None] | None = None
    instants: Callable[[Trajectory, Case], Floats] | None = None
    always: bool = False

    def __post_init__(self) -> None:
        """Check that there is one function."""
        given = [name for name in ("number", "signal", "instants") if getattr(self, name) is not None]
        if len(given) != 1:
            raise InvalidValue(
                f"A metric of a case has exactly one of number, signal and instants; given: {given or 'none'}."
            )
