"""The commands `crossbody replay` and `crossbody identify`: their options, nothing heavy."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from crossbody.reports.voice import speaks

_Work = TypeVar("_Work", bound=Callable[..., int])
memory_option = click.option(
    "--memory", type=click.IntRange(1), default=1000, show_default=True, metavar="MB",
    help="That reading LOG may take over its own size; a file that unfolds to more is refused.",
)  # fmt: skip


def _replayed(command: _Work) -> _Work:
    """Options that say which log is replayed on which model; results go to a folder of the command's own."""
    place = Path("out") / command.__name__
    options = (
        click.argument("path", metavar="LOG", type=click.Path(path_type=Path)),
        click.option("--model", "-m", required=True, metavar="M", help="Model; `crossbody list` names them."),
        click.option("--columns", metavar="MAP", help="Column map (TOML); not needed for a stored log."),
        click.option("--part", type=int, metavar="N", help="Number of the run, where the map tells several apart."),
        click.option(
            "--repair", metavar="R", multiple=True, help="fill_dropped, drop_duplicates or unwrap; repeatable."
        ),
        memory_option,
        click.option("--set", "pairs", metavar="K=V", multiple=True, help="Parameter of the model; repeatable."),
        click.option("--restart", type=float, metavar="S", help="Time between restarts, s; 0 for a free run."),
        click.option("--horizon", type=float, metavar="S", help="Length of a window, s, if not to the next restart."),
        click.option("--delay", type=float, default=0.0, metavar="S", help="Delay of what was measured, s."),
        click.option(
            "--limit",
            "limits",
            metavar="NAME=V",
            multiple=True,
            help="Limit on a metric, for example fit=90 or rmse_th1=0.01; repeatable.",
        ),
        click.option("--out", type=click.Path(path_type=Path), default=place, show_default=True, metavar="DIR"),
    )
    for option in reversed(options):
        command = option(command)
    return command


def _time_limit(text: str) -> Callable[[_Work], _Work]:
    return click.option(
        "--time-limit", "limit", type=click.FloatRange(0.0, min_open=True), default=3660.0, show_default=True,
        metavar="S", help=text,
    )  # fmt: skip


@click.command()
@_replayed
@click.option("--engine", "-e", "wanted", metavar="E[:PROFILE]", multiple=True, help="Engine; repeatable.")
@_time_limit("An engine that has not come back by then is ended, s.")
@click.option("--closed-loop", is_flag=True, help="Recorded references through the model's controller.")
@speaks
def replay(wanted: tuple[str, ...], limit: float, closed_loop: bool, out: Path, **log: Any) -> int:
    """Replay LOG on a model and say how well it matches."""
    from crossbody.reports.commands.replay import Ask, run_replay

    return run_replay(Ask(**log), "closed_loop" if closed_loop else "forward", wanted, out, _command(), limit)


@click.command()
@_replayed
@click.option("--free", "-f", metavar="NAME", multiple=True, required=True, help="Parameter, or delay; repeatable.")
@click.option("--hold", type=int, default=2, show_default=True, help="Hold every N-th window out of the fit; 0: none.")
@click.option("--starts", type=click.Choice(["auto", "measured", "free"]), default="auto", show_default=True)
@click.option("--stride", type=int, default=1, show_default=True, help="Compare every N-th sample.")
@click.option("--budget", type=float, default=300.0, show_default=True, metavar="S", help="Time of the search, s.")
@_time_limit("All is stopped by then, with the best so far; a run that does not come back is ended, s.")
@speaks
def identify(
    free: tuple[str, ...], hold: int, starts: str, stride: int, budget: float, limit: float, out: Path, **log: Any
) -> int:
    """Identify parameters of a model from LOG, with intervals, judged on windows that were held out."""
    from crossbody.reports.commands.replay import Ask, run_identify

    return run_identify(Ask(**log), free, hold, starts, stride, budget, out, _command(), limit)


def _command() -> str:
    return shlex.join(["crossbody", *sys.argv[1:]])
