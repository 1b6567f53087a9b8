"""The discrete variables of a mechanism: calls of its `watch` and `switch` kernels, and what they changed."""

from __future__ import annotations

import numpy as np

from crossbody.cases import Mode, Outcome, Switch
from crossbody.reference._kinds import Floats
from crossbody.reference._system import System
from crossbody.reference.kernels import CHANGED, LOST, START, TOUCHED
from crossbody.reference.sundials.equations import Ended, Equations

__all__ = ["START", "TOUCHED", "Discrete"]

TINY = 1e-300  # in place of 0: a guard at 0 has fired, and SUNDIALS takes one that starts at 0 for absent


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

    def watch(self, t: float, q: Floats, v: Floats, out: Floats) -> None:
        """All guards (guards,): each fires where it falls from above 0 to 0 or below."""
        if self.guards:
            self.system.watch(t, q, v, self.p, out)
            out[out == 0.0] = -TINY

    def switch(self, t: float, q: Floats, v: Floats, modes: list[Mode], fired: int) -> tuple[bool, list[Mode]]:
        """Call the kernel; whether it changed anything, and the modes that it wants.

        Raises:
            Ended: LOST if the kernel says so.
        """
        if self.system.switch is None:
            return False, modes
        before, wanted = self._values.copy(), np.array(modes, dtype=np.int8)
        code = int(self.system.switch(t, q, v, self.p, wanted, int(fired)))
        for k in np.flatnonzero(self._values != before).tolist():
            self.switches.append(Switch(t=t, variable=k, before=int(before[k]), after=int(self._values[k])))
        if code == LOST:
            raise Ended(Outcome.LOST)
        return code == CHANGED, [Mode(m) for m in wanted.tolist()]
