"""The stability map of the closed-loop ball maze: from which scenes the ball still comes to the centre.

Each point changes the default run in one thing: a bound, a gain, the model that the controller believes
in, the start, or how it is sampled. What is published of that run stands beside what was found; where a
ball tumbles through several rings the outcome hangs on the last digits, and nothing is expected.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import pandas as pd

from crossbody import cases, engines
from crossbody.cases import Case, Trajectory, Value
from crossbody.cases.mechanisms.maze.claims import ring_changes
from crossbody.reports.runs.choice import Pick

COLUMNS = (
    "engine", "profile", "change", "scene", "expected", "arrived", "outcome", "ended",
    "arrival", "changes", "wall_ms", "why",
)  # fmt: skip
HORIZON = 130.0  # time in which the slowest maze of the map comes to the centre, s
RTOL = 1e-8
TUMBLES, SKIPPED = "either", "skipped"
DEFAULT = Pick(engine="reference", profile="compiled")


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """One scene.

    Attributes:
        change: what is changed, the same word for a whole sweep.
        parameters: of the case, beside the defaults of its closed loop.
        expected: "solved", "fails" or `TUMBLES`.
    """

    change: str
    parameters: Mapping[str, Value] = field(default_factory=lambda: MappingProxyType({}))
    expected: str = "solved"

    @property
    def scene(self) -> str:
        """The parameters in words."""
        return ", ".join(f"{k} = {v:g}" if isinstance(v, float) else f"{k} = {v}" for k, v in self.parameters.items())


def _sweep(
    name: str, solved: Sequence[float], fails: Sequence[float] = (), either: Sequence[float] = ()
) -> list[Point]:
    groups = (("solved", solved), ("fails", fails), (TUMBLES, either))
    found = [(float(value), word) for word, values in groups for value in values]
    return [Point(change=name, parameters={name: value}, expected=word) for value, word in sorted(found)]


def _accelerations(solved: Sequence[float], fails: Sequence[float]) -> list[Point]:
    """Bounds on the maze's acceleration alone; 0 is none."""
    points = _sweep("a_max", solved, fails)
    return [Point(change=p.change, parameters={**p.parameters, "u_max": 0.0}, expected=p.expected) for p in points]


def _sampled(sample: float, delay: int, expected: str, **noise: Value) -> Point:
    parameters = {"controller": "sampled", "sample": sample, "delay": delay, **noise}
    return Point(change="noise" if noise else "sample", parameters=parameters, expected=expected)


POINTS = (
    Point(change="default"),
    *_accelerations([0.0, 200.0, 100.0, 60.0, 40.0], [30.0, 20.0, 15.0]),
    *_sweep("u_max", [0.0, 0.1, 0.05], [0.02]),
    *_sweep("wn", [30.0, 40.0, 60.0, 100.0], [10.0], [15.0, 20.0]),
    *_sweep("pole", [3.0, 4.0, 5.0, 7.0, 10.0]),
    *_sweep("omega", [0.03, 0.06, 0.1, 0.2, 0.4, 0.8]),
    *_sweep("model_gravity", [0.7, 0.85, 1.2, 1.4]),
    *_sweep("model_mass", [0.7, 0.85, 1.2, 1.4]),
    *_sweep("model_inertia", [0.7, 0.85, 1.2, 1.4]),
    *_sweep("angle", [-0.1, -0.05, 0.05, 0.1], either=[-0.4, -0.3, -0.2, 0.2, 0.3, 0.4]),
    *_sweep("theta", [0.3, 0.8, 1.5, 2.5, 4.0, 5.5]),
    _sampled(1e-3, 0, "solved"),
    _sampled(5e-3, 1, "solved"),
    _sampled(1e-2, 1, "fails"),
    _sampled(2e-2, 1, "fails"),
    _sampled(2e-3, 1, "solved", noise=2e-5, noise_speed=2e-3),
)


def stability_map(
    picks: Iterable[Pick] = (DEFAULT,), points: Sequence[Point] = POINTS, tell: Callable[[str], None] = lambda _: None
) -> pd.DataFrame:
    """Run every point on every engine, the reference to 1e-8; one row a run, columns `COLUMNS`.

    `ended` is where the run ended, `arrival` when the ball came to the centre to stay, s. What an
    engine cannot run is a row with its sentence.
    """
    rows = []
    for pick in picks:
        for point in points:
            tell(f"{pick.engine}:{pick.profile} {point.change}: {point.scene}")
            about = {"engine": pick.engine, "profile": pick.profile, "change": point.change, "scene": point.scene}
            rows.append({**about, "expected": point.expected, **_run(pick, point)})
    return pd.DataFrame(rows, columns=list(COLUMNS))


def _run(pick: Pick, point: Point) -> dict[str, Any]:
    case = cases.load("ball_maze", "solve", **{"t_end": HORIZON, **point.parameters})
    reason = pick.skipped or engines.load(pick.engine).why_not(case, pick.profile)
    if reason:
        return {"outcome": SKIPPED, "arrived": False, "why": reason}
    settings = {"rtol": RTOL} if pick.engine == "reference" else {}
    return _measured(case, engines.load(pick.engine).prepare(case, pick.profile, **settings).run())


def _measured(case: Case, run: Trajectory) -> dict[str, Any]:
    channel = case.discrete.index("channel")
    last = next((switch for switch in reversed(run.switches) if switch.variable == channel), None)
    there = last is not None and last.after == 0
    return {
        "arrived": there and run.outcome.ok,
        "outcome": run.outcome.value,
        "ended": float(run.t[-1]) if len(run.t) else 0.0,
        "arrival": last.t if last is not None and there else math.nan,
        "changes": len(ring_changes(run, case)),
        "wall_ms": 1e3 * run.wall_s,
        "why": run.message,
    }


def surprises(rows: pd.DataFrame) -> pd.DataFrame:
    """The points whose end is not the expected one."""
    known = (rows["expected"] != TUMBLES) & (rows["outcome"] != SKIPPED)
    return rows[known & (rows["arrived"] != (rows["expected"] == "solved"))]
