"""Whether a motion keeps its energy account, told by the first instant at which it does not."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crossbody.cases import InvalidValue, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.reports.testing._agreement import _motion
from crossbody.reports.testing._offence import Signal, fail_if_any

if TYPE_CHECKING:
    from crossbody.engines import Run


def assert_energy(run: Trajectory | Run, *, rtol: float = 1e-6, conserved: bool = False) -> None:
    """Assert that the integrator neither made nor lost energy.

    E(t) - E(0) must be the work of the inputs, less what damping took, plus the work of every multiplier: what the
    contact law itself makes is no error of the integrator.

    Args:
        run: what is tested; a prepared run of an engine is run.
        rtol: of the largest kinetic energy.
        conserved: hold E(t) against E(0) alone, for a scene in which nothing does work; needs no account.

    Raises:
        AssertionError: naming the first offending instant, the energy there, and what is allowed.
        InvalidValue: for a run without an account, unless `conserved`.
    """
    motion = _motion(run)
    change = motion.total_energy - motion.total_energy[0]
    wanted = np.zeros_like(change) if conserved else _account(motion)
    largest = float(np.max(motion.energy[:, 0], initial=0.0))
    word = "E(t) - E(0) [J]" if conserved else "E(t) - E(0) against the account of inputs, damping and contacts [J]"
    signal = Signal(
        name=word, t=motion.t, found=change, wanted=wanted, allowed=rtol * largest,
        basis=f"rtol {rtol:g} of the largest kinetic energy, {largest:.3g} J",
    )  # fmt: skip
    fail_if_any([signal.offence()])


def _account(run: Trajectory) -> Floats:
    """Energy that everything outside the integrator has brought since the start (n,), J."""
    if run.ledger is None:
        raise InvalidValue(
            "The run keeps no energy account: prepare it with ledger=True where the engine has that setting, or hold "
            "it against its start with conserved=True."
        )
    book: Floats = run.ledger.input - run.ledger.dissipated + run.ledger.contact.sum(axis=1)
    brought: Floats = book - book[0]
    return brought
