"""What a scene does not need costs nothing: measured as ratios within one run, and as counts."""

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


Row = dict[str, Any]


def ratio(
    what: str, value: float, limit: float | None, beside: str, how: str, unit: str = "1", least: bool = False
) -> Row:
    """A row of ratios and counts: what, its value, a largest or least limit, and what it is made of.

    `how` says what leaves it out, or makes it quick; without a limit it is only stated.
    """
    held = limit is None or (value >= limit if least else not value > limit)
    given = np.nan if limit is None else limit
    return {"what": what, "value": value, "unit": unit, "limit": given, "held": held, "beside": beside, "how": how}


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


def _rings(repeats: int) -> Iterator[Row]:
    runs = {str(n): _run(cases.load("ball_maze", "solve", rings=n)) for n in (5, 50)}
    took = _seconds(runs, repeats)
    how = "rings that the ball cannot reach are excluded by bounds"
    yield ratio("50 rings over 5", took["50"] / took["5"], 1.2, _beside(took, 1e3, "ms"), how)


def _idle_balls(repeats: int) -> Iterator[Row]:
    """Sliders that strike one after another: each ball waits until its turn comes."""
    runs, per = {}, {}
    for n in (5, 200):
        runs[str(n)] = run = _run(cases.load("newtons_cradle", "sliders", n=n, gap=1e-3), samples=())
        run.go()
        per[str(n)] = int(run.trajectory(Outcome.FINISHED, 0.0).counts["collisions"])
    took = {n: wall / per[n] for n, wall in _seconds(runs, repeats).items()}
    yield ratio(
        "a collision among 200 balls over one among 5", took["200"] / took["5"], 3.0,
        _beside(took, 1e6, "us a collision"),
        "guards of far neighbours are excluded by bounds; a chain of rows is banded; masses are diagonal",
    )  # fmt: skip


def _recording(repeats: int) -> Iterator[Row]:
    case = cases.load("delta_impulse", "light")
    runs = {
        "end alone": _run(case, samples=[case.t_end], events=False), "every step": _run(case),
        "every step, energy account": _run(case, ledger=True),
    }  # fmt: skip
    took = _seconds(runs, repeats)
    lean = took.pop("end alone")
    for name, wall in took.items():
        beside = _beside({"end alone": lean, name: wall}, 1e3, "ms")
        what = f"recording {name} over the end alone"
        yield ratio(what, wall / lean, None, beside, "what was not requested is not kept")


def _counted(_repeats: int) -> Iterator[Row]:
    """Counts of one run each: they are the same every time."""
    flight = cases.load("bouncing_ball", "listing", height=1e3, t_end=5.0)
    linear, loops = cases.load("bouncing_ball", "linear"), cases.load("delta_impulse", "light")
    resolved = cases.load("newtons_cradle", "sliders", collisions="resolved", gap=1e-3)
    bare, closed, masses = _counts(flight, rows=False), _counts(loops), _counts(resolved)
    flown, bounced = _counts(flight), _counts(linear)
    past = closed["guards"] - closed["steps"] - 1
    in_form = [f"{one['steps']} steps, {one['exact_steps']} of them in closed form" for one in (flown, bounced)]
    for what, count, limit, beside, how in (
        ("guard evaluations of a scene without rows", bare["guards"], 0.0, f"{bare['steps']} steps",
         "no contacts, no guards"),
        ("guard evaluations besides the gaps of each step, where no row opens", past, 0.0, f"{closed['steps']} steps",
         "no contact, no guard"),
        ("right-hand sides of 5 s in free flight", flown["rhs"], 20.0, in_form[0], "free flight in closed form"),
        ("right-hand sides of a ball on a linear floor", bounced["rhs"], None, in_form[1],
         "closed form where a scene is affine"),
        ("closed-form steps of a ball on a linear floor", bounced["exact_steps"], None, in_form[1],
         "one contact, scalar multiplier"),
        ("factorisations of a constant mass matrix", masses["factorisations"], 1.0, f"{masses['rhs']} right-hand sides",
         "factorised once, before the run"),
    ):  # fmt: skip
        yield ratio(what, float(count), limit, beside, how, "count")


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


def _shortcut(repeats: int) -> Iterator[Row]:
    case = cases.load("bouncing_ball", "linear")
    took = _seconds({name: _run(case, shortcuts=name == "on") for name in ("on", "off")}, repeats)
    what, beside = "closed forms over integration, linear floor", _beside(took, 1e6, "us")
    yield ratio(what, took["on"] / took["off"], 1.0, beside, "affine arcs in closed form")


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


def _bounces(_repeats: int) -> Iterator[Row]:
    """A million bounces beside ten times a hundred thousand: both last as long, on an uneven machine."""
    few, many = endless(100_000), endless(1_000_000)
    took = _seconds({"1e5": Again(few, 10), "1e6": many}, 3)
    held = [sum(a.nbytes for of in (run.buffers, run.work) for a in of.values()) for run in (few, many)]
    per = {name: wall / 1e6 for name, wall in took.items()}
    yield ratio(
        "time of a bounce, 1e6 over 1e5 of them", per["1e6"] / per["1e5"], 1.2,
        _beside(per, 1e6, "us a bounce"), "a step costs the same at any time",
    )  # fmt: skip
    yield ratio(
        "memory that 1e6 bounces take and 1e5 do not", float(held[1] - held[0]), 0.0,
        f"{held[1]} B in all", "events counted, not kept", "B",
    )  # fmt: skip


def _beside(took: Mapping[str, float], factor: float, unit: str) -> str:
    return ", ".join(f"{name}: {factor * wall:.3g} {unit}" for name, wall in took.items())


LEVERS: tuple[Callable[[int], Iterator[Row]], ...] = (_rings, _idle_balls, _recording, _counted, _shortcut, _bounces)


def measure(repeats: int) -> pd.DataFrame:
    """One row a lever: what it costs to have what a scene does not need, by the shortest of repeated runs.

    value and limit are ratios or counts; held is whether the value is within its limit, if there is
    one.
    """
    return pd.DataFrame([row for lever in LEVERS for row in lever(repeats)], columns=COLUMNS)
