"""The commands replay and identify: tables, page, provenance, exit codes; nothing written where something is wrong."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from rig_data import PENDULUM, needs_pendulum

from crossbody import hw
from crossbody.reports.cli import main

MODEL = ["--model", "double_pendulum", "--columns", "multiarm_double"]


def code(*arguments: str) -> int:
    with pytest.raises(SystemExit) as end:
        main([str(a) for a in arguments])
    return int(end.value.code or 0)


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten seconds of the double pendulum, stored: it needs no map any more."""
    path = tmp_path_factory.mktemp("logs") / "short.parquet"
    hw.store(hw.read(PENDULUM / "double_train.parquet", "multiarm_double").window(0.0, 10.5), path)
    return path


@needs_pendulum
def test_replay_writes_the_report_with_the_measurement_in_it(
    short: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert code("replay", short, "-m", "double_pendulum", "-e", "reference", "-e", "mujoco", "--out", out) == 0
    printed = capsys.readouterr().out
    assert "measurement" in printed
    assert "error_2s_median" in printed
    page = (out / "replay.html").read_text(encoding="utf-8")
    assert "A measurement." in page
    assert "Measured less predicted" in page
    rows = json.loads((out / "verdicts.json").read_text(encoding="utf-8"))["rows"]
    assert {row["engine"] for row in rows} == {"reference", "mujoco"}
    assert {row["tier"] for row in rows} == {"measurement"}
    told = json.loads((out / "provenance.json").read_text(encoding="utf-8"))
    assert told["log"]["sha256"]
    assert not told["log"]["synthetic"]
    assert len(list((out / "traces").glob("*.parquet"))) == 3
    assert code("report", out) == 0
    case = next(out.glob("case-*.html")).read_text(encoding="utf-8")
    assert '<option value="all" selected>' in case  # nothing is judged: every number is shown
    heads = re.findall(r"<h2>([^<]*)", case)
    assert heads == ["At a glance", "Verdicts", "Motion", "Runs", "Parity audit", "Provenance"]


@needs_pendulum
def test_replay_speaks_json(short: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ("replay", short, "-m", "double_pendulum", "-e", "reference", "--set", "k1=1e-3", "--json")
    assert code(*asked, "--out", tmp_path / "out") == 0
    rows = json.loads(capsys.readouterr().out)["metrics"]
    assert {row["metric"] for row in rows} >= {"fit", "rmse", "largest", "bias", "delay", "autocorrelation_inside"}
    assert all(row["who"] == "reference:compiled" for row in rows)


@needs_pendulum
def test_identify_writes_estimates_and_what_they_are_worth(
    short: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    asked = ("identify", short, "-m", "double_pendulum", "-f", "s1", "-f", "s2", "--stride", "20", "--json")
    assert code(*asked, "--out", out) == 0
    told = json.loads(capsys.readouterr().out)
    assert [row["name"] for row in told["identify"]] == ["s1", "s2"]
    assert {row["error"] for row in told["held_out"]} == {"rmse", "end_median", "end_90"}
    page = (out / "index.html").read_text(encoding="utf-8") + (out / "identify.html").read_text(encoding="utf-8")
    assert "Identified parameters" in page
    assert "complex step" in page


def test_a_synthetic_log_is_called_so_everywhere(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("mujoco")
    path, out = tmp_path / "rig.parquet", tmp_path / "out"
    hw.store(hw.delta_log(hw.delta_plant(t_end=0.6)), path)
    asked = ("replay", path, "-m", "delta", "-e", "reference", "--closed-loop", "--delay", "4e-4", "--out", out)
    assert code(*asked) == 0
    assert "SYNTHETIC, no measurement" in capsys.readouterr().out
    rows = json.loads((out / "verdicts.json").read_text(encoding="utf-8"))["rows"]
    assert {row["tier"] for row in rows} == {"SYNTHETIC, no measurement"}
    assert all("synthetic" in row["variant"] for row in rows)
    assert "SYNTHETIC" in (out / "replay.html").read_text(encoding="utf-8")


@needs_pendulum
@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["-m", "triple_pendulum", "--columns", "multiarm_double"], "There is no model 'triple_pendulum'"),
        ([*MODEL, "-e", "bullet"], "There is no engine 'bullet'"),
        ([*MODEL, "--set", "mass=1"], "There is no parameter of double_pendulum 'mass'"),
        ([*MODEL, "--restart", "100"], "no window of 100 s"),
        ([*MODEL, "--closed-loop"], "has no controller"),
    ],
)
def test_wrong_use_is_one_sentence_and_writes_nothing(
    more: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert code("replay", PENDULUM / "double_train.parquet", *more, "--out", out) == 2
    said = capsys.readouterr().err
    assert words in said
    assert len(said.strip().splitlines()) == 1
    assert not out.exists()


def test_models_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert code("list") == 0
    printed = capsys.readouterr().out
    assert all(name in printed for name in hw.models.names())
