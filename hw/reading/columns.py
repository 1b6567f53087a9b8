"""Column maps: which column of a log is which signal of the model, in TOML.

about = "delta rig, 2024"            # optional words
format = "csv"                       # optional; recognised by the file's beginning
options = { delimiter = ";" }        # optional; of the format

[time]
column = "t"
unit = "ms"
sample_time = 0.88e-3                # nominal, s

[coordinates.q11]                    # also velocities, inputs, references, sensors
column = "enc1"
unit = "deg"                         # SI = unit of (sign (scale raw + offset))
sign = -1
delay = 0.88e-3                      # s: what stands at t was true at t - delay
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec

from crossbody.cases import ColumnMapError, FormatUnavailable, InvalidValue, arguments
from crossbody.cases.regular import open_regular
from crossbody.hw.reading.published import MAPS, names
from crossbody.hw.reading.units import to_si

LARGEST = 1 << 20  # bytes of a map
MOST_DOTS = 256  # of a line: TOML parsers take the square of a key's parts
LONGEST = 300  # characters of a parser's own words
Name = Annotated[str, msgspec.Meta(min_length=1, max_length=64)]


class Role(StrEnum):
    """What a signal is to the model."""

    COORDINATES = "coordinates"
    VELOCITIES = "velocities"
    INPUTS = "inputs"
    REFERENCES = "references"
    SENSORS = "sensors"

    @property
    def measured(self) -> bool:
        """Whether such a signal is measured, not commanded."""
        return self not in (Role.INPUTS, Role.REFERENCES)


class Signal(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True, omit_defaults=True):
    """One column and how it becomes SI: `unit` of sign (scale raw + offset).

    Attributes:
        column: name of the column.
        unit: unit after scale and offset; the file's own if not given.
        scale, offset, sign: from the raw number to that unit.
        delay: what stands at t was true at t - delay, s. Nothing is shifted: a `Channel` carries it.
        range: smallest and largest plausible value, in `unit`.
        time: column of times of this signal, where its rows are not those of `[time]`.
    """

    column: str
    unit: str | None = None
    scale: float = 1.0
    offset: float = 0.0
    sign: Literal[1, -1] = 1
    delay: float = 0.0
    range: tuple[float, float] | None = None
    time: str = ""


class Time(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True, omit_defaults=True):
    """Where the times are.

    Attributes:
        column: name of the column; the rows are counted if not given.
        unit: a unit of time, or "sample" for a column that counts samples.
        scale: the raw number times this is in `unit` (clock ticks).
        sample_time: nominal time between samples, s.
    """

    column: str = ""
    unit: str | None = None
    scale: float = 1.0
    sample_time: float | None = None


class Columns(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True, omit_defaults=True):
    """A column map.

    Attributes:
        about: words for the report.
        format: name of the log's format; recognised if not given.
        options: of the format.
        synthetic: whether the log was computed, not measured.
        part: column of whole numbers that tells apart the runs in one file.
        join: how signals with times of their own come to the rows of `[time]`: "exact" (the times
            must be equal), "hold" (the last sample before) or "linear".
        time: where the times are.
        coordinates, velocities, inputs, references, sensors: signals by the model's names.
    """

    about: str = ""
    format: str | None = None
    options: dict[str, Any] = {}
    synthetic: bool = False
    part: str = ""
    join: Literal["exact", "hold", "linear"] = "exact"
    time: Time
    coordinates: dict[Name, Signal] = {}
    velocities: dict[Name, Signal] = {}
    inputs: dict[Name, Signal] = {}
    references: dict[Name, Signal] = {}
    sensors: dict[Name, Signal] = {}

    def signals(self) -> Iterator[tuple[Role, str, Signal]]:
        """Every signal with its role and its name in the model."""
        for role in Role:
            for name, signal in getattr(self, role.value).items():
                yield role, name, signal


def load_columns(source: str | Path) -> Columns:
    """Read a column map.

    Args:
        source: a TOML file, or the name of one of `maps()`.

    Raises:
        ColumnMapError: with the path of the key, for what is not TOML, an unknown key, a wrong
            type, a number that is not finite or a unit that does not exist.
    """
    path = Path(arguments.path("columns", source))
    if str(source) in maps():
        path = MAPS / f"{source}.toml"
    try:
        with open_regular(path) as file:
            text = file.read(LARGEST + 1)
    except (OSError, ValueError) as error:
        known = ", ".join(maps())
        reason = getattr(error, "strerror", None) or str(error)
        raise ColumnMapError(path, "$", f"cannot be read ({reason}); name a TOML file or one of: {known}.") from None
    if len(text) > LARGEST:
        raise ColumnMapError(path, "$", "is larger than a megabyte, which no column map is.")
    return parse_columns(text, path)


def parse_columns(text: bytes | str, path: str | Path = "column map") -> Columns:
    """A column map from TOML text; see `load_columns`."""
    path = arguments.path("path", path)
    if not isinstance(text, (bytes, str)):
        raise InvalidValue(f"text is {arguments.shown(text)}; it must be TOML, as text or bytes.")
    raw = text.encode("utf-8", "replace") if isinstance(text, str) else text
    if any(line.count(b".") > MOST_DOTS for line in raw.split(b"\n")):
        raise ColumnMapError(path, "$", f"has a line of more than {MOST_DOTS} dots, deeper than any key.")
    try:
        found = msgspec.toml.decode(text)
    except (msgspec.DecodeError, ValueError, RecursionError) as error:  # a number of 5,000 digits is a ValueError
        raise ColumnMapError(path, "$", f"is not TOML: {str(error)[:LONGEST]}.") from None
    _check_numbers(found, "$", path)
    _signals_one_by_one(found, path)
    columns: Columns = _convert(found, Columns, "$", path)
    _check(columns, path)
    return columns


def _check_numbers(value: Any, key: str, path: str | Path) -> None:
    """Refuse whole numbers beyond the 64 bits of TOML, which Python takes: no message could show them."""
    if isinstance(value, int) and not -(2**63) <= value < 2**63:
        raise ColumnMapError(path, key, "is a whole number of more than 64 bits.")
    inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for name, one in inside:
        _check_numbers(one, f"{key}.{name}", path)


def dump_columns(columns: Columns) -> str:
    """The TOML text of a map; it reads back as the same map."""
    arguments.instance("columns", columns, Columns, "a column map")
    try:
        return msgspec.toml.encode(columns).decode()
    except ImportError as error:  # msgspec's own words do not name our extra
        raise FormatUnavailable(f"Writing a column map needs tomli-w: pip install 'crossbody[logs]'. {error}") from None


def maps() -> tuple[str, ...]:
    """Names of the maps for published data sets that come along."""
    return names()


def _convert(value: Any, kind: Any, key: str, path: str | Path) -> Any:
    try:
        return msgspec.convert(value, kind, strict=True)
    except msgspec.ValidationError as error:
        told, _, where = str(error).partition(" - at `$")
        raise ColumnMapError(path, key + where.rstrip("`"), f"{told}.") from None


def _signals_one_by_one(found: Mapping[str, Any], path: str | Path) -> None:
    """Check every signal under its own name: msgspec calls all members of a table `[...]`."""
    for role in Role:
        table = found.get(role.value)
        for name, signal in table.items() if isinstance(table, dict) else ():
            _convert(signal, Signal, f"$.{role.value}.{name}", path)


def _check(columns: Columns, path: str | Path) -> None:
    if columns.time.sample_time is None and columns.time.unit == "sample":
        raise ColumnMapError(path, "$.time.sample_time", "is missing: a column that counts samples needs it.")
    if columns.time.sample_time is not None and not 0 < columns.time.sample_time < math.inf:
        raise ColumnMapError(path, "$.time.sample_time", f"is {columns.time.sample_time:g}; it must be above 0 s.")
    if columns.time.unit not in (None, "sample"):
        _unit(str(columns.time.unit), "$.time.unit", path, "s")
    _scale(columns.time.scale, "$.time.scale", path)
    if next(columns.signals(), None) is None:
        roles = ", ".join(role.value for role in Role)
        raise ColumnMapError(path, "$", f"has no signal; there must be one in {roles}.")
    for role, name, signal in columns.signals():
        _check_signal(signal, f"$.{role.value}.{name}", path)


def _check_signal(signal: Signal, key: str, path: str | Path) -> None:
    _scale(signal.scale, f"{key}.scale", path)
    for field in ("offset", "delay"):
        if not math.isfinite(getattr(signal, field)):
            raise ColumnMapError(path, f"{key}.{field}", f"is {getattr(signal, field)}; it must be finite.")
    if signal.range is not None and not signal.range[0] < signal.range[1]:
        raise ColumnMapError(path, f"{key}.range", f"is {list(signal.range)}; the first must be below the second.")
    if signal.unit is not None:
        _unit(signal.unit, f"{key}.unit", path)


def _scale(scale: float, key: str, path: str | Path) -> None:
    if not math.isfinite(scale) or scale == 0.0:
        raise ColumnMapError(path, key, f"is {scale}; it must be finite and not 0.")


def _unit(unit: str, key: str, path: str | Path, wanted: str = "") -> None:
    try:
        found = to_si(unit).si
    except InvalidValue as error:
        raise ColumnMapError(path, key, str(error)) from None
    if wanted and found != wanted:
        raise ColumnMapError(path, key, f"{unit!r} measures [{found}]; it must measure [{wanted}].")


def safe_name(text: str) -> str:
    """A name for a signal out of a column's name: letters, digits and underscores."""
    return re.sub(r"\W+", "_", text).strip("_")[:64] or "signal"
