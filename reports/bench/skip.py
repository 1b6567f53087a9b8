"""What a scene does not need costs nothing: measured as ratios within one run, and as counts (spec 5.6)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from crossbody import cases, engines
from crossbody.cases import Case, Outcome
from crossbody.reference import Options, System, prepare

COLUMNS = ["what", "value", "unit", "limit", "held", "beside", "how"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Lever:
    """One thing that is left out.

    Attributes:
        what: in words.
        limit: largest value; None where it is only stated.
        how: what leaves it out.
    """

    what: str
    limit: float | None
    how: str

    def row(self, value: float, unit: str, beside: str) -> dict[str, Any]:
        """A row of the table; `beside` are the numbers that the value is made of."""
        limit = np.nan if self.limit is None else self.limit
        return {
            "what": self.what, "value": value, "unit": unit, "limit": limit, "held": not value > limit,
            "beside": beside, "how": self.how,
        }  # fmt: skip


def _run(case: Case, **options: Any) -> Any:
    """A warm compiled run of a case without an account of energy."""
    system: System = engines.load("reference").prepare(case, "compiled").system  # type: ignore[attr-defined]
    given: dict[str, Any] = {"t_end": case.t_end, "rtol": 1e-8, "collisions": case.collisions, **options}
    inputs = None if case.inputs is None else (case.inputs.times, case.inputs.values)
    run = prepare(system, case.q0, case.v0, Options(inputs=inputs, **given))
    run.warm()
    return run


def _seconds(runs: Mapping[str, Any], repeats: int) -> dict[str, float]:
    """Shortest time of each, s, interleaved: nothing makes a run faster than it is."""
    found = dict.fromkeys(runs, np.inf)
    for _ in range(repeats):
        for name, run in runs.items():
            outcome, wall = run.go()
            assert outcome is Outcome.FINISHED, (name, outcome)
            found[name] = min(found[name], wall)
    return found


def _rings(repeats: int) -> Iterator[dict[str, Any]]:
    lever = Lever(what="50 rings over 5", limit=1.2, how="rings that the ball cannot reach are bounded away")
    runs = {str(n): _run(cases.load("ball_maze", "solve", rings=n)) for n in (5, 50)}
    took = _seconds(runs, repeats)
    yield lever.row(took["50"] / took["5"], "1", _beside(took, 1e3, "ms"))


def _idle_balls(repeats: int) -> Iterator[dict[str, Any]]:
    """Sliders that strike one after another: each ball waits until its turn comes."""
    lever = Lever(
        what="a collision among 200 balls over one among 5", limit=3.0,
        how="guards of far neighbours are bounded away; a chain of rows is banded; masses are diagonal",
    )  # fmt: skip
    runs, per = {}, {}
    for n in (5, 200):
        runs[str(n)] = run = _run(cases.load("newtons_cradle", "sliders", n=n, gap=1e-3), samples=())
        run.go()
        per[str(n)] = int(run.trajectory(Outcome.FINISHED, 0.0).counts["collisions"])
    took = {n: wall / per[n] for n, wall in _seconds(runs, repeats).items()}
    yield lever.row(took["200"] / took["5"], "1", _beside(took, 1e6, "us a collision"))


def _recording(repeats: int) -> Iterator[dict[str, Any]]:
    case = cases.load("delta_impulse", "light")
    runs = {
        "end alone": _run(case, samples=[case.t_end], events=False), "every step": _run(case),
        "every step, energy account": _run(case, ledger=True),
    }  # fmt: skip
    took = _seconds(runs, repeats)
    lean = took.pop("end alone")
    for name, wall in took.items():
        lever = Lever(what=f"recording {name} over the end alone", limit=None, how="what nobody asked for is not kept")
        yield lever.row(wall / lean, "1", _beside({"end alone": lean, name: wall}, 1e3, "ms"))


def _counted(_repeats: int) -> Iterator[dict[str, Any]]:
    """Counts of one run each: they are the same every time."""
    flight = cases.load("bouncing_ball", "listing", height=1e3, t_end=5.0)
    linear = cases.load("bouncing_ball", "linear")
    loops = cases.load("delta_impulse", "light")
    bare = _counts(flight, rows=False)
    closed = _counts(loops)
    yield Lever(what="guard evaluations of a scene without rows", limit=0.0, how="no contacts, no guards").row(
        float(bare["guards"]), "count", f"{bare['steps']} steps"
    )
    lever = Lever(
        what="guard evaluations beside the gaps of each step, where no row opens", limit=0.0, how="no contact, no guard"
    )
    yield lever.row(float(closed["guards"] - closed["steps"] - 1), "count", f"{closed['steps']} steps")
    for case, count, limit, what, how in (
        (flight, "rhs", 20.0, "right-hand sides of 5 s in free flight", "free flight in closed form"),
        (linear, "rhs", None, "right-hand sides of a ball on a linear floor", "closed form where a scene is affine"),
        (
            linear,
            "exact_steps",
            None,
            "closed-form steps of a ball on a linear floor",
            "one contact, scalar multiplier",
        ),
    ):
        counts = _counts(case)
        yield Lever(what=what, limit=limit, how=how).row(
            float(counts[count]), "count", f"{counts['steps']} steps, {counts['exact_steps']} of them in closed form"
        )


def _counts(case: Case, rows: bool = True) -> dict[str, int]:
    """Steps and counters of one run; without rows the same mechanism with nothing in its way."""
    run = _run(case)
    if not rows:
        system = run.system
        free = System(n=system.n, dynamics=system.kernels["dynamics"], parameters=system.parameters)
        run = prepare(free, case.q0, case.v0, Options(t_end=case.t_end))
        run.warm()
    found = run.trajectory(*run.go())
    return {"steps": found.steps, **found.counts}


def _factorised(_repeats: int) -> Iterator[dict[str, Any]]:
    case = cases.load("newtons_cradle", "sliders", collisions="resolved", gap=1e-3)
    counts = _counts(case)
    lever = Lever(what="factorisations of a constant mass matrix", limit=1.0, how="factorised once, before the run")
    yield lever.row(float(counts["factorisations"]), "count", f"{counts['rhs']} right-hand sides")


def _shortcut(repeats: int) -> Iterator[dict[str, Any]]:
    case = cases.load("bouncing_ball", "linear")
    took = _seconds({name: _run(case, shortcuts=name == "on") for name in ("on", "off")}, repeats)
    lever = Lever(what="closed forms over integration, linear floor", limit=1.0, how="affine arcs in closed form")
    yield lever.row(took["on"] / took["off"], "1", _beside(took, 1e6, "us"))


def endless(bounces: int) -> Any:
    """A prepared run of a ball that loses nothing, recorded by its end alone, over so many bounces.

    From height h it meets a linear floor with v = sqrt(2 g h) every 2 v/g + pi/sqrt(a0) s.
    """
    h, g, a0 = 0.01, 9.81, 1e6
    period = 2.0 * math.sqrt(2.0 * h / g) + math.pi / math.sqrt(a0)
    case = cases.load("bouncing_ball", "elastic", height=h, a0=a0, a1=0.0, a2=0.0, t_end=bounces * period)
    return _run(case, fsm="memoryless", samples=[case.t_end], events=False, rtol=1e-6, max_steps=10**9)


@dataclass(frozen=True, slots=True)
class Again:
    """A run several times in a row."""

    run: Any
    times: int

    def go(self) -> tuple[Outcome, float]:
        """The last outcome, and the time of all, s."""
        done = [self.run.go() for _ in range(self.times)]
        return done[-1][0], sum(wall for _, wall in done)


def _bounces(_repeats: int) -> Iterator[dict[str, Any]]:
    """A million bounces beside ten times a hundred thousand: both last as long, on an uneven machine."""
    few, many = endless(100_000), endless(1_000_000)
    took = _seconds({"1e5": Again(few, 10), "1e6": many}, 3)
    held = {name: _bytes(run) for name, run in (("few", few), ("many", many))}
    per = {name: wall / 1e6 for name, wall in took.items()}
    lever = Lever(what="time of a bounce, 1e6 over 1e5 of them", limit=1.2, how="a step costs the same at any time")
    yield lever.row(per["1e6"] / per["1e5"], "1", _beside(per, 1e6, "us a bounce"))
    lever = Lever(what="memory that 1e6 bounces take and 1e5 do not", limit=0.0, how="events counted, not kept")
    yield lever.row(float(held["many"] - held["few"]), "B", f"{held['many']} B in all")


def _bytes(run: Any) -> int:
    """What a run holds, B."""
    return sum(array.nbytes for arrays in (run.buffers, run.work) for array in arrays.values())


def _beside(took: Mapping[str, float], factor: float, unit: str) -> str:
    return ", ".join(f"{name}: {factor * wall:.3g} {unit}" for name, wall in took.items())


LEVERS: tuple[Callable[[int], Iterator[dict[str, Any]]], ...] = (
    _rings, _idle_balls, _recording, _counted, _factorised, _shortcut, _bounces,
)  # fmt: skip


def measure(repeats: int) -> pd.DataFrame:
    """One row a lever: what it costs to have what a scene does not need.

    Args:
        repeats: interleaved runs of each, the shortest of which counts.

    Returns:
        value and limit are ratios or counts; held is whether the value is within its limit (always, without one).
    """
    return pd.DataFrame([row for lever in LEVERS for row in lever(repeats)], columns=COLUMNS)
