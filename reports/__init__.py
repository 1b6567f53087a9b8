"""Comparison and what people see: metrics, truths, verdicts, tables, pages, the command line."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from crossbody.reports.judging.comparison import compare
    from crossbody.reports.judging.run_verdicts import Entry
    from crossbody.reports.judging.truth import truth_of
    from crossbody.reports.measuring.truth import Truth

_LAZY = {
    "compare": "judging.comparison",
    "Entry": "judging.run_verdicts",
    "Truth": "judging.truth",
    "truth_of": "judging.truth",
}

__all__ = ["Entry", "Truth", "compare", "truth_of"]


def __getattr__(name: str) -> Any:
    """Import what needs pandas and numpy only when it is asked for."""
    if name in _LAZY:
        return getattr(import_module(f"crossbody.reports.{_LAZY[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
