"""The ball maze in MuJoCo: segments and its own contacts, or a polar chain that follows the case's law (spec 4.2)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from time import perf_counter
from typing import Any, Protocol

import mujoco

from crossbody.cases import Case, Outcome, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.files.warned import captured
from crossbody.engines._maze.log import MazeLog
from crossbody.engines._maze.machine import MazeMachine
from crossbody.engines._maze.scene import ONLY_CONTINUOUS, BallMaze, ball_maze
from crossbody.engines.contract import Run
from crossbody.engines.linear import Spot
from crossbody.engines.mujoco import _maze_audit as audits
from crossbody.engines.mujoco import _maze_segments as segments
from crossbody.engines.mujoco._globals import hooked
from crossbody.engines.mujoco._linear import Stand
from crossbody.engines.mujoco._maze_charts import Charts
from crossbody.engines.mujoco._maze_march import MazeMarch
from crossbody.engines.mujoco._maze_steps import MazeSteps


class Stepper(Protocol):
    """What steps through a run and fills its log."""

    steps: int
    trials: int
    outcome: Outcome
    message: str

    def run(self, q0: Floats, v0: Floats, t_end: float) -> None:
        """Step from (q0, v0) to t_end, s."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class MazeRun(Run):
    """One prepared run; see `crossbody.engines.Run`.

    Attributes:
        maze: geometry and masses.
        stepper: makes what steps, with an empty log.
        hook: what MuJoCo calls in every evaluation, while in force.
        shown: the physics read back from the model.
    """

    case: Case
    maze: BallMaze
    profile: str
    settings: Mapping[str, Any]
    stepper: Callable[[MazeLog], Stepper]
    hook: Callable[[], AbstractContextManager[None]]
    shown: Callable[[], dict[str, Any]]
    follows: Case | None = None
    engine: str = "mujoco"

    def run(self) -> Trajectory:
        """Integrate from the start."""
        log, case = MazeLog(), self.case
        march = self.stepper(log)
        with captured() as warned, self.hook():
            start = perf_counter()
            march.run(case.q0, case.v0, case.t_end)
            wall = perf_counter() - start
        words = [march.message, *(f"MuJoCo warned: {w.strip()}" for w in dict.fromkeys(warned))]
        message = " ".join(w for w in words if w)
        observe, counts = self.maze.observer(log.places), {"located": march.trials}
        return log.trajectory(observe, march.outcome, message, march.steps, wall, counts)

    def audit(self) -> Mapping[str, Any]:
        """The physics read back from the compiled model."""
        return self.shown()


def why_not(case: Case, profile: str) -> str | None:
    """Controllers that are not a function of the state."""
    return ONLY_CONTINUOUS if case.parameters["controller"] == "sampled" else None


def default_step(case: Case, profile: str) -> float:
    """Time step when none is given, s: MuJoCo's own; or one that is stable on a face, whose law is the fastest part.

    The law's poles are at most max(a1, sqrt(a0)) fast; Runge-Kutta 4 is stable up to 2.8 over that.
    """
    fastest = max(float(case.law.a1.max()), math.sqrt(float(case.law.a0.max())), 1.0)
    return 2e-3 if profile == "default" else min(1e-3, 2.0 / fastest)


def prepare(case: Case, profile: str, used: Mapping[str, Any]) -> MazeRun:
    """Compile the model of one profile.

    Raises:
        ValueError: MuJoCo's own, for a model that it refuses.
        InvalidValue: for a geometry that is impossible.
    """
    return (_segments if profile == "default" else _matched)(case, ball_maze(case), used)


def stand(case: Case, spot: Spot) -> Stand:
    """The matched model with the ball at rest on a face."""
    charts = Charts(case, ball_maze(case))
    q, v = tuple(spot.q.tolist()), tuple(spot.v.tolist())
    machine = MazeMachine(charts.maze, charts.probe)
    with hooked(charts.stage):
        charts.arm(machine.untouched(q), q, v)
        charts.arm(machine.first(q, v).memory, q, v)
    return Stand(model=charts.model, data=charts.data, chart=charts.linear(), hook=charts.stage)


def _matched(case: Case, maze: BallMaze, used: Mapping[str, Any]) -> MazeRun:
    charts = Charts(case, maze)
    return MazeRun(
        case=case,
        maze=maze,
        profile="matched",
        settings={**used, "integrator": "RK4", "solver": "PGS", "located_events": True, "law": "level"},
        stepper=lambda log: MazeMarch(charts, log, float(used["dt"]), int(used["max_steps"])),
        hook=lambda: hooked(charts.stage),
        shown=lambda: audits.matched(case, charts),
    )


def _segments(case: Case, maze: BallMaze, used: Mapping[str, Any]) -> MazeRun:
    model, rings = segments.compiled(maze)
    data = mujoco.MjData(model)
    return MazeRun(
        case=case,
        maze=maze,
        profile="default",
        settings={**used, "integrator": "EULER", "solver": "NEWTON", "located_events": False, "law": "memoryless"},
        stepper=lambda log: MazeSteps(maze, model, data, rings, log, float(used["dt"]), int(used["max_steps"])),
        hook=lambda: hooked(None),
        shown=lambda: audits.segments(case, model, data),
    )
