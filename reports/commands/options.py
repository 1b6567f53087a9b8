"""Options that several commands have; nothing heavy is imported to read a command line."""

from __future__ import annotations

import math
import shlex
import sys
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import wraps
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

import click
from click.shell_completion import CompletionItem

_Work = TypeVar("_Work", bound=Callable[..., int])
PATH = click.Path(path_type=Path)


def command() -> str:
    """What was typed."""
    return shlex.join(["crossbody", *sys.argv[1:]])


def together(command: _Work, *options: Any) -> _Work:
    """Give a command several options, which its help shows in this order."""
    for option in reversed(options):
        command = option(command)
    return command


def names_of(*modules: str) -> Callable[[click.Context, click.Parameter, str], list[CompletionItem]]:
    """Return what a shell completes to names that modules of crossbody tell (`names`), or to files where none fits.

    Behind a colon stand the variants of a case and the profiles of an engine.
    """

    def fitting(_context: click.Context, _parameter: click.Parameter, begun: str) -> list[CompletionItem]:
        known = [name for module in modules for name in import_module(f"crossbody.{module}").names()]
        head, colon, _ = begun.partition(":")
        if colon and head in known:
            known = [f"{head}:{one}" for module in modules for one in _kinds(module, head)]
        found = [CompletionItem(name) for name in known if name.startswith(begun)]
        return found or [CompletionItem(begun, type="file")]

    return fitting


def _kinds(module: str, name: str) -> Iterable[str]:
    """Return the variants of a case or the profiles of an engine, if it is one that a shell completes."""
    from crossbody import cases, engines

    with suppress(cases.CrossbodyError):
        if module == "cases":
            return cases.variants(name)
        if module == "engines":
            return engines.load(name).profiles
    return ()


def free_of(context: click.Context, _parameter: click.Parameter, begun: str) -> list[CompletionItem]:
    """Return what a shell completes to parameters that may be fitted: of the model, or of all where none is given."""
    from crossbody import cases
    from crossbody.hw import models

    found: dict[str, str] = {"delay": "of the measured coordinates, s"}
    given = context.params.get("model")
    for name in [given] if given else models.names():
        with suppress(cases.CrossbodyError):
            found |= {key: one.doc for key, one in models.load(name).parameters.items()}
    return [CompletionItem(name, help=doc) for name, doc in found.items() if name.startswith(begun)]


def _given(context: click.Context) -> list[str]:
    """Return the cases that stand before what a shell completes; files of users' own among them."""
    from crossbody import cases
    from crossbody.cases.loading import OF_USERS, parted

    words = (*context.args, *(context.params.get("names") or ()), context.params.get("name") or "")
    return [word for word in words if parted(word)[0] in cases.names() or word.endswith(OF_USERS)]


def variants_of(context: click.Context, _parameter: click.Parameter, begun: str) -> list[CompletionItem]:
    """Return what a shell completes to variants of the cases that stand before it."""
    from crossbody import cases

    return [CompletionItem(one) for name in _given(context) for one in cases.variants(name) if one.startswith(begun)]


def parameters_of(context: click.Context, _parameter: click.Parameter, begun: str) -> list[CompletionItem]:
    """Return what a shell completes to parameters of the cases that stand before it."""
    from crossbody.cases import CrossbodyError, loading

    found: dict[str, str] = {}
    with suppress(CrossbodyError):
        for name in _given(context) or ["bouncing_ball"]:
            found |= {key: one.doc for key, one in loading.module(loading.parted(name)[0]).PARAMETERS.items()}
    return [CompletionItem(f"{name}=", help=doc) for name, doc in found.items() if name.startswith(begun)]


def law_of(context: click.Context, _parameter: click.Parameter, begun: str) -> list[CompletionItem]:
    """Return what a shell completes to constants of the law of rows, behind those that are given."""
    given, comma, last = begun.rpartition(",")
    return [
        CompletionItem(f"{given}{comma}{name}=")
        for name in LAW if name.startswith(last) and f"{name}=" not in given
    ]  # fmt: skip


def files_of(context: click.Context, _parameter: click.Parameter, begun: str) -> list[CompletionItem]:
    """Let a shell complete the name of a file."""
    return [CompletionItem(begun, type="file")]


def settings_of(context: click.Context, _parameter: click.Parameter, begun: str) -> list[CompletionItem]:
    """Return what a shell completes to settings of the engines that are asked for, or of those that are installed."""
    from crossbody import cases, engines
    from crossbody.reports.runs.choice import DEFAULT_ENGINES, parse_engine

    found: dict[str, str] = {}
    wanted = context.params.get("wanted") or [one for one in DEFAULT_ENGINES if one in engines.names()]
    for name, profile in map(parse_engine, wanted):
        if not (begun.startswith(f"{name}.") or name.startswith(begun)):
            continue  # an engine takes long to import
        with suppress(cases.CrossbodyError):
            case, engine = cases.load((_given(context) or ["bouncing_ball"])[0]), engines.load(name)
            for each in (profile,) if profile else engine.profiles:
                with suppress(cases.CaseUnsupported):
                    found |= {f"{name}.{key}=": one.doc for key, one in engine.offered(case, each).items()}
    return [CompletionItem(name, help=doc) for name, doc in found.items() if name.startswith(begun)]


LAW = ("a0", "a1", "a2")
"""Constants of the law of rows."""


class _Number(click.types.FloatParamType):
    name = "number"


class _Count(click.types.IntParamType):
    name = "whole number"


NUMBER, COUNT = _Number(), _Count()
"""Numbers that are checked by what uses them; what is none is told in words."""


class Whole(click.IntRange):
    """A range of whole numbers, which is told where something else is given."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Read a number."""
        try:
            int(value)
        except ValueError:
            self.fail(f"{value!r} is not a whole number in the range {self._describe_range()}.", param, ctx)
        return super().convert(value, param, ctx)


class Number(click.FloatRange):
    """A range, which is told where something else is given; NaN is no number."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Read a number."""
        with suppress(ValueError):
            if not math.isnan(float(value)):
                return super().convert(value, param, ctx)
        self.fail(f"{value!r} is not a number in the range {self._describe_range()}.", param, ctx)


ABOVE_0 = Number(0.0, min_open=True)


def time_limit(text: str, seconds: float = 3660.0) -> Callable[[_Work], _Work]:
    """--time-limit, as `limit`, with what happens then."""
    return click.option(
        "--time-limit", "limit", type=ABOVE_0, default=seconds, show_default=True, metavar="S",
        help=text,
    )  # fmt: skip


def out(folder: str = "out") -> Callable[[_Work], _Work]:
    """--out, with the folder that is written if nothing is said."""
    return click.option(
        "--out", type=PATH, default=Path(folder), show_default=True, metavar="DIR", help="Folder for the results."
    )


wanted = click.option(
    "--engine", "-e", "wanted", metavar="E[:PROFILE]", multiple=True, help="Engine; repeatable.",
    shell_complete=names_of("engines"),
)  # fmt: skip
readers = click.option(
    "--engine",
    "-e",
    "engines",
    metavar="E",
    multiple=True,
    help="Engine; repeatable; all if not given.",
    shell_complete=names_of("engines"),
)
variant = click.option(
    "--variant",
    "--key",
    metavar="V",
    help="Variant of the case, or keyframe of a robot file; all if not given.",
    shell_complete=variants_of,
)
against = click.option(
    "--against", type=PATH, metavar="BASE", help="Folder of an earlier run: the index shows what has changed."
)
others = click.option(
    "--with", "others", type=PATH, metavar="DIR", multiple=True,
    help="Folder of a study (bench, stress, gapmap, ...) to include in the report; repeatable.",
)  # fmt: skip
reader_limit = time_limit("Terminate a reader that has not returned after this time, s.", 20.0)
engine_limit = time_limit("Terminate an engine that has not finished a case after this time, s, with compilation.")
memory = click.option(
    "--memory", type=Whole(1), default=1000, show_default=True, metavar="MB",
    help="Memory for reading LOG, beyond its size; a file that decompresses to more is refused.",
)  # fmt: skip


def parameters(command: _Work) -> _Work:
    """Options that give parameters of the case; the command takes all of them as `pairs`, texts K=V."""

    @wraps(command)
    def gathered(*given: Any, pairs: tuple[str, ...], law: str | None, **asked: Any) -> int:
        named = {name: asked.pop(name) for name in ("t_end", "ctrl", "control", "tick", "without")}
        if named["tick"] is not None and named["control"] is None and not any(p.startswith("control=") for p in pairs):
            raise click.UsageError("--tick is the time between calls of a controller, but no --control is given.")
        named["rank"] = asked.pop("rank")
        for name in ("push", "start", "rate"):
            named[name] = "; ".join(" ".join(map(str, one)) for one in asked.pop(name)) or None
        own = [f"{name}={value}" for name, value in named.items() if value is not None]
        return command(*given, pairs=(*pairs, *own, *filter(None, (law or "").split(","))), **asked)

    taking: Any = gathered
    found: _Work = together(
        taking,
        click.option("--set", "pairs", metavar="K=V", multiple=True, help="Parameter of the case; repeatable.",
                     shell_complete=parameters_of),
        click.option("--t-end", type=NUMBER, metavar="S", help="Horizon, s; same as --set t_end=S."),
        click.option("--law", metavar="a0=,a1=", help="Constants of all rows; same as --set for each constant.",
                     shell_complete=law_of),
        click.option("--ctrl", metavar="FILE", help="Robot file: table of controls (CSV, Parquet, NPZ).",
                     shell_complete=files_of),
        click.option(
            "--control", metavar="FILE.py:NAME",
            help="Robot file: your own callable (t, q, v) -> u, or a class of such callables.",
        ),
        click.option("--tick", type=NUMBER, metavar="S", help="Time between calls of --control, s; 1e-3 if not given."),
        click.option(
            "--push", type=(str, *(float,) * 5), multiple=True, metavar="BODY FX FY FZ T0 T1",
            help="Robot file: a force, N, at a body's centre of mass from T0 to T1, s; repeatable.",
        ),
        click.option(
            "--start", type=(str, NUMBER), multiple=True, metavar="NAME VALUE",
            help="Robot file: a coordinate at the start, m or rad, by its joint's name; repeatable.",
        ),
        click.option(
            "--rate", type=(str, NUMBER), multiple=True, metavar="NAME VALUE",
            help="Robot file: a velocity at the start, m/s or rad/s; repeatable.",
        ),
        click.option("--without", metavar="PARTS", help="Robot file: parts to leave out in every engine."),
        click.option("--rank", type=COUNT, metavar="N", help="Robot file: number of independent rows of its loops."),
    )  # fmt: skip
    return found


def cases(command: _Work) -> _Work:
    """Options that say what is run."""
    names = click.argument("names", metavar="[CASE]...", nargs=-1, shell_complete=names_of("cases"))
    return together(command, names, wanted, variant, parameters, out())


columns = click.option(
    "--columns", metavar="MAP", shell_complete=names_of("hw.reading.published"),
    help="Column map: a TOML file, or one that `crossbody list` names; not needed for a stored log.",
)  # fmt: skip


def replayed(command: _Work) -> _Work:
    """Options that say which log is replayed on which model; results go to a folder of the command's own."""
    return together(
        command,
        click.argument("path", metavar="LOG", type=PATH),
        click.option("--model", "-m", required=True, metavar="M", help="Model; `crossbody list` names them.",
                     shell_complete=names_of("hw.models")),
        columns,
        click.option("--part", type=COUNT, metavar="N", help="Number of the run, if the map separates several."),
        click.option(
            "--repair", metavar="R", multiple=True, help="fill_dropped, drop_duplicates or unwrap; repeatable."
        ),
        memory,
        click.option("--set", "pairs", metavar="K=V", multiple=True, help="Parameter of the model; repeatable."),
        click.option("--restart", type=NUMBER, metavar="S", help="Time between restarts, s; 0 for a free run."),
        click.option("--horizon", type=NUMBER, metavar="S", help="Length of a window, s; if not to the next restart."),
        click.option("--delay", type=NUMBER, default=0.0, metavar="S", help="Delay of the measurement, s."),
        click.option(
            "--limit", "limits", metavar="NAME=V", multiple=True,
            help="Limit on a metric, for example fit=90 or rmse_th1=0.01; repeatable.",
        ),
        out(f"out/{command.__name__}"),
    )  # fmt: skip
