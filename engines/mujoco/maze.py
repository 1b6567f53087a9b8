"""The ball maze in MuJoCo: walls of capsules and its own contacts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import mujoco

from crossbody.cases import Case, Trajectory
from crossbody.cases.files.warned import captured
from crossbody.engines._maze.log import MazeLog
from crossbody.engines._maze.scene import ONLY_CONTINUOUS, BallMaze, ball_maze
from crossbody.engines.contract import Run
from crossbody.engines.mujoco import _maze_segments as segments
from crossbody.engines.mujoco._globals import hooked
from crossbody.engines.mujoco._maze_audit import audit
from crossbody.engines.mujoco._maze_steps import MazeSteps

OWN_CONTACTS = (
    "MuJoCo has no shape for the face of a ring and no row for rolling on it: what its contacts make of walls of "
    "capsules is the profile default."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class MazeRun(Run):
    """One prepared run; see `crossbody.engines.Run`.

    Attributes:
        maze: geometry and masses.
        model: of `_maze_segments`, and the ring of each of its shapes.
    """

    case: Case
    maze: BallMaze
    model: Any
    rings: Sequence[int]
    settings: Mapping[str, Any]
    profile: str = "default"
    engine: str = "mujoco"

    def run(self) -> Trajectory:
        """Integrate from the start."""
        log, case, data = MazeLog(), self.case, mujoco.MjData(self.model)
        limit = int(self.settings["max_steps"])
        march = MazeSteps(self.maze, self.model, data, self.rings, log, float(self.settings["dt"]), limit)
        with captured() as warned, hooked(None):
            start = perf_counter()
            march.run(case.q0, case.v0, case.t_end)
            wall = perf_counter() - start
        words = [march.message, *(f"MuJoCo warned: {w.strip()}" for w in dict.fromkeys(warned))]
        message = " ".join(w for w in words if w)
        return log.trajectory(self.maze.observer(log.places), march.outcome, message, march.steps, wall)

    def audit(self) -> Mapping[str, Any]:
        """The physics read back from the compiled model."""
        return audit(self.case, self.model)


def why_not(case: Case, profile: str) -> str | None:
    """Return why a profile cannot do it: controllers that are no function of the state, and the case's own rows."""
    if case.parameters["controller"] == "sampled":
        return ONLY_CONTINUOUS
    return OWN_CONTACTS if profile == "matched" else None


def default_step(case: Case, profile: str) -> float:
    """Return MuJoCo's own time step, s."""
    return 2e-3


def prepare(case: Case, profile: str, used: Mapping[str, Any]) -> MazeRun:
    """Compile the model.

    Raises:
        ValueError: MuJoCo's own, for a model that it refuses.
        InvalidValue: for a geometry that is impossible.
    """
    maze = ball_maze(case)
    model, rings = segments.compiled(maze)
    return MazeRun(
        case=case, maze=maze, model=model, rings=rings,
        settings={**used, "integrator": "EULER", "solver": "NEWTON", "located_events": False, "law": "memoryless"},
    )  # fmt: skip
