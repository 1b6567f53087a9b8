"""What acts on a scene from outside in a run: recorded inputs, and a controller of the user's on top."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from crossbody.cases import Case, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.control import Controller


@dataclass(slots=True)
class Acting:
    """The inputs of one case, run by run.

    Attributes:
        case: a scene.
        times (m,), values (m, nu): recorded.
        instants: when any input changes or a force is not smooth, s, increasing.
        controller: of the present run; None where there is none.
    """

    case: Case
    times: Floats = field(init=False)
    values: Floats = field(init=False)
    instants: list[float] = field(init=False)
    controller: Controller | None = field(init=False, default=None)
    ticks: frozenset[float] = field(init=False, default=frozenset())

    def __post_init__(self) -> None:
        """Lay out the instants."""
        given, control, scene = self.case.inputs, self.case.control, self.case.scene
        count = len(scene.inputs) if scene is not None else 0
        self.times = np.zeros(0) if given is None else given.times
        self.values = np.zeros((0, count)) if given is None else given.values
        self.instants = self.times.tolist()
        if control is not None:
            ticks = control.instants(self.case.t_end)
            self.ticks = frozenset(ticks.tolist())
            self.instants = np.union1d(self.times, ticks).tolist()
        if self.case.force is not None and self.case.force.breaks:
            self.instants = np.union1d(self.instants, self.case.force.breaks).tolist()

    def reset(self) -> None:
        """Begin a run, with a controller of its own."""
        if self.case.control is not None:
            self.controller = self.case.control.begin(self.values.shape[1])

    def at(self, t: float, q: Floats, v: Floats) -> Floats:
        """Return the inputs (nu,) from one of the instants on.

        Args:
            t: the instant, s.
            q: positions (nq,) there in the case's coordinates.
            v: velocities (nv,).

        Raises:
            ControlError, NotFinite: as `Controller`.
        """
        total = np.zeros(self.values.shape[1]) if self.case.inputs is None else self.case.inputs.at(t)
        if self.controller is not None:
            total += self.controller(t, q, v) if t in self.ticks else self.controller.u
        return total

    def told(self, run: Trajectory) -> Trajectory:
        """Return the run with what its controller gave and how long it took."""
        if self.controller is None:
            return run
        more: dict[str, Any] = {"inputs": self.controller.given(self.times, self.values)}
        return replace(run, control_s=self.controller.seconds, **more)
