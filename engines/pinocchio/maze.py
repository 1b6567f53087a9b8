"""The ball maze in Pinocchio: the case's law by forwardDynamics, with the maze's own event machine (spec 2.3, 4.3)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np

from crossbody.cases import Case, Parameter, Trajectory, Value
from crossbody.engines._maze.log import MazeLog
from crossbody.engines._maze.machine import MazeMachine
from crossbody.engines._maze.scene import ONLY_CONTINUOUS, ball_maze
from crossbody.engines.contract import Run
from crossbody.engines.linear import Spot, same
from crossbody.engines.pinocchio._linear import Stand
from crossbody.engines.pinocchio._maze_flow import MazeFlow
from crossbody.engines.pinocchio._maze_law import MazeLaw, audit
from crossbody.engines.pinocchio._rows import ALGEBRA

SETTINGS = {
    "rtol": Parameter(default=1e-12, doc="relative tolerance", low=1e-14, high=1e-1),
    "method": Parameter(default="BDF", doc="linear multistep method of CVODE", choices=("BDF", "Adams")),
    "algebra": Parameter(default="forwardDynamics", doc="how v' and lam are solved for", choices=tuple(ALGEBRA)),
    "max_steps": Parameter(default=1_000_000, doc="bound on the number of steps", low=1, high=1e9),
}
"""BDF, because a ball that rests on a face is stiff: its rows decay a thousand times faster than it moves."""
SIZES = np.array([1.0, 1e-3, 1e-3, 1.0, 1.0, 1e-1, 1e-1, 1.0])
"""Sizes of theta, x, y, phi and their rates, which times rtol are the absolute tolerances: rad, m, rad/s, m/s."""


SMALL = 2e-2
"""Size of the coordinates, for differences: the rings are a few centimetres wide."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MazeRun(Run):
    """One prepared run; see `crossbody.engines.Run`."""

    case: Case
    law: MazeLaw
    settings: Mapping[str, Any]
    profile: str = "law"
    engine: str = "pinocchio"

    def run(self) -> Trajectory:
        """Integrate from the start."""
        case, used, log = self.case, self.settings, MazeLog()
        rtol, maze = float(used["rtol"]), self.law.maze
        start = perf_counter()
        machine = MazeMachine(maze, self.law.accelerate)
        flow = MazeFlow(machine, log, rtol, rtol * SIZES, str(used["method"]), int(used["max_steps"]))
        flow.run(case.q0, case.v0, case.t_end)
        wall = perf_counter() - start
        observe = maze.observer(log.places)
        return log.trajectory(observe, flow.outcome, flow.message, flow.steps, wall, {"rhs": flow.rhs})

    def audit(self) -> Mapping[str, Any]:
        """The physics read back from the model, at the place of the start."""
        return audit(self.case, self.law)


def why_not(case: Case, profile: str) -> str | None:
    """Profiles without gaps, and controllers that are not a function of the state."""
    if profile != "law":
        return f"The profile {profile} has no rows that hand a contact over where a wall ends, as at the maze's gaps."
    return ONLY_CONTINUOUS if case.parameters["controller"] == "sampled" else None


def prepare(case: Case, used: Mapping[str, Value]) -> MazeRun:
    """Build the model of a case.

    Raises:
        InvalidValue: for a geometry that is impossible.
    """
    return MazeRun(case=case, law=MazeLaw(case, ball_maze(case), str(used["algebra"])), settings=used)


def stand(case: Case, spot: Spot) -> Stand:
    """The model with the ball at rest on a face."""
    law = MazeLaw(case, ball_maze(case), "forwardDynamics")
    q, v = tuple(spot.q.tolist()), tuple(spot.v.tolist())
    memory = MazeMachine(law.maze, law.accelerate).first(q, v).memory
    return Stand(
        model=law.model, data=law.data, q=spot.q, v=spot.v, chart=same(4), size=SMALL,
        force=lambda q, v: law.force(tuple(q.tolist()), tuple(v.tolist()), memory),
        jacobian=lambda q: law.rows(tuple(q.tolist()), tuple(spot.v.tolist()), memory)[0],
        law=lambda q, v: law.rows(tuple(q.tolist()), tuple(v.tolist()), memory)[1],
    )  # fmt: skip
