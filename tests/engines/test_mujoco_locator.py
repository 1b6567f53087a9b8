"""The first event of a step of MuJoCo: where it ends, and who is behind it."""

from __future__ import annotations

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from crossbody.cases import Mode
from crossbody.engines.mujoco._march import Locator

STEP = 1e-3


@pytest.mark.parametrize("seed", range(40))
def test_a_step_ends_behind_all_rows_that_cross_together(seed: int) -> None:
    """Ballistic rows whose rates turn at one instant, by numbers that differ by rounding, and one that turns later."""
    rng = np.random.default_rng(seed)
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    data, n = mujoco.MjData(model), int(rng.integers(2, 6))
    turn, slopes = rng.uniform(0.05, 0.9) * STEP, 10 ** rng.uniform(-2.0, 2.0, n)
    off = np.append(rng.uniform(-1e-16, 1e-16, n - 1) * STEP * rng.integers(0, 2), 0.05 * STEP)

    def margins() -> list[tuple[float, float]]:
        return [(-1e-3, float(a)) for a in slopes * (data.time - turn - off)]

    def rewind() -> None:
        data.time = 0.0

    def advance() -> None:
        data.time = model.opt.timestep

    model.opt.timestep = STEP
    advance()
    scene = SimpleNamespace(model=model, data=data, margins=margins, outlives=True, entered=tuple)
    locator, modes = Locator(scene, advance, rewind), (int(Mode.BALLISTIC),) * n  # type: ignore[arg-type]
    locator.land(modes)
    assert data.time == pytest.approx(turn, abs=1e-12 * STEP)
    assert locator.beyond(modes) == (int(Mode.CONTACT),) * (n - 1) + (int(Mode.BALLISTIC),)
