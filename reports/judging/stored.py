"""What a run of this version gave: the size of what is expected-outside, and the band in which numbers stay.

`stored.json` beside this file is made by one command (`make bands`) and committed; it holds the
deviation of every number from what is claimed, by case and variant, engine and profile, to three digits.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from crossbody import engines
from crossbody.cases import Case
from crossbody.cases.defaults import limits_of

if TYPE_CHECKING:
    from crossbody.reports.judging.run_verdicts import Entry

FILE = Path(__file__).with_name("stored.json")
SAME_END = 0.01
"""Part of the horizon by which a comparison may end elsewhere than the stored one and still be the same."""
Deviations = Mapping[str, float]
Laid = tuple[str, dict[str, Any], str, dict[str, Any]]
"""What is stored of a run: label of its case, what its runs share, its engine, and its settings and numbers."""


def words(settings: Mapping[str, Any]) -> str:
    """Settings of an engine in one line."""
    return " ".join(f"{k}={v:g}" if isinstance(v, float) else f"{k}={v}" for k, v in settings.items())


def deviations(case: Case, entry: Entry, trusted: float) -> Deviations:
    """Metric -> deviation of the stored run with the same parameters and settings; empty where there is none.

    What was compared up to another instant than `trusted`, s, says nothing of this run. A number
    that the stored run did not have is NaN.
    """
    if not abs(compared_until(case) - min(trusted, case.t_end)) <= SAME_END * case.t_end:
        return {}
    run = _table()[case.label]["runs"].get(f"{entry.engine}:{entry.profile}")
    if run is None or run["settings"] != words(entry.settings):
        return {}
    return {metric: float(value) for metric, value in run["deviations"].items()}


def repeated(case: Case, entry: Entry) -> frozenset[str]:
    """Metrics of which the same version of an engine must give the stored numbers again, as it steps on a fixed grid.

    None of a comparison that ends before the horizon: where it ends decides what is the largest.
    """
    if not compared_until(case) >= case.t_end:
        return frozenset()
    run = _table()[case.label]["runs"].get(f"{entry.engine}:{entry.profile}", {})
    steady = run.get("steady")
    if steady is None or run["settings"] != words(entry.settings) or steady["versions"] != versions(entry.engine):
        return frozenset()
    return frozenset(run["deviations"]).difference(steady["but"])


def versions(engine: str) -> str:
    """Return the versions of an engine's packages in one line."""
    return ", ".join(f"{name} {version}" for name, version in sorted(engines.load(engine).versions.items()))


def defaults(case: Case, entry: Entry) -> str:
    """Settings, in words, that the engine had itself in the stored run of the same parameters; or none."""
    if math.isnan(compared_until(case)):
        return ""
    return str(_table()[case.label]["runs"].get(f"{entry.engine}:{entry.profile}", {}).get("settings", ""))


def compared_until(case: Case) -> float:
    """Return up to when the stored runs with the same parameters were compared, s; NaN without any."""
    stored = _table().get(case.label, {})
    return float(stored.get("compared", case.t_end)) if stored.get("parameters") == _digest(case) else math.nan


def judged_alike(case: Case) -> bool:
    """Whether limits and claims of a case are those of its stored runs; true where none are stored."""
    return math.isnan(compared_until(case)) or _table()[case.label].get("limits") == _limits(case)


def changed(case: Case) -> bool:
    """Whether runs of a case are stored, with other parameters: its limits are for those."""
    return case.label in _table() and math.isnan(compared_until(case))


def differing(case: Case, entry: Entry) -> frozenset[str]:
    """What was looked at in the stored run of that variant, engine and profile, whatever its parameters."""
    return frozenset(_numbers(case, entry))


def lacking(case: Case, entry: Entry) -> frozenset[str]:
    """What the stored run of that variant, engine and profile has no number of, whatever its settings."""
    return frozenset(metric for metric, value in _numbers(case, entry).items() if math.isnan(float(value)))


def _numbers(case: Case, entry: Entry) -> Mapping[str, float | str]:
    run = _table().get(case.label, {}).get("runs", {}).get(f"{entry.engine}:{entry.profile}", {"deviations": {}})
    numbers: Mapping[str, float | str] = run["deviations"]
    return numbers


@cache
def _table() -> dict[str, Any]:
    return json.loads(FILE.read_text(encoding="utf-8")) if FILE.is_file() else {}


def _digest(case: Case) -> str:
    text = repr(sorted(case.parameters.items())) + f"{case.t_end!r}"
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def _limits(case: Case) -> str:
    """Return a digest of all that decides what is outside, to six digits."""
    limits = [
        f"{x.metric} {x.engine} {x.profile} {x.value:.6g} {x.known_least:.6g} {x.known_size:.6g} {x.covers_none} "
        f"{x.known != ''}"
        for x in limits_of(case)
    ]
    claims = [f"{claim.metric} {claim.expected:.6g}" for claim in case.claims]
    return hashlib.sha256("\n".join([*limits, "", *claims]).encode()).hexdigest()[:12]


def laid(case: Case, entry: Entry, found: Deviations, trusted: float, unsteady: Iterable[str] | None = None) -> Laid:
    """Return what is stored of a run, as plain numbers that a process can send to another.

    Args:
        case: what ran.
        entry: its run.
        found: metric -> deviation.
        trusted: up to when it was compared, s.
        unsteady: metrics that a change of rounding moves, of an engine that steps on a fixed grid; None of others.
    """
    head: dict[str, Any] = {"parameters": _digest(case), "limits": _limits(case)}
    head |= {"compared": float(f"{trusted:.3g}")} if trusted < case.t_end else {}
    numbers = {
        metric: float(f"{value:.3g}") if math.isfinite(value) else str(value)  # JSON has no number for it
        for metric, value in sorted(found.items())
    }
    run: dict[str, Any] = {"settings": words(entry.settings), "deviations": numbers}
    if unsteady is not None:
        run["steady"] = {"versions": versions(entry.engine), "but": sorted(unsteady)}
    return case.label, head, f"{entry.engine}:{entry.profile}", run


def write(runs: Iterable[Laid]) -> None:
    """Put runs in the place of those that are stored of the same cases and engines; others stay.

    So do runs with the same parameters, compared as far, of engines that are not installed here.
    """
    table = dict(_table())
    fresh: dict[str, Any] = {}
    for label, head, who, run in runs:
        if label not in fresh:
            old = table.get(label, {})
            same = all(old.get(name) == head.get(name) for name in ("parameters", "compared"))
            kept = dict(old["runs"]) if old and same else {}
            fresh[label] = head | {"runs": kept}
        fresh[label]["runs"][who] = run
    lines = [f"{json.dumps(label)}: {_block(runs)}" for label, runs in sorted((table | fresh).items())]
    FILE.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
    _table.cache_clear()


def _block(stored: Mapping[str, Any]) -> str:
    """One case, a line an engine."""
    runs = ",\n  ".join(f"{json.dumps(who)}: {json.dumps(run)}" for who, run in stored["runs"].items())
    head = json.dumps({name: value for name, value in stored.items() if name != "runs"})
    return f'{head[:-1]}, "runs": {{\n  {runs}}}}}'
