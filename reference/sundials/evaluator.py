"""Compiled looks at one state: what a run of SUNDIALS and a re-check of a finished motion ask for alike."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from crossbody.cases import Outcome
from crossbody.reference.kinds import Floats
from crossbody.reference.sundials.compiled import evaluation
from crossbody.reference.sundials.compiled.workspace import GOOD, ILL_POSED, NOT_FINITE, workspace
from crossbody.reference.sundials.equations import Ended, Equations
from crossbody.reference.sundials.level_machine import Guard

NONE: Mapping[int, float] = MappingProxyType({})
ENDS = {ILL_POSED: Outcome.ILL_POSED, NOT_FINITE: Outcome.NOT_FINITE}


class Evaluator:
    """One system's compiled equations and guards, with their memory.

    Args:
        equations: parameters, inputs, active rows and law in force; read anew by `begin`.
        terms: largest number of terms of all guards.
        nz: accounts of work integrated beside the motion.

    Attributes:
        work: arrays that compiled code reads and writes, by name.
        values (terms,): where `TERMS` leaves what it found.
    """

    def __init__(self, equations: Equations, terms: int, nz: int = 0) -> None:
        self.equations = equations
        self.work, self.lines = workspace(equations.system, equations.p, equations.u, terms, nz)
        self.call = evaluation.entry(equations.system)
        self.values = np.zeros(terms)

    def ask(self, what: int, t: float, y: Floats) -> int:
        """`evaluation.evaluate`; terms go to `values`.

        Raises:
            Ended: if the equations cannot be evaluated there.
        """
        code = self.call(what, t, y, self.values, self.lines)
        if code == GOOD or (what == evaluation.SCAN and code > 0):
            return code
        raise Ended(ENDS[abs(code)], self.equations.active)

    def begin(self, guards: Sequence[Guard], frozen: Collection[int], tied: Mapping[int, float] = NONE) -> None:
        """Put the active rows, their law and guards in force.

        Args:
            guards: what is watched.
            tied: open rows that depend on the active ones, and since when they are, s.
            frozen: rows whose collisions take no time: inactive, they would follow their slow law.
        """
        work, e = self.work, self.equations
        terms = [(g, term) for g, guard in enumerate(guards) for term in guard.terms]
        work["size"][4:7] = len(e.active), len(terms), len(guards)
        sharing = [*e.active, *(e.beside or ())]
        work["size"][9] = len(sharing) - len(e.active)
        work["tied"][:] = 0
        work["tied"][list(tied)] = 1
        for i in tied:
            work["let_go"][i] = tied[i]
        work["idx"][: len(sharing)] = sharing
        work["law"][:], work["law_if"][:] = e.law, e.law
        for i in range(e.system.nc):
            if i not in e.active and e.has_fast[i] and i not in frozen:
                work["law_if"][i] = e.fast[i]
        for j, (g, term) in enumerate(terms):
            work["kind"][j], work["row"][j], work["group"][j] = term.kind, term.row, g
            work["shift"][j], work["side"][j] = term.shift, term.sides
