"""A failure made small: its parameters moved to the case's own while the run fails the same way."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import pandas as pd

from crossbody.cases import Outcome, Value
from crossbody.cases.loading import module
from crossbody.reports.judging.verdict import Word
from crossbody.reports.sweep import pools
from crossbody.reports.sweep.execute import CRASHED, REFUSED, SKIPPED, execute
from crossbody.reports.sweep.spec import Spec

TRIES, FEWEST, STEPS = 60, 6, 300_000
"""Runs that one failure may cost: fewer, to a least number, where they take more steps than this together."""
HALVES = 6  # how often a parameter that matters is moved half of what is left towards its default
KINDS = ("suite", "case", "variant", "engine", "profile", "outcome", "verdict")
COLUMNS = (*KINDS, "count", "why", "parameters", "tries", "command")
Fails = Callable[[Mapping[str, Value]], bool]


def failures(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows that are outside, and runs that ended before their horizon."""
    ended = ~rows["outcome"].isin([Outcome.FINISHED.value, SKIPPED, REFUSED])
    return rows[(rows["verdict"] == Word.OUTSIDE) | ended]


def reproducers(rows: pd.DataFrame, specs: Sequence[Spec], count: int, tell: Callable[[str], None]) -> pd.DataFrame:
    """The smallest scene found for the first failure of every kind: suite, scene, engine, outcome, verdict."""
    kinds = [group for _, group in failures(rows).groupby(list(KINDS), sort=False)]
    firsts = [(specs[int(group["index"].iloc[0])], group.iloc[0]) for group in kinds]
    small = [_as_it_came(*first) for first in firsts]
    for i, told in pools.surviving(_numbered, list(enumerate(firsts)), count):
        small[i] = told
        tell("{engine}:{profile} {case}: {outcome}".format(**firsts[i][1]))
    found = [
        {name: first[name] for name in (*KINDS, "why")} | {"count": len(group)} | told
        for group, (_, first), told in zip(kinds, firsts, small, strict=True)
    ]
    return pd.DataFrame(found, columns=list(COLUMNS))


def _numbered(task: tuple[int, tuple[Spec, pd.Series[Any]]]) -> tuple[int, dict[str, Any]]:
    number, first = task
    return number, _smallest(*first)


def _smallest(spec: Spec, first: pd.Series[Any]) -> dict[str, Any]:
    if first["outcome"] in (CRASHED, Outcome.TIME_LIMIT.value):  # a process or many seconds a try
        return _as_it_came(spec, first)
    tries = min(TRIES, max(FEWEST, STEPS // max(1, int(first["steps"]))))
    return _told(spec, first, *shrink(spec.parameters, defaults(spec), _same(spec, first), tries))


def _as_it_came(spec: Spec, first: pd.Series[Any]) -> dict[str, Any]:
    return _told(spec, first, spec.parameters, 0)


def _told(spec: Spec, first: pd.Series[Any], left: Mapping[str, Value], tries: int) -> dict[str, Any]:
    settings = dict(json.loads(first["settings"]))
    if first["outcome"] == Outcome.STEP_LIMIT.value:
        settings["max_steps"] = spec.max_steps
    return {"parameters": json.dumps(dict(left)), "tries": tries, "command": spec.command(settings, left)}


def defaults(spec: Spec) -> dict[str, Value]:
    """What the case itself has for each parameter of a run."""
    source = module(spec.case)
    preset = source.VARIANTS[spec.variant]
    return {name: preset.get(name, source.PARAMETERS[name].default) for name in spec.parameters}


def _same(spec: Spec, first: pd.Series[Any]) -> Fails:
    """Whether a run fails in the same way; the independent integrator is asked of finished ones."""
    second = spec.second and first["outcome"] == Outcome.FINISHED.value

    def fails(parameters: Mapping[str, Value]) -> bool:
        row = execute(replace(spec, parameters=dict(parameters), ends=False, second=second))
        return bool(row["outcome"] == first["outcome"] and row["verdict"] == first["verdict"])

    return fails


def shrink(
    parameters: Mapping[str, Value], own: Mapping[str, Value], fails: Fails, tries: int = TRIES
) -> tuple[dict[str, Value], int]:
    """Move parameters to their defaults: all the way if it still fails, else in part, then to a few digits.

    Return what has to be said, and how often was asked. A failure that does not repeat is returned
    as it came.
    """
    left, asked = dict(parameters), 0

    def still(changed: Mapping[str, Value]) -> bool:
        nonlocal asked
        asked += 1
        return asked <= tries and fails(changed)

    if not still(left):
        return left, asked
    for name in list(left):
        fewer = {key: value for key, value in left.items() if key != name}
        if still(fewer):
            left = fewer
    for name in list(left):
        for value in _nearer(left[name], own.get(name)):
            if value != left[name] and still({**left, name: value}):
                left[name] = value
                break
    return left, min(asked, tries)


def _nearer(value: Value, default: Value | None) -> Iterator[Value]:
    """Values between this and the default, the nearest to the default first; then this in few digits."""
    if isinstance(value, (bool, str)) or isinstance(default, (bool, str)) or default is None:
        return
    a, b = float(value), float(default)
    steps = [1.0 - 0.5**k for k in range(HALVES, 0, -1)]
    between: Iterable[float] = [b + (a - b) * (1.0 - s) for s in steps]
    if a > 0.0 and b > 0.0:
        between = [math.exp(math.log(b) + math.log(a / b) * (1.0 - s)) for s in steps]
    if isinstance(value, int):
        yield from dict.fromkeys(round(x) for x in between)
        return
    for number in (*between, a):
        yield float(f"{number:.2g}")
