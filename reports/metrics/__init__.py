"""One number for one run, judged against a truth: a module here is a metric, found by its name.

A metric is a module with a docstring whose first line says what it measures, and the public names

    UNIT                            SI unit, "1" for a ratio or a count
    CLAIMED                         True: measured only where the case claims or limits it
    measure(truth, run, case)       the number; None where there is none (no contact, another mechanism, ...), NaN where
                                    the run does not show what it needs

and, if it needs a signal that an engine may withhold (`crossbody.engines.contract`), NEEDS, its name; a number that can
say of what it is, which signal and when, is a `crossbody.reports.measuring.placed.Placed`. What the runs of
one mechanism alone show is data of its cases (`crossbody.cases.case`). Metrics of a kind stand together as functions of
one module, named by its UNITS and NEEDS; those of a run alone, (run, case), in `_of_run` and `_of_friction`.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, cast

from crossbody.cases import InvalidValue, UnknownName
from crossbody.cases.registry import Registry

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.measuring.truth import Truth


class Metric(Protocol):
    """What every metric module offers."""

    UNIT: str
    CLAIMED: bool

    def measure(self, truth: Truth, run: Trajectory, case: Case) -> float | None:
        """The number, or None where the run cannot tell."""
        ...


_REGISTRY = Registry("metric", __name__)
_OF_RUNS = ("_of_run", "_of_friction")


def names() -> tuple[str, ...]:
    """Names of all metrics; imports none of them."""
    return tuple(sorted({*_REGISTRY.names(), *_together()}))


def own() -> frozenset[str]:
    """Names of those that are crossbody's own; imports none of them."""
    return frozenset({*_REGISTRY.own(), *_together()})


def summary(name: str) -> str:
    """What a metric measures, in one line; imports nothing."""
    return _together()[name][1] if name in _together() else _REGISTRY.summary(name)


@cache
def _together() -> Mapping[str, tuple[str, str]]:
    """Return the functions of the modules that hold several, each with its module and what it measures."""
    found: dict[str, tuple[str, str]] = {}
    for module in (*_OF_RUNS, "_contacts", "_energies", "_impulses", "_motions", "_multipliers"):
        text = Path(__file__).with_name(f"{module}.py").read_text(encoding="utf-8")
        for node in ast.parse(text).body:
            if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
                found[node.name] = module, (ast.get_docstring(node) or "").partition("\n")[0]
    return found


def load(name: str) -> Metric:
    """Import a metric.

    Raises:
        UnknownName: if there is no such metric; the message lists the names.
    """
    if isinstance(name, str) and name in _together():
        return _among_others(name)
    try:
        return cast("Metric", _REGISTRY.load(name))
    except UnknownName:
        raise UnknownName("metric", name, names()) from None


@cache
def _among_others(name: str) -> Metric:
    from crossbody.cases.case import CaseMetric  # numpy, without which names are listed
    from crossbody.reports.metrics._of_case import OfCase, OfModule

    module, doc = _together()[name]
    own = import_module(f"{__name__}.{module}")
    if module not in _OF_RUNS:
        return OfModule(getattr(own, name), UNIT=own.UNITS.get(name, "1"), NEEDS=own.NEEDS.get(name, ""))
    return OfCase(CaseMetric(doc=doc, unit=own.UNITS.get(name, "1"), always=own.ALWAYS, number=getattr(own, name)))


def of(case: Case) -> Mapping[str, Metric]:
    """Return the metrics of a case by name, in order: its own beside those that every case has.

    Raises:
        InvalidValue: if one of its own has the name of another.
    """
    from crossbody.reports.metrics._of_case import OfCase

    if twice := sorted(set(names()) & set(case.metrics)):
        raise InvalidValue(f"{case.label}: metrics {', '.join(twice)} have the same names as metrics of all cases.")
    every: dict[str, Metric] = {name: load(name) for name in names()}
    every |= {name: OfCase(own) for name, own in case.metrics.items()}
    return {name: every[name] for name in sorted(every)}
