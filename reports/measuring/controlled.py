"""What a controller among the equations gives in a run: computed again from its own motion, tick by tick."""

from __future__ import annotations

import numpy as np

from crossbody.cases import Case, Inputs, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.control import Control
from crossbody.cases.splines import straight
from crossbody.reference import System
from crossbody.reports.measuring.cubics import coordinates
from crossbody.reports.measuring.equations import equations, finite

MOST = 200_000
"""Ticks beyond which nothing is computed again: at a microsecond each, a fifth of a second."""


def acting(case: Case, run: Trajectory) -> Inputs | None:
    """Return what acted on a run from outside; None where nothing did, or its controller cannot be asked again.

    What the run recorded, else what the case gives, else what the case's compiled controller makes of the run's states
    at its ticks, between samples by cubics: an encoder's last count may be another one there. One that looks at what no
    sample tells (latched values) cannot be asked.
    """
    given = case.inputs if run.inputs is None else run.inputs
    system = equations(case) if run.inputs is None else None
    if system is None or system.control is None or isinstance(system.control, Control) or system.latched:
        return given
    return _asked(case, system, run, given)


def _asked(case: Case, system: System, run: Trajectory, given: Inputs | None) -> Inputs | None:
    """Ask a compiled controller at every tick of a run, beside the inputs that a case gives."""
    if len(run.t) < 2 or not run.t[-1] < MOST * system.tick or not finite(run):
        return given
    ticks: Floats = system.tick * np.arange(int(run.t[-1] / system.tick + 1e-9) + 1, dtype=np.float64)
    q = coordinates(run, ticks, case.quaternions)
    v = straight(run.t, run.v, ticks)
    known = np.zeros((len(ticks), system.inputs)) if given is None else given.at(ticks)
    u, memory, p = np.zeros(system.inputs), np.zeros(system.memory), np.array(system.p)
    values, before = np.zeros((len(ticks), system.inputs)), np.zeros(system.inputs)
    for k, t in enumerate(ticks.tolist()):
        u += known[k] - before  # by its change, so that what a controller holds on top stays
        before = known[k]
        system.control(t, q[k], v[k], u, memory, p)
        values[k] = u
    named = case.controls or (() if given is None else given.names)
    names = named or tuple(f"input {i + 1}" for i in range(system.inputs))
    acts = values.any(axis=0)
    return Inputs(names=tuple(np.array(names)[acts].tolist()), times=ticks, values=values[:, acts])
