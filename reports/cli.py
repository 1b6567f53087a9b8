"""The command `crossbody`.

Exit code 0: nothing is outside its limit (a known deviation counts as fine); 1: something is; 2: wrong use, told in one
sentence on stderr; 3: a fault of crossbody, whose traceback is in a file; 130: interrupted. Whatever is not needed to
read the command line is imported by the command that needs it.
"""

from __future__ import annotations

import errno
import json
import os
import shlex
import sys
import tempfile
import traceback
from collections.abc import Callable
from contextlib import suppress
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar

import click

from crossbody.cases import CrossbodyError, installed
from crossbody.reports.commands.replay_options import identify, memory_option, replay
from crossbody.reports.runs.watch import stopping
from crossbody.reports.voice import as_json, folded, quiet, speaks

_Work = TypeVar("_Work", bound=Callable[..., int])

DEFAULT_OUT = Path("out")


class _Positive(click.FloatRange):
    """A range in which NaN is no number."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Read a number."""
        found = super().convert(value, param, ctx)
        if found != found:
            self.fail(f"{value} is no number.", param, ctx)
        return found


def _plug(context: click.Context, _: click.Parameter, given: tuple[str, ...]) -> None:
    if not context.resilient_parsing:
        with suppress(FileNotFoundError):  # the folder one works in may be gone
            installed.use(installed.configured(Path.cwd()))
        installed.use(given)


class _Commands(click.Group):
    """Commands that all take --plugin, and the plug-ins that the configuration names."""

    group_class = type

    def add_command(self, cmd: click.Command, name: str | None = None) -> None:
        """Add a command, or a group of such."""
        text = "Engine, metric, log format, case, ... in a file of your own; repeatable, as [tool.crossbody] plugins."
        option = click.Option(
            ["--plugin"], metavar="FILE", multiple=True, is_eager=True, expose_value=False, callback=_plug, help=text
        )
        if not isinstance(cmd, click.Group):
            cmd.params.append(option)
        super().add_command(cmd, name)


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(package_name="crossbody")
def cli() -> None:
    """Cross-check a reference model of contact and constrained dynamics against rigid-body engines."""


@cli.command("list")
@click.argument("name", metavar="[CASE or ENGINE]", required=False)
@click.option("--json", "plain", is_flag=True, help="Print names and summaries as JSON.")
def list_(name: str | None, plain: bool) -> None:
    """List cases, engines, metrics, stress suites and models of logs; or what CASE or ENGINE has."""
    from crossbody.reports import described

    told = described.everything() if name is None else described.one(name)
    click.echo(json.dumps({k.lower(): v for k, v in told.items()}, indent=1) if plain else described.text(told))


def _parameters(command: _Work) -> _Work:
    """Options that give parameters of the case; the command takes all of them as `pairs`, texts K=V."""

    @wraps(command)
    def gathered(
        *given: Any, pairs: tuple[str, ...], t_end: float | None, law: str | None, ctrl: str | None,
        control: str | None, tick: float | None, without: str | None, push: tuple[tuple[Any, ...], ...],
        rank: int | None, **others: Any,
    ) -> int:  # fmt: skip
        if tick is not None and control is None and not any(pair.startswith("control=") for pair in pairs):
            raise click.UsageError(
                "--tick is the time between two calls of a controller, and none is given: --control."
            )
        pushes = "; ".join(" ".join(map(str, one)) for one in push) or None
        named = {"t_end": t_end, "ctrl": ctrl, "control": control, "tick": tick, "without": without, "push": pushes}
        named["rank"] = rank
        own = [f"{name}={value}" for name, value in named.items() if value is not None]
        return command(*given, pairs=(*pairs, *own, *filter(None, (law or "").split(","))), **others)

    options = (
        click.option("--set", "pairs", metavar="K=V", multiple=True, help="Parameter of the case; repeatable."),
        click.option("--t-end", type=float, metavar="S", help="Horizon, s; as --set t_end=S."),
        click.option("--law", metavar="a0=,a1=", help="Constants of the rows; as --set for each of them."),
        click.option("--ctrl", metavar="FILE", help="Of a robot's file: table of controls (CSV, Parquet, NPZ)."),
        click.option(
            "--control",
            metavar="FILE.py:NAME",
            help="Of a robot's file: a callable (t, q, v) -> u of your own, or a class of such.",
        ),
        click.option("--tick", type=float, metavar="S", help="Between two calls of it, s; 1e-3 if not given."),
        click.option(
            "--push",
            type=(str, *(float,) * 5),
            multiple=True,
            metavar="BODY FX FY FZ T0 T1",
            help="Of a robot's file: a force, N, at a body's centre of mass from T0 to T1, s; repeatable.",
        ),
        click.option("--without", metavar="PARTS", help="Of a robot's file: parts to leave out of every engine."),
        click.option("--rank", type=int, metavar="N", help="Of a robot's file: how many rows of its loops hold."),
    )
    told: Any = gathered
    for option in reversed(options):
        told = option(told)
    taking: _Work = told
    return taking


def _shared(command: _Work) -> _Work:
    """Options that say what is run."""
    options = (
        click.argument("names", metavar="[CASE]...", nargs=-1),
        click.option("--engine", "-e", "wanted", metavar="E[:PROFILE]", multiple=True, help="Engine; repeatable."),
        click.option(
            "--variant", "--key", metavar="V", help="Variant of the case, keyframe of a robot's file; all if not given."
        ),
        _parameters,
        click.option("--out", type=click.Path(path_type=Path), default=DEFAULT_OUT, show_default=True, metavar="DIR"),
    )
    for option in reversed(options):
        command = option(command)
    return command


_AGAINST = click.option(
    "--against", type=click.Path(path_type=Path), metavar="BASE",
    help="Folder of an earlier run: the index says what has changed.",
)  # fmt: skip
_WITH = click.option(
    "--with", "others", type=click.Path(path_type=Path), metavar="DIR", multiple=True,
    help="Folder of a study (bench, stress, gapmap, ...): its pages stand beside; repeatable.",
)  # fmt: skip


_LIMIT = click.option(
    "--time-limit", "limit", type=_Positive(0.0, min_open=True), default=3660.0, show_default=True, metavar="S",
    help="An engine that has not come back from a case by then is ended, s; compilation counts.",
)  # fmt: skip


@cli.command()
@_shared
@click.option("--rtol", type=float, metavar="R", help="Tolerance, for the engines that have one.")
@click.option(
    "--set-engine", "settings", metavar="[E[:PROFILE].]K=V", multiple=True,
    help="Setting of one engine, or of all that have it; repeatable.",
)  # fmt: skip
@click.option("--dry-run", "dry", is_flag=True, help="Say what would be run, and run nothing.")
@click.option("--strict", is_flag=True, help="Exit code 1 too if a number is worse than its regression band allows.")
@click.option(
    "--jobs",
    type=click.IntRange(0, 1024),
    default=1,
    show_default=True,
    metavar="J",
    help="Cases at once, in processes; 0: one a processor. Run times are then those beside each other.",
)
@_LIMIT
@_AGAINST
@_WITH
@speaks
def run(
    names: tuple[str, ...], wanted: tuple[str, ...], variant: str | None, pairs: tuple[str, ...], out: Path,
    rtol: float | None, settings: tuple[str, ...], strict: bool, limit: float, against: Path | None,
    others: tuple[Path, ...], jobs: int, dry: bool,
) -> int:  # fmt: skip
    """Run cases on engines, judge them, and write the report."""
    if dry:
        from crossbody.reports.commands.planned import tell

        return tell(names, wanted, variant, pairs, settings)
    from crossbody.reports.commands.run import run as work

    return work(
        names,
        wanted,
        variant,
        pairs,
        out,
        rtol,
        settings,
        _command(),
        against,
        others,
        limit,
        strict,
        jobs or os.cpu_count() or 1,
    )


@cli.command()
@_shared
@click.option("--repeats", type=click.IntRange(1, 1000), metavar="N", help="Timed runs of each; 3, or 7 with --full.")
@click.option("--full", is_flag=True, help="Every case, every rung of every ladder; without it some minutes.")
@click.option("--minutes", type=click.FloatRange(0.1), help="About how long; ladders end earlier for it.")
@click.option("--against", type=click.Path(path_type=Path), metavar="BASE", help="Folder of an earlier benchmark.")
@click.option("--skip", "what", flag_value="skip", help="Instead: what is not done that a scene does not need.")
@click.option("--throughput", "what", flag_value="throughput", help="Instead: many runs at once, in threads.")
@_LIMIT
@speaks
def bench(
    names: tuple[str, ...], wanted: tuple[str, ...], variant: str | None, pairs: tuple[str, ...], out: Path,
    repeats: int | None, full: bool, minutes: float | None, against: Path | None, what: str | None, limit: float,
) -> int:  # fmt: skip
    """Time engines against their error over ladders of tolerances and steps.

    With --against the exit code is 1 if accuracy or a ratio of run times was lost.
    """
    from crossbody.reports.commands import bench as work

    if what is not None:
        return work.alone(what, (names, wanted, variant, pairs, full, minutes, against), repeats, out, _command())
    bound = float("inf") if minutes is None else minutes
    return work.run(names, wanted, variant, pairs, out, repeats, full, against, _command(), limit, bound)


@cli.command()
@click.option(
    "--n",
    "counts",
    type=click.IntRange(2, 200),
    multiple=True,
    default=(3, 5),
    show_default=True,
    help="Number of balls; repeatable.",
)
@click.option("--engine", "-e", "wanted", metavar="E[:PROFILE]", multiple=True, help="Engine; repeatable.")
@click.option("--points", type=click.IntRange(2, 10_000), default=61, show_default=True, help="Gaps from s = 0 to 3.")
@click.option("--out", type=click.Path(path_type=Path), default=DEFAULT_OUT, show_default=True, metavar="DIR")
@speaks
def gapmap(counts: tuple[int, ...], wanted: tuple[str, ...], points: int, out: Path) -> int:
    """Map energy created and pattern of Newton's cradle over the gap between its balls."""
    from crossbody.reports.commands.maps import gap_map as work

    return work(counts, wanted, points, out, _command())


@cli.command()
@click.option("--engine", "-e", "wanted", metavar="E[:PROFILE]", multiple=True, help="Engine; repeatable.")
@click.option("--out", type=click.Path(path_type=Path), default=DEFAULT_OUT, show_default=True, metavar="DIR")
@speaks
def stability(wanted: tuple[str, ...], out: Path) -> int:
    """Map from which scenes the closed-loop ball maze still comes to its centre."""
    from crossbody.reports.commands.maps import stability_map as work

    return work(wanted, out, _command())


@cli.command()
@click.argument("names", metavar="[SUITE]...", nargs=-1)
@click.option("--engine", "-e", "wanted", metavar="E[:PROFILE]", multiple=True, help="Engine; repeatable.")
@click.option("--runs", type=int, metavar="N", help="Runs of the first engine over all suites.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of every draw.")
@click.option("--jobs", type=click.IntRange(0, 1024), default=0, metavar="J", help="Processes; 0: one a processor.")
@click.option("--scheduler", metavar="ADDRESS", help="Run on a dask cluster instead, for example tcp://host:8786.")
@click.option("--tls-ca", default="", metavar="FILE", help="Certificates (PEM) that a scheduler's must come from.")
@click.option("--tls-cert", default="", metavar="FILE", help="Certificate (PEM) that is shown to a scheduler.")
@click.option("--tls-key", default="", metavar="FILE", help="Its key, if it is not in the same file.")
@click.option("--resume", is_flag=True, help="Go on with the sweep in DIR; it has to be there.")
@click.option("--out", type=click.Path(path_type=Path), default=Path("stress"), show_default=True, metavar="DIR")
@_parameters
@speaks
def stress(
    names: tuple[str, ...], wanted: tuple[str, ...], runs: int | None, seed: int, jobs: int, scheduler: str | None,
    tls_ca: str, tls_cert: str, tls_key: str, resume: bool, out: Path, pairs: tuple[str, ...],
) -> int:  # fmt: skip
    """Run suites of extreme scenes, map where each engine stays finite and accurate, and shrink every failure.

    A SUITE may be a case of your own or a robot's file: other laws of its rows, pushes on its bodies, other numbers.
    A sweep that was interrupted goes on where it stood when the same command is given again.
    """
    from crossbody.reports.commands.stress import Ask
    from crossbody.reports.commands.stress import stress as work
    from crossbody.reports.sweep.pools import Tls

    tls = Tls(ca=tls_ca, cert=tls_cert, key=tls_key)
    asked = Ask(
        names=names, wanted=wanted, runs=runs, seed=seed, jobs=jobs, scheduler=scheduler, tls=tls, resume=resume,
        pairs=pairs,
    )  # fmt: skip
    return work(asked, out, _command())


@cli.command()
@click.argument("name", metavar="CASE")
@_parameters
@click.option("--out", type=click.Path(path_type=Path), default=DEFAULT_OUT, show_default=True, metavar="DIR")
@speaks
def bode(name: str, pairs: tuple[str, ...], out: Path) -> int:
    """Frequency responses of a case (soft_contact) about its equilibrium, with and without feedback."""
    from crossbody.reports.commands.bode import bode as work

    return work(name, pairs, out, _command())


@cli.command()
@click.argument("name", metavar="CASE")
@click.option("--variant", "--key", metavar="V", help="Variant of the case; the first if not given.")
@_parameters
@click.option("--at", metavar="K=V", multiple=True, help="Where to look: x, y, z of the flange, m; repeatable.")
@click.option("--bode", is_flag=True, help="Frequency responses too.")
@click.option("--locus", metavar="PARAM=a..b", help="Poles over a parameter of the case.")
@click.option("--map", "mapped", is_flag=True, help="Stability over the workspace.")
@click.option("--out", type=click.Path(path_type=Path), metavar="DIR", help="Folder for tables and figures.")
@speaks
def analyse(
    name: str, variant: str | None, pairs: tuple[str, ...], at: tuple[str, ...], bode: bool, locus: str | None,
    mapped: bool, out: Path | None,
) -> int:  # fmt: skip
    """Equilibria of a case, their linear models, poles, ranks, responses and maps."""
    from crossbody.reports.commands.analyse import analyse as work

    return work(
        name, variant, pairs, at, bode=bode, locus=locus, mapped=mapped, out=out, command=_command()
    )  # fmt: skip


@cli.command()
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.option("--single-file", is_flag=True, help="One file with all pages, to be sent.")
@_AGAINST
@_WITH
@speaks
def report(folder: Path, single_file: bool, against: Path | None, others: tuple[Path, ...]) -> int:
    """Make the pages of an earlier run again."""
    from crossbody.reports.pages import site

    made = site.write(folder, single_file=single_file, against=against, others=others).absolute()
    if as_json():
        click.echo(json.dumps({"report": str(made)}))
    elif not quiet():
        click.echo(f"Report: {made}")
    return 0


@cli.command()
@click.argument("file", metavar="FILE", type=click.Path(path_type=Path))
@click.option("--engine", "-e", "engines", metavar="E", multiple=True, help="Engine; repeatable; all if not given.")
@click.option("--without", default="", metavar="PARTS", help="Parts of the file that no reader is held to.")
@click.option(
    "--time-limit",
    "limit",
    type=_Positive(0.0, min_open=True),
    default=20.0,
    show_default=True,
    metavar="S",
    help="A reader that has not come back by then is ended, s.",
)
@click.option("--explain", is_flag=True, help="Say which feature is read wrongly, on which line, and how to write it.")
@click.option("--fix", type=click.Path(path_type=Path), metavar="OUT", help="Write FILE so that more readers agree.")
@click.option("--force", is_flag=True, help="Let files be written over that were not written so.")
@click.option("--sarif", type=click.Path(path_type=Path), metavar="F", help="Write the findings as SARIF too.")
@click.option("--markdown", type=click.Path(path_type=Path), metavar="F", help="Write a summary in Markdown too.")
@speaks
def audit(
    file: Path, engines: tuple[str, ...], without: str, limit: float, explain: bool, fix: Path | None, force: bool,
    sarif: Path | None, markdown: Path | None,
) -> int:  # fmt: skip
    """Say whether every engine's own reader makes the same robot of FILE (MJCF or URDF), where not, and why."""
    from crossbody.reports.commands.audit import Ask
    from crossbody.reports.commands.audit import audit as work

    asked = Ask(
        path=file, engines=engines, without=without, seconds=limit, explain=explain, fix=fix, force=force, sarif=sarif,
        markdown=markdown,
    )  # fmt: skip
    return work(asked)


@cli.command()
@click.option("--engine", "-e", "engines", metavar="E", multiple=True, help="Engine; repeatable; all if not given.")
@click.option("--feature", default="", metavar="TEXT", help="Features alone whose name has TEXT in it.")
@click.option(
    "--time-limit",
    "limit",
    type=_Positive(0.0, min_open=True),
    default=20.0,
    show_default=True,
    metavar="S",
    help="A reader that has not come back by then is ended, s.",
)
@click.option("--out", type=click.Path(path_type=Path), default=DEFAULT_OUT, show_default=True, metavar="DIR")
@speaks
def conformance(engines: tuple[str, ...], feature: str, limit: float, out: Path) -> int:
    """Show what every engine's own reader makes of each feature of robot files, by one small file a feature."""
    from crossbody.reports.commands.conformance import conformance as work

    return work(engines, feature, limit, out, _command())


cli.add_command(replay)
cli.add_command(identify)


@cli.group()
def log() -> None:
    """Look at logs of hardware."""


@log.command("info")
@click.argument("path", metavar="LOG", type=click.Path(path_type=Path))
@click.option("--columns", metavar="MAP", help="Column map (TOML) to check it by.")
@click.option("--part", type=int, metavar="N", help="Number of the run, where the map tells several apart.")
@click.option("--draft", is_flag=True, help="Print a draft of a column map and nothing else.")
@memory_option
@speaks
def log_info(path: Path, columns: str | None, part: int | None, draft: bool, memory: int) -> int:
    """Show channels, rates, gaps and ranges of LOG, what is wrong with it, and a draft of a column map."""
    from crossbody.reports.replay.log import info

    return info(path, columns, part, draft, memory)


@cli.command()
@speaks
def warm() -> int:
    """Compile ahead what runs need, on all processors."""
    from crossbody.reports.commands.warm import warm as work

    return work()


@cli.group(invoke_without_command=True)
@click.pass_context
def cache(context: click.Context) -> None:
    """Show where compiled code is kept and how much it is."""
    if context.invoked_subcommand is None:
        context.exit(context.invoke(cache_show))


@cache.command("show")
@speaks
def cache_show() -> int:
    """Show where compiled code is kept and how much it is."""
    from crossbody.reports.commands.cache import show

    return show()


@cache.command("clear")
@speaks
def cache_clear() -> int:
    """Remove all compiled code; the next run compiles again."""
    from crossbody.reports.commands.cache import clear

    return clear()


def _command() -> str:
    return shlex.join(["crossbody", *sys.argv[1:]])


def main(arguments: list[str] | None = None) -> None:
    """Entry point: every error of use is one sentence and exit code 2, every fault of crossbody's own is 3.

    From a shell (no arguments given here) the command runs in a child that this process watches.
    """
    if arguments is None and hasattr(os, "fork"):
        from crossbody.reports.runs.watch import watched

        sys.exit(watched(lambda: _obey(None)))
    sys.exit(_obey(arguments))


def _obey(arguments: list[str] | None) -> int:
    try:
        code = cli.main(args=arguments, prog_name="crossbody", standalone_mode=False)
        sys.stdout.flush()  # what cannot be written is told, not lost with the process
    except (click.exceptions.Abort, KeyboardInterrupt):
        return 130
    except click.ClickException as error:
        return _say(error.format_message())
    except CrossbodyError as error:
        return 130 if stopping() else _say(str(error))
    except BrokenPipeError:
        return _enough()
    except SystemExit:  # click's own answer to a pipe that is closed, whose streams it has wrapped
        if type(sys.stdout).__name__.endswith("PacifyFlushWrapper"):
            return _enough()
        raise
    except Exception as error:
        if stopping():  # what is being imported may make an ImportError of it
            return 130
        if isinstance(error, OSError) and error.errno in REFUSED:
            _drop_what_cannot_be_printed()
            return _say(f"The system refuses: {error.strerror}{f' ({error.filename})' if error.filename else ''}.")
        return _crashed(error)
    return code if isinstance(code, int) else 0


REFUSED = (
    errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS, errno.EACCES, errno.EPERM, errno.EMFILE,
    errno.ENFILE, errno.ENOMEM, errno.ENAMETOOLONG, errno.ELOOP, errno.ENOTDIR, errno.EISDIR,
    errno.EBUSY, errno.ETXTBSY,
)  # fmt: skip
"""What the system may refuse whatever a program does, paths that a user gave among it."""


def _enough() -> int:
    """Whoever read what is printed has read enough: let the rest go nowhere, which is no fault."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    return 0


def _drop_what_cannot_be_printed() -> None:
    """Let what waits for a full disk go nowhere: the end of the process would try it again."""
    try:
        sys.stdout.flush()
    except OSError:
        _enough()


def _say(text: str, code: int = 2) -> int:
    with suppress(OSError):  # the code tells where stderr cannot
        click.echo(folded(f"crossbody: {text}"), err=True)
    return code


def _crashed(error: Exception) -> int:
    """A fault of crossbody's own: one sentence, and the traceback in a file."""
    text = f"{_command()}\n{sys.version}\n{''.join(traceback.format_exception(error))}"
    try:
        handle, name = tempfile.mkstemp(prefix="crossbody-crash-", suffix=".txt")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
    except OSError:
        with suppress(OSError):
            click.echo(text, err=True)
        name = "what stands above"
    what = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    return _say(f"This is a fault of crossbody ({what[:300]}). Please report it with {name}.", 3)
