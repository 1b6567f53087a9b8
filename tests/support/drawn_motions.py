"""Made-up motions of cases of the library."""

from __future__ import annotations

from crossbody.cases import load
from crossbody.reports import metrics
from crossbody.reports.judging.made_up import MadeUp

CASES = [
    ("ball_maze", "inside"), ("delta_free", "light"), ("red_body", "resolved"), ("rolling_sphere", "straight"),
    ("stacked_blocks", "apart"), ("newtons_cradle", "pendulums"), ("soft_contact", "delta"),
    ("bouncing_ball", "bilateral"),
]  # fmt: skip
N = 120


class Drawn(MadeUp):
    """A motion of a case of the library, by its name and variant."""

    def __init__(self, name: str, variant: str, seed: int) -> None:
        super().__init__(load(name, variant), seed, N)

    def measured(self, name: str) -> float | None:
        return metrics.of(self.case)[name].measure(self.truth, self.run, self.case)
