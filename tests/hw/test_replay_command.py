"""The commands replay and identify: tables, page, provenance, exit codes; nothing written where something is wrong."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rig_data import PENDULUM, channels, log_of, needs_pendulum

from crossbody import engines, hw
from crossbody.cases import InvalidValue, Limit
from crossbody.hw.models.contract import Segment
from crossbody.reports.cli import main
from crossbody.reports.commands import replay as command
from crossbody.reports.replay.comparison import findings, verdicts
from crossbody.reports.replay.meanings import MEANS
from crossbody.reports.runs import watch
from crossbody.reports.sections.identify import sections

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
    page = (out / "index.html").read_text(encoding="utf-8")
    assert "is a measurement" in page
    assert "Measured minus predicted" in page
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
    assert heads == ["At a glance", "Verdicts", "Motion", "Runs", "Provenance"]


@needs_pendulum
@pytest.mark.parametrize("limit", ["", "fit=90", "fit=99.9999"])
def test_replay_says_first_what_is_judged_and_how_far_off_every_engine_is(
    limit: str, short: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, asked = tmp_path / "out", ("--limit", limit) if limit else ()
    assert code("replay", short, "-m", "double_pendulum", "-e", "reference:compiled", "--out", out, *asked) in (0, 1)
    said = " ".join(capsys.readouterr().out.split())
    rows = json.loads((out / "replay.json").read_text(encoding="utf-8"))["rows"]
    fits = {row["channel"]: row["value"] for row in rows if row["metric"] == "fit"}
    least = min(fits, key=fits.__getitem__)
    off = next(row["value"] for row in rows if (row["metric"], row["channel"]) == ("largest", least))
    met = sum(fit >= float(limit.partition("=")[2]) for fit in fits.values()) if limit else 0
    explained = f"Explained least: {fits[least]:.3g} % of {least}, off by up to {off:.3g} rad (reference:compiled)."
    assert said.startswith(f"{met} of {len(fits)} limits are met." if limit else explained)
    assert explained in said
    assert "Speed, in times of real time: reference:compiled" in said
    page = (out / "index.html").read_text(encoding="utf-8")
    assert explained in page
    assert page.count("Nothing is judged") == (0 if limit else 1)


@needs_pendulum
def test_replay_speaks_json(short: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ("replay", short, "-m", "double_pendulum", "-e", "reference", "--set", "k1=1e-3", "--json")
    assert code(*asked, "--out", tmp_path / "out") == 0
    rows = json.loads(capsys.readouterr().out)["metrics"]
    assert {row["metric"] for row in rows} >= {"fit", "rmse", "largest", "bias", "delay", "autocorrelation_inside"}
    assert all(row["who"] == "reference:compiled" for row in rows)
    assert all(MEANS[row["metric"].partition("_")[0]] for row in rows), "the page says what each of them means"


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
    page = (out / "index.html").read_text(encoding="utf-8")
    assert "Identified parameters" in page
    assert "complex step" in page


def test_a_synthetic_log_is_called_so_everywhere(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("mujoco")
    path, out = tmp_path / "rig.parquet", tmp_path / "out"
    hw.store(hw.delta_log(hw.delta_plant(t_end=0.6)), path)
    asked = ("replay", path, "-m", "delta", "-e", "reference", "--closed-loop", "--delay", "4e-4", "--out", out)
    assert code(*asked) == 0
    printed = capsys.readouterr().out
    assert "SYNTHETIC, no measurement" in printed
    assert "[rad]" in printed
    assert "[1]" not in printed, "a count or a ratio has no unit"
    rows = json.loads((out / "verdicts.json").read_text(encoding="utf-8"))["rows"]
    assert {row["tier"] for row in rows} == {"SYNTHETIC, no measurement"}
    assert all("synthetic" in row["variant"] for row in rows)
    page = (out / "index.html").read_text(encoding="utf-8")
    assert "SYNTHETIC" in page
    assert '<td class="text">rad</td>' in page
    assert '<td class="text">1</td>' not in page


@needs_pendulum
@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["-m", "triple_pendulum", "--columns", "multiarm_double"], "There is no model 'triple_pendulum'"),
        ([*MODEL, "-e", "bullet"], "There is no engine 'bullet'"),
        ([*MODEL, "--set", "mass=1"], "There is no parameter 'mass' of double_pendulum"),
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


@pytest.fixture(scope="module")
def two_frictions(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A pendulum whose friction is tenfold in every other second, as a stored log with rates."""
    model, step = hw.models.load("single_pendulum"), 1e-2
    y, yd = [], []
    for k1 in (1e-2, 1e-3) * 4:
        case = model.build(model.numbers({"k1": k1}), Segment(y=np.array([2.0]), yd=np.array([1.0]), t_end=1.0))
        run = engines.load("reference").prepare(case, samples=step * np.arange(100), rtol=1e-9).run()
        y.append(run.q[:100, 2])
        yd.append(run.v[:100, 2])
    t = step * np.arange(800)
    log = log_of(
        t, channels("coordinates", "rad", {"th1": np.concatenate(y)}),
        channels("velocities", "rad/s", {"th1": np.concatenate(yd)}),
    )  # fmt: skip
    path = tmp_path_factory.mktemp("logs") / "two.parquet"
    hw.store(log, path)
    return path


ONE = ("-m", "single_pendulum", "--restart", "1", "--horizon", "0.98", "--set", "k1=1e-3")


def test_a_fit_that_is_worse_where_it_was_not_fitted_is_outside(
    two_frictions: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    asked = ("identify", two_frictions, *ONE, "-f", "k1", "--out", out)
    assert code(*asked) == 1
    said = " ".join(capsys.readouterr().out.split())
    assert "worse than the start" in said
    assert re.search(r"outside: reference:compiled held_out_worse is [\d.e+]+ %", said)
    held = json.loads((out / "held_out.json").read_text(encoding="utf-8"))["rows"]
    assert [row["verdict"] for row in held] == ["outside", "not judged", "not judged"]
    row = sections(out)[0].tables[0].rows[0]
    assert row["half"] == pytest.approx((row["high"] - row["low"]) / 2.0)
    assert f"rmse grew from {held[0]['held_before']:.4g} to {held[0]['held_after']:.4g}:" in said


@pytest.mark.slow
def test_a_fit_that_is_worse_is_within_a_limit_that_allows_it_or_where_nothing_is_held_out(
    two_frictions: Path, tmp_path: Path
) -> None:
    asked = ("identify", two_frictions, *ONE, "-f", "k1", "--out", tmp_path / "out")
    assert code(*asked, "--limit", "held_out_worse=1e9", "--quiet") == 0
    assert code(*asked, "--hold", "0", "--json") == 0


@pytest.mark.parametrize(("limits", "expected"), [(["fit=1", "windows_failed=0"], 0), (["fit=1", "rmse=1e-9"], 1)])
def test_replay_has_limits_and_an_exit_code(
    limits: list[str], expected: int, two_frictions: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = [word for limit in limits for word in ("--limit", limit)]
    asked = ("replay", two_frictions, *ONE, "-e", "reference", *options, "--out", tmp_path)
    assert code(*asked) == expected
    rows = json.loads((tmp_path / "replay.json").read_text(encoding="utf-8"))["rows"]
    judged = [row["verdict"] for row in rows if row["verdict"] != "not judged"]
    assert set(judged) == ({"outside", "within"} if expected else {"within"})
    told = re.findall("^outside: reference:compiled ([a-z]+)", capsys.readouterr().out, re.MULTILINE)
    assert told == [row["metric"] for row in rows if row["verdict"] == "outside"]


def test_a_lower_bound_is_told_as_it_was_given(
    two_frictions: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = ("replay", two_frictions, *ONE, "-e", "reference", "--limit", "fit=99.9995", "--limit", "rmse=1e-9")
    assert code(*asked, "--out", tmp_path) == 1
    told = capsys.readouterr().out
    assert re.search(r"outside: reference:compiled fit_th1 is [\d.]+ %, valid: at least 99\.9995\. ", told), told
    assert re.search(r"outside: reference:compiled rmse_th1 is [\d.e-]+ rad, valid: at most 1e-09\. ", told)


def test_what_was_identified_is_replayed_as_replay_does(
    two_frictions: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """With its windows, its settings and its delay: both commands tell the same numbers of the same parameters."""
    same = ("-m", "single_pendulum", "--restart", "0.5", "--horizon", "0.4", "--set", "a1=0.4", "--delay", "0.02")
    assert code("identify", two_frictions, *same, "-f", "k1", "--limit", "held_out_worse=1e9", "--json",
                "--out", tmp_path / "one") == 0  # fmt: skip
    told = json.loads(capsys.readouterr().out)
    found = told["identify"][0]["value"]
    asked = ("replay", two_frictions, *same, "--set", f"k1={found!r}", "-e", "reference")
    assert code(*asked, "--json", "--out", tmp_path / "two") == 0
    of_identify, of_replay = (
        {(row["metric"], row["channel"]): row["value"] for row in rows if row["metric"] != "speed"}
        for rows in (told["metrics"], json.loads(capsys.readouterr().out)["metrics"])
    )
    assert of_identify == pytest.approx(of_replay, nan_ok=True)


def test_a_limit_on_any_metric_is_its_verdict(two_frictions: Path) -> None:
    found = hw.replay(hw.read(two_frictions), "single_pendulum", restart=1.0, wanted=("reference",))
    for metric, value, outside in (
        ("fit", 1.0, False), ("fit", 99.9999, True), ("rmse", 1.0, False), ("rmse", 1e-9, True),
        ("rmse_th1", 1.0, False), ("windows_failed", 0.0, False), ("autocorrelation_inside", 0.0, False),
    ):  # fmt: skip
        rows = verdicts(found, "a command", (Limit(metric=metric, value=value),))
        judged = set(rows.loc[rows["metric"].str.startswith(metric), "verdict"]) - {"not judged"}
        assert judged == {"outside" if outside else "within"}, metric


@pytest.mark.parametrize(
    ("limit", "words"),
    [("fit", "is not NAME=VALUE"), ("fit=-1", "at least 0"), ("fit=101", "at most 100"), ("fitt=90", "no metric")],
)
def test_a_wrong_limit_is_one_sentence_and_writes_nothing(
    limit: str, words: str, two_frictions: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert code("replay", two_frictions, *ONE, "-e", "reference", "--limit", limit, "--out", out) == 2
    assert words in capsys.readouterr().err
    assert not out.exists()


def test_a_model_brings_limits_of_its_own(two_frictions: Path) -> None:
    log, model = hw.read(two_frictions), hw.models.load("single_pendulum")
    strict = replace(model, limits=(Limit(metric="fit", value=99.9999, why="A pendulum in a vacuum."),))
    found = hw.replay(log, strict, restart=1.0)
    rows = verdicts(found, "a command")
    assert rows.loc[rows["metric"] == "fit_th1", "verdict"].tolist() == ["outside"]
    given = verdicts(found, "a command", (Limit(metric="fit", value=1.0),))
    assert given.loc[given["metric"] == "fit_th1", "verdict"].tolist() == ["within"]


def test_a_search_ends_within_its_time(two_frictions: Path) -> None:
    fit = hw.identify(hw.read(two_frictions), "single_pendulum", ["k1", "a1"], restart=1.0, budget=1e-3)
    assert not fit.success
    assert "time for the search was over" in fit.message
    assert np.isfinite(fit["k1"].value)
    with pytest.raises(ValueError, match="budget is 0"):
        hw.identify(hw.read(two_frictions), "single_pendulum", ["k1"], budget=0)


def test_an_identification_that_is_stopped_is_told_and_outside(
    two_frictions: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = ("identify", two_frictions, *ONE, "-f", "k1", "--time-limit", "1e-6", "--json", "--out", tmp_path / "out")
    assert code(*asked) == 1
    told = json.loads(capsys.readouterr().out)
    assert [row["identifiable"] for row in told["identify"]] == [False]
    assert "Stopped at the time limit of 1e-06 s" in told["warnings"][0]["text"]
    assert "0 of 1 parameter is identified; not k1." in (tmp_path / "out" / "index.html").read_text()


def test_a_replay_may_take_the_seconds_that_are_asked_for_and_an_identification_is_given_them(
    two_frictions: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its process has twice those and two seconds more: it stops by itself before."""
    given: list[float] = []

    def identify(*_: object, time_limit: float, **__: object) -> None:
        given.append(time_limit)
        raise InvalidValue("asked enough")

    monkeypatch.setattr(watch, "limited", lambda label, seconds: given.append(seconds))
    asked = (two_frictions, *ONE, "--time-limit", "70", "--out")
    assert code("replay", *asked, tmp_path / "one", "-e", "reference") == 0
    assert set(given) == {70.0}
    given.clear()
    monkeypatch.setattr(hw, "identify", identify)
    assert code("identify", *asked, tmp_path / "two", "-f", "k1") == 2
    assert given == [142.0, 70.0]


def test_tables_of_an_identification_tell_its_own_numbers() -> None:
    """No two are equal: each stands in its own column."""
    names = ("value", "low", "high", "start", "std", "freedom", "kept_low", "kept_high")
    told = dict(zip(names, np.arange(1.0, 9.0), strict=True)) | {"name": "k", "unit": "N", "identifiable": True}
    fit: Any = SimpleNamespace(
        estimates=[SimpleNamespace(**told)], agreement=[SimpleNamespace(name="k", values=(11.0, 12.0))],
        before={"rmse": (21.0, 20.0)}, after={"rmse": (23.0, 25.0)},
    )  # fmt: skip
    halves = {"first_half": 11.0, "second_half": 12.0}
    assert command.estimates(fit).to_dict(orient="records") == [told | halves]
    assert command.held_out(fit).to_dict(orient="records") == [{
        "error": "rmse", "fitted_before": 21.0, "held_before": 20.0, "fitted_after": 23.0, "held_after": 25.0,
        "change": 25.0,
    }]  # fmt: skip


@pytest.mark.parametrize(("count", "left"), [(4000, 1.998), (4001, 0.0), (4101, 0.2)])
def test_what_no_window_covers_is_told(count: int, left: float) -> None:
    """A log that is one sample short of its last window: a quarter of it was not replayed, and nothing said so."""
    t = 2e-3 * np.arange(count)
    log = log_of(t, channels("coordinates", "rad", {"th1": 0.1 * np.cos(5.0 * t)}))
    found = findings(hw.replay(log, "single_pendulum", wanted=["reference"], restart=2.0))
    told = found[found["what"] == "windows"]["text"].tolist()
    samples = round(left / 2e-3)
    wanted = [f"The last {left:g} s ({samples} samples) are shorter than a window and are not used."]
    assert told == (wanted if left else [])
