"""Benchmark: what it measures, what it makes of it, and what it says of an earlier one."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from unpacked import numbers

from crossbody import cases, engines
from crossbody.cases import InvalidValue, Mode, Outcome, OutputError, Tier, Trajectory
from crossbody.reports.bench import against as bench_against
from crossbody.reports.bench import measure, scenes
from crossbody.reports.bench.errors import errors, hermite
from crossbody.reports.bench.figure import work_precision
from crossbody.reports.bench.headline import REFERENCE, headline
from crossbody.reports.bench.ladder import Effort, Ladder
from crossbody.reports.bench.measure import COLUMNS, bench, joined
from crossbody.reports.bench.order import orders, says, stays
from crossbody.reports.bench.scenes import DROP, QUICK
from crossbody.reports.bench.throughput import best_pair
from crossbody.reports.cli import main
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.runs.choice import Pick

ORDERS = {"second": 2.0, "liar": 4.0, "fails": 1.0, "throws": 1.0}


@dataclass
class FakeRun(engines.Run):
    """The truth, moved by dt^2 for "second" and "liar"; for "fails" only below a step of 1 ms."""

    case: cases.Case
    profile: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    engine: str = "fake"

    def run(self) -> Trajectory:
        dt = float(self.settings["dt"])
        if self.profile == "throws":
            raise ZeroDivisionError("planted")
        exact = truth_of(self.case).trajectory
        bad = self.profile == "fails" and dt > 1e-3
        return replace(
            exact, q=exact.q + 0.1 * dt**2, steps=7, wall_s=1e-3 / dt,
            outcome=Outcome.DIVERGED if bad else Outcome.FINISHED,
        )  # fmt: skip

    def audit(self) -> Mapping[str, Any]:
        return {}


class FakeEngine(engines.Engine):
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


@pytest.mark.parametrize("late", [0.0, 1e-7, 1e-3])
@pytest.mark.parametrize("off", [0.0, 1e-9, 1e-4])
def test_the_error_of_a_timed_run_is_the_larger_of_where_and_when(late: float, off: float) -> None:
    case = cases.load("bouncing_ball", "linear", t_end=1.0)
    truth = truth_of(case)
    run = truth.trajectory
    events = tuple(replace(e, t=e.t + late * (e.before == Mode.CONTACT)) for e in run.events)
    moved = replace(run, q=run.q * (1.0 + off), events=events)
    found = errors(truth, moved, case)
    assert found["error_times"] == pytest.approx(late, rel=1e-6, abs=1e-12)
    assert found["error_q"] == pytest.approx(off, rel=1e-6, abs=1e-12)
    assert found["error"] == max(found["error_q"], found["error_times"] / case.t_end)
    assert errors(truth, replace(moved, events=moved.events[:-3]), case)["error"] == np.inf
    assert errors(truth, replace(moved, outcome=Outcome.STEP_LIMIT), case)["error"] == np.inf


def test_one_row_a_rung_with_every_error(rows: pd.DataFrame) -> None:
    assert list(rows.columns) == list(COLUMNS)
    second = rows[rows["profile"] == "second"]
    np.testing.assert_allclose(second["error"], 0.1 * second["setting"] ** 2, rtol=1e-6)
    np.testing.assert_allclose(second["error_v"], 0.0, atol=1e-12)
    np.testing.assert_allclose(second["median_ms"], 1.0 / second["setting"])
    assert (second["call_ms"] > 0.0).all()
    assert (rows["repeats"] == np.where(rows["profile"] == "throws", 1, 2)).all()
    assert set(rows["tier"]) == {"A"}
    ours = rows[rows["engine"] == "reference"]
    np.testing.assert_allclose(ours["honesty"], ours["error"] / ours["setting"])


def test_a_failed_run_stays_as_a_row_without_an_error(rows: pd.DataFrame) -> None:
    failed = rows[rows["profile"] == "fails"].set_index("setting")
    assert failed.loc[4e-3, "outcome"] == "diverged"
    assert np.isinf(failed.loc[4e-3, "error"])
    assert np.isfinite(failed.loc[1e-3, "error"])


def test_a_run_that_throws_stays_as_a_row_and_the_others_are_timed(rows: pd.DataFrame) -> None:
    thrown = rows[rows["profile"] == "throws"]
    assert len(thrown)
    assert thrown["outcome"].str.startswith("crashed: ZeroDivisionError: planted").all()
    assert np.isinf(thrown["error"]).all()
    says = headline(rows).set_index("profile").loc["throws", "says"]
    assert says.startswith("reaches no error") and "ZeroDivisionError: planted" in says  # noqa: PT018 - one sentence


def test_orders_are_held_against_promises(rows: pd.DataFrame) -> None:
    orders = joined([rows])[1].set_index("profile")
    assert orders.loc["second", "order"] == pytest.approx(2.0, abs=1e-3)
    assert orders.loc["second", "says"] == "converges"
    assert orders.loc["liar", "says"] == "converges, but not with the promised order 4"
    assert orders.loc["fails", "says"] == "fewer than three runs have a finite error above rounding"
    assert orders.loc["compiled", "says"] == "exact at every setting"


@settings(max_examples=30)
@given(
    st.lists(
        st.tuples(st.floats(0.6, 6.0), st.floats(-2.0, 1.0), st.integers(3, 8), st.integers(0, 5)),
        min_size=1,
        max_size=4,
    )
)
def test_a_floor_takes_nothing_from_an_order(drawn: list[tuple[float, float, int, int]]) -> None:
    """Errors of c h^p that stay at a floor behind so many points: the order is p, of every engine beside the others."""
    ladders, ends = [], []
    for k, (p, c, above, below) in enumerate(drawn):
        h = 0.5 ** np.arange(above + below)
        exact = 10.0**c * h**p
        error = np.maximum(exact, 0.09 * exact[above - 1] if below else 0.0)
        ends.append(np.append(np.ones(3), error)[-4:] / error[-1] if error[-1] > 1e-11 else np.full(4, np.nan))
        named = {"case": "ball", "engine": f"e{k}", "profile": f"p{k % 2}", "knob": "dt", "promised": p + 0.4}
        ladders.append(pd.DataFrame({**named, "setting": h, "error": error}))
    together = pd.concat(ladders).sort_values("setting", kind="stable")
    found = orders(together).set_index("engine")
    for k, (p, *_) in enumerate(drawn):
        assert found.loc[f"e{k}", "order"] == pytest.approx(p, rel=1e-9)
        assert found.loc[f"e{k}", ["profile", "promised"]].to_list() == [f"p{k % 2}", p + 0.4]
        told = str(found.loc[f"e{k}", "says"])
        if ends[k].max() > 1.3:
            assert told == "converges"
        elif ends[k].max() == 1.0:
            assert told.startswith(f"does not converge to the truth of the case: of order {p:.2g} above a floor")


@pytest.mark.parametrize(
    ("errors", "said"),
    [
        ([0.0262, 0.0188, 0.0064, 0.0039, 0.0047, 0.0053], "its error grows again below dt = 0.125, near 0.0053"),
        ([0.0262, 0.0188, 0.0064, 0.0039, 0.0041, 0.0045], "its error grows again below dt = 0.125, near 0.0045"),
        ([0.02, 0.018, 0.017, 0.0165], "its error does not fall below dt = 0.5, near 0.017"),
        ([0.3, 0.1, 0.01, 1e-3, 9e-4, 9e-4, 9e-4],
         "of order 2.5 above a floor of its own, its error does not fall below dt = 0.0625, near 0.0009"),
        ([0.4, 0.2, 0.1, 0.05, 0.025], ""), ([1e-13] * 5, ""), ([0.5, 0.1], ""),
        ([0.4, 0.1, 0.025, 0.004, 0.006, 0.0007, 0.0009], ""),  # events at random places in a step
        ([1e-3, 1e-7, 3e-12, 4e-12, 5e-12], ""),  # rounding
    ],
)  # fmt: skip
def test_errors_that_do_not_fall_any_further_are_told(errors: list[float], said: str) -> None:
    """Those of a rung may be small by chance, where two parts of an error cancel: an order hides what remains."""
    dt = [0.5**k for k in range(len(errors))]
    assert stays("dt", dt, errors, 0.0) == (said and f"does not converge to the truth of the case: {said}")
    assert not stays("dt", dt, errors, 1.0), "what the truth is known to"


def test_every_engine_declares_what_it_promises() -> None:
    for name in ("reference", "mujoco", "pinocchio", "exudyn", "drake", "dart", "pymunk"):
        try:
            engine: Any = engines.load(name)
        except cases.EngineUnavailable:
            continue
        assert set(engine.orders) == set(engine.profiles), name


@pytest.mark.parametrize(
    ("order", "promised", "words"),
    [
        (np.nan, 1.0, "fewer than three"),
        (0.2, 1.0, "does not converge"),
        (3.9, 4.0, "converges"),
        (1.0, np.nan, "converges"),
    ],
)
def test_what_an_order_says(order: float, promised: float, words: str) -> None:
    assert says(order, promised).startswith(words)


def table(*rungs: tuple[str, float, float, float]) -> pd.DataFrame:
    """(engine, setting, error, ms)."""
    frame = pd.DataFrame(rungs, columns=["engine", "setting", "error", "median_ms"])
    profile = np.where(frame["engine"] == "reference", "compiled", "matched")
    return frame.assign(
        case="c", profile=profile, tier="A", against="the case", knob="rtol", call_ms=2.0 * frame["median_ms"],
        outcome="finished", known_to=0.0, touches=0.0,
    )  # fmt: skip


def test_between_steps_all_are_measured_on_one_grid() -> None:
    """A parabola is met exactly by cubics through places and rates, however few the steps; not by a chord."""
    case = cases.load("bouncing_ball", "linear", t_end=0.3)
    truth = truth_of(case)
    grid = np.linspace(0.0, case.t_end, 7)
    few = hermite(truth.at(np.array([0.0, 0.1, 0.3])), grid)
    np.testing.assert_allclose(few.q, truth.at(grid).q, rtol=1e-14)
    off = truth.at(np.array([0.0, 0.3]))
    assert np.abs(hermite(replace(off, v=0.0 * off.v), grid).q - truth.at(grid).q).max() > 0.01


def test_an_instant_that_stands_twice_divides_cubics() -> None:
    t, q = np.array([0.0, 1.0, 1.0, 2.0]), np.array([[1.0], [0.0], [0.0], [1.0]])
    v = np.array([[-1.0], [-1.0], [1.0], [1.0]])
    both = replace(
        truth_of(cases.load("bouncing_ball", "linear")).trajectory, t=t, q=q, v=v, gap=q, lam=0.0 * q,
        energy=np.zeros((4, 2)), mode=np.zeros((4, 1), dtype=np.int8), ledger=None,
    )  # fmt: skip
    np.testing.assert_allclose(hermite(both, np.linspace(0.0, 2.0, 9)).q[:, 0], np.abs(1.0 - np.linspace(0.0, 2.0, 9)))


def test_what_is_python_is_said_and_the_native_loop_stands_beside_it() -> None:
    case = cases.load("bouncing_ball", "listing", t_end=0.5)
    wanted = [Pick(engine="reference", profile="compiled"), Pick(engine="mujoco", profile="matched")]
    rows = bench(case, wanted, Effort(repeats=1, every=3, longest=0.3)).set_index("engine")
    assert (rows.loc[["reference"], "interpreted"] == "").all()
    assert rows.loc[["reference"], "native_ms"].isna().all()
    assert rows.loc[["mujoco"], "interpreted"].str.contains("Python|loop over steps").all()
    assert (rows.loc[["mujoco"], "native_ms"] > 0.02 * rows.loc[["mujoco"], "median_ms"]).all(), "all of its steps"
    assert (rows.loc[["mujoco"], "native_ms"] < rows.loc[["mujoco"], "median_ms"]).all()


@pytest.mark.parametrize(("each", "climb"), [(1.0, 0.5), (1e9, scenes.FULL_EFFORT.climb)])
def test_a_bound_on_the_whole_shortens_every_ladder(each: float, climb: float) -> None:
    found = scenes.effort(full=True, every_rung=False, repeats=None, each=each)
    assert found.climb == climb
    assert found.longest <= found.climb


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
    assert found.loc["lost", "says"] == "reaches no error: at rtol = 0.001 its run ends finished"


@pytest.mark.parametrize("seed", range(20))
def test_the_ratio_at_an_error_is_to_the_cheapest_run_of_the_reference_that_is_no_worse(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ours, theirs = (
        [
            ("reference" if k else "other", 1e-3, 10.0 ** rng.uniform(-12.0, -2.0), rng.uniform(1.0, 9.0))
            for _ in range(12)
        ]
        for k in (1, 0)
    )
    found = headline(table(*ours, *theirs)).iloc[0]
    ratios = {e: ms / min((x for *_, mine, x in ours if mine <= e), default=np.nan) for *_, e, ms in theirs}
    assert found["best_error"] == min(ratios)
    assert found["ratio"] == pytest.approx(ratios[min(ratios)], nan_ok=True)
    least = np.nan if any(np.isnan(x) for x in ratios.values()) else min(ratios.values())
    assert found["least_ratio"] == pytest.approx(least, nan_ok=True)


def test_an_engine_with_other_events_reaches_no_error() -> None:
    rows = table(("reference", 1e-4, 1e-5, 1.0), ("other", 1e-3, np.inf, 1.0), ("other", 1e-6, np.inf, 1.0))
    says = headline(rows.assign(touches=[0.0, 5.0, 2.0]))["says"][0]
    assert says == "reaches no error: at rtol = 1e-06 its touches differ from the truth's by +2"


def test_errors_below_what_the_truth_is_known_to_are_alike() -> None:
    rows = table(("reference", 1e-4, 1e-5, 1.0), ("reference", 1e-9, 1e-11, 9.0), ("other", 1e-9, 1e-10, 3.0))
    assert headline(rows)["ratio"][0] == pytest.approx(1.0 / 3.0)
    assert headline(rows.assign(known_to=2e-5))["ratio"][0] == 3.0


def test_of_an_engine_too_the_cheapest_of_alike_errors_counts() -> None:
    """The reference was given its cheapest one below what the truth is known to, an engine its smallest."""
    rows = table(("reference", 1e-9, 1e-11, 1.0), ("other", 1e-3, 5e-11, 4.0), ("other", 1e-4, 1e-13, 40.0))
    assert headline(rows)["best_error"][0] == 1e-13
    fair = headline(rows.assign(known_to=1e-10)).iloc[0]
    assert (fair["best_error"], fair["ratio"]) == (5e-11, 4.0)


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
        (["--skip", "bouncing_ball"], "its own scenes"),
        (["-e", "dart", "delta_impulse", "--variant", "light"], "None of the selected engines can run"),
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
    assert len([line for line in said.strip().splitlines() if "waiting for it" not in line]) == 1
    assert not (tmp_path / "out").exists()


@pytest.fixture
def call(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., int]:
    """The command on one short scene, in a folder of its own; the exit code."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(scenes, "QUICK_EFFORT", Effort(repeats=1, every=3))

    def run(*more: str, t_end: float = 0.6) -> int:
        scene = ["bouncing_ball", "--variant", "listing", "--set", f"t_end={t_end}"]
        with pytest.raises(SystemExit) as end:
            main(["bench", *scene, "-e", "reference:compiled", "-e", "reference:cvode", "--quiet", *more])
        return int(end.value.code or 0)

    return run


def test_the_command_writes_tables_and_compares(call: Callable[..., int], capsys: pytest.CaptureFixture[str]) -> None:
    assert call("--out", "base") == 0
    for name in ("bench", "orders", "headline"):
        assert all(Path("base", f"{name}.{suffix}").is_file() for suffix in ("parquet", "csv", "json"))
    rows, lines = (pd.read_parquet(f"base/{name}.parquet") for name in ("bench", "headline"))
    lines.assign(ratio=lines["ratio"] / 100.0).to_parquet("base/headline.parquet")
    assert call("--out", "same", "--against", "base") == 0
    rows.assign(error=rows["error"] / 100.0).to_parquet("base/bench.parquet")
    assert call("--out", "worse", "--against", "base") == 1
    assert "lost accuracy: bouncing_ball:listing(t_end=0.6) reference:compiled: error" in capsys.readouterr().out
    assert set(pd.read_parquet("worse/lost.parquet")["what"]) == {"accuracy"}
    rows.to_parquet("base/bench.parquet")
    lines.assign(ratio=lines["ratio"] * 100.0).to_parquet("base/headline.parquet")
    assert call("--out", "slower", "--against", "base") == 1
    assert "lost ratio: bouncing_ball:listing(t_end=0.6) reference:cvode: the reference is" in capsys.readouterr().out


def test_a_base_of_other_parameters_is_refused_before_anything_is_run(
    call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    Path("base").mkdir()
    rows = table(("reference", 1e-9, 1e-10, 1.0)).assign(case="bouncing_ball:listing(t_end=0.6)")
    rows.to_parquet("base/bench.parquet")
    headline(rows).to_parquet("base/headline.parquet")
    assert call("--against", "base", t_end=0.7) == 2
    assert "has none of these cases; it has: bouncing_ball:listing(t_end=0.6)." in capsys.readouterr().err


def test_every_case_with_a_closed_form_or_published_digits_is_timed_beside_another_engine() -> None:
    full = {case.label: case for case in scenes.default(full=True)}
    known = [cases.load(name, variant) for name in cases.names() for variant in cases.variants(name)]
    judged = [case for case in known if case.closed_form or {claim.tier for claim in case.claims} & {Tier.A, Tier.B}]
    assert len(judged) > 10
    for case in judged:
        assert case.label in full
        others = [pick for pick in scenes.picks(["reference", "mujoco", "pinocchio"]) if not pick.skipped]
        able = [pick for pick in others if engines.load(pick.engine).why_not(case, pick.profile) is None]
        assert any((pick.engine, pick.profile) != REFERENCE for pick in able), case.label
        assert any((pick.engine, pick.profile) == REFERENCE for pick in able), case.label


@dataclass
class SlowRun(FakeRun):
    """Every step takes 10 ms, and half the step twice as many."""

    def run(self) -> Trajectory:
        steps = min(round(8e-3 / float(self.settings["dt"])), int(self.settings["max_steps"]))
        time.sleep(0.01 * steps)
        done = steps < int(self.settings["max_steps"])
        outcome = Outcome.FINISHED if done else Outcome.STEP_LIMIT
        return replace(truth_of(self.case).trajectory, steps=steps, wall_s=0.01 * steps, outcome=outcome)


@pytest.mark.parametrize(("longest", "rungs"), [(0.01, 1), (0.06, 2), (1.0, 6)])
def test_a_ladder_ends_before_the_rung_that_takes_too_long(
    longest: float, rungs: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    slow = FakeEngine()
    monkeypatch.setattr(
        slow, "prepare", lambda case, profile, **s: SlowRun(case, profile, {"dt": 1e-3, "max_steps": 10**6} | s),
        raising=False,
    )  # fmt: skip
    real = engines.load
    monkeypatch.setattr(engines, "load", lambda name: slow if name == "fake" else real(name))
    case = cases.load("bouncing_ball", "linear", t_end=1.0)
    climbed = Ladder(case, Pick(engine="fake", profile="second"), Effort(longest=longest))
    found = []
    for _, setting, run in climbed:
        motion = run.run()
        climbed.climbed(motion.wall_s, motion.steps)
        found.append((setting, int(run.settings["max_steps"])))
    assert len(found) == rungs
    assert all(bound <= 2.0 * longest / 0.01 * 1.001 or bound <= 2**i for i, (_, bound) in enumerate(found[1:], 1))


def test_a_ladder_ends_where_the_engine_admits_no_finer_setting() -> None:
    pytest.importorskip("exudyn")
    case = cases.load("bouncing_ball", "linear", t_end=0.1)
    settings = [setting for _, setting, _ in Ladder(case, Pick(engine="exudyn", profile="matched"), Effort())]
    assert settings[-1] == 1e-12


def test_what_was_ended_or_skipped_is_not_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    """And what cannot run the case does not keep the others from it."""
    case, asked = cases.load("bouncing_ball", "linear"), list[str]()

    def climbed(case: cases.Case, pick: Pick, *_: object) -> list[str]:
        asked.append(pick.engine)
        if pick.engine == "unable":
            raise cases.CaseUnsupported("It cannot.")
        return [pick.engine]

    lost = f"{case.label}: ended:"
    monkeypatch.setattr(measure.watch, "lost", lambda label: "It was ended." if label.startswith(lost) else "")
    monkeypatch.setattr(measure, "_climbed", climbed)
    monkeypatch.setattr(measure, "of_case", lambda pick, case: pick)
    named = ("one", "ended", "unable", "skipped", "two")
    picks = [Pick(engine=name, profile="p", skipped="It is not there." * (name == "skipped")) for name in named]
    assert list(measure._rungs(measure.Truths(case), picks, Effort(), lambda _: None, 1.0)) == ["one", "two"]
    assert asked == ["one", "unable", "two"]


def test_no_line_leads_to_a_rung_that_failed(rows: pd.DataFrame) -> None:
    """It is a cross at the edge, without a label; thirteen engines look different."""
    many = [rows.assign(engine=f"engine{k}") for k in range(4)]
    drawn = work_precision(pd.concat([rows, *many], ignore_index=True))["data"]
    lines = [line for line in drawn if "lines" in line["mode"]]
    crosses = [line for line in drawn if line["marker"]["symbol"] == "x"]
    assert len(lines) + len(crosses) == len(drawn)
    assert all("lines" not in line["mode"] and "text" not in line for line in crosses)
    assert len({(line["line"]["color"], line["line"]["dash"]) for line in lines}) == len(lines) >= 10
    shown = [line["name"] for line in drawn if line.get("showlegend", True)]
    assert sorted(shown) == sorted({line["name"] for line in drawn}), "each engine is once in the legend"
    for line in crosses:
        edge = set(numbers(line["x"]))
        assert len(edge) == 1
        assert edge.pop() > rows["error"][np.isfinite(rows["error"])].max()


def test_where_nothing_can_touch_no_touch_is_missed() -> None:
    """A bilateral row has no touches to count; every engine of that case once reached no error."""
    case = cases.load("bouncing_ball", "bilateral", t_end=0.2)
    run = engines.load("reference").prepare(case, "compiled", rtol=1e-8, samples=np.linspace(0.0, 0.2, 50)).run()
    assert errors(truth_of(case), run, case)["error"] < 1e-5


def test_one_run_has_no_spread() -> None:
    case = cases.load("bouncing_ball", "linear", t_end=0.1)
    rows = bench(case, [Pick(engine="reference", profile="compiled")], Effort(repeats=1, every=4))
    assert set(rows["repeats"]) == {1}
    assert rows["iqr_ms"].isna().all()


def test_an_engine_s_own_loop_is_drawn_below_its_run() -> None:
    ladder = table(("reference", 1e-6, 1e-6, 1.0), ("mujoco", 1e-3, 1e-2, 40.0), ("mujoco", 5e-4, 5e-3, 80.0))
    rows = ladder.assign(
        iqr_ms=0.0, native_ms=np.where(ladder["engine"] == "mujoco", 0.1 * ladder["median_ms"], np.nan)
    )
    drawn = {line["name"]: line for line in work_precision(rows)["data"]}
    assert list(numbers(drawn["mujoco:matched, its own loop"]["y"])) == [4.0, 8.0]
    assert list(numbers(drawn["mujoco:matched"]["y"])) == [40.0, 80.0]
    assert "reference:compiled, its own loop" not in drawn
    assert len(work_precision(rows.assign(native_ms=np.nan))["data"]) == 2
