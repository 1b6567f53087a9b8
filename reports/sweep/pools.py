"""Who executes the chunks of a sweep: this process, processes beside it, or a dask cluster."""

from __future__ import annotations

import asyncio
import time
import warnings
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeVar

import numpy as np

from crossbody import cases
from crossbody.cases import Case, CrossbodyError, InvalidValue, Outcome, SchedulerUnavailable, Trajectory
from crossbody.cases.installed import shared
from crossbody.engines.equations import system_of
from crossbody.reference import System
from crossbody.reports.judging.covered import covered
from crossbody.reports.sweep.execute import EXCEPTION, REFUSED, Tried, crashed, execute, row
from crossbody.reports.sweep.measure import Error, at_the_end
from crossbody.reports.sweep.spec import Spec

RTOL = 1e-9
CONSTANTS = ("a0", "a1", "a2", "b0", "b1")
Ready = tuple[Spec, Case, System]
Rows = list[dict[str, Any]]
Chunk = tuple[int, Sequence[Spec]]
Task = TypeVar("Task")
Done = TypeVar("Done")
ANSWER = 4.0  # time that a scheduler has to answer, s
ENDED = "the process ended during this run: it crashed, ran out of memory, or hung and was terminated"


def together(specs: Iterable[Spec]) -> list[dict[str, Any]]:
    """The rows of all specs that ask for the end alone.

    What stands in one ensemble shares kernels, shape, horizon and unnamed parameters. A run that
    is not finite, or that throws while it is built, is a row like any other.
    """
    rows, groups = [], defaultdict[Any, list[Ready]](list)
    for spec in specs:
        if not spec.ends:
            continue
        try:
            case = covered(cases.load(spec.case, spec.variant, **spec.parameters), spec.time_limit)
            system = system_of(case)
        except CrossbodyError as error:
            rows.append(row(spec, Tried(outcome=REFUSED, message=str(error)), Error(), []))
            continue
        except (Exception, SystemExit) as error:
            said = f"{type(error).__name__}: {error}"
            rows.append(row(spec, Tried(outcome=EXCEPTION, message=said, broken=said), Error(), []))
            continue
        groups[_key(spec, case, system)].append((spec, case, system))
    for group in groups.values():
        rows += _ensemble(group)
    return rows


def _key(spec: Spec, case: Case, system: System) -> Any:
    own: Any = tuple(system.parameters) if isinstance(system.parameters, Mapping) else system.p.tobytes()
    settings = tuple(sorted(spec.knobs.items()))
    return case.mechanism, system.n, case.t_end, case.fsm, case.collisions, spec.max_steps, settings, own


def _ensemble(group: Sequence[Ready]) -> list[dict[str, Any]]:
    from crossbody.reference import ensemble

    spec, case, system = group[0]
    names = list(system.parameters) if isinstance(system.parameters, Mapping) else []
    rtol = float(spec.knobs.get("rtol", RTOL))
    began = time.perf_counter()
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        done = ensemble(
            system, np.stack([c.q0 for _, c, _ in group]),
            np.stack([c.v0 for _, c, _ in group]), case.t_end, threads=1,
            parameters={name: np.array([s.p[i] for _, _, s in group]) for i, name in enumerate(names)},
            law={name: np.stack([getattr(c.law, name) for _, c, _ in group]) for name in CONSTANTS},
            rtol=rtol, fsm=case.fsm, collisions=case.collisions, max_steps=spec.max_steps,
        )  # fmt: skip
    each = (time.perf_counter() - began) / len(group)
    heard = [f"{one.category.__name__}: {one.message}" for one in said]
    return [_row(ready, done, i, rtol, each, heard) for i, ready in enumerate(group)]


def _row(ready: Ready, done: Any, i: int, rtol: float, wall_s: float, heard: list[str]) -> dict[str, Any]:
    spec, case, _ = ready
    outcome = Outcome(done.outcome[i])
    q, v = done.q[i], done.v[i]
    run = _ended(float(done.t[i]), q, v, len(case.contacts), outcome, int(done.steps[i]), wall_s)
    tried = Tried(outcome=outcome.value, run=run, case=case, settings={"rtol": rtol}, wall_s=wall_s)
    tried.message = "" if outcome.ok else outcome.advice
    try:
        error = at_the_end(case, q, v) if outcome.ok else Error()
    except Exception as fault:
        tried.broken = tried.message = f"measuring: {type(fault).__name__}: {fault}"
        error = Error()
    return row(spec, tried, error, heard) | {"events": int(done.events[i])}


def _ended(t: float, q: Any, v: Any, nc: int, outcome: Outcome, steps: int, wall_s: float) -> Trajectory:
    """The end as a motion of one row: what was not asked for is 0."""
    nothing = np.zeros((1, nc))
    return Trajectory(
        t=np.array([t]), q=q[None], v=v[None], gap=nothing, lam=nothing, energy=np.zeros((1, 2)),
        mode=np.full((1, nc), -1, np.int8), outcome=outcome, steps=steps, wall_s=wall_s,
    )  # fmt: skip


def work(chunk: Chunk, alone: bool = False) -> tuple[int, Rows]:
    """Execute the specs of a chunk; those that can share the interpreter's absence go together."""
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
        """What distributed wants of it; None where nothing is given."""
        if self == Tls():
            return None
        if not (self.ca and self.cert):
            raise InvalidValue(
                "--tls-ca and --tls-cert must be given together: both ends of a connection must be known."
            )
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
    """A client of a dask.distributed cluster at tcp://HOST:PORT, or tls://HOST:PORT with `tls`.

    Without it the connection is neither encrypted nor authenticated.
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
