"""One run of a sweep as plain data: it pickles, and it is all that a worker needs."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass

from crossbody.cases import Value, installed
from crossbody.reports.suites.contract import Ladder


@dataclass(frozen=True, slots=True, kw_only=True)
class Spec:
    """What is run, by whom, within which bounds.

    Attributes:
        suite, index: whose run, and its number in the table of the whole sweep.
        draw: number of the draw in its suite, the same for every engine.
        case, variant, parameters: the scene.
        engine, profile: who runs it.
        rung: of the ladder, -1 for the engine's own default.
        ladder: tolerances beside steps.
        seed: of this run.
        second: whether the independent integrator is asked whatever it costs.
        afford: whether it is asked where the run took few steps.
        limit: largest error and energy residual of the reference.
        finishes: whether the reference has to reach the horizon.
        ends: whether only the end state is asked for.
        max_steps, time_limit: bounds; s.
    """

    suite: str
    index: int
    draw: int
    case: str
    variant: str
    parameters: Mapping[str, Value]
    engine: str
    profile: str
    rung: int
    ladder: Ladder | None
    seed: int
    second: bool
    afford: bool
    limit: float
    finishes: bool
    ends: bool
    max_steps: int
    time_limit: float

    @property
    def knobs(self) -> dict[str, float]:
        """Tolerance and step of this rung; an engine takes the one it knows."""
        if self.ladder is None or self.rung < 0:
            return {}
        return {"rtol": self.ladder.rtol[self.rung], "dt": self.ladder.dt[self.rung]}

    def command(self, settings: Mapping[str, float], parameters: Mapping[str, Value] | None = None) -> str:
        """The command line that repeats this run alone, with settings as used, and other parameters."""
        words = ["crossbody", "run", self.case, "--variant", self.variant, "--engine", f"{self.engine}:{self.profile}"]
        for name, value in (self.parameters if parameters is None else parameters).items():
            words += ["--set", f"{name}={_text(value)}"]
        for name, value in settings.items():
            words += ["--set-engine", f"{name}={_text(value)}"]
        return shlex.join(words + installed.options())


def _text(value: Value) -> str:
    return repr(value) if isinstance(value, float) else str(value)
