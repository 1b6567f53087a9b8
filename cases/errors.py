"""What goes wrong: errors of those who use crossbody wrongly, and how a run ends.

    CrossbodyError
    +-- UnknownName         a case, engine, profile, metric or parameter that does not exist
    |   +-- NoFile          a file that does not exist
    +-- InvalidValue        a value outside what its name admits
    +-- SceneError          a mechanism whose parts contradict each other (shapes, start, constants)
    |   +-- KernelError     a kernel that is not what it says
    +-- ControlError        a controller of the user's own that raises, or gives something else than its controls
    +-- EngineUnavailable   an engine whose third-party package is not installed
    +-- CaseUnsupported     an engine that cannot do a case, in the engine's own words
    +-- FormatUnavailable   a log format whose third-party package is not installed
    +-- LogFormatError      a log that cannot be read or trusted, with file, row and column
    +-- ColumnMapError      a column map that says what no map can say, with the path of the key
    +-- OutputError         a folder that cannot be written, or that holds something of somebody else's
    +-- SchedulerUnavailable  a cluster that does not answer

Numerical failure is never an exception: it is an `Outcome`. What crossbody finds wrong with itself is an `OwnFault`.
"""

from __future__ import annotations

import contextlib
import difflib
import os
import re
from collections.abc import Iterable
from enum import StrEnum
from typing import Any

SHOWN = 80
LISTED = 20  # files of a folder, or of many names, that are named at most
NAMED = 60  # names that are listed in full


def several(count: int, one: str, many: str = "") -> str:
    """Return how many there are of what is called `one`, and otherwise `many`, else with an s."""
    return f"{count} {one if count == 1 else many or f'{one}s'}"


def shown(value: object) -> str:
    """A value in a message: cut where it is long, and never a fault of its own."""
    try:
        text = repr(value)
    except Exception:
        text = f"a {type(value).__name__}"
    return text if len(text) <= SHOWN else f"{text[: SHOWN - 3]}..."


class CrossbodyError(Exception):
    """Wrong use, told in one sentence: what is wrong, where, and what would be valid."""

    def __reduce__(self) -> Any:
        """Return how another process makes it again: what a subclass takes is not its sentence."""
        return _again, (type(self), self.args, self.__dict__)


class OwnFault(RuntimeError):  # noqa: N818
    """A fault of crossbody's own that a check of its own has found: nobody has used it wrongly."""


def _again(kind: type[CrossbodyError], told: tuple[Any, ...], state: dict[str, Any]) -> CrossbodyError:
    made = kind.__new__(kind, *told)
    made.__dict__.update(state)
    return made


class UnknownName(CrossbodyError):  # noqa: N818 - says what it is, as the other names here do
    """A name that nobody knows; the message lists those that exist, or the nearest of many.

    Args:
        kind: what was named, for example "case" or "variant of bouncing_ball".
        name: the name that was given.
        known: the names that exist.
    """

    def __init__(self, kind: str, name: str, known: Iterable[str]) -> None:
        self.kind, self.name, self.known = kind, name, tuple(sorted(known))
        stems = {_stem(one): one for one in self.known}
        close = difflib.get_close_matches(_stem(name), stems, n=1) if isinstance(name, str) else ()
        hint = f" Did you mean {stems[close[0]]!r}?" if close else ""
        others = f"Known: {', '.join(self.known)}." if self.known else "There are none."
        if len(self.known) > NAMED and isinstance(name, str):
            near = difflib.get_close_matches(_stem(name), stems, n=LISTED, cutoff=0.0)
            others = f"Known are {len(self.known)}, of which the nearest: {', '.join(stems[one] for one in near)}."
        what, *where = re.split(r"(?= of | in | \()", kind, maxsplit=1)
        self.advice = f".{hint} {others}"
        super().__init__(f"There is no {what} {shown(name)}{''.join(where)}{self.advice}")


def _stem(name: str) -> str:
    """Return what tells names apart: of the path of a file neither folder nor suffix."""
    return os.path.splitext(os.path.basename(name))[0]


class NoFile(UnknownName):
    """A file that is not there; the message lists those that are, of the same suffix in the same folder.

    Args:
        kind: what it would hold, for example "robot file".
        path: that was given.
        known: names that may stand in its place.
    """

    def __init__(self, kind: str, path: str | os.PathLike[str], known: Iterable[str] = ()) -> None:
        text = os.fspath(path)
        folder, name = os.path.split(text)
        suffix = os.path.splitext(name)[1]
        with contextlib.suppress(OSError, ValueError), os.scandir(folder or os.curdir) as found:
            beside = sorted(one.name for one in found if suffix and one.name.endswith(suffix) and one.is_file())
            known = (*known, *beside[:LISTED])
        super().__init__(kind, name, known)
        told = self.advice
        if os.path.exists(text):
            told = ": it is a folder, a pipe or a device."
        elif folder and not os.path.isdir(folder):
            told = f": there is no folder {folder!r}."
        elif not self.known:
            told = f"; there is no other *{suffix} in its folder." if suffix else "; valid: the path of a file."
        self.name, self.args = text, (f"There is no {kind} {text!r}{told}",)


class InvalidValue(CrossbodyError, ValueError):  # noqa: N818
    """A value outside what its name admits."""


class SceneError(CrossbodyError, ValueError):
    """A mechanism or start whose parts contradict each other."""


class KernelError(SceneError):
    """A kernel that is not what it says, whatever the numbers of the scene: whoever wrote it made the mistake."""


class ControlError(CrossbodyError, ValueError):
    """A controller of the user's own that raises, or gives no controls; it names tick and time."""


class EngineUnavailable(CrossbodyError):  # noqa: N818
    """An engine whose package is not installed; the message names the extra that brings it."""


class CaseUnsupported(CrossbodyError):  # noqa: N818
    """An engine that cannot do a case; the message is the engine's own sentence."""


class FormatUnavailable(CrossbodyError):  # noqa: N818
    """A log format whose package is not installed; the message names the extra that brings it."""


class LogFormatError(CrossbodyError, ValueError):
    """A log that cannot be read or trusted.

    Args:
        path: the file or folder.
        text: what is wrong and what would be valid.
        row: sample that it begins with, counted from 0; None if it concerns no single sample.
        column: column or channel that it concerns; empty if none.
    """

    def __init__(self, path: str | os.PathLike[str], text: str, row: int | None = None, column: str = "") -> None:
        self.path, self.row, self.column = os.fspath(path), row, column
        where = [repr(column)[1:-1]] if column else []
        where += [f"row {row}"] if row is not None else []
        super().__init__(": ".join([repr(self.path)[1:-1], *([", ".join(where)] if where else []), text]))


class ColumnMapError(CrossbodyError, ValueError):
    """A column map that cannot be followed.

    Args:
        path: the map's file.
        key: path of the offending key, for example `$.coordinates.q11.unit`.
        text: what is wrong and what would be valid.
    """

    def __init__(self, path: str | os.PathLike[str], key: str, text: str) -> None:
        self.path, self.key = os.fspath(path), key
        where = "" if key == "$" else f"{repr(key)[1:-1]}: "
        super().__init__(f"{repr(self.path)[1:-1]}: {where}{text}")


class OutputError(CrossbodyError, OSError):
    """A place that cannot be written, or that holds what crossbody did not write."""


class SchedulerUnavailable(CrossbodyError):  # noqa: N818
    """A cluster that does not answer, or whose package is not installed."""


class Outcome(StrEnum):
    """How a run ended. Only `FINISHED` reached its horizon."""

    FINISHED = "finished"
    STEP_LIMIT = "step_limit"
    TIME_LIMIT = "time_limit"
    STEP_TOO_SMALL = "step_too_small"
    DIVERGED = "diverged"
    NOT_FINITE = "not_finite"
    ILL_POSED = "ill_posed"
    MODE_CYCLE = "mode_cycle"
    LOST = "lost"
    INCONSISTENT = "inconsistent"
    INTERRUPTED = "interrupted"
    PAINLEVE = "painleve"
    NO_CONSISTENT_MODES = "no_consistent_modes"

    @property
    def advice(self) -> str:
        """What the user can do about it, in one sentence."""
        return _ADVICE[self]

    @property
    def ok(self) -> bool:
        """Whether the run reached its horizon."""
        return self is Outcome.FINISHED


_ADVICE = {
    Outcome.FINISHED: "The run reached its horizon.",
    Outcome.STEP_LIMIT: "Raise max_steps, loosen the tolerance, or check whether events accumulate (Zeno).",
    Outcome.TIME_LIMIT: "Raise the time limit, or loosen the tolerance.",
    Outcome.STEP_TOO_SMALL: "The step fell below the resolution of time: loosen the tolerance or lower the stiffness.",
    Outcome.DIVERGED: "The motion exceeded all plausible bounds: take a smaller step, or check signs and constants.",
    Outcome.NOT_FINITE: "A kernel or controller returned NaN or infinity: examine the state named with this outcome.",
    Outcome.ILL_POSED: "The active rows or the mass matrix lost rank: the multipliers are not unique here.",
    Outcome.MODE_CYCLE: (
        "The contacts named with this outcome switch forever, at one instant or within no time: their laws contradict "
        "each other."
    ),
    Outcome.LOST: "The motion left the region in which its controller holds: start closer, or change the controller.",
    Outcome.INCONSISTENT: "The results contradict the model in the quantity named with this outcome.",
    Outcome.PAINLEVE: (
        "A force at a sliding contact would press it in further (Painleve): no motion of rigid bodies exists."
    ),
    Outcome.NO_CONSISTENT_MODES: "No set of sticking and sliding contacts is consistent with the resulting forces.",
    Outcome.INTERRUPTED: "The run was interrupted; what was computed until then is kept.",
}
