"""The settings at which an engine is timed, from coarse to fine, within a bound on time and steps."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from crossbody import engines
from crossbody.cases import Case, InvalidValue
from crossbody.reports.runs.choice import Pick

LADDERS = {
    "rtol": (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13),
    "dt": (4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4),
}
GROWTH = 3.0
"""At most this many times what the last rung took is expected of the next: early failures tell nothing."""
PATIENCE = 2.0  # a rung may take this many times the longest; its steps are bounded accordingly


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """How much is measured, and for how long.

    Attributes:
        repeats: timed runs of each rung.
        slow: a run longer than this is its own warm-up and not repeated, s.
        longest: a ladder ends before the rung that would take longer, s.
        climb: a ladder ends with the rung at which it has taken longer, s.
        rounds: no round of repeats begins after this, s.
        every: one rung in so many is taken.
    """

    repeats: int = 5
    slow: float = 0.5
    longest: float = 2.0
    climb: float = 10.0
    rounds: float = 20.0
    every: int = 1


@dataclass(slots=True)
class Ladder:
    """The settings of one engine on one case, from coarse to fine, each prepared when its turn comes."""

    case: Case
    pick: Pick
    effort: Effort
    took: list[float] = field(default_factory=list)
    steps: int = 0

    def __iter__(self) -> Iterator[tuple[str, float, Any]]:
        """(knob, setting, prepared run) of every rung; one without a knob for an engine that has none."""
        plain = engines.load(self.pick.engine).prepare(self.case, self.pick.profile)
        # Nobody asked for the account, and what is compiled for a model is compiled before it is timed.
        lean = {name: value for name, value in (("ledger", False), ("traced", "yes")) if name in plain.settings}
        if not (knob := next((name for name in LADDERS if name in plain.settings), "")):
            yield "", math.nan, plain
        met: set[float] = set()
        for setting in LADDERS.get(knob, ())[:: self.effort.every]:
            if self._too_long():
                return
            if knob != "dt" or setting <= self.case.t_end:
                given = {knob: setting, **lean, **self._bound(plain)}
                try:
                    run = engines.load(self.pick.engine).prepare(self.case, self.pick.profile, **given)
                except InvalidValue:  # finer than the engine admits
                    return
                used = float(run.settings[knob])  # a controller's tick may ask for a smaller step
                if used not in met:
                    met.add(used)
                    yield knob, used, run

    def climbed(self, took: float, steps: int) -> None:
        """Tell what the rung cost: wall time, s, and steps."""
        self.took.append(took)
        self.steps = steps

    def _too_long(self) -> bool:
        if len(self.took) < 2:
            return bool(self.took) and self.took[-1] > self.effort.longest
        before, last = self.took[-2:]
        growth = min(max(1.0, last / before), GROWTH)
        return last * growth > self.effort.longest or sum(self.took) > self.effort.climb

    def _bound(self, plain: Any) -> dict[str, int]:
        """As many steps as may be taken in the longest time, by what a step cost so far."""
        if not self.took or not self.steps or "max_steps" not in plain.settings:
            return {}
        most = PATIENCE * self.effort.longest * self.steps / self.took[-1]
        return {"max_steps": max(self.steps, min(int(most), int(plain.settings["max_steps"])))}
