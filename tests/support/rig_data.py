"""Published measurements where they are at hand, and logs made of a run."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from places import DATA

from crossbody import engines, hw
from crossbody.cases import Case

PENDULUM = DATA / "multiarm_pendulum"
CUBE = DATA / "contactnets_cube" / "tosses.parquet"

needs_pendulum = pytest.mark.skipif(
    not PENDULUM.is_dir(), reason=f"No pendulum logs in {PENDULUM}: set CROSSBODY_DATA to the folder that holds them."
)
needs_cube = pytest.mark.skipif(
    not CUBE.is_file(), reason=f"No cube tosses in {CUBE}: set CROSSBODY_DATA to the folder that holds them."
)


@cache
def pendulum(name: str) -> hw.Log:
    return hw.read(PENDULUM / f"{name}_train.parquet", f"multiarm_{name}")


@cache
def tosses(step: int) -> tuple[hw.Log, ...]:
    parts = hw.parts(CUBE, "contactnets_cube")[::step]
    return tuple(hw.read(CUBE, "contactnets_cube", part=part) for part in parts)


def channels(role: str, unit: str, values: dict[str, np.ndarray]) -> tuple[hw.Channel, ...]:
    return tuple(hw.Channel(role=hw.Role(role), name=name, unit=unit, values=x) for name, x in values.items())


def log_of(t: np.ndarray, *groups: tuple[hw.Channel, ...]) -> hw.Log:
    about = hw.Provenance(
        file="(synthetic)", sha256="", format="synthetic", library="numpy", synthetic=True, about="SYNTHETIC"
    )
    flat = tuple(channel for group in groups for channel in group)
    return hw.Log(time=t, channels=flat, sample_time=float(np.median(np.diff(t))), provenance=about)


def run_as_log(case: Case, names: dict[str, int], noise: float, rate: float = 500.0, seed: int = 0) -> hw.Log:
    """A run of the reference as a log of some coordinates, with white noise, and of their rates, without."""
    t = np.arange(0.0, case.t_end, 1.0 / rate)
    run = engines.load("reference").prepare(case, samples=t, rtol=1e-10).run()
    keep = np.append(np.diff(run.t) > 0.0, True)
    random = np.random.default_rng(seed)
    y = {name: run.q[keep][:, i] + noise * random.standard_normal(keep.sum()) for name, i in names.items()}
    yd = {name: run.v[keep][:, i] for name, i in names.items()}
    units = {name: case.coordinates[i].unit for name, i in names.items()}
    seen = (
        channels(role, f"{units[name]}{per}", {name: values})
        for role, per, of in (("coordinates", "", y), ("velocities", "/s", yd))
        for name, values in of.items()
    )
    return log_of(run.t[keep], *seen)
