"""A file whose motion leaves its model is refused before anything that takes long is run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import Case, CaseUnsupported
from crossbody.reports.bench.measure import bench
from crossbody.reports.judging.covered import covered
from crossbody.reports.judging.reach import BUDGET, COARSE
from crossbody.reports.runs.choice import picks
from crossbody.reports.runs.jobs import run_case
from crossbody.reports.sweep.execute import SKIPPED, execute
from crossbody.reports.sweep.spec import Spec

SCENE = """<mujoco><worldbody><geom name="floor" type="plane" size="2 2 .1"/>
<body name="a" pos="0 0 .05"><freejoint/><geom name="a" type="box" size=".05 .05 .05" mass="1"/></body>
<body name="b" pos="{place}" euler="{turn}"><freejoint/>
<geom name="b" type="{kind}" size=".04 .04 .05" mass=".5"/></body>
</worldbody></mujoco>"""


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Tolerances of the runs that the reference is asked for; infinity for those of another solver."""
    reference, found = type(engines.load("reference")), []
    prepare = reference.prepare

    def noted(self: Any, case: Case, profile: str = "compiled", **settings: Any) -> Any:
        found.append(settings.get("rtol", COARSE) if profile == "compiled" else 0.0)
        return prepare(self, case, profile, **settings)

    monkeypatch.setattr(reference, "prepare", noted)
    return found


def scene(folder: Path, place: str, turn: str = "0 0 0", kind: str = "box") -> Case:
    path = folder / "scene.xml"
    path.write_text(SCENE.format(place=place, turn=turn, kind=kind))
    return cases.from_file(path)


def test_what_the_start_tells_is_told_before_any_run(tmp_path: Path, asked: list[float]) -> None:
    with pytest.raises(CaseUnsupported, match="Shapes 'a' and 'b' come within reach at t = 0 s"):
        run_case(scene(tmp_path, ".01 0 .15"), picks(("reference:compiled",)))
    assert asked == []


@pytest.mark.parametrize("seed", [0, 2, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 3))])
def test_whatever_falls_onto_what_has_no_row_is_refused_by_cheap_runs(
    seed: int, tmp_path: Path, asked: list[float]
) -> None:
    rng = np.random.default_rng(seed)
    x, y, z = *rng.uniform(-0.03, 0.03, 2), rng.uniform(0.25, 0.6)
    turn = " ".join(f"{angle:.3g}" for angle in rng.uniform(-40.0, 40.0, 3))
    dropped = scene(tmp_path, f"{x:.3g} {y:.3g} {z:.3g}", turn, str(rng.choice(["box", "cylinder"])))
    with pytest.raises(CaseUnsupported, match=r"Shapes '[ab]' and '[ab]' come within reach") as told:
        run_case(dropped, picks(("reference:compiled",)))
    assert 1 <= len(asked) <= 3  # without friction, with it, and to know that it is sure
    assert min(asked) >= COARSE
    met = float(str(told.value).split(" at t = ")[1].split(" s")[0])
    reach = np.linalg.norm([0.04, 0.04, 0.05])  # of a body that turns, from its centre
    assert np.sqrt(2.0 * max(z - 0.1 - reach, 0.0) / 9.81) <= met <= np.sqrt(2.0 * (z - 0.1) / 9.81)


def test_what_stays_within_its_model_is_as_it_was(tmp_path: Path, asked: list[float]) -> None:
    apart = scene(tmp_path, "1 0 5")
    assert covered(apart, BUDGET).parameters["t_end"] == apart.parameters["t_end"]
    assert len(asked) <= 2
    own = cases.load("bouncing_ball")
    assert covered(own, BUDGET) is own


STANDS = """<mujoco><worldbody><geom name="floor" type="plane" size="9 9 .1" friction=".5 0 0"/>
<body name="a" pos="0 0 .1"><joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
<geom type="sphere" size=".1" mass="1" friction=".5 0 0"/></body></worldbody>
<keyframe><key name="slides" qpos="0 0" qvel="{speed} 0"/></keyframe></mujoco>"""


@pytest.mark.parametrize("speed", [0.3, 1.0])
def test_a_file_is_timed_and_stressed_with_the_friction_that_its_motion_comes_to(tmp_path: Path, speed: float) -> None:
    """Without it the body fell through the floor, and engines that stand on it were rated by that."""
    path = tmp_path / "stands.xml"
    path.write_text(STANDS.format(speed=speed))
    case = cases.load(str(path), "slides", t_end=0.1)
    rows = bench(case, picks(("reference:compiled", "mujoco:as_is")), 1)
    assert set(rows["outcome"]) == {"finished"}
    errors = rows.set_index("engine")["error"].astype(float)
    assert errors["reference"].max() < 1e-4
    assert 1e-9 < errors["mujoco"].max() < 0.1, "a rating by what falls is of the size of the motion"
    row = execute(spec_of(case))
    assert (row["outcome"], row["verdict"]) == ("finished", "within")


def spec_of(case: Case) -> Spec:
    """What asks the reference for a case as it is, and another integrator for its truth."""
    return Spec(
        suite="own", index=0, draw=0, case=case.file, variant=case.variant, parameters={"t_end": case.t_end},
        engine="reference", profile="compiled", rung=-1, ladder=None, seed=0, second=True, afford=True, limit=1e-6,
        finishes=True, ends=False, max_steps=100_000, time_limit=60.0,
    )  # fmt: skip


def test_a_file_whose_motion_leaves_its_model_is_neither_timed_nor_stressed(tmp_path: Path) -> None:
    meets = scene(tmp_path, ".01 0 .15")
    with pytest.raises(CaseUnsupported, match="come within reach at t = 0 s"):
        bench(meets, picks(("reference:compiled",)), 1)
    row = execute(spec_of(meets))
    assert row["outcome"] == SKIPPED
    assert "come within reach at t = 0 s" in row["why"]
