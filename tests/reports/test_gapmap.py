"""The gap map: the table, its summary, its figure, and the command that makes them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from unpacked import numbers

from crossbody import engines
from crossbody.cases import EngineUnavailable, Mode, Trajectory
from crossbody.reports.cli import main
from crossbody.reports.maps import gapmap
from crossbody.reports.maps.figure import gap_map as figure
from crossbody.reports.runs.choice import Pick, picks

REFERENCE = Pick(engine="reference", profile="compiled")


@pytest.fixture(scope="module")
def rows() -> pd.DataFrame:
    return gapmap.gap_map([3, 5], [REFERENCE], points=16)


def test_one_row_a_run(rows: pd.DataFrame) -> None:
    assert list(rows.columns) == list(gapmap.COLUMNS)
    assert len(rows) == 2 * 2 * 16
    assert set(rows["machine"]) == {"level", "memoryless"}
    done = rows[rows["outcome"] == "finished"]
    assert np.abs(done["momentum"].astype(float)).max() < 1e-12
    assert rows["s"].max() == gapmap.LARGEST_S


def test_touching_balls_follow_the_simultaneous_rule_and_distant_ones_the_sequential(rows: pd.DataFrame) -> None:
    done = rows[rows["outcome"] == "finished"]
    assert set(done[done["s"] == 0.0]["nearest"]) == {"simultaneous"}
    assert set(done[done["s"] > np.pi / 2]["nearest"]) == {"sequential"}


def test_energy_created_is_that_of_switching(rows: pd.DataFrame) -> None:
    done = rows[(rows["outcome"] == "finished")]
    np.testing.assert_allclose(done["energy_created"].astype(float), done["energy_switching"].astype(float), atol=1e-6)


def test_summary_says_where_most_is_made_and_from_where_on_it_is_ideal(rows: pd.DataFrame) -> None:
    lines = gapmap.summary(rows)
    assert len(lines) == 4
    three = lines[(lines["n"] == 3) & (lines["machine"] == "level")].iloc[0]
    five = lines[(lines["n"] == 5) & (lines["machine"] == "level")].iloc[0]
    assert three["most"] == pytest.approx(0.167, abs=0.02)
    assert five["most"] > three["most"]
    assert set(lines["ideal_from"]) == {1.6}
    assert set(lines[lines["failed"] == 0]["at_touch"]) == {"simultaneous"}


def test_figure_has_two_plots_a_number_of_balls(rows: pd.DataFrame) -> None:
    drawn = figure(rows)
    named = [trace for trace in drawn["data"] if trace["mode"] == "lines"]
    assert len(named) == 2 * 2 * 2
    assert sum(trace["showlegend"] for trace in named) == 2
    assert "sqrt(a0)" in drawn["layout"]["xaxis3"]["title"]["text"]


def test_a_failed_run_is_a_cross(rows: pd.DataFrame) -> None:
    failed = rows.head(3).assign(outcome="step_limit", energy_created=np.nan, why="too many")
    crosses = [trace for trace in figure(failed)["data"] if trace["mode"] == "markers"]
    assert crosses
    assert all(len(numbers(trace["x"])) == 3 and trace["marker"]["symbol"] == "x" for trace in crosses)
    lines = gapmap.summary(failed)
    assert lines["failed"].tolist() == [3]
    assert lines["why"].tolist() == ["too many"]


def test_an_engine_that_cannot_is_one_row_with_its_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    class Unable:
        def why_not(self, _case: Any, _profile: str) -> str:
            return "It has no balls."

    monkeypatch.setattr(engines, "load", lambda _name: Unable())
    rows = gapmap.gap_map([3], [Pick(engine="unable", profile="at all")], points=5)
    assert rows["outcome"].tolist() == ["skipped"]
    assert rows["why"].tolist() == ["It has no balls."]


def test_an_absent_engine_is_one_row_with_its_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    def load(name: str) -> Any:
        raise EngineUnavailable(f"{name} is not installed.")

    monkeypatch.setattr(engines, "load", load)
    rows = gapmap.gap_map([3], picks(["absent"]), points=5)
    assert rows["why"].tolist() == ["absent is not installed."]


def test_the_command_writes_table_and_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "map"
    with pytest.raises(SystemExit) as end:
        main(["gapmap", "--n", "3", "-e", "reference:compiled", "--points", "4", "--out", str(out)])
    assert end.value.code == 0
    assert f"Report: {out / 'index.html'}" in capsys.readouterr().out
    table = pd.read_parquet(out / "gapmap.parquet")
    assert len(table) == 8
    assert len(pd.read_csv(out / "gapmap.csv")) == 8
    page = (out / "index.html").read_text(encoding="utf-8")
    assert 'id="index--gapmap"' in page
    assert "Gap map" in page


@pytest.mark.parametrize(
    ("arguments", "says"),
    [(["--n", "1"], "1"), (["--points", "1"], "1"), (["-e", "nobody"], "nobody"), (["--n", "x"], "x")],
)
def test_wrong_use_is_one_sentence(arguments: list[str], says: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(["gapmap", *arguments])
    told = capsys.readouterr().err
    assert end.value.code == 2
    assert says in told
    assert told.count("\n") == 1


@pytest.mark.parametrize("seed", range(40))
def test_collisions_are_over_where_no_gap_closes_and_nothing_pushes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    v, modes = np.sort(rng.normal(size=4)), rng.choice([Mode.FREE, Mode.BALLISTIC, Mode.COLLISION_SEPARATION], 3)
    closing, pushing = rng.random(2) < 0.5
    if closing:
        i = rng.integers(3)
        v[[i, i + 1]] = v[[i + 1, i]]
    if pushing:
        modes[rng.integers(3)] = rng.choice([Mode.CONTACT, Mode.COLLISION])
    nothing = np.zeros((1, 3))
    run = Trajectory(
        t=np.ones(1), q=np.zeros((1, 4)), v=v[None], gap=nothing, lam=nothing, energy=np.zeros((1, 2)),
        mode=modes[None].astype(np.int8),
    )  # fmt: skip
    assert gapmap.over(run) == (not closing and not pushing)
