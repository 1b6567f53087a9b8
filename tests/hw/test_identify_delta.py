"""The delta robot's parameters from synthetic logs: inside their intervals as often as 95 % promise."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest

from crossbody import hw

pytest.importorskip("mujoco")

TRUE = {"m1": 0.2, "m3": 0.3, "d1": 0.05, "delay": 4e-4}
START = {"m1": 0.25, "m3": 0.35, "d1": 0.03}


@pytest.fixture(scope="module")
def plant() -> hw.Plant:
    return hw.delta_plant(t_end=0.6)


def fits(plant: hw.Plant, seeds: Iterable[int]) -> list[hw.Fit]:
    return [
        hw.identify(
            hw.delta_log(plant, seed=seed), "delta", list(TRUE), restart=0.0, hold=0, starts="free", stride=3,
            parameters=START,
        ) for seed in seeds
    ]  # fmt: skip


def inside(found: list[hw.Fit]) -> dict[str, int]:
    return {name: sum(fit[name].low <= TRUE[name] <= fit[name].high for fit in found) for name in TRUE}


@pytest.mark.slow
def test_parameters_and_delay_are_recovered(plant: hw.Plant) -> None:
    found = fits(plant, range(2))
    assert all(fit.success for fit in found)
    told = [warning for fit in found for warning in fit.warnings]
    assert all("can hardly be separated" in warning for warning in told)  # m1 and m3: the log is short
    assert min(inside(found).values()) >= 1
    for fit in found:
        assert fit["delay"].value == pytest.approx(TRUE["delay"], abs=1e-4)
        assert fit["m3"].std < 1e-3
        assert fit["m3"].start == START["m3"]


@pytest.mark.slow
def test_ninety_of_a_hundred_seeds_lie_inside(plant: hw.Plant) -> None:
    found = fits(plant, range(100))
    counts = inside(found)
    off = np.array([[(fit[name].value - TRUE[name]) / fit[name].std for name in TRUE] for fit in found])
    print(counts, "scatter over stated deviation:", np.round(off.std(axis=0), 2))
    assert min(counts.values()) >= 90
    assert np.all(off.std(axis=0) > 0.7)  # intervals that are far too wide would pass the rest
    assert max(abs(fit["delay"].value - TRUE["delay"]) for fit in found) < 1e-4
