"""Runs of the reference of which only the end is asked for: many of a mechanism at once, compiled."""

from __future__ import annotations

import time
import warnings
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from crossbody import cases
from crossbody.cases import Case, CrossbodyError, Outcome, Trajectory
from crossbody.engines.equations import system_of
from crossbody.reference import System
from crossbody.reports.sweep.execute import EXCEPTION, REFUSED, Tried, row
from crossbody.reports.sweep.measure import Error, at_the_end
from crossbody.reports.sweep.spec import Spec

RTOL = 1e-9
CONSTANTS = ("a0", "a1", "a2", "b0", "b1")
Ready = tuple[Spec, Case, System]


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
            case = cases.load(spec.case, spec.variant, **spec.parameters)
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
