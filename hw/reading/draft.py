"""A first column map for a file, guessed from the names of its columns."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Literal

import msgspec

from crossbody.cases import InvalidValue, arguments
from crossbody.hw.reading.clock_guess import last_word, looks_like_time
from crossbody.hw.reading.columns import Columns, Role, Signal, Time, dump_columns, safe_name
from crossbody.hw.reading.survey import GroupSurvey, Survey, largest
from crossbody.hw.reading.units import to_si

if TYPE_CHECKING:
    from crossbody.hw.formats import Column

PATTERNS = (
    (Role.VELOCITIES, r"(v|w|dq|qd|dth|vel|velocity|omega|rate|speed)\w{0,3}(\[\d+\])?"),
    (Role.COORDINATES, r"(q|th|theta|phi|angle|pos|position|enc|encoder)\w{0,3}(\[\d+\])?|[xyz]\d?|p[xyz]"),
    (Role.INPUTS, r"(u|tau|torque|cmd|command|effort)\w{0,3}(\[\d+\])?"),
    (Role.REFERENCES, r"(r|ref|reference|target|setpoint|des|desired)\w{0,3}(\[\d+\])?"),
)
USUAL = {Role.COORDINATES: "rad", Role.VELOCITIES: "rad/s", Role.INPUTS: "N m", Role.REFERENCES: "1", Role.SENSORS: "1"}
ADMITTED = {Role.COORDINATES: ("rad", "m", "1"), Role.VELOCITIES: ("rad/s", "m/s", "1/s")}


def draft(found: Survey) -> Columns:
    """A map that reads what was surveyed; see `Survey.draft`."""
    main = largest(arguments.instance("found", found, Survey, "what `survey` found").groups)
    unit = main.clock.unit if main.clock else None
    tables: dict[str, dict[str, Signal]] = {role.value: {} for role in Role}
    for group in (main, *(g for g in found.groups if g is not main and g.clock and g.clock.unit == unit)):
        for one in group.columns:
            if not looks_like_time(one.column.name) and not (group.clock and one.column.name == group.clock.column):
                _add(tables, one.column, group, group is main)
    step = None if main.clock or main.group.step else 1.0
    time = Time(column=main.clock.column if main.clock else "", unit=unit, sample_time=step)
    joined = any(signal.time for table in tables.values() for signal in table.values())
    how: Literal["hold", "exact"] = "hold" if joined else "exact"
    columns = Columns(format=found.format, options=dict(found.options), join=how, time=time)
    return msgspec.structs.replace(columns, **tables)


def _add(tables: dict[str, dict[str, Signal]], column: Column, group: GroupSurvey, own: bool) -> None:
    unit, word = _si(column), last_word(column.name)
    role = next((role for role, pattern in PATTERNS if re.fullmatch(pattern, word)), Role.SENSORS)
    if unit is not None and unit not in ADMITTED.get(role, (unit,)):
        role = Role.SENSORS
    table = tables[role.value]
    name = safe_name(word + "".join(re.findall(r"\[\d+\]$", column.name)))
    if name in table:
        name = safe_name(column.name)
    while name in table:
        name += "_"
    clock = "" if own or group.clock is None else group.clock.column
    table[name] = Signal(column=column.name, unit=None if unit is not None else USUAL[role], time=clock)


def _si(column: Column) -> str | None:
    """SI unit of what the file calls the column's unit; None if it says nothing that can be understood."""
    try:
        return to_si(column.unit).si if column.unit else None
    except InvalidValue:
        return None


def draft_text(found: Survey) -> str:
    """The draft as TOML, with what was guessed in a comment above."""
    columns = draft(found)
    guessed = [f"{role.value}.{name} [{s.unit}]" for role, name, s in columns.signals() if s.unit is not None]
    lines = ["# Draft: roles and names are guessed from the columns' names; check every line."]
    if guessed:
        lines.append("# Units that the file does not tell, guessed: " + ", ".join(guessed))
    if columns.time.sample_time is not None:
        lines.append("# No column of times was found: set the sample time, s.")
    return "\n".join([*lines, dump_columns(columns)])
