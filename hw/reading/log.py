"""A log after reading: SI, checked, frozen."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import SceneError, UnknownName
from crossbody.cases.arrays import Floats
from crossbody.cases.entry_points import checked_arguments, checked_fields
from crossbody.hw.checks.finding import Finding
from crossbody.hw.reading.columns import Role


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Channel:
    """One signal.

    Attributes:
        role: what it is to the model.
        name: its name in the model.
        unit: SI unit.
        values (n,): in that unit.
        delay: the value at time t was true at t - delay, s.
        column: where it came from.
        range: smallest and largest plausible value, SI, if the map says so.
    """

    role: Role
    name: str
    unit: str
    values: Floats
    delay: float = 0.0
    column: str = ""
    range: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Repair:
    """A change of the recorded rows that was asked for.

    Attributes:
        name: "drop_duplicates", "fill_dropped", "unwrap" or "trim" (rows before the first sample
            of a joined signal).
        rows: number of rows removed, added, or at which an angle wrapped.
        row: row of the file where it happened first.
        t: its time, s.
    """

    name: str
    rows: int
    row: int
    t: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Provenance:
    """Where the numbers of a log come from.

    Attributes:
        file: path as it was given.
        sha256: of the file's bytes (of a folder: of its files, in the order of their names).
        format: name of the format.
        library: package that read it, with its version.
        columns: the column map as TOML.
        part: the run's number, where the file holds several.
        rows: rows in the file that belong to the log.
        origin: what was taken off integer times too large for a float64, in the column's own ticks.
        join: how signals with times of their own were brought to the log's rows; empty if there were none.
        repairs: what was changed because it was asked for.
        synthetic: True for a log that was computed: it is no measurement, whatever it is compared with.
        about: words of the map.
    """

    file: str
    sha256: str
    format: str
    library: str
    columns: str = ""
    part: int | None = None
    rows: int = 0
    origin: int = 0
    join: str = ""
    repairs: tuple[Repair, ...] = ()
    synthetic: bool = False
    about: str = ""


@checked_fields
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Log:
    """What a rig recorded: one time axis, its channels, where they come from, what is doubtful about them.

    Attributes:
        time (n,): s, strictly increasing.
        channels: in the order of the map.
        sample_time: nominal time between samples, s; the median of the first rows where the map does not say.
        provenance: file, hash, map, reader, repairs.
        findings: what the checks noticed and did not refuse: see `Finding.check`.
        filled (m,): rows that a repair made up, and no measurement.
    """

    time: Floats
    channels: tuple[Channel, ...]
    sample_time: float
    provenance: Provenance
    findings: tuple[Finding, ...] = ()
    filled: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    _index: Mapping[tuple[Role, str], int] = field(init=False, repr=False, default_factory=dict)

    def __post_init__(self) -> None:
        """Check shapes once and make every array read-only; large arrays are taken over, not copied."""
        time = _frozen("time", self.time, None)
        object.__setattr__(self, "time", time)
        made = tuple(replace(c, values=_frozen(f"{c.role}.{c.name}", c.values, len(time))) for c in self.channels)
        index = {(c.role, c.name): i for i, c in enumerate(made)}
        if len(index) < len(made):
            raise SceneError("Log.channels holds a role and name twice; they must differ.")
        object.__setattr__(self, "channels", made)
        object.__setattr__(self, "_index", MappingProxyType(index))

    def __len__(self) -> int:
        return len(self.time)

    @checked_arguments
    def channel(self, role: Role | str, name: str) -> Channel:
        """One channel."""
        try:
            return self.channels[self._index[Role(role), name]]
        except (KeyError, ValueError):
            known = (f"{c.role}.{c.name}" for c in self.channels)
            raise UnknownName("channel", f"{role}.{name}", known) from None

    @checked_arguments
    def names(self, role: Role | str) -> tuple[str, ...]:
        """Names of the channels of one role, in the order of the map."""
        return tuple(c.name for c in self.channels if c.role == role)

    @checked_arguments
    def matrix(self, role: Role | str, names: Iterable[str] | None = None) -> Floats:
        """Values (n, k) of channels of one role, a column each, in the order of `names` (all if not given).

        Raises:
            UnknownName: for a name that the log does not have.
        """
        found = [self.channel(role, name).values for name in (self.names(role) if names is None else names)]
        return np.column_stack(found) if found else np.zeros((len(self), 0))

    @checked_arguments
    def times(self, role: Role | str, name: str) -> Floats:
        """When the values of a channel were true: the log's times less the channel's delay (n,), s."""
        return self.time - self.channel(role, name).delay

    @checked_arguments
    def window(self, start: float, stop: float) -> Log:
        """The rows with start <= time < stop, s; nothing is copied.

        Raises:
            SceneError: if that leaves no row.
            InvalidValue: for what is no number.
        """
        a, b = np.searchsorted(self.time, (start, stop))
        if a >= b:
            raise SceneError(
                f"The log has no rows from {start:g} to {stop:g} s; it has {self.time[0]:g} to {self.time[-1]:g} s."
            )
        kept = tuple(replace(c, values=c.values[a:b]) for c in self.channels)
        filled = self.filled[(self.filled >= a) & (self.filled < b)] - a
        return replace(self, time=self.time[a:b], channels=kept, filled=filled)


def _frozen(name: str, values: Any, rows: int | None) -> Floats:
    array: Floats = np.asarray(values, dtype=np.float64)
    if array.ndim != 1 or (rows is not None and len(array) != rows) or not len(array):
        wanted = "(n,), n > 0" if rows is None else f"({rows},)"
        raise SceneError(f"Log {name} has shape {array.shape}; it must have shape {wanted}.")
    array = array.view()
    array.setflags(write=False)
    return array
