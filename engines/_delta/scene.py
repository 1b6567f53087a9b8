"""A case of the delta robot as any engine of hinges needs it: robot, start, what drives it, and what is seen of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from crossbody.cases import Case
from crossbody.cases.arrays import Floats
from crossbody.engines._delta import chart
from crossbody.engines._delta.controller import Controller, controller
from crossbody.engines._delta.forces import table
from crossbody.engines.linear import Spot
from crossbody.reference.delta import Robot, scene


class Drive:
    """The inputs of a run: they change at given instants and hold between them.

    Attributes:
        times (m,): instants, s; the first is 0 if anything acts at the start.
        u (6,): what acts now, motor torques (3,), N m, and the force on the flange (3,), N.
    """

    def __init__(self, case: Case) -> None:
        self.controller = _controller(case)
        given = case.inputs
        self._changes = {} if given is None else dict(zip(given.times.tolist(), given.values, strict=True))
        self._ticks: dict[float, None] = {}
        if self.controller is not None:
            ticks = scene.sampling_of(case.parameters).ticks(case.t_end).tolist()
            self._ticks = dict.fromkeys(t for t in ticks if t < case.t_end)
        self.times: list[float] = sorted(t for t in {**self._changes, **self._ticks} if t < case.t_end)
        self.u = np.zeros(6)
        self.reset()

    def reset(self) -> None:
        """Nothing acts, and the controller remembers nothing."""
        self.u[:] = 0.0
        if self.controller is not None:
            self.controller.reset()

    def change(self, t: float, q: Floats) -> None:
        """Put in force what acts from t on; q (9,) are the absolute angles at t."""
        if t in self._changes:
            self.u[:] = self._changes[t]
        if self.controller is not None and t in self._ticks:
            self.u[:3] = self.controller.tick(t, q)


def _controller(case: Case) -> Controller | None:
    path = scene.path_of(case.parameters)
    if path is None:
        return None
    scene.program_of(case.parameters)  # refuses what the reference refuses, in the same words
    return controller(case.parameters, scene.robot_of(case.parameters), path, scene.sampling_of(case.parameters))


@dataclass(frozen=True, slots=True, kw_only=True)
class Delta:
    """A case.

    Attributes:
        robot: geometry, masses, gravity, friction.
        r0, rd0 (9,): start in the coordinates of the tree.
        drive: what acts from outside.
        table: numbers of `engines._delta.forces.forces`.
    """

    robot: Robot
    r0: Floats
    rd0: Floats
    drive: Drive
    table: Floats

    def absolute(self, r: Floats, rd: Floats) -> tuple[Floats, Floats]:
        """Q and v (n, 9) of a motion of the tree; q_i3 goes on where its angle passes pi."""
        q, v = chart.from_tree(r, rd)
        if len(q) > 1:
            q[:, 2::3] = np.unwrap(q[:, 2::3], axis=0)
        return q, v


def delta(case: Case) -> Delta:
    """Read a case.

    Raises:
        SceneError: if the start does not close the loops; it offers one that does.
        InvalidValue: for a number outside its range.
    """
    scene.check_start(case.parameters, case.q0, case.v0)
    robot = scene.robot_of(case.parameters)
    r0, rd0 = chart.to_tree(np.array(case.q0), np.array(case.v0))
    forces = table(robot, scene.servo_of(case.parameters))
    return Delta(robot=robot, r0=r0, rd0=rd0, drive=Drive(case), table=forces)


def steady(case: Case, spot: Spot) -> Delta:
    """A case under constant inputs, without its controller; its servos act if the spot says so.

    Raises:
        SceneError: if the start does not close the loops.
    """
    own = delta(case)
    own.drive.u[:] = spot.u
    return own if spot.powered else replace(own, table=table(own.robot, None))


def in_absolute(terms: Any) -> dict[str, Any]:
    """M(q), bias(q, v) and H(q) of the audit in absolute angles.

    Args:
        terms: (r, rd) -> M (9, 9), bias (9,), H (6, 9) of the tree.
    """

    def at(q: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
        r, rd = chart.to_tree(q, v)
        return chart.absolute(r, rd, *terms(r, rd))

    return {
        "M": lambda q: at(q, np.zeros(9))[0],
        "bias": lambda q, v: at(q, v)[1],
        "H": lambda q: at(q, np.zeros(9))[2],
    }
