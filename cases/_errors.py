"""What goes wrong when crossbody is used wrongly.

    CrossbodyError
    +-- UnknownName         a case, engine, profile, metric or parameter that does not exist
    +-- InvalidValue        a value outside what its name admits
    +-- SceneError          a mechanism whose parts contradict each other (shapes, start, constants)
    +-- EngineUnavailable   an engine whose third-party package is not installed
    +-- CaseUnsupported     an engine that cannot do a case, in the engine's own words
    +-- OutputError         a folder that cannot be written, or that holds something of somebody else's

Numerical failure is never an exception: it is an `Outcome`.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class CrossbodyError(Exception):
    """Wrong use, told in one sentence: what is wrong, where, and what would be valid."""


class UnknownName(CrossbodyError):  # noqa: N818 - says what it is, as the other names here do
    """A name that nobody knows; the message lists those that exist.

    Args:
        kind: what was named, for example "case".
        name: the name that was given.
        known: the names that exist.
    """

    def __init__(self, kind: str, name: str, known: Iterable[str]) -> None:
        self.kind, self.name, self.known = kind, name, tuple(sorted(known))
        close = difflib.get_close_matches(name, self.known, n=1)
        hint = f" Did you mean {close[0]!r}?" if close else ""
        super().__init__(f"There is no {kind} {name!r}.{hint} Known: {', '.join(self.known) or 'none'}.")


class InvalidValue(CrossbodyError, ValueError):  # noqa: N818
    """A value outside what its name admits."""


class SceneError(CrossbodyError, ValueError):
    """A mechanism or start whose parts contradict each other."""


class EngineUnavailable(CrossbodyError):  # noqa: N818
    """An engine whose package is not installed; the message names the extra that brings it."""


class CaseUnsupported(CrossbodyError):  # noqa: N818
    """An engine that cannot do a case; the message is the engine's own sentence."""


class OutputError(CrossbodyError, OSError):
    """A place that cannot be written, or that holds what crossbody did not write."""
