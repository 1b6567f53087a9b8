"""The reference model: constrained dynamics with contact as a hybrid penalty DAE.

System      a mechanism: kernels, parameters, the law of every row
simulate    one motion of it
ensemble    many motions of it, in threads
recheck     whether a finished motion stands in the modes that it should
kernels     decorators that declare the functions of a mechanism
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from crossbody.reference import _numba

if TYPE_CHECKING:
    from crossbody.reference import kernels
    from crossbody.reference._ensemble import Ensemble, ensemble
    from crossbody.reference._recheck import Violation, recheck
    from crossbody.reference._simulate import prepare, simulate
    from crossbody.reference._system import System
    from crossbody.reference.options import Options

__all__ = ["Ensemble", "Options", "System", "Violation", "ensemble", "kernels", "prepare", "recheck", "simulate"]
_LAZY = {"Options": "options", "System": "_system", "simulate": "_simulate", "prepare": "_simulate"} | dict.fromkeys(
    ("Ensemble", "ensemble"), "_ensemble"
)
_LAZY |= dict.fromkeys(("Violation", "recheck"), "_recheck")


def __getattr__(name: str) -> Any:
    """Import numba only when something of it is asked for."""
    if name in __all__:
        _numba.load()
    if name == "kernels":
        return import_module("crossbody.reference.kernels")
    if name in _LAZY:
        return getattr(import_module(f"crossbody.reference.{_LAZY[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
