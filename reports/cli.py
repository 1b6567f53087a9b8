"""The command `crossbody`.

Exit code 0: nothing is outside its limit (what is expected-outside, or not judged, does not count); 1: something is; 2:
wrong use, reported in one sentence on stderr; 3: a fault of crossbody, whose traceback is in a file; 130:
interrupted. Whatever is not needed to read the command line is imported by the command that needs it.
"""

from __future__ import annotations

import errno
import json
import os
import sys
import tempfile
import traceback
from collections.abc import Callable
from contextlib import nullcontext, redirect_stdout, suppress
from importlib import import_module
from pathlib import Path
from typing import Any

import click

from crossbody.cases import installed
from crossbody.reports.commands import options
from crossbody.reports.runs.watch import stopping
from crossbody.reports.voice import as_json, folded, pure, quiet, result, speaks


def _plug(context: click.Context, _: click.Parameter, given: tuple[str, ...]) -> None:
    if not context.resilient_parsing:
        with suppress(FileNotFoundError):  # the folder one works in may be gone
            given = (*map(str, installed.configured(Path.cwd())), *given)
        with redirect_stdout(sys.stderr):  # what a file prints while it is imported is no result
            installed.use(given)


class _Commands(click.Group):
    """Commands that all take --plugin, and the plug-ins that the configuration names."""

    group_class = type

    def add_command(self, cmd: click.Command, name: str | None = None) -> None:
        """Add a command, or a group of such."""
        text = "File with your own engine, metric, log format, case, ...; repeatable, or [tool.crossbody] plugins."
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
@click.argument(
    "name", metavar="[NAME]", required=False, shell_complete=options.names_of("cases", "engines", "hw.models")
)  # fmt: skip
@click.option("--json", "plain", is_flag=True, help="Print names and summaries as JSON.")
def list_(name: str | None, plain: bool) -> None:
    """List all names, or the details of one.

    One is a case, a robot file, an engine or a model of logs; all names are those of cases, engines, metrics, stress
    suites, models and column maps of logs.
    """
    from crossbody.reports import described

    with pure() if plain else nullcontext():
        told = described.everything() if name is None else described.one(name)
    if name is not None and Path(name).suffix:  # a file
        from crossbody.reports.commands.shared import check_answers

        check_answers("list")
    click.echo(json.dumps({k.lower(): v for k, v in told.items()}, indent=1) if plain else described.text(told))


def _do(where: str, *given: Any, **asked: Any) -> int:
    """Import what does a command, MODULE.FUNCTION of `commands`, and do it."""
    module, _, name = where.partition(".")
    work: Callable[..., int] = getattr(import_module(f"crossbody.reports.commands.{module}"), name)
    return work(*given, **asked)


@cli.command()
@options.cases
@click.option("--rtol", type=options.NUMBER, metavar="R", help="Tolerance, for the engines that have one.")
@click.option(
    "--set-engine", "settings", metavar="[E[:PROFILE].]K=V", multiple=True,
    help="Setting of one engine, or of all engines that have it; repeatable.", shell_complete=options.settings_of,
)  # fmt: skip
@click.option("--dry-run", "dry", is_flag=True, help="Show what would be run, without running it.")
@click.option("--strict", is_flag=True, help="Exit code 1 also if a number has left its regression band.")
@click.option(
    "--jobs", type=options.Whole(0, 1024), default=1, show_default=True, metavar="J",
    help="Cases at once, in processes; 0: one per processor. Run times then include the mutual slowdown.",
)  # fmt: skip
@click.option(
    "--budget", type=options.ABOVE_0, default=5.0, show_default=True, metavar="S",
    help=("Processor time of the tightest run of a scene: motions are compared as far as it gets. Engines may "
        "take 12 times as long."),
)  # fmt: skip
@options.engine_limit
@options.against
@options.others
@speaks
def run(dry: bool, jobs: int, **asked: Any) -> int:
    """Run cases on engines, judge them, and write the report."""
    if dry:
        words = ("names", "wanted", "variant", "pairs", "rtol", "settings", "out", "against", "others", "limit")
        return _do("planned.tell", **{name: asked[name] for name in (*words, "budget")})
    from crossbody.reports.runs import choice, output  # wrong words are reported before all else is imported

    given = choice.parse_settings(asked["pairs"])
    output.check(asked["out"], "run")
    names, variant = asked["names"], asked.pop("variant")
    cases = choice.load_cases(names, variant, given, asked["limit"])
    sources = choice.sources(names, variant)
    return _do("run.run", cases, sources, **asked, at_once=jobs or os.cpu_count() or 1, command=options.command())


@cli.command()
@options.cases
@click.option("--repeats", type=options.Whole(1, 1000), metavar="N", help="Timed runs of each; 3, or 7 with --full.")
@click.option(
    "--full",
    is_flag=True,
    help="Every case and every rung of every ladder; without it, a selection that takes some minutes.",
)
@click.option(
    "--minutes", type=options.Number(0.1), metavar="M", help="Approximate total time; ladders are shortened to meet it."
)
@click.option("--against", type=options.PATH, metavar="BASE", help="Folder of an earlier benchmark.")
@click.option("--skip", "what", flag_value="skip", help="Instead: measure the work that a scene avoids.")
@click.option("--throughput", "what", flag_value="throughput", help="Instead: measure many runs at once, in threads.")
@options.engine_limit
@speaks
def bench(what: str | None, **asked: Any) -> int:
    """Measure run time against error.

    Engines climb ladders of tolerances and steps.

    With --against the exit code is 1 if accuracy or a ratio of run times was lost.
    """
    if what is None:
        return _do("bench.run", **asked, command=options.command())
    return _do("bench.alone", what, **asked, command=options.command())


@cli.command()
@click.option(
    "--n", "counts", type=options.Whole(2, 200), multiple=True, default=(3, 5), show_default=True,
    metavar="N", help="Number of balls; repeatable.",
)  # fmt: skip
@options.wanted
@click.option(
    "--points", type=options.Whole(2, 10_000), default=61, show_default=True, metavar="N", help="Gaps from s = 0 to 3."
)
@options.out()
@speaks
def gapmap(**asked: Any) -> int:
    """Map Newton's cradle over the gap between its balls.

    The map shows the energy created and the distance from the ideal pattern.
    """
    return _do("maps.gap_map", **asked, command=options.command())


@cli.command()
@options.wanted
@options.out()
@speaks
def stability(**asked: Any) -> int:
    """Map when the closed-loop ball maze reaches its centre."""
    return _do("maps.stability_map", **asked, command=options.command())


@cli.command()
@click.argument("names", metavar="[SUITE]...", nargs=-1, shell_complete=options.names_of("reports.suites", "cases"))
@options.wanted
@click.option("--runs", type=options.COUNT, metavar="N", help="Number of runs of the first engine, over all suites.")
@click.option("--seed", type=options.Whole(0), default=0, show_default=True, metavar="N", help="Seed of all draws.")
@click.option("--jobs", type=options.Whole(0, 1024), default=0, metavar="J", help="Processes; 0: one per processor.")
@click.option(
    "--time-limit", "limit", type=options.ABOVE_0, metavar="S", help="Time of one run, s; else the suite's own."
)
@click.option("--scheduler", metavar="ADDRESS", help="Run on a dask cluster instead, for example tcp://host:8786.")
@click.option(
    "--tls-ca", default="", metavar="FILE", help="Certificates (PEM) of the authorities that may sign the scheduler's."
)
@click.option("--tls-cert", default="", metavar="FILE", help="Certificate (PEM) to present to the scheduler.")
@click.option("--tls-key", default="", metavar="FILE", help="Key of --tls-cert, if it is not in the same file.")
@click.option("--resume", is_flag=True, help="Continue the sweep in DIR, which must exist.")
@options.out("stress")
@options.parameters
@speaks
def stress(out: Path, tls_ca: str, tls_cert: str, tls_key: str, **asked: Any) -> int:
    """Run extreme scenes, and shrink every failure.

    The pages map where each engine stays finite and accurate.

    A SUITE may be a case or a robot file, whose laws, pushes and parameters are then varied.
    An interrupted sweep continues when the same command is repeated.
    """
    from crossbody.reports.commands.stress import Ask
    from crossbody.reports.sweep.pools import Tls

    ask = Ask(tls=Tls(ca=tls_ca, cert=tls_cert, key=tls_key), **asked)
    return _do("stress.stress", ask, out, options.command())


@cli.command()
@click.argument("name", metavar="CASE", type=click.Choice(("soft_contact",)), expose_value=False)
@options.parameters
@options.out()
@speaks
def bode(**asked: Any) -> int:
    """Compute frequency responses of a case.

    The case soft_contact has them, about its equilibrium, with and without feedback.
    """
    return _do("analyse.bode", **asked, command=options.command())


@cli.command()
@click.argument("name", metavar="CASE", shell_complete=options.names_of("cases"))
@click.option(
    "--variant", "--key", metavar="V", help="Variant of the case; the first if not given.",
    shell_complete=options.variants_of,
)  # fmt: skip
@options.parameters
@click.option("--at", metavar="K=V", multiple=True, help="Position of the flange (x, y, z), m; repeatable.")
@click.option("--bode", is_flag=True, help="Add frequency responses.")
@click.option("--locus", metavar="PARAM=a..b", help="Poles over a parameter of the case.")
@click.option("--map", "mapped", is_flag=True, help="Stability over the workspace.")
@click.option("--out", type=options.PATH, metavar="DIR", help="Folder for tables and figures.")
@speaks
def analyse(**asked: Any) -> int:
    """Find equilibria of a case and their linear models.

    For each: poles, ranks, responses, and maps over a parameter or the workspace.
    """
    from crossbody import cases
    from crossbody.reports.runs.choice import parse_settings

    # What is wrong is told before anything is compiled.
    cases.load(asked["name"], asked["variant"], **parse_settings(asked["pairs"]))
    return _do("analyse.analyse", **asked, command=options.command())


@cli.command()
@click.argument("folder", metavar="DIR", type=options.PATH)
@click.option("--single-file", is_flag=True, help="Write all pages into one file that can be sent.")
@options.against
@options.others
@speaks
def report(folder: Path, **asked: Any) -> int:
    """Rewrite the pages of an earlier run."""
    from crossbody.cases.errors import several
    from crossbody.reports import layout
    from crossbody.reports.pages import site
    from crossbody.reports.pages.figures import few

    before = site.pages_of(folder)
    made = site.write(folder, **asked).absolute()
    gone = sorted(before - site.pages_of(folder)) if asked["single_file"] else []
    if as_json():
        result(json.dumps({"report": str(made)}))
    elif not quiet():
        if gone:
            click.echo(layout.told(f"{several(len(gone), 'page')} removed, which {made.name} now holds: {few(gone)}."))
        click.echo(f"Report: {made}")
    return 0


@cli.command()
@click.argument("folder", metavar="DIR", type=options.PATH)
@click.argument("out", metavar="FILE", type=options.PATH)
@click.option("--case", "case", metavar="CASE:V", default="", help="Case and variant, if the folder has several.")
@click.option(
    "--engine", "-e", metavar="E[:PROFILE]", default="truth", show_default=True, help="Engine whose motion is drawn."
)
@click.option(
    "--at", "instant", metavar="S", type=options.NUMBER, help="Time of the picture, s; 0 if not given. A GIF has none."
)
@click.option(
    "--fps", type=options.ABOVE_0, default=25.0, show_default=True, metavar="F", help="Frames per second of a GIF."
)
@click.option(
    "--speed", type=options.ABOVE_0, default=1.0, show_default=True, metavar="X",
    help="Speed of a GIF, as a multiple of real time.",
)  # fmt: skip
@speaks
def picture(folder: Path, out: Path, case: str, engine: str, instant: float | None, fps: float, speed: float) -> int:
    """Draw a motion of an earlier run.

    FILE.svg or FILE.png shows one instant, FILE.gif the whole motion.
    """
    from crossbody.reports.commands.shared import check_answers
    from crossbody.reports.pages import picture as drawing
    from crossbody.reports.pages.results import motion
    from crossbody.reports.runs.output import require_ours

    require_ours(folder, "run")  # what is wrong is told before anything is asked
    check_answers("picture")
    trace = motion(folder, case, engine)
    drawing.write(drawing.Film(trace), out, instant, fps, speed)
    if as_json():
        result(json.dumps({"picture": str(out.absolute())}))
    elif not quiet():
        click.echo(f"Picture: {out.absolute()}")
    return 0


@cli.command()
@click.argument("file", metavar="FILE", type=options.PATH)
@options.readers
@click.option("--without", default="", metavar="PARTS", help="Parts of the file to leave out of the comparison.")
@options.reader_limit
@click.option("--explain", is_flag=True, help="Show which feature is read wrongly, on which line, and how to write it.")
@click.option("--fix", type=options.PATH, metavar="OUT", help="Write an equivalent file on which more readers agree.")
@click.option("--force", is_flag=True, help="Overwrite files that the same option did not write.")
@click.option("--sarif", type=options.PATH, metavar="F", help="Also write the findings as SARIF.")
@click.option("--markdown", type=options.PATH, metavar="F", help="Also write a summary in Markdown.")
@speaks
def audit(file: Path, limit: float, **asked: Any) -> int:
    """Check whether engines read the same robot from FILE.

    FILE is MJCF or URDF, read by every engine's own reader; differences are listed with their
    place and cause.
    """
    from crossbody.reports.commands.audit import Ask

    return _do("audit.audit", Ask(path=file, seconds=limit, **asked))


@cli.command()
@options.readers
@click.option("--feature", default="", metavar="TEXT", help="Only features whose name contains TEXT.")
@options.reader_limit
@options.out()
@speaks
def conformance(engines: tuple[str, ...], feature: str, limit: float, out: Path) -> int:
    """Show how engines read each feature of robot files.

    Every engine's own reader reads a minimal file for each feature.
    """
    return _do("conformance.conformance", engines, feature, limit, out, options.command())


@cli.command()
@options.replayed
@options.wanted
@options.time_limit("Terminate an engine that has not returned after this time, s.")
@click.option("--closed-loop", is_flag=True, help="Feed the recorded references to the model's controller.")
@speaks
def replay(wanted: tuple[str, ...], limit: float, closed_loop: bool, out: Path, **log: Any) -> int:
    """Replay LOG on a model, and compare the motions."""
    from crossbody.reports.commands.replay import Ask, run_replay

    kind = "closed_loop" if closed_loop else "forward"
    return run_replay(Ask(**log), kind, wanted, out, options.command(), limit)


@cli.command()
@options.replayed
@click.option(
    "--free", "-f", metavar="NAME", multiple=True, required=True, help="Parameter to fit, or delay; repeatable.",
    shell_complete=options.free_of,
)  # fmt: skip
@click.option(
    "--hold", type=options.COUNT, default=2, show_default=True, metavar="N",
    help="Hold every N-th window out of the fit; 0: none.",
)  # fmt: skip
@click.option(
    "--starts", type=click.Choice(["auto", "measured", "free"]), default="auto", show_default=True,
    help="Initial states of the windows: measured, or free unknowns.",
)  # fmt: skip
@click.option(
    "--stride", type=options.COUNT, default=1, show_default=True, metavar="N", help="Compare every N-th sample."
)
@click.option(
    "--budget", type=options.NUMBER, default=300.0, show_default=True, metavar="S", help="Time for the search, s."
)
@options.time_limit("Stop after this time, s, with the best values so far, and terminate a run that does not return.")
@speaks
def identify(
    free: tuple[str, ...], hold: int, starts: str, stride: int, budget: float, limit: float, out: Path, **log: Any
) -> int:
    """Identify parameters of a model from LOG.

    Estimates have intervals, and are judged on held-out windows.
    """
    from crossbody.reports.commands.replay import Ask, run_identify

    return run_identify(Ask(**log), free, hold, starts, stride, budget, out, options.command(), limit)


@cli.group()
def log() -> None:
    """Inspect hardware logs."""


@log.command("info")
@click.argument("path", metavar="LOG", type=options.PATH)
@options.columns
@click.option("--part", type=options.COUNT, metavar="N", help="Number of the run, if the map separates several.")
@click.option("--draft", is_flag=True, help="Print only a draft of a column map.")
@options.memory
@speaks
def log_info(path: Path, columns: str | None, part: int | None, draft: bool, memory: int) -> int:
    """Show channels, rates, gaps and ranges of LOG, its faults, and a draft of a column map."""
    from crossbody.reports.commands.shared import check_answers
    from crossbody.reports.replay.log import info

    check_answers("log")
    return info(path, columns, part, draft, memory)


@cli.command()
@speaks
def warm() -> int:
    """Compile in advance what runs need, on all processors."""
    return _do("cache.warm")


@cli.group(invoke_without_command=True)
@click.pass_context
@speaks
def cache(context: click.Context) -> int:
    """Show the folder of compiled code and its size."""
    return _do("cache.show") if context.invoked_subcommand is None else 0


@cache.command("show")
@speaks
def cache_show() -> int:
    """Show the folder of compiled code and its size."""
    return _do("cache.show")


@cache.command("clear")
@speaks
def cache_clear() -> int:
    """Remove all compiled code; the next run compiles it again."""
    return _do("cache.clear")


def main(arguments: list[str] | None = None) -> None:
    """Entry point: every error of use is one sentence and exit code 2, every fault of crossbody's own is 3.

    From a shell (no arguments given here) the command runs in a child that this process watches.
    """
    if arguments is None and "_CROSSBODY_COMPLETE" in os.environ:  # a shell asks what may stand there
        cli.main(prog_name="crossbody")
    if arguments is None and hasattr(os, "fork"):
        from crossbody.reports.runs.watch import watched

        sys.exit(watched(lambda: _obey(None)))
    sys.exit(_obey(arguments))


def _obey(arguments: list[str] | None) -> int:
    try:
        code = cli.main(args=arguments, prog_name="crossbody", standalone_mode=False)
        sys.stdout.flush()  # what cannot be written is reported, not lost with the process
    except (click.exceptions.Abort, KeyboardInterrupt):
        return 130
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.ctx.get_help() if error.ctx else error.format_message(), err=True)
        return 2
    except click.ClickException as error:
        return _say(error.format_message())
    except (Exception, SystemExit) as error:
        if stopping():  # what is being imported may make an ImportError of it
            return 130
        if told := installed.sentence(error):
            return _say(told)
        if isinstance(error, FileNotFoundError) and _nowhere():
            return _say("The working folder has been removed; change to another one.")
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


def _nowhere() -> bool:
    try:
        os.getcwd()
    except FileNotFoundError:
        return True
    return False


def _drop_what_cannot_be_printed() -> None:
    """Let what waits for a full disk go nowhere: the end of the process would try it again."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)


def _say(text: str, code: int = 2) -> int:
    line = f"crossbody: {' '.join(text.split())}"
    with suppress(OSError):  # the code tells where stderr cannot; a program that reads it finds one line
        click.echo(folded(line) if sys.stderr.isatty() else line, err=True)
    return code


def _crashed(error: BaseException) -> int:
    """A fault of crossbody's own: one sentence, and the traceback in a file."""
    text = f"{options.command()}\n{sys.version}\n{''.join(traceback.format_exception(error))}"
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
