"""Hardware logs: formats, column maps, checks, and what is read as one frozen type.

    log = read("run17.mf4", "delta.toml", repair=("fill_dropped",))
    log.time, log.matrix("coordinates"), log.channel("sensors", "touch1").values

A log that `store` wrote needs no map. A log too large for the memory is gone through by `scan`; `check` tells
everything that is doubtful about one, `survey` what is in a file without a description.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from crossbody.hw import models
    from crossbody.hw.checks.finding import Finding
    from crossbody.hw.fitting.fit import Agreement, Estimate, Fit
    from crossbody.hw.fitting.identify import identify
    from crossbody.hw.reading.columns import (
        Columns,
        Role,
        Signal,
        Time,
        dump_columns,
        load_columns,
        maps,
        parse_columns,
    )
    from crossbody.hw.reading.log import Channel, Log, Provenance, Repair
    from crossbody.hw.reading.read import Scan, check, parts, read, scan
    from crossbody.hw.reading.store import store
    from crossbody.hw.reading.stream import Rows
    from crossbody.hw.reading.survey import GroupSurvey, Survey, draft_text, survey
    from crossbody.hw.replaying.comparison import Comparison, Prediction
    from crossbody.hw.replaying.inverse import Inferred, estimate_force, inverse
    from crossbody.hw.replaying.replay import replay
    from crossbody.hw.replaying.sensors import Sensor, unlagged
    from crossbody.hw.replaying.tracked import track_force
    from crossbody.hw.synthetic import Plant, Push, Sensors, delta_log, delta_plant

_HOMES = {
    "reading.columns": ("Columns", "Role", "Signal", "Time", "dump_columns", "load_columns", "maps", "parse_columns"),
    "replaying.comparison": ("Comparison", "Prediction"),
    "checks.finding": ("Finding",),
    "fitting.fit": ("Agreement", "Estimate", "Fit"),
    "fitting.identify": ("identify",),
    "replaying.inverse": ("Inferred", "estimate_force", "inverse"),
    "reading.log": ("Channel", "Log", "Provenance", "Repair"),
    "reading.read": ("Scan", "check", "parts", "read", "scan"),
    "replaying.replay": ("replay",),
    "reading.stream": ("Rows",),
    "replaying.tracked": ("track_force",),
    "replaying.sensors": ("Sensor", "unlagged"),
    "reading.store": ("store",),
    "synthetic": ("Plant", "Push", "Sensors", "delta_log", "delta_plant"),
    "reading.survey": ("GroupSurvey", "Survey", "draft_text", "survey"),
}
_LAZY = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "Agreement",
    "Channel",
    "Columns",
    "Comparison",
    "Estimate",
    "Finding",
    "Fit",
    "GroupSurvey",
    "Inferred",
    "Log",
    "Plant",
    "Prediction",
    "Provenance",
    "Push",
    "Repair",
    "Role",
    "Rows",
    "Scan",
    "Sensor",
    "Sensors",
    "Signal",
    "Survey",
    "Time",
    "check",
    "delta_log",
    "delta_plant",
    "draft_text",
    "dump_columns",
    "estimate_force",
    "identify",
    "inverse",
    "load_columns",
    "maps",
    "models",
    "parse_columns",
    "parts",
    "read",
    "replay",
    "scan",
    "store",
    "survey",
    "track_force",
    "unlagged",
]


def __getattr__(name: str) -> Any:
    """Import what is asked for; an absent package is an error that names the extra."""
    if name == "models":
        return import_module("crossbody.hw.models")
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        return getattr(import_module(f"crossbody.hw.{_LAZY[name]}"), name)
    except ModuleNotFoundError as error:
        from crossbody.hw.formats import unavailable

        raise unavailable("Reading logs", error) from None
