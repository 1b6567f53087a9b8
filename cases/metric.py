"""A number that one mechanism's runs show, beside those of every case (`crossbody.reports.metrics`)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from crossbody.cases.arrays import Floats
from crossbody.cases.errors import InvalidValue

if TYPE_CHECKING:
    from crossbody.cases.case import Case
    from crossbody.cases.trajectory import Trajectory


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseMetric:
    """How a case measures one number; its name is its key in `Case.metrics`. One of the three functions is given.

    Attributes:
        doc: what it measures, one line.
        unit: SI unit, "1" for a ratio or a count.
        number: of (run, case), the number itself; None where there is none, NaN where the run
            does not show it.
        signal: of (run, case), values (n, k) at the run's samples: the number is their largest
            difference from the truth's, on arcs between matched events; None where there are none.
        instants: of (run, case), times (m,), s, in order: the number is their largest difference
            from the truth's, None where the truth has none or another number of them.
        always: whether every run is measured; else where the case claims or limits it.
    """

    doc: str
    unit: str = "1"
    number: Callable[[Trajectory, Case], float | None] | None = None
    signal: Callable[[Trajectory, Case], Floats | None] | None = None
    instants: Callable[[Trajectory, Case], Floats] | None = None
    always: bool = False

    def __post_init__(self) -> None:
        """Check that there is one function.

        Raises:
            InvalidValue: if there is none, or more than one.
        """
        given = [name for name in ("number", "signal", "instants") if getattr(self, name) is not None]
        if len(given) != 1:
            raise InvalidValue(f"A metric of a case has one of number, signal and instants; given: {given or 'none'}.")
