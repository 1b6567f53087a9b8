"""One number for one run, judged against a truth: a module here is a metric, found by its name.

A metric is a module with a docstring whose first line says what it measures, and the public names

    UNIT                            SI unit, "1" for a ratio or a count
    CLAIMED                         True: measured only where the case claims or limits it
    measure(truth, run, case)       the number; None where there is none (no contact, another mechanism, ...), NaN where
                                    the run does not show what it needs

and, if it needs a signal that an engine may withhold (`crossbody.engines.contract`), NEEDS, its name. What the runs of
one mechanism alone show is data of its cases (`crossbody.cases.metric`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Protocol, cast

from crossbody.cases import InvalidValue
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


def names() -> tuple[str, ...]:
    """Names of all metrics; imports none of them."""
    return _REGISTRY.names()


def summary(name: str) -> str:
    """What a metric measures, in one line; imports nothing."""
    return _REGISTRY.summary(name)


def load(name: str) -> Metric:
    """Import a metric.

    Raises:
        UnknownName: if there is no such metric; the message lists the names.
    """
    return cast("Metric", _REGISTRY.load(name))


def of(case: Case) -> Mapping[str, Metric]:
    """Return the metrics of a case by name, in order: its own beside those that every case has.

    Raises:
        InvalidValue: if one of its own has the name of another.
    """
    from crossbody.reports.metrics._of_case import OfCase  # numpy, without which names are listed

    if twice := sorted(set(names()) & set(case.metrics)):
        raise InvalidValue(f"{case.label}: metrics {', '.join(twice)} have the names of metrics that every case has.")
    every: dict[str, Metric] = {name: load(name) for name in names()}
    every |= {name: OfCase(own) for name, own in case.metrics.items()}
    return {name: every[name] for name in sorted(every)}
