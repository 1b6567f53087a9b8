"""The last step of a solver of SUNDIALS, between its ends."""

from __future__ import annotations

from typing import Any

from crossbody.reference.kinds import Floats


class DenseStep:
    """The last step, of which the solver's dense output is joined to where it began.

    Attributes:
        solver: of scikit-sundae, which stands at the step's end.
        t0, t1: where the step begins and ends, s.
        y0, y1: the unknowns there.
    """

    solver: Any

    def _stand(self, t: float, y: Floats) -> None:
        """Begin with a step of no length."""
        self.t0, self.t1, self.y0, self.y1 = t, t, y, y
        self._defect: Floats | None = None

    def _between(self, t: float) -> Floats:
        """The unknowns at an instant of the step: the solver's own polynomial misses its beginning by its error."""
        if t >= self.t1:
            return self.y1
        if t <= self.t0:
            return self.y0
        if self._defect is None:
            self._defect = self.y0 - self.solver.step(self.t0, "normal").y
        part = (t - self.t0) / (self.t1 - self.t0)
        y: Floats = self.solver.step(t, "normal").y + ((1.0 - part) ** 2 * (1.0 + 2.0 * part)) * self._defect
        return y
