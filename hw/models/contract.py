"""What a model must say so that a log can be replayed on it and its parameters identified."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from crossbody.cases import Case, Coordinate, Limit, Parameter, SceneError, Trajectory, UnknownName, Value, arguments
from crossbody.cases.arrays import Floats

if TYPE_CHECKING:
    from crossbody.hw.reading.log import Log

Numbers = Mapping[str, Value]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Segment:
    """What a model needs to know of one stretch of a log; its time begins at 0.

    Attributes:
        y, yd (k,): measured coordinates and their rates at the start.
        t_end: length, s.
        times (m,): when the recorded inputs change, s.
        inputs (m, nu): their values from then on.
    """

    y: Floats
    yd: Floats
    t_end: float
    times: Floats = field(default_factory=lambda: np.zeros(0))
    inputs: Floats = field(default_factory=lambda: np.zeros((0, 0)))


TORQUE = "N m"  # unit of the inputs of every model


def read_as_they_are(model: Model, log: Log) -> tuple[Floats, Floats | None]:
    """Measured coordinates (n, k), and their rates where the log has them."""
    names = [c.name for c in model.measured]
    known = log.names("velocities")
    rates = log.matrix("velocities", names) if all(name in known for name in names) else None
    return log.matrix("coordinates", names), rates


def see_by_hermite(model: Model, run: Trajectory, times: Floats) -> tuple[Floats, Floats]:
    """Measured coordinates and rates (m, k) of a run at given times: cubic between its samples."""
    seen = list(model.seen)
    keep = np.append(np.diff(run.t) > 0.0, True)  # behind an event
    t, q, v = run.t[keep], run.q[keep][:, seen], run.v[keep][:, seen]
    if len(t) == len(times) and np.array_equal(t, times):
        return q, v
    if len(t) < 2:
        return np.full((len(times), len(seen)), np.nan), np.full((len(times), len(seen)), np.nan)
    spline = CubicHermiteSpline(t, q, v)
    y, yd = spline(times), spline(times, 1)
    beyond = times > t[-1] + 1e-9
    y[beyond], yd[beyond] = np.nan, np.nan
    return y, yd


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """A mechanism with what a rig measures of it.

    Attributes:
        name, title: which model; the title says it in words.
        parameters: its numbers, with units and bounds.
        measured: names and units of what is compared; the coordinates that a log must have, but for `needs`.
        seen: which coordinates of the case they are.
        needs: names of the coordinates that a log must have, where they are others.
        inputs: names of the recorded torques that drive it, N m; a log without any of them is a free motion.
        forces: names of the case's further inputs: what acts besides, and may be estimated.
        build: (parameters, segment) -> the scene of one stretch.
        places: parameter -> its place in the parameter array of the reference, for exact derivatives;
            a model whose contacts open has none, and is differentiated by finite differences.
        loop: (parameters, segment, log) -> motion of one stretch under the model's own
            controller, which follows the recorded references; None where there is no controller.
        references: names of the references that the controller follows.
        read: the measured coordinates of a log, and their rates if it has them.
        see: the measured coordinates of a run at given times.
        turns: of each rotation among the compared coordinates, the first of the three that are
            its rotation vector.
        differ: (measured, predicted), both (n, k) -> what an identification makes small (n, k).
        engine: what runs it where derivatives are finite differences.
        falls: which compared coordinate jumps in its rate at impacts; -1 for none.
        restart: usual time between restarts, s; 0 for a free run.
        start_span: length of what a window's start is fitted to, s; 0 where the measured state
            itself is the start.
        settings: engine -> settings of the usual profile.
        why_not: engine -> the sentence why it cannot run the model.
        profiles: engine -> profile, where the usual one does not serve.
        limits: on metrics of its replays, judged by the commands: of shares (`fit`, `*_inside`)
            the least, of others the largest size; `held_out_worse` is that of an identification.
    """

    name: str
    title: str
    parameters: Mapping[str, Parameter]
    measured: tuple[Coordinate, ...]
    seen: tuple[int, ...]
    needs: tuple[str, ...] = ()
    inputs: tuple[str, ...] = ()
    forces: tuple[str, ...] = ()
    build: Callable[[Numbers, Segment], Case]
    places: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))
    loop: Callable[[Numbers, Segment, Log], Trajectory] | None = None
    references: tuple[str, ...] = ()
    read: Callable[[Model, Log], tuple[Floats, Floats | None]] = read_as_they_are
    see: Callable[[Model, Trajectory, Floats], tuple[Floats, Floats]] = see_by_hermite
    turns: tuple[int, ...] = ()
    differ: Callable[[Floats, Floats], Floats] = np.subtract
    engine: str = "reference"
    falls: int = -1
    restart: float = 0.0
    start_span: float = 0.0
    settings: Mapping[str, Mapping[str, Value]] = field(default_factory=lambda: MappingProxyType({}))
    why_not: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    profiles: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    limits: tuple[Limit, ...] = ()

    def numbers(self, given: Numbers | None = None) -> dict[str, Value]:
        """Every parameter: the given ones, checked, and the defaults."""
        if given is not None:
            arguments.instance(f"{self.name}: parameters", given, Mapping, "a table of names and values")
        found = {name: p.default for name, p in self.parameters.items()}
        for name, value in (given or {}).items():
            if name not in self.parameters:
                raise UnknownName(f"parameter of {self.name}", name, self.parameters)
            found[name] = self.parameters[name].checked(f"{self.name}: {name}", value)
        return found

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the coordinates that a log must have."""
        return self.needs or tuple(c.name for c in self.measured)

    def check_log(self, log: Log) -> None:
        """Whether a log is one of this mechanism."""
        from crossbody.hw.reading.log import Log

        have = arguments.instance("log", log, Log, "a log that was read").names("coordinates")
        lacking = [name for name in self.channels if name not in have]
        if lacking:
            raise SceneError(
                f"The log has no coordinate {', '.join(lacking)}, which {self.name} needs; it has: "
                f"{', '.join(have) or 'none'}. Name them so in the column map."
            )
        given = [name for name in self.inputs if name in log.names("inputs")]
        lacking = [name for name in self.inputs if name not in given]
        if given and lacking:
            raise SceneError(
                f"The log has the input {given[0]}, and no {', '.join(lacking)}, which drives "
                f"{self.name} too; an undriven joint needs a column of zeros."
            )
        wanted = {} if self.needs else {("coordinates", c.name): c.unit for c in self.measured}
        for (role, name), unit in (wanted | {("inputs", name): TORQUE for name in given}).items():
            if (told := log.channel(role, name).unit) != unit:
                raise SceneError(f"{role}.{name} of the log is in [{told}]; {self.name} takes it in {unit}.")
