"""What a run of this version gave: the size of every known deviation, and the band in which numbers stay.

`stored.json` beside this file is made by one command (`make bands`) and committed; it holds the deviation of every
number from what is claimed, by case and variant, engine and profile, to three digits.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from crossbody.cases import Case

if TYPE_CHECKING:
    from crossbody.reports.judging.comparison import Entry

FILE = Path(__file__).with_name("stored.json")
Deviations = Mapping[str, float]


def words(settings: Mapping[str, Any]) -> str:
    """Settings of an engine in one line."""
    return " ".join(f"{k}={v:g}" if isinstance(v, float) else f"{k}={v}" for k, v in settings.items())


def deviations(case: Case, entry: Entry) -> Deviations:
    """Metric -> deviation of the stored run with the same parameters and settings; empty where there is none.

    A number that the stored run did not have is NaN.
    """
    stored = _table().get(case.label, {})
    if stored.get("parameters") != _digest(case):
        return {}
    run = stored["runs"].get(f"{entry.engine}:{entry.profile}")
    if run is None or run["settings"] != words(entry.settings):
        return {}
    return {metric: float(value) for metric, value in run["deviations"].items()}


def defaults(case: Case, entry: Entry) -> str:
    """Settings, in words, that the engine had by itself in the stored run with the same parameters; empty without."""
    stored = _table().get(case.label, {})
    if stored.get("parameters") != _digest(case):
        return ""
    return str(stored["runs"].get(f"{entry.engine}:{entry.profile}", {}).get("settings", ""))


def differing(case: Case, entry: Entry) -> frozenset[str]:
    """What was looked at in the stored run of that variant, engine and profile, whatever its parameters."""
    run = _table().get(case.label, {}).get("runs", {}).get(f"{entry.engine}:{entry.profile}")
    return frozenset() if run is None else frozenset(run["deviations"])


@cache
def _table() -> dict[str, Any]:
    found: dict[str, Any] = json.loads(FILE.read_text(encoding="utf-8")) if FILE.is_file() else {}
    return found


def _digest(case: Case) -> str:
    text = repr(sorted(case.parameters.items())) + f"{case.t_end!r}"
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def write(measured: Iterable[tuple[Case, Entry, Deviations]]) -> None:
    """Put runs in the place of those that are stored of the same cases and engines; others stay.

    So do runs with the same parameters of engines that are not installed here.
    """
    table = dict(_table())
    fresh: dict[str, Any] = {}
    for case, entry, found in measured:
        if case.label not in fresh:
            old, digest = table.get(case.label, {}), _digest(case)
            kept = dict(old["runs"]) if old.get("parameters") == digest else {}
            fresh[case.label] = {"parameters": digest, "runs": kept}
        fresh[case.label]["runs"][f"{entry.engine}:{entry.profile}"] = {
            "settings": words(entry.settings),
            "deviations": {metric: _short(value) for metric, value in sorted(found.items())},
        }
    lines = [f"{json.dumps(label)}: {_block(runs)}" for label, runs in sorted((table | fresh).items())]
    FILE.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
    _table.cache_clear()


def _block(stored: Mapping[str, Any]) -> str:
    """One case, a line an engine."""
    runs = ",\n  ".join(f"{json.dumps(who)}: {json.dumps(run)}" for who, run in stored["runs"].items())
    return f'{{"parameters": {json.dumps(stored["parameters"])}, "runs": {{\n  {runs}}}}}'


def _short(value: float) -> float | str:
    """Three digits; a word for what JSON has no number for."""
    return float(f"{value:.3g}") if math.isfinite(value) else str(value)
