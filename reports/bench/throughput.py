"""Many runs at once: the compiled reference in threads beside MuJoCo's batch stepping on the same cores."""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numba
import numpy as np
import pandas as pd

from crossbody import cases, engines
from crossbody.cases import EngineUnavailable, Outcome
from crossbody.cases.arrays import Floats
from crossbody.reference import ensemble
from crossbody.reports.bench.skip import COLUMNS, Row, ratio

RTOL = 1e-9
STEP = 1e-3  # of MuJoCo, s
RUNS, BATCH = 4000, 200  # runs of the reference, and of MuJoCo, whose are slower
PAIR_RUNS, PAIRS = 1500, 4
"""Runs on one core and on two, and such pairs for each repeat: short ones find two free cores."""
LEAST_RATIO, LEAST_TWO = 40.0, 1.7
SPINNING = 1.9
"""Two threads that only count must be given this many cores, or the machine has no second one to give."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Draw:
    """Heights (N,), m, and dampings a1 (N,), 1/s, about those of the case: every run its own."""

    heights: Floats
    a1: Floats


def draw(count: int) -> Draw:
    """The same for the same count."""
    random = np.random.default_rng(20240917)
    return Draw(heights=random.uniform(0.9, 1.1, count), a1=random.uniform(15.0, 25.0, count))


def reference(count: int, threads: int, rtol: float = RTOL) -> float:
    """Runs a second of the case "listing" by `ensemble`; every one must finish."""
    case, given = cases.load("bouncing_ball", "listing"), draw(count)
    system = engines.load("reference").prepare(case, "compiled").system  # type: ignore[attr-defined]
    found = ensemble(
        system, given.heights[:, None], np.zeros((count, 1)), case.t_end, law={"a1": given.a1},
        threads=threads, rtol=rtol,
    )  # fmt: skip
    assert all(outcome is Outcome.FINISHED for outcome in found.outcome)
    return count / found.wall_s


def mujoco(count: int, threads: int, integrator: str = "Euler") -> float:
    """Runs a second of the same drops by MuJoCo's batch, stepped in its own threads at 1 ms.

    Its batch takes no Python callback, so the cubic part of the law is missing: this is less work
    than the case's. Its integrator is "Euler", MuJoCo's own and fastest, or "RK4".
    """
    import mujoco as mj
    from mujoco import batch

    case, given = cases.load("bouncing_ball", "listing"), draw(count)
    model = engines.load("mujoco").prepare(case, "matched", dt=STEP).scene.model  # type: ignore[attr-defined]
    model.opt.timestep, model.opt.integrator = STEP, getattr(mj.mjtIntegrator, f"mjINT_{integrator.upper()}")
    model.jnt_margin[0] = 0.0  # the floor: a run opens and closes it by hand
    many = batch.Batch(model, count, threads, persistent=True)
    many.bind("qpos")[:, 0] = given.heights
    steps = round(case.t_end / STEP)
    many.step(nstep=1)
    began = time.perf_counter()
    many.step(nstep=steps - 1)
    return count / (time.perf_counter() - began)


@numba.njit(nogil=True)  # type: ignore[untyped-decorator, unused-ignore]
def _spin(count: int) -> int:
    state = 1
    for _ in range(count):
        state = (state * 1103515245 + 12345) & 0x7FFFFFFF
    return state


def spinning(count: int = 30_000_000) -> float:
    """How many cores two threads that only count are given: processor time over wall time, at most 2."""
    _spin(1)
    cpu, began = time.process_time(), time.perf_counter()
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(_spin, [count] * 2))
    return (time.process_time() - cpu) / (time.perf_counter() - began)


def best_pair(
    one: Callable[[], float], two: Callable[[], float], pairs: int, given: Callable[[], float] = spinning
) -> tuple[float, float, float, float]:
    """The largest ratio two/one of interleaved pairs, its two throughputs, and the cores that were given beside it.

    Pairs beside which two cores were given come first.
    """
    found = [(given(), one(), two()) for _ in range(pairs)]
    cores, a, b = max(found, key=lambda pair: (pair[0] >= SPINNING, pair[2] / pair[1]))
    return b / a, a, b, cores


def against_mujoco(repeats: int, integrator: str) -> Row:
    """Median of the interleaved ratios."""
    cores = len(os.sched_getaffinity(0))
    pairs = [(reference(RUNS, cores), mujoco(BATCH, cores, integrator)) for _ in range(repeats)]
    a, b = (statistics.median(side) for side in zip(*pairs, strict=True))
    return ratio(
        f"runs of `listing` at {RTOL:g} over MuJoCo's batch, {integrator} at {1e3 * STEP:g} ms, {cores} threads",
        statistics.median(a / b for a, b in pairs), LEAST_RATIO,
        f"reference: {a:.4g} runs/s, MuJoCo: {b:.4g} runs/s",
        "compiled, in threads without the interpreter", least=True,
    )  # fmt: skip


def two_cores(repeats: int) -> Row:
    """The best of interleaved pairs; not judged where the machine does not give two cores."""
    on_one, on_two = (partial(reference, PAIR_RUNS, threads) for threads in (1, 2))
    found, one, two, given = best_pair(on_one, on_two, PAIRS * repeats)
    how, beside = f"two spinning threads are given {given:.2f} cores", f"one: {one:.4g} runs/s, two: {two:.4g} runs/s"
    unable = found < LEAST_TWO and given < SPINNING
    row = ratio(
        "runs on two threads over one", found, LEAST_TWO, beside, f"not judged: {how}" if unable else how, least=True
    )
    return row | {"held": row["held"] or unable}


def measure(repeats: int) -> pd.DataFrame:
    """One row a ratio; those over MuJoCo are not measured where it is not installed."""
    rows: list[Row] = []
    try:
        rows += [against_mujoco(repeats, integrator) for integrator in ("Euler", "RK4")]
    except EngineUnavailable as error:
        row = ratio("runs over MuJoCo's batch", float("nan"), LEAST_RATIO, "", f"skipped: {error}", least=True)
        rows.append(row | {"held": True})
    return pd.DataFrame([*rows, two_cores(repeats)], columns=COLUMNS)
