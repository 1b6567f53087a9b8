"""A published quadruped that stands on a floor: feet stick, joints rub, and their rows depend on each other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from places import ROBOTS

from crossbody import cases, engines
from crossbody.cases import Case, Outcome, Trajectory
from crossbody.cases.rotations import differences
from crossbody.engines.equations import system_of
from crossbody.reports.measuring.friction import changes, rubbing

FLOOR = '<worldbody>\n<geom name="floor" type="plane" size="0 0 .05"/>'


@pytest.fixture(scope="module")
def standing(tmp_path_factory: pytest.TempPathFactory) -> Case:
    path: Path = ROBOTS / "unitree_go1" / "go1.xml"
    if not path.is_file():
        pytest.skip(f"The robot's file {path} is not here.")
    copy = tmp_path_factory.mktemp("robot") / "go1.xml"
    copy.write_text(path.read_text(encoding="utf-8").replace("<worldbody>", FLOOR, 1), encoding="utf-8")
    return cases.load(str(copy), "home", without="rolling", friction=1, t_end=0.28)


def motion(case: Case, rtol: float) -> Trajectory:
    run = engines.load("reference").prepare(case, "compiled", rtol=rtol).run()
    assert run.outcome is Outcome.FINISHED, run.message
    return run


def test_its_feet_hold_and_no_contact_bears_more_than_it_can(standing: Case) -> None:
    run, system = motion(standing, 1e-9), system_of(standing)
    for i in np.flatnonzero(system.tangents):
        along = run.lam[:, system.tangent[i] : system.tangent[i] + system.tangents[i]]
        bound = system.friction[i] * (1.0 if system.dry[i] else np.maximum(run.lam[:, i], 0.0))
        assert np.max(np.linalg.norm(along, axis=1) - bound) < 1e-5 * np.max(np.abs(run.lam))


def test_its_slips_do_not_depend_on_the_tolerance(standing: Case) -> None:
    runs = [motion(standing, rtol) for rtol in (1e-11, 1e-13)]
    found = [rubbing(run, standing) for run in runs]
    assert found[0] is not None
    assert found[1] is not None
    one, two = (list(changes(run, each)) for run, each in zip(runs, found, strict=True) if each is not None)
    assert [(pair, slides) for pair, _, slides in one] == [(pair, slides) for pair, _, slides in two]
    assert len(one) >= 8
    assert [t for _, t, _ in one] == pytest.approx([t for _, t, _ in two], abs=1e-7)
    assert differences(runs[0].q[-1:], runs[1].q[-1:], standing.quaternions).max() < 1e-9
