"""The commands `crossbody warm` and `cache`: compiling ahead; where code is kept, and its removal."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, ProcessPoolExecutor, wait
from multiprocessing import get_context

import click

from crossbody import cases, engines
from crossbody.cases import OutputError
from crossbody.cases.errors import several
from crossbody.reference import ahead, code_store
from crossbody.reference.compiling import EVERY_S, silence
from crossbody.reports import voice
from crossbody.reports.runs import watch

Task = tuple[str, Callable[[str], None], str]
"""What is told of it, what does it, and on which name."""


def warm() -> int:
    """Compile what is the same for all mechanisms, and the kernels of every case; the exit code.

    While one processor is at the largest piece, kernels are compiled: an interrupt keeps what is ready, and they are
    ready first.
    """
    began = time.perf_counter()
    watch.resumable("What is compiled is kept; the same command continues.")
    kernels = [(f"kernels of {name}", compile_kernels, name) for name in cases.names()]
    largest, *others = ((name, ahead.compile_piece, name) for name in ahead.PIECES)
    runs = [(name, compile_case, name) for name in cases.names()]
    with voice.progress(len(ahead.PIECES) + 2 * len(runs), 0) as tell, _processes() as pool:
        _each(pool, (largest, *kernels, *others), tell)
        _each(pool, runs, tell)
    if not voice.silent():
        click.echo(f"Compiled in {time.perf_counter() - began:.0f} s; kept in {code_store.base()}.")
    return 0


def _processes() -> ProcessPoolExecutor:
    """As many as there are processors, which leave it to this one to say how far they are."""
    return ProcessPoolExecutor(ahead.processors(), get_context("spawn"), initializer=silence)


def _each(pool: Executor, tasks: Sequence[Task], tell: Callable[[str], None]) -> None:
    """Do all tasks, and say what is done, or every few seconds what is not."""
    found = {pool.submit(work, name): told for told, work, name in tasks}
    left = set(found)
    while left:
        ended, left = wait(left, EVERY_S, FIRST_COMPLETED)
        for done in ended:
            done.result()
            tell(found[done])
            voice.note(f"{found[done]} is compiled")
        if not ended:
            first = [name for one, name in found.items() if one in left][: ahead.processors()]
            voice.note(f"compiling {', '.join(first)}; {len(left)} of {len(tasks)} to go")


def compile_kernels(name: str) -> None:
    """Compile the kernels of a case, in all its variants."""
    from crossbody.engines.equations import has_equations, system_of  # numba, which the other commands do without

    for variant in cases.variants(name):
        if has_equations(case := cases.load(name, variant)):
            system_of(case)


def compile_case(name: str) -> None:
    """Compile what else the runs of a case ask for, in all its variants."""
    for variant in cases.variants(name):
        engines.load("reference").prepare(cases.load(name, variant), "compiled").run()


def show() -> int:
    """Print the folder, the number of its files and their size."""
    where, store = code_store.base(), code_store.current()
    entries = store.entries() if store else []
    size = sum(found.st_size for _, found in entries)
    if voice.as_json():
        folder = None if where is None else str(where)
        told = {"folder": folder, "usable": store is not None, "files": len(entries), "bytes": size}
        voice.result(json.dumps(told))
    else:
        print(f"{where or 'No folder'}: {len(entries)} files, {size / 1e6:.1f} MB" + ("" if store else " (not used)"))
    return 0


def clear() -> int:
    """Remove all compiled code; other files of the folder stay."""
    store = code_store.current()
    entries = store.entries() if store else []
    removed = store.clear() if store else 0
    if left := sum(path.exists() for path, _ in entries):
        files = f"{several(left, 'file')} of {code_store.base()}"
        raise OutputError(f"{files} cannot be removed ({removed} were): the folder must be writable.")
    if voice.as_json():
        voice.result(json.dumps({"removed": removed}))
    elif not voice.quiet():
        print(f"Removed {removed} files of compiled code; the next run compiles again.")
    return 0
