"""One number for one run, judged against a truth: a module here is a metric, found by its name.

A metric is a module with a docstring whose first line says what it measures, and the public names

    UNIT                            SI unit, "1" for a ratio or a count
    CLAIMED                         True: measured only where the case claims or limits it
    measure(truth, run, case)       the number; None where there is none (no contact, another mechanism, ...), NaN where
                                    the run does not show what it needs

and, if it needs a signal that an engine may withhold (`crossbody.engines.contract`), NEEDS, its name.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, cast

from crossbody.cases.registry import Registry

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.truth import Truth


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
