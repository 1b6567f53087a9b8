"""Who executes the chunks of a sweep: this process, processes beside it, or a dask cluster."""

from __future__ import annotations

import asyncio
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeVar

from crossbody.cases import InvalidValue, SchedulerUnavailable
from crossbody.cases.installed import shared
from crossbody.reports.sweep.execute import crashed, execute
from crossbody.reports.sweep.spec import Spec

Rows = list[dict[str, Any]]
Chunk = tuple[int, Sequence[Spec]]
Task = TypeVar("Task")
Done = TypeVar("Done")
ANSWER = 4.0  # time that a scheduler has to answer, s
ENDED = "the process ended during this run: it crashed, ran out of memory, or hung and was ended"


def work(chunk: Chunk, alone: bool = False) -> tuple[int, Rows]:
    """Execute the specs of a chunk; those that can share the interpreter's absence go together."""
    from crossbody.reports.sweep.together import together

    number, specs = chunk
    rows = together(specs)
    rows += [execute(spec, alone) for spec in specs if not spec.ends]
    return number, sorted(rows, key=lambda row: row["index"])


def processes(chunks: Sequence[Chunk], jobs: int) -> Iterator[tuple[int, Rows]]:
    """In processes of joblib's, each with its engines loaded once; as they finish.

    A chunk whose process ends is cut into its runs, and these are tried one by one: the one that
    ends a process alone is a row that says so.
    """
    warm(chunks)
    left = dict(chunks)
    for _ in range(2):
        for number, rows in surviving(partial(work, alone=True), list(left.items()), jobs):
            del left[number]
            yield number, rows
        if not left:
            return
    for number, specs in left.items():
        yield number, [row for spec in specs for row in _single(spec)]


def surviving(function: Callable[[Task], Done], tasks: Sequence[Task], jobs: int) -> Iterator[Done]:
    """What comes back from processes, as done, until one ends that should not; with one job, from here."""
    if jobs == 1:
        yield from map(function, tasks)
        return
    from joblib import Parallel, delayed
    from joblib.externals.loky.process_executor import BrokenProcessPool

    parallel = Parallel(n_jobs=jobs, backend="loky", return_as="generator_unordered", pre_dispatch="2*n_jobs")
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message=".*worker stopped while some jobs.*")
            yield from parallel(delayed(shared(function))(task) for task in tasks)
    except BrokenProcessPool:
        return


def _single(spec: Spec) -> Rows:
    for _, rows in surviving(partial(work, alone=True), [(spec.index, [spec])], 2):  # 1 would be this process
        return rows
    return [crashed(spec, ENDED)]


def warm(chunks: Sequence[Chunk]) -> None:
    """Have the reference's kernels compiled to disk once, before several processes want them."""
    seen = set[tuple[str, str]]()
    for _, specs in chunks:
        for spec in specs:
            if spec.engine == "reference" and (spec.case, spec.variant) not in seen:
                seen.add((spec.case, spec.variant))
                execute(replace(spec, max_steps=1, second=False, ends=False))


@dataclass(frozen=True, slots=True, kw_only=True)
class Tls:
    """Files (PEM) by which both ends of a connection to a cluster prove who they are.

    Attributes:
        ca: certificates that are trusted.
        cert: this end's own certificate.
        key: its private key; empty where the certificate's file holds it.
    """

    ca: str = ""
    cert: str = ""
    key: str = ""

    def security(self) -> Any:
        """What distributed wants of it; None where nothing is given.

        Raises:
            InvalidValue: if one of `ca` and `cert` is missing, or a file cannot be read as what it should be.
        """
        if self == Tls():
            return None
        if not (self.ca and self.cert):
            raise InvalidValue("--tls-ca and --tls-cert belong together: both ends of a connection have to be known.")
        from distributed import Security

        security = Security(
            tls_ca_file=self.ca, tls_client_cert=self.cert, tls_client_key=self.key or None, require_encryption=True
        )
        try:
            security.get_connection_args("client")
        except OSError as error:  # ssl.SSLError is one
            files = ", ".join(filter(None, (self.ca, self.cert, self.key)))
            raise InvalidValue(f"--tls-ca, --tls-cert, --tls-key ({files}) cannot be used: {error}.") from None
        return security


def connect(address: str, tls: Tls | None = None) -> Any:
    """A client of a dask.distributed cluster.

    Args:
        address: tcp://HOST:PORT, or tls://HOST:PORT with `tls`.
        tls: who both ends are; without it the connection is neither encrypted nor authenticated.

    Raises:
        SchedulerUnavailable: if the package is not installed, or nothing answers at the address in time.
        InvalidValue: if the files of `tls` cannot be used.
    """
    try:
        from distributed import Client
    except ModuleNotFoundError:
        raise SchedulerUnavailable(
            "--scheduler needs the package 'distributed', which is not installed: pip install 'crossbody[cluster]'."
        ) from None
    security = (tls or Tls()).security()
    try:
        asyncio.run(_greet(address, security))
        return Client(address, timeout=ANSWER, set_as_default=False, security=security)
    except (
        TimeoutError,
        OSError,
        ValueError,
        MemoryError,
        TypeError,
        RuntimeError,
    ) as error:  # words of another protocol read as a huge size
        said = " ".join(str(error).split()) or type(error).__name__
        raise SchedulerUnavailable(
            f"No dask scheduler answers at {address!r} within {ANSWER:g} s ({said}); "
            "start one with `dask scheduler`, and name it as tcp://HOST:PORT."
        ) from None


async def _greet(address: str, security: Any) -> None:
    """Shake hands once: a client waits for ever for one that listens and says nothing."""
    from distributed.comm import connect as reach

    given = {} if security is None else security.get_connection_args("client")
    comm = await asyncio.wait_for(reach(address, timeout=ANSWER, **given), ANSWER)
    await comm.close()


def cluster(chunks: Sequence[Chunk], client: Any) -> Iterator[tuple[int, Rows]]:
    """On a dask.distributed cluster, which gives the work of a lost worker to another."""
    from distributed import as_completed
    from distributed.scheduler import KilledWorker

    specs = dict(chunks)
    futures = [client.submit(shared(work), chunk, pure=False) for chunk in chunks]
    numbers = {future.key: number for future, (number, _) in zip(futures, chunks, strict=True)}
    for future in as_completed(futures, loop=client.loop):  # this client is nobody's default
        error = future.exception()
        if isinstance(error, KilledWorker):
            number = numbers[future.key]
            why = f"one run of this chunk ended its worker: {error}"
            yield number, [crashed(spec, why) for spec in specs[number]]
        else:
            yield future.result()
        future.release()
