"""A force that sets in within a step keeps the energy account: its power is sharper than the motion it brings about."""

from __future__ import annotations

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import Outcome
from crossbody.reports.measuring.scale import energy


@pytest.mark.parametrize("seed", range(6))
def test_servos_that_move_at_once_leave_the_account_closed(seed: int) -> None:
    draw = np.random.default_rng(seed)
    ramp, rtol = float(10.0 ** draw.uniform(-3.5, -1.5)), float(10.0 ** draw.uniform(-12.0, -6.0))
    variant = ("light", "heavy")[seed % 2]
    case = cases.load("delta_singularity", variant, ramp=ramp, t_end=0.5)
    run = engines.load("reference").prepare(case, "compiled", rtol=rtol).run()
    assert run.outcome is Outcome.FINISHED, run.message
    assert run.ledger is not None
    book = run.ledger.input - run.ledger.dissipated + run.ledger.contact.sum(axis=1)
    through = max(energy(run), float(np.abs(run.ledger.input).max()))
    off = np.abs(run.total_energy - run.total_energy[0] - book).max()
    assert off <= 1e3 * rtol * through  # a thousand steps, each as far off as its tolerance
