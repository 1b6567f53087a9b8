"""crossbody under pytest: assertions for tests of one's own, and the plugin that pytest finds by itself.

    from crossbody.reports.testing import assert_agrees, assert_energy

`plugin` adds the options `--crossbody-case`, `--crossbody-engine` and `--crossbody-update` and the
fixtures `crossbody_case`, `crossbody_engine`, `crossbody_truth`, `crossbody_run`, `crossbody_verdicts`
and `crossbody_baseline`. Importing it, as every run of pytest does, imports neither numpy nor an engine.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from crossbody.reports.testing._baseline import Baseline
    from crossbody.reports.testing._motions import assert_agrees, assert_energy

_LAZY = {"assert_agrees": "_motions", "assert_energy": "_motions", "Baseline": "_baseline"}

__all__ = ["Baseline", "assert_agrees", "assert_energy"]


def __getattr__(name: str) -> Any:
    """Import what needs numpy only when it is asked for."""
    if name in _LAZY:
        return getattr(import_module(f"{__name__}.{_LAZY[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
