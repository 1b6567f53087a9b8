"""How much of an error is importer's, model's and step's, and what makes it smaller."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

from crossbody.reports.judging.parts import LARGEST, PARTS, part_of
from crossbody.reports.judging.verdict import Row

NOTICED = 1e-3
"""Part of an error below which nobody asks where it is from."""
SHORTER = 4.0
"""So many times shorter a step shows whether the error falls with it."""
_STEP = re.compile(r"\bdt=(\S+)")
DOES = {
    "importer": "the engine reads the file in another way: crossbody audit shows where",
    "model": "no shorter step makes it smaller, but other constants of the engine's model, or another profile, may",
}
"""What makes each part smaller, but for the step, whose setting depends on the run."""


def remedy(who: str, rows: Sequence[Row], metric: str) -> str:
    """Say which part of a run's error is how large, and what makes it smaller; nothing where no step is known.

    Args:
        who: engine:profile.
        rows: of that run.
        metric: of which error.
    """
    own = {row["metric"]: row for row in rows}
    step = _shorter(who, own[metric]) if metric in own else ""
    parts = {part: own[name] for part in PARTS if (name := part_of(metric, part)) in own}
    if not parts or not step:
        return ""
    shares = {part: _number(row["value"]) / abs(own[metric]["value"]) for part, row in parts.items()}
    if not all(map(math.isfinite, shares.values())):
        test = f"if {step} makes it smaller, it is the step's"
        return f"What is model and what step is not known: {test}"
    most = max(shares, key=lambda part: abs(shares[part]))
    does = DOES.get(most, f"{step} makes it smaller{_at_best(own, metric)}")
    told = ", ".join(_told(parts, shares, own[metric]))
    return f"Its parts: {told}; {does}"


def _at_best(own: Mapping[str, Row], metric: str) -> str:
    """Say below what no step brings an error whose largest is the step's: its model alone is off somewhere, too."""
    row = own.get(f"{LARGEST} {part_of(metric, 'model')}")
    least = math.nan if row is None else abs(_number(row["value"]))
    if row is None or not least > _number(row.get("known")):
        return ""
    if least >= abs(own[metric]["value"]):
        return f" there, but elsewhere the model alone is off by {least:.2g}"
    return f", to {least:.2g} at best: by so much the model alone is off at another instant"


def _number(value: float | None) -> float:
    """Return a number; NaN where a folder has none."""
    return math.nan if value is None else value


def _shorter(who: str, row: Row) -> str:
    """Say how a shorter step is asked for, where the engine has one."""
    found = _STEP.search(row.get("settings") or "")
    return f"a shorter step (--set-engine {who.partition(':')[0]}.dt={float(found[1]) / SHORTER:g})" if found else ""


def _told(parts: Mapping[str, Row], shares: Mapping[str, float], whole: Row) -> list[str]:
    """Return each part in per cent, with its sign, the largest first; those that nobody would notice are left out."""
    told = []
    for part in sorted(parts, key=lambda part: -abs(shares[part])):
        known = _number(parts[part].get("known")) / abs(whole["value"])
        size, below = (known, "below ") if abs(shares[part]) < known else (shares[part], "")
        if abs(size) >= NOTICED:
            told.append(f"{part} {below}{100.0 * size:.3g} %")
    return told
