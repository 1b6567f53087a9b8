"""Real tosses of a cube: friction is found, stiffness and damping of the contact are not in the data."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from rig_data import needs_cube, tosses

from crossbody import hw

pytestmark = needs_cube
mujoco = pytest.importorskip("mujoco")
SIDE = 0.1048  # of the cube, m


def missed(logs: tuple[hw.Log, ...], engine: str, **given: Any) -> np.ndarray:
    """Mean distance of the cube's centre from where it was seen, m, of each toss."""
    found = [hw.replay(log, "cube_toss", wanted=(engine,), **given) for log in logs]
    return np.array([np.linalg.norm(one.residual(one.predictions[0])[:, :3], axis=1).mean() for one in found])


@pytest.mark.slow
def test_over_all_tosses_the_reference_and_mujoco_cannot_be_told_apart() -> None:
    """Every toss, in pairs: some tosses alone would favour either. The 95 % interval of the difference holds 0."""
    logs = tosses(1)
    own, theirs = missed(logs, "reference"), missed(logs, "mujoco")
    assert len(logs) == 190
    assert told("at the defaults", own, theirs)
    assert max(own.mean(), theirs.mean()) < SIDE / 5


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_neither_can_be_told_apart_with_the_constants_of_the_other_half() -> None:
    """Damping or time constant of either is what misses least in one half of the tosses; the other half is judged."""
    logs = tosses(1)
    own = np.array([missed(logs, "reference", parameters={"a1": a1}) for a1 in (400.0, 640.0, 1000.0)])
    theirs = np.array([missed(logs, "mujoco", settings={"timeconst": time}) for time in (2e-3, 4e-3, 8e-3)])
    halves = np.split(np.random.default_rng(0).permutation(len(logs)), 2)
    judged = np.empty((2, len(logs)))
    for known, held in (halves, halves[::-1]):
        for k, each in enumerate((own, theirs)):
            judged[k, held] = each[np.argmin(each[:, known].mean(axis=1)), held]
    assert told("with the other half's constants", *judged)


def told(when: str, own: np.ndarray, theirs: np.ndarray) -> bool:
    """Print both means and the paired difference; whether its 95 % interval holds 0."""
    difference = own - theirs
    half = 1.97 * difference.std(ddof=1) / np.sqrt(len(own))
    print(f"{when}: mean {1e3 * own.mean():.2f} mm, MuJoCo {1e3 * theirs.mean():.2f} mm, reference minus MuJoCo")
    print(f"{1e3 * difference.mean():+.2f} +- {1e3 * half:.2f} mm, worse in {(difference > 0.0).sum()} of {len(own)}")
    return bool(abs(difference.mean()) < half)


def test_tosses_are_a_centimetre_off() -> None:
    logs = tosses(19)
    assert max(missed(logs, engine).mean() for engine in ("reference", "mujoco")) < SIDE / 5


@pytest.mark.parametrize("engine", ["pinocchio", "drake", "dart"])
def test_the_same_scene_is_tossed_in_every_engine(engine: str) -> None:
    pytest.importorskip({"drake": "pydrake", "dart": "dartpy"}.get(engine, engine))
    logs = tosses(95)
    assert np.median(missed(logs, engine)) < 40e-3
    found = hw.replay(logs[0], "cube_toss", wanted=("pinocchio:law",))
    assert "has friction" in found.skipped["pinocchio", "law"]


@pytest.mark.slow
def test_friction_is_found_in_its_published_interval() -> None:
    fit = hw.identify(tosses(19), "cube_toss", ["mu"], hold=0, parameters={"mu": 0.25})
    assert fit["mu"].value == pytest.approx(0.18, abs=0.03)
    assert fit["mu"].identifiable
    assert 0.12 < fit["mu"].low < fit["mu"].high < 0.24


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a0", "a1"])
def test_the_data_are_flat_in_stiffness_and_damping(name: str) -> None:
    fit = hw.identify(tosses(19), "cube_toss", [name], hold=0)
    assert not fit[name].identifiable
    assert any(f"{name} is not identifiable" in warning for warning in fit.warnings)
