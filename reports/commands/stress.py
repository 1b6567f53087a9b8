"""The command `crossbody stress`: draw, run or go on, join, map, shrink the failures, show."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import click
import pandas as pd

from crossbody.cases import InvalidValue, OutputError
from crossbody.reports import layout, suites, voice
from crossbody.reports.commands.shared import check_answers, print_rows, publish, where
from crossbody.reports.judging.verdict import exit_code
from crossbody.reports.runs import choice, watch
from crossbody.reports.runs.provenance import provenance
from crossbody.reports.suites.contract import Suite
from crossbody.reports.sweep import draw, pools
from crossbody.reports.sweep.map import ERROR, in_words, stability_map, summary, unrun, varied
from crossbody.reports.sweep.minimise import reproducers
from crossbody.reports.sweep.spec import Spec
from crossbody.reports.sweep.store import STRESS, SWEEP, Store, identity

LEAST, MOST, CHUNKS = 4, 100, 400
"""Runs in a chunk, and chunks that a sweep is cut into if they allow it, whatever the number of workers."""
SHOWN = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class Ask:
    """What the user asks for; see the command's help."""

    names: Sequence[str] = ()
    wanted: Sequence[str] = ()
    runs: int | None = None
    seed: int = 0
    jobs: int = 0
    scheduler: str | None = None
    tls: pools.Tls = field(default_factory=pools.Tls)
    resume: bool = False
    pairs: Sequence[str] = ()
    limit: float | None = None


def stress(ask: Ask, out: Path, command: str) -> int:
    """Run suites, or what is left of them; the exit code."""
    check_answers("stress")
    specs = plan(ask)
    chunk = min(max(len(specs) // CHUNKS, LEAST), MOST)
    if ask.resume and not (out / SWEEP).is_file():
        raise OutputError(f"{out} contains no sweep to continue; omit --resume to start one.")
    with _client(ask.scheduler, ask.tls) as client:
        store = Store(out, identity(specs, chunk, {"seed": ask.seed}))
        watch.resumable(f"What is complete is kept in {out}; the same command continues.")
        sweep(store, specs, chunk, Pool(count=ask.jobs, client=client))
    rows, times = store.table()
    with voice.progress(None, done=0) as tell:
        small = reproducers(rows, specs, _processes(ask.jobs), tell)
    tables = {"stress": rows, "stress_times": times, "reproducers": small, "stress_map": stability_map(rows)}
    tables["stress_summary"] = summary(rows, times)
    publish(store.path, STRESS, tables, provenance(command, seed=ask.seed))
    if voice.as_json():
        voice.result(voice.rows_as_json(small))
    else:
        _show(rows, small, out)
    return exit_code(rows["verdict"])


def plan(ask: Ask) -> list[Spec]:
    """Every run that is asked for."""
    if ask.runs is not None and ask.runs < 1:
        raise InvalidValue(f"--runs is {ask.runs}; a sweep needs at least 1.")
    names = list(dict.fromkeys(ask.names or suites.names()))
    fixed = choice.parse_settings(ask.pairs, "--set")
    chosen: list[tuple[str, Suite]] = [(name, suites.load(name, fixed)) for name in names]
    for name, suite in chosen:
        draw.check(name, suite)
    given = choice.picks(ask.wanted) if ask.wanted else None
    picks = {name: given or choice.picks(suite.engines) for name, suite in chosen}
    specs = draw.specs(chosen, picks, ask.runs, ask.seed, share=given is None)
    return specs if ask.limit is None else [replace(spec, time_limit=ask.limit) for spec in specs]


@dataclass(frozen=True, slots=True, kw_only=True)
class Pool:
    """Who executes: a number of processes (0: one a processor, 1: this one), or a cluster's client."""

    count: int = 1
    client: Any = None


@contextmanager
def _client(address: str | None, tls: pools.Tls) -> Iterator[Any]:
    """The cluster, asked for before anything is written."""
    if address is None:
        if tls != pools.Tls():
            raise InvalidValue("--tls-ca, --tls-cert and --tls-key are for the connection to a --scheduler.")
        yield None
        return
    client = pools.connect(address, tls)
    try:
        yield client
    finally:
        client.close(timeout=pools.ANSWER)


def sweep(store: Store, specs: Sequence[Spec], chunk: int, pool: Pool) -> None:
    """Execute what is missing; every chunk is on disk as soon as it is there."""
    parts = [specs[i : i + chunk] for i in range(0, len(specs), chunk)]
    if not (left := [(i, parts[i]) for i in store.missing(len(parts))]):
        return
    with voice.progress(len(parts), done=len(parts) - len(left)) as tell:
        for number, rows in _executed(left, pool):
            store.put(number, rows)
            tell(f"{rows[0]['suite']}: {len(rows)} runs")


def _processes(count: int) -> int:
    return count or len(os.sched_getaffinity(0))


def _executed(left: Sequence[pools.Chunk], pool: Pool) -> Iterable[tuple[int, pools.Rows]]:
    if pool.client is not None:
        return pools.cluster(left, pool.client)
    count = _processes(pool.count)
    return pools.surviving(pools.work, left, 1) if count == 1 else pools.processes(left, count)


def _show(rows: pd.DataFrame, small: pd.DataFrame, out: Path) -> None:
    """One line a suite and engine, the reproducers, and where the page is."""
    if not voice.quiet():
        click.echo(layout.told(in_words(rows)))
        click.echo("\n".join(map(layout.told, varied(rows))))
    print_rows(summary(rows), digits=2, above="suite", left_out=("with_truth", "not_run", "worst_residual"))
    if not voice.quiet():
        click.echo("\n".join(map(layout.told, [ERROR, *unrun(rows)])))
    for line in small.head(SHOWN).to_dict(orient="records"):
        click.echo(f"{line['verdict']}: {line['outcome']} ({line['count']}x): {line['command']}")
        click.echo(layout.told(f"    {line['why'][:300]}"))
    if len(small) > SHOWN:
        print(f"and {len(small) - SHOWN} more kinds in {out / 'reproducers.csv'}")
    where(out)
