"""The discrete variables of a mechanism: calls of its `watch` and `switch` kernels, and what they changed."""

from __future__ import annotations

import numpy as np

from crossbody.cases import Mode, Outcome, Switch
from crossbody.reference._system import System
from crossbody.reference.kernels import CHANGED, GIVEN, LOST, START, TOUCHED
from crossbody.reference.kinds import Floats
from crossbody.reference.sundials.compiled.workspace import Kind
from crossbody.reference.sundials.equations import Ended, Equations
from crossbody.reference.sundials.level_machine import Guard, Term

__all__ = ["GIVEN", "START", "TOUCHED", "Discrete"]


class Discrete:
    """Keeps the discrete variables at the end of the run's own parameters.

    Attributes:
        guards: number of watched functions.
        switches: changes so far.
    """

    def __init__(self, system: System, equations: Equations) -> None:
        self.system, self.p = system, equations.p
        self.guards = system.guards if system.watch is not None else 0
        self.switches: list[Switch] = []
        end = len(self.p) - system.latched
        self._values = self.p[end - np.size(system.discrete) : end]

    def give(self, rtol: float, u: Floats) -> bool:
        """Write tolerance and inputs (nu,) where the mechanism looks for them; whether it does."""
        if self.system.kinks:
            self.p[len(self.p) - len(u) - 1 :] = [rtol, *u]
        return self.system.kinks > 0

    def watched(self) -> list[Guard]:
        """The mechanism's own guards."""
        return [Guard(i, None, [Term(Kind.WATCH, i)]) for i in range(self.guards)]

    def switch(self, t: float, q: Floats, v: Floats, modes: list[Mode], fired: int) -> tuple[bool, list[Mode]]:
        """Call the kernel; whether it changed anything, and the modes that it wants.

        Raises:
            Ended: LOST if the kernel says so.
        """
        if self.system.switch is None:
            return False, modes
        before, wanted = self._values.copy(), np.array(modes, dtype=np.int8)
        code = int(self.system.switch(t, q, v, self.p, wanted, int(fired)))
        jumping = len(before) - self.system.kinks
        for k in np.flatnonzero(self._values != before).tolist():
            old, new = int(before[k]), int(self._values[k])
            if k < jumping or old * new != 0:
                self.switches.append(Switch(t=t, variable=k, before=old, after=new, smooth=k >= jumping))
        if code == LOST:
            raise Ended(Outcome.LOST)
        return code == CHANGED, [Mode(m) for m in wanted.tolist()]
