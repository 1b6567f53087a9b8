"""How a command speaks: tables, only what is wrong, or JSON. Progress goes to a terminal's stderr."""

from __future__ import annotations

import ctypes
import json
import math
import os
import sys
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, redirect_stdout, suppress
from functools import wraps
from typing import TYPE_CHECKING, Any, TypeVar

import click

from crossbody.reference.compiling import count, nothing

if TYPE_CHECKING:
    import pandas as pd

_Work = TypeVar("_Work", bound=Callable[..., int])
_KEY = "crossbody.voice"
QUIET, JSON, OUT, PLACE = "quiet", "json", "out", "place"


def speaks(command: _Work) -> _Work:
    """Give a command the options --quiet and --json; it takes none of them as arguments."""

    @wraps(command)
    def spoken(*args: Any, quiet: bool, as_json: bool, **more: Any) -> int:
        click.get_current_context().meta[_KEY] = {QUIET: quiet, JSON: as_json, OUT: sys.stdout}
        with (
            pure() if as_json else nullcontext() as own,
            count.shown(nothing) if silent() else nullcontext(),
        ):
            click.get_current_context().meta[_KEY][PLACE] = own
            return command(*args, **more)

    options = (
        click.option("--quiet", "-q", is_flag=True, help="Print errors and failures only, and no progress."),
        click.option("--json", "as_json", is_flag=True, help="Print only the result, as JSON."),
    )
    told: Any = spoken
    for option in options:
        told = option(told)
    speaking: _Work = told
    return speaking


@contextmanager
def pure() -> Iterator[int | None]:
    """Let what a user's code, or compiled code of an engine, prints go to stderr: stdout has the result alone.

    Yields:
        A descriptor of stdout; None where there is none.
    """
    with redirect_stdout(sys.stderr), _as_stdout(2) as own:
        yield own


@contextmanager
def _as_stdout(other: int) -> Iterator[int | None]:
    """Write to a descriptor what is written to 1, and yield another one for what was 1; None if one of them is closed.

    What C has printed and not yet written goes where it was printed to.
    """
    try:
        own = os.dup(1)
        _flush()
        os.dup2(other, 1)
    except OSError:
        yield None
        return
    try:
        yield own
    finally:
        _flush()
        os.dup2(own, 1)
        os.close(own)


def _flush() -> None:
    with suppress(AttributeError, OSError, TypeError):  # not a POSIX system
        ctypes.CDLL(None).fflush(None)


def _told() -> Mapping[str, Any]:
    context = click.get_current_context(silent=True)
    return {} if context is None else context.meta.get(_KEY, {})


def _asked(word: str) -> bool:
    return bool(_told().get(word))


def result(text: str) -> None:
    """Print the result of a command that prints nothing else."""
    own = _told().get(PLACE)
    with nullcontext() if own is None else _as_stdout(own):
        print(text, file=_told().get(OUT, sys.stdout), flush=True)


def quiet() -> bool:
    """Whether tables and paths are left out."""
    return _asked(QUIET)


def as_json() -> bool:
    """Whether the result is printed as JSON and nothing else is."""
    return _asked(JSON)


def silent() -> bool:
    """Whether nothing may be said besides the result."""
    return quiet() or as_json()


def note(text: str) -> None:
    """Say something beside the result, on stderr."""
    if not silent():
        print(folded(f"crossbody: {text}"), file=sys.stderr)


def folded(text: str) -> str:
    """Return a sentence in lines of 80 columns; words stay."""
    line = " ".join(text.split())
    return textwrap.fill(line, 80, subsequent_indent="    ", break_on_hyphens=False, break_long_words=False)


def rows_as_json(rows: pd.DataFrame) -> str:
    """A table as a JSON list of its rows."""
    return str(rows.to_json(orient="records", double_precision=15))


def plain_rows_as_json(rows: Sequence[Mapping[str, Any]]) -> str:
    """The same of plain rows."""
    return json.dumps([{name: finite(value) for name, value in row.items()} for row in rows], separators=(",", ":"))


def finite(value: Any) -> Any:
    """A value as JSON knows it: nothing for a number that is not finite."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def told_as_json(tables: Mapping[str, pd.DataFrame]) -> bool:
    """Print tables as one JSON object if that was asked for; whether it was."""
    if as_json():
        result(json.dumps({name: json.loads(rows_as_json(rows)) for name, rows in tables.items()}))
    return as_json()


@contextmanager
def progress(steps: int | None, done: int | None = None) -> Iterator[Callable[[str], None]]:
    """Show a bar on stderr with the time left, advanced each time it is called with what is being done, or was.

    Where stderr is no terminal, what takes long is told once, in a line.

    Args:
        steps: how many in all; None where nobody knows.
        done: how many are done already, where each is told of when it is done; else each is told
            of when it begins.
    """
    if silent() or not sys.stderr.isatty():
        from crossbody.reports.runs import watch

        try:
            yield watch.doing if done is None and not silent() else lambda _text: None
        finally:
            watch.doing("")
        return
    from rich import progress as shown
    from rich.console import Console
    from rich.table import Column

    words = Column(ratio=1, no_wrap=True, overflow="ellipsis")  # numbers are never cut, names may be
    columns = (
        shown.BarColumn(8), shown.MofNCompleteColumn(), shown.TimeElapsedColumn(), shown.TextColumn("left"),
        shown.TimeRemainingColumn(), shown.TextColumn("{task.description}", table_column=words),
    )  # fmt: skip
    with shown.Progress(*columns, console=Console(stderr=True), transient=True, expand=True) as bar:
        at = -1 if done is None else done
        task = bar.add_task("", total=steps, completed=max(at, 0))
        compiling = bar.add_task("compiling for this processor, once", visible=False)

        def show(ready: int, needed: int) -> None:
            bar.update(compiling, total=needed, completed=ready, visible=ready < needed)

        def tell(text: str) -> None:
            nonlocal at
            at += 1
            bar.update(task, description=text, completed=at)

        with count.shown(show):
            yield tell
