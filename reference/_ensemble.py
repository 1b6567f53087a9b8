"""Many runs of one mechanism, each with its own start, parameters and law, in threads without the interpreter."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from queue import SimpleQueue
from typing import Any, Unpack

import numba
import numpy as np
from numba import types
from numpy.typing import ArrayLike, NDArray

from crossbody.cases import InvalidValue, SceneError, UnknownName
from crossbody.cases.arrays import distinct, frozen, numbers
from crossbody.cases.control import Control
from crossbody.cases.entry_points import checked_arguments
from crossbody.reference import kernels
from crossbody.reference._check import check_once
from crossbody.reference._program import advance, advance_address, bound
from crossbody.reference._run import OUTCOMES, CompiledRun
from crossbody.reference._system import System, initial_modes
from crossbody.reference.cache import compiled
from crossbody.reference.core.bundles import ADDRESSES, TABLE
from crossbody.reference.core.layout import MORE, STATE, open_buffers, open_model, open_work
from crossbody.reference.kinds import Floats, Index
from crossbody.reference.options import Chosen, Options, checked
from crossbody.reference.start import check_starts

CONSTANTS = ("a0", "a1", "a2", "b0", "b1", "b2")
CHUNKS = 16  # parts a thread takes, so that none waits long for another
SLICE = 1000  # steps between two looks at the bound on steps


@dataclass(frozen=True, slots=True, kw_only=True)
class Ensemble:
    """Where many runs ended.

    Attributes:
        t (N,): time reached, s: the horizon, unless a run failed.
        q (N, nq), v (N, n): state there.
        outcome (N,): how each ended, as `Outcome`.
        steps, events (N,): counts.
        wall_s: time of all runs together, s.
    """

    t: Floats
    q: Floats
    v: Floats
    outcome: NDArray[Any]
    steps: Index
    events: Index
    wall_s: float


@checked_arguments
def ensemble(
    system: System,
    q0: ArrayLike,
    v0: ArrayLike,
    t_end: float,
    *,
    parameters: Mapping[str, ArrayLike] | None = None,
    law: Mapping[str, ArrayLike] | None = None,
    threads: int | None = None,
    **options: Unpack[Chosen],
) -> Ensemble:
    """Run one mechanism N times to t_end.

    Args:
        system: the mechanism; what is not given below is its own.
        q0: positions at the start (N, nq); N is the number of runs.
        v0: velocities at the start (N, n).
        t_end: horizon, s.
        parameters: name -> (N,) values of the system's named parameters.
        law: a0, a1, a2, b0, b1, b2 -> (N,) or (N, nc).
        threads: at most the processors at hand, which is the default.
        options: as in `Options`, without samples, events and dense: nothing is recorded on the way.

    Raises:
        SceneError: for an array of another shape, if a kernel is wrong at the first start
            (`System.check`), or if a start is off a row that is always on (`Options.consistent`).
        UnknownName: for a parameter or constant that the system does not have.
        InvalidValue: for an option or a number of threads outside its range.
    """
    if isinstance(system.control, Control):
        raise SceneError("ensemble: the system has a controller in Python, one for every run; run them by `simulate`.")
    for name in {"samples", "events", "dense"} & options.keys():
        raise InvalidValue(f"ensemble: {name} is given; nothing is recorded on the way (`simulate` does, of one run).")
    settings = replace(checked(t_end, options), samples=(), events=False)
    job = _Job(system, q0, v0, parameters or {}, law or {})
    count = len(os.sched_getaffinity(0)) if threads is None else threads
    if not 1 <= count <= 1024:
        raise InvalidValue(f"threads is {threads}; valid: 1 to 1024.")
    settings.check_friction(system)
    check_once(system, job.starts[0, : system.nq], job.starts[0, system.nq :], t_end)
    check_starts(system, job.starts, job.p, settings)
    spaces: SimpleQueue[CompiledRun] = SimpleQueue()
    for _ in range(count):
        spaces.put(_space(system, job, settings))
    loop = bound(compile_loop(), kernels.NAMES, tuple(system.kernels.values()), advance_address())
    edges = distinct(np.linspace(0, job.size, count * CHUNKS + 1).astype(int))
    began = time.perf_counter()
    with ThreadPoolExecutor(count) as pool:
        list(pool.map(lambda ends: job.call(loop, spaces, *ends), pairwise(edges)))
    return job.result(time.perf_counter() - began)


def _space(system: System, job: _Job, settings: Options) -> CompiledRun:
    run = CompiledRun(system, job.starts[0, : system.nq], job.starts[0, system.nq :], settings)
    run.start()
    return run


class _Job:
    """Inputs and outputs of all runs, one line a run."""

    def __init__(
        self, system: System, q0: ArrayLike, v0: ArrayLike, given: Mapping[str, ArrayLike], law: Mapping[str, ArrayLike]
    ) -> None:
        self.system, n, nq = system, system.n, system.nq
        q = frozen("ensemble", "q0", q0, (None, nq))
        self.size = len(q)
        if not self.size:
            raise SceneError("ensemble.q0 has no line; give one start a run.")
        v = frozen("ensemble", "v0", v0, (self.size, n))
        if not (np.all(np.isfinite(q)) and np.all(np.isfinite(v))):
            raise SceneError("ensemble.q0 and v0 must be finite.")
        self.starts = np.ascontiguousarray(np.hstack([system.normalised("ensemble.q0", q), v]))
        self.p = np.tile(np.asarray(system.p), (self.size, 1))
        names = list(system.parameters) if isinstance(system.parameters, Mapping) else []
        for name, values in given.items():
            if name not in names:
                raise UnknownName("parameter", name, names)
            self.p[:, names.index(name)] = self._column(name, values)
        self.laws = np.tile(np.stack([system.alpha, system.beta]), (self.size, 1, 1, 1))
        for name, values in law.items():
            self._put_constant(name, values)
        self.out = np.zeros((self.size, 1 + nq + n))
        self.counts = np.zeros((self.size, 3), np.int64)

    def _column(self, name: str, values: ArrayLike) -> Floats:
        column: Floats = frozen("ensemble", name, values, (self.size,))
        if not np.all(np.isfinite(column)):
            raise SceneError(f"ensemble.{name} must be finite.")
        return column

    def _put_constant(self, name: str, values: ArrayLike) -> None:
        if name not in CONSTANTS:
            raise UnknownName("constant", name, CONSTANTS)
        array = numbers("ensemble", name, values)
        full = np.repeat(array[:, None], self.system.nc, axis=1) if array.ndim == 1 else array
        full = frozen("ensemble", name, full, (self.size, self.system.nc))
        if not np.all(np.isfinite(full)) or np.any(full < 0.0):
            raise SceneError(f"ensemble.{name} must be finite and at least 0.")
        self.laws[:, "ab".index(name[0]), :, int(name[1])] = full

    def call(self, loop: Any, spaces: SimpleQueue[CompiledRun], first: int, last: int) -> None:
        """Do the runs from first to last in one workspace."""
        run = spaces.get()
        try:
            loop(
                first, last, run.template, run.state, *run.tables, self.p, self.laws, self.starts,
                initial_modes(self.system), self.out, self.counts, int(min(run.options.max_steps, 2**62)),
            )  # fmt: skip
        finally:
            spaces.put(run)

    def result(self, wall_s: float) -> Ensemble:
        """What was written."""
        at = 1 + self.system.nq
        return Ensemble(
            t=self.out[:, 0], q=self.system.normalised("ensemble", self.out[:, 1:at]), v=self.out[:, at:],
            outcome=np.array([OUTCOMES[int(code)] for code in self.counts[:, 0]], dtype=object),
            steps=self.counts[:, 1], events=self.counts[:, 2], wall_s=wall_s,
        )  # fmt: skip


def _runs(at, first, last, template, state, model, work, buffers, p, laws, starts, modes, out, counts, limit):  # type: ignore[no-untyped-def]  # fmt: skip
    """The program over a range of runs."""
    go = advance(at[10])
    m, w, b = open_model(model), open_work(work), open_buffers(buffers)
    s = state[0]
    for r in range(first, last):
        state[0] = template[0]
        # Entry by entry: what an array of another shape would be told takes seconds to compile.
        for i in range(len(m.p)):
            m.p[i] = p[r, i]
        for i in range(len(modes)):
            b.mode[i] = modes[i]
            for j in range(3):
                m.alpha[i, j], m.beta[i, j] = laws[r, 0, i, j], laws[r, 1, i, j]
        for i in range(len(w.y)):
            w.y[i] = starts[r, i]
        for z in (w.u, w.s, w.z):
            z.fill(0.0)
        code = MORE
        while code == MORE and s.steps < limit:
            code = go(at, state, model, work, buffers, min(SLICE, limit - s.steps))
        out[r, 0] = s.t
        for i in range(len(w.y)):
            out[r, 1 + i] = w.y[i]
        counts[r, 0], counts[r, 1], counts[r, 2] = code, s.steps, s.events + s.dropped


@cache
def compile_loop() -> Any:
    """Those runs without the interpreter's lock."""
    word, lines, state = types.int64, types.float64[:, ::1], numba.from_dtype(STATE)[::1]
    laws = types.float64[:, :, :, ::1]
    signature = types.void(
        ADDRESSES, word, word, state, state, TABLE, TABLE, TABLE, lines, laws, lines, types.int8[::1], lines,
        types.int64[:, ::1], word,
    )  # fmt: skip
    return compiled(_runs, [signature], nogil=True)
