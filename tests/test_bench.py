"""Benchmark: what it measures, what it makes of it, and what it says of an earlier one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from crossbody import cases, engines
from crossbody.cases import InvalidValue, Outcome, OutputError, Trajectory
from crossbody.reports.bench import against as bench_against
from crossbody.reports.bench.headline import headline
from crossbody.reports.bench.ladder import COLUMNS, Effort, bench, joined
from crossbody.reports.bench.order import says
from crossbody.reports.bench.scenes import DROP, QUICK
from crossbody.reports.bench.throughput import best_pair
from crossbody.reports.cli import main
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.runs.jobs import Pick

ORDERS = {"second": 2.0, "liar": 4.0, "fails": 1.0}


@dataclass
class FakeRun:
    """The truth, moved by dt^2 for "second" and "liar"; for "fails" only below a step of 1 ms."""

    case: cases.Case
    profile: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    engine: str = "fake"

    def run(self) -> Trajectory:
        dt = float(self.settings["dt"])
        exact = truth_of(self.case).trajectory
        bad = self.profile == "fails" and dt > 1e-3
        return replace(
            exact, q=exact.q + 0.1 * dt**2, steps=7, wall_s=1e-3 / dt,
            outcome=Outcome.DIVERGED if bad else Outcome.FINISHED,
        )  # fmt: skip


class FakeEngine:
    name = "fake"
    profiles: Mapping[str, str] = dict.fromkeys(ORDERS, "")
    versions: Mapping[str, str] = {}
    orders = ORDERS

    def prepare(self, case: cases.Case, profile: str = "second", **settings: Any) -> FakeRun:
        return FakeRun(case, profile, {"dt": 1e-3} | settings)


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> list[Pick]:
    real = engines.load
    monkeypatch.setattr(engines, "load", lambda name: FakeEngine() if name == "fake" else real(name))
    return [Pick(engine="fake", profile=profile) for profile in ORDERS]


@pytest.fixture
def rows(fake: list[Pick]) -> pd.DataFrame:
    case = cases.load("bouncing_ball", "linear", t_end=1.0)
    return bench(case, [Pick(engine="reference", profile="compiled"), *fake], Effort(repeats=2, every=2))


def test_one_row_a_rung_with_every_error(rows: pd.DataFrame) -> None:
    assert list(rows.columns) == list(COLUMNS)
    second = rows[rows["profile"] == "second"]
    np.testing.assert_allclose(second["error"], 0.1 * second["setting"] ** 2, rtol=1e-6)
    np.testing.assert_allclose(second["error_v"], 0.0, atol=1e-12)
    np.testing.assert_allclose(second["median_ms"], 1.0 / second["setting"])
    assert (second["call_ms"] > 0.0).all()
    assert (rows["repeats"] == 2).all()
    assert set(rows["tier"]) == {"A"}
    ours = rows[rows["engine"] == "reference"]
    np.testing.assert_allclose(ours["honesty"], ours["error"] / ours["setting"])


def test_a_failed_run_stays_as_a_row_without_an_error(rows: pd.DataFrame) -> None:
    failed = rows[rows["profile"] == "fails"].set_index("setting")
    assert failed.loc[4e-3, "outcome"] == "diverged"
    assert np.isinf(failed.loc[4e-3, "error"])
    assert np.isfinite(failed.loc[1e-3, "error"])


def test_orders_are_held_against_promises(rows: pd.DataFrame) -> None:
    orders = joined([rows])[1].set_index("profile")
    assert orders.loc["second", "order"] == pytest.approx(2.0, abs=1e-3)
    assert orders.loc["second", "says"] == "converges"
    assert orders.loc["liar", "says"] == "converges, but not with the promised order 4"
    assert orders.loc["fails", "says"] == "too few points above rounding"
    assert orders.loc["compiled", "says"] == "exact at every setting"


def test_every_engine_declares_what_it_promises() -> None:
    for name in ("reference", "mujoco", "pinocchio", "exudyn", "drake", "dart", "pymunk"):
        try:
            engine: Any = engines.load(name)
        except cases.EngineUnavailable:
            continue
        assert set(engine.orders) == set(engine.profiles), name


@pytest.mark.parametrize(
    ("order", "promised", "words"),
    [(np.nan, 1.0, "too few"), (0.2, 1.0, "does not converge"), (3.9, 4.0, "converges"), (1.0, np.nan, "converges")],
)
def test_what_an_order_says(order: float, promised: float, words: str) -> None:
    assert says(order, promised).startswith(words)


def table(*rungs: tuple[str, float, float, float]) -> pd.DataFrame:
    """(engine, setting, error, ms)."""
    frame = pd.DataFrame(rungs, columns=["engine", "setting", "error", "median_ms"])
    profile = np.where(frame["engine"] == "reference", "compiled", "matched")
    return frame.assign(
        case="c", profile=profile, tier="A", against="the case", knob="rtol", call_ms=2.0 * frame["median_ms"],
        outcome="finished", known_to=0.0,
    )  # fmt: skip


def test_headline_takes_the_cheapest_run_that_is_as_accurate() -> None:
    found = headline(
        table(
            ("reference", 1e-4, 1e-5, 1.0), ("reference", 1e-9, 1e-10, 2.0), ("reference", 1e-12, 1e-13, 5.0),
            ("slow", 1e-4, 1e-3, 3.0), ("slow", 1e-9, 1e-8, 80.0), ("exact", 1e-9, 1e-16, 10.0),
            ("quick", 1e-3, 1e-2, 0.5), ("quick", 1e-6, 1e-9, 8.0), ("lost", 1e-3, np.inf, 1.0),
        )
    ).set_index("engine")  # fmt: skip
    assert found.loc["slow", ["ratio", "ratio_call", "least_ratio"]].to_list() == [40.0, 40.0, 3.0]
    assert found.loc["exact", "ratio"] == 2.0  # below rounding all are alike
    assert found.loc["quick", ["ratio", "least_ratio", "least_error"]].to_list() == [4.0, 0.5, 1e-2]
    assert found["ahead"].dropna().to_dict() == {"slow": "yes", "exact": "yes", "quick": "no"}
    assert "no less than its cheapest run, 1 ms at 1.0e-05" in found.loc["quick", "says"]
    assert "reaches no error" in found.loc["lost", "says"]


def test_errors_below_what_the_truth_is_known_to_are_alike() -> None:
    rows = table(("reference", 1e-4, 1e-5, 1.0), ("reference", 1e-9, 1e-11, 9.0), ("other", 1e-9, 1e-10, 3.0))
    assert headline(rows)["ratio"][0] == pytest.approx(1.0 / 3.0)
    assert headline(rows.assign(known_to=2e-5))["ratio"][0] == 3.0


def test_an_error_that_the_reference_does_not_reach_is_said() -> None:
    found = headline(table(("reference", 1e-9, 1e-6, 1.0), ("other", 1e-9, 1e-8, 1.0))).iloc[0]
    assert np.isnan(found["ratio"])
    assert found["ahead"] == "no"
    assert "the reference does not get below 1.0e-06" in found["says"]


def test_what_was_lost_is_told_with_its_reason() -> None:
    before = table(("reference", 1e-9, 1e-10, 1.0), ("slow", 1e-9, 1e-8, 80.0))
    same = bench_against.lost(before, headline(before), before, headline(before))
    assert not len(same)
    after = table(("reference", 1e-9, 1e-9, 5.0), ("slow", 1e-9, 1e-8, 80.0))
    found = bench_against.lost(after, headline(after), before, headline(before))
    assert found["what"].to_list() == ["accuracy", "ratio"]
    assert "error 1e-09 at rtol = 1e-09 where it was 1e-10" in found["why"][0]
    assert "16 times as fast at its best error where it was 80 times" in found["why"][1]
    failed = after.assign(error=np.inf, outcome="diverged")
    assert "diverged" in bench_against.lost(failed, headline(failed), before, headline(before))["why"][0]


def test_seconds_are_never_compared() -> None:
    before = table(("reference", 1e-9, 1e-10, 1.0), ("slow", 1e-9, 1e-8, 80.0))
    slower = before.assign(median_ms=100.0 * before["median_ms"])
    assert not len(bench_against.lost(slower, headline(slower), before, headline(before)))


def test_an_earlier_benchmark_has_something_in_common() -> None:
    a = table(("reference", 1e-9, 1e-10, 1.0))
    with pytest.raises(InvalidValue, match="no case"):
        bench_against.lost(a, headline(a), a.assign(case="d"), headline(a))


def test_folders_that_are_no_base(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="not a folder"):
        bench_against.read(tmp_path / "none")
    with pytest.raises(OutputError, match=r"bench\.parquet cannot be read"):
        bench_against.read(tmp_path)
    (tmp_path / "bench.parquet").write_bytes(b"no parquet")
    with pytest.raises(OutputError, match=r"bench\.parquet cannot be read"):
        bench_against.read(tmp_path)
    pd.DataFrame({"case": ["c"]}).to_parquet(tmp_path / "bench.parquet")
    with pytest.raises(OutputError, match="no column engine"):
        bench_against.read(tmp_path)


def test_scenes_have_labels_of_their_own() -> None:
    labels = [scene.case().label for scene in QUICK]
    assert len(set(labels)) == len(labels)
    assert DROP.case().label == "bouncing_ball:elastic(a0=100000,a1=0,a2=0,t_end=2)"


def test_pairs_beside_which_two_cores_were_given_come_first() -> None:
    rates = iter([1.0, 5.0, 1.0, 1.8])
    spun = iter([1.2, 1.95])
    ratio, *_, cores = best_pair(lambda: next(rates), lambda: next(rates), 2, lambda: next(spun))
    assert (ratio, cores) == (1.8, 1.95)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--against", "nowhere"], "not a folder"),
        (["--skip", "bouncing_ball"], "scenes of its own"),
        (["-e", "dart", "delta_impulse", "--variant", "light"], "No engine asked for can run"),
        (["--repeats", "0"], "0 is not in the range"),
        (["no_such_case"], "no case"),
    ],
)
def test_wrong_use_is_one_sentence(
    arguments: list[str],
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as end:
        main(["bench", *arguments])
    assert end.value.code == 2
    said = capsys.readouterr().err
    assert words in said
    assert len(said.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_the_command_writes_tables_and_compares(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    asked = ["bench", "bouncing_ball", "--variant", "linear", "--set", "t_end=0.6", "-e", "reference:compiled"]

    def call(*more: str) -> int:
        with pytest.raises(SystemExit) as end:
            main([*asked, "--repeats", "1", *more])
        return int(end.value.code or 0)

    assert call("--out", "base") == 0
    for name in ("bench", "orders", "headline"):
        assert all(Path("base", f"{name}.{suffix}").is_file() for suffix in ("parquet", "csv", "json"))
    assert call("--out", "same", "--against", "base") == 0
    assert "0 lost" in capsys.readouterr().out
    now = pd.read_parquet("same/bench.parquet")
    now.assign(error=1e-3, outcome="finished").to_parquet("base/bench.parquet")
    monkeypatch.setattr(bench_against, "ACCURACY", 1e-15)
    assert call("--out", "again", "--against", "base") == 1
    assert "lost accuracy: bouncing_ball:linear reference:compiled: error" in capsys.readouterr().out
    assert len(pd.read_parquet("again/lost.parquet")) == len(now)
