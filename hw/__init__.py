"""Hardware logs: formats, column maps, checks, and what is read as one frozen type.

    log = read("run17.mf4", "delta.toml", repair=("fill_dropped",))
    log.time, log.matrix("coordinates"), log.channel("sensors", "touch1").values

A log that `store` wrote needs no map. A log too large for the memory is gone through by `scan`; `check` tells
everything that is doubtful about one, `survey` what is in a file that nobody has described yet.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from crossbody.hw import models
    from crossbody.hw._columns import Columns, Role, Signal, Time, dump_columns, load_columns, maps, parse_columns
    from crossbody.hw._comparison import Comparison, Prediction
    from crossbody.hw._draft import draft_text
    from crossbody.hw._finding import Finding
    from crossbody.hw._fit import Estimate, Fit
    from crossbody.hw._identify import identify
    from crossbody.hw._inverse import Inferred, estimate_force, inverse
    from crossbody.hw._log import Channel, Log, Provenance, Repair
    from crossbody.hw._read import Scan, check, parts, read, scan
    from crossbody.hw._replay import replay
    from crossbody.hw._rows import Rows
    from crossbody.hw._sensors import Sensor, unlagged
    from crossbody.hw._store import store
    from crossbody.hw._survey import GroupSurvey, Survey, survey
    from crossbody.hw._synthetic_log import Sensors, delta_log
    from crossbody.hw._synthetic_plant import Plant, Push, delta_plant

_HOMES = {
    "_columns": ("Columns", "Role", "Signal", "Time", "dump_columns", "load_columns", "maps", "parse_columns"),
    "_comparison": ("Comparison", "Prediction"),
    "_draft": ("draft_text",),
    "_finding": ("Finding",),
    "_fit": ("Estimate", "Fit"),
    "_identify": ("identify",),
    "_inverse": ("Inferred", "estimate_force", "inverse"),
    "_log": ("Channel", "Log", "Provenance", "Repair"),
    "_read": ("Scan", "check", "parts", "read", "scan"),
    "_replay": ("replay",),
    "_rows": ("Rows",),
    "_sensors": ("Sensor", "unlagged"),
    "_store": ("store",),
    "_synthetic_log": ("Sensors", "delta_log"),
    "_synthetic_plant": ("Plant", "Push", "delta_plant"),
    "_survey": ("GroupSurvey", "Survey", "survey"),
}
_LAZY = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
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
    "unlagged",
]


def __getattr__(name: str) -> Any:
    """Import what is asked for; an absent package is an error that names the extra.

    Raises:
        FormatUnavailable: if msgspec or another package of the extra `logs` is not installed.
    """
    if name == "models":
        return import_module("crossbody.hw.models")
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        return getattr(import_module(f"crossbody.hw.{_LAZY[name]}"), name)
    except ModuleNotFoundError as error:
        from crossbody.hw.formats import unavailable

        raise unavailable("Reading logs", error) from None
