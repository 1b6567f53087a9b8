"""The command as a user meets it: exit codes, one-sentence errors, the folder it leaves."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from crossbody import cases, engines
from crossbody.cases import Case, CaseUnsupported, EngineUnavailable, Trajectory, UnknownName
from crossbody.reports.bench import measure
from crossbody.reports.bench.ladder import Effort
from crossbody.reports.cli import main
from crossbody.reports.judging import known
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.runs import jobs, watch


@dataclass
class FakeRun(engines.Run):
    case: Case
    profile: str
    engine: str = "fake"
    settings: Mapping[str, Any] = field(default_factory=lambda: {"dt": 1e-3})

    def run(self) -> Trajectory:
        run = truth_of(self.case).trajectory
        wrong = {"exact": run.q, "off": 1.01 * run.q, "nan": np.full_like(run.q, np.nan)}
        return replace(run, q=wrong[self.profile], steps=0)  # it tells no steps of its own

    def audit(self) -> Mapping[str, Any]:
        return {}


class FakeEngine(engines.Engine):
    """The closed form under three names: as it is, one per cent off, and not a number."""

    name = "fake"
    profiles: Mapping[str, str] = {"exact": "as it is", "off": "1 % off", "nan": "not a number"}
    versions: Mapping[str, str] = {}

    def prepare(self, case: Case, profile: str = "exact", **settings: Any) -> FakeRun:
        if case.closed_form is None:
            raise CaseUnsupported("The fake engine knows closed forms only.")
        return FakeRun(case, profile, settings={"dt": 1e-3} | settings)


@pytest.fixture(autouse=True)
def _fake(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def load(name: str) -> Any:
        if name == "fake":
            return FakeEngine()
        if name == "absent":
            raise EngineUnavailable("Engine 'absent' needs the package 'absent', which is not installed.")
        raise UnknownName("engine", name, ("fake", "absent"))

    list(known.wrong())  # asked of the engines as they are, once in a process
    monkeypatch.setattr(engines, "names", lambda: ("absent", "fake"))
    monkeypatch.setattr(engines, "load", load)
    monkeypatch.chdir(tmp_path)


def call(*arguments: str) -> int:
    with pytest.raises(SystemExit) as end:
        main(list(arguments))
    return int(end.value.code or 0)


LINEAR = ("run", "bouncing_ball", "--variant", "linear")


def test_all_within_is_zero(capsys: pytest.CaptureFixture[str]) -> None:
    assert call(*LINEAR, "-e", "fake:exact") == 0
    said = capsys.readouterr().out
    assert f"Report: {Path('out/index.html').absolute()}" in said


def test_a_case_is_taken_with_its_variant() -> None:
    assert call("run", "bouncing_ball:linear", "-e", "fake:exact") == 0
    rows = pd.read_parquet("out/verdicts.parquet")
    assert set(rows["variant"]) == {"linear"}
    assert rows["command"][0].startswith("crossbody run bouncing_ball --variant linear")


def test_outside_is_one() -> None:
    assert call(*LINEAR, "-e", "fake:nan") == 1


def test_an_engine_without_its_package_is_skipped_with_its_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    assert call(*LINEAR, "-e", "fake:exact", "-e", "absent") == 0
    assert "not installed" in capsys.readouterr().out
    rows = pd.read_parquet("out/verdicts.parquet")
    assert rows.loc[rows["engine"] == "absent", "verdict"].tolist() == ["skipped"]


def test_a_case_that_an_engine_cannot_do_is_skipped(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("crossbody.reports.runs.jobs.truth_of", lambda case: truth_of(replace(case, closed_form=LAW)))
    assert call("run", "--variant", "listing", "-e", "fake:exact", "-e", "fake:nan") == 2
    assert capsys.readouterr().err.count("The fake engine knows closed forms only.") == 1


def test_where_no_engine_has_run_nothing_is_within_and_an_earlier_report_stays(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert call(*LINEAR, "-e", "fake:exact") == 0
    before = {path: path.read_bytes() for path in Path("out").rglob("*") if path.is_file()}
    capsys.readouterr()
    assert call(*LINEAR, "-e", "absent") == 2
    said = capsys.readouterr()
    assert {path: path.read_bytes() for path in Path("out").rglob("*") if path.is_file()} == before
    assert not said.out
    assert "None of the selected engines can run any of the selected cases. " in said.err
    assert "not installed" in said.err


def LAW(times: Any) -> Trajectory:
    from crossbody.cases import load

    motion = load("bouncing_ball", "linear").closed_form
    assert motion is not None
    return motion(times)


def test_json_is_one_list_and_nothing_else(capsys: pytest.CaptureFixture[str]) -> None:
    call(*LINEAR, "-e", "fake:exact", "--json")
    rows = json.loads(capsys.readouterr().out)
    wanted = {"case", "variant", "engine", "profile", "metric", "value", "unit", "limit", "tier", "verdict", "why"}
    assert rows
    assert all(wanted | {"command"} <= set(row) for row in rows)


def test_the_folder_holds_the_same_rows_three_times_with_provenance() -> None:
    call(*LINEAR, "-e", "fake:exact", "--set", "a0=2e4")
    parquet, csv = pd.read_parquet("out/verdicts.parquet"), pd.read_csv("out/verdicts.csv")
    told = json.loads(Path("out/verdicts.json").read_text())
    assert len(parquet) == len(csv) == len(told["rows"]) > 10
    np.testing.assert_allclose(csv["value"], parquet["value"], rtol=1e-14)
    stored = json.loads(pq.read_schema("out/verdicts.parquet").metadata[b"provenance"])
    assert stored == told["provenance"]
    assert {"command", "git", "versions", "cpu", "python", "threads", "seed", "rtol"} <= set(stored)
    assert parquet["command"][0] == "crossbody run bouncing_ball --variant linear --set a0=2e4 --engine fake:exact"


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("run", "bouncing_bal"), "Did you mean 'bouncing_ball'"),
        (("run", "--variant", "nope"), "listing"),
        (("run", "bouncing_ball:nope"), "listing"),
        (("run", "bouncing_ball:linear", "--variant", "listing"), "give one of them"),
        (("run", "-e", "nope"), "fake"),
        (("run", "-e", "fake:nope"), "exact"),
        (("run", "--set", "stiffness=1"), "a0"),
        (("run", "--set", "a0"), "name=value"),
        (("run", "--set", "mass=-1"), "mass is -1"),
        (("run", "--set", "a0=nan"), "a0 is nan"),
        (("run", "--set", "t_end=-1"), "t_end is -1"),
        (("run", "--rtol", "1"), "[1e-14, 0.1]"),
        (("run", "--rtol", "small"), "small"),
        (("run", "--nonsense"), "--nonsense"),
        (("run", "--jobs", "x"), "'x' is not a whole number in the range 0<=x<=1024"),
        (("run", "--jobs", "5000"), "5000 is not in the range 0<=x<=1024"),
        (("run", "--time-limit", "x"), "'x' is not a number in the range x>0"),
        (("run", "--time-limit", "nan"), "'nan' is not a number in the range x>0"),
        (("bench", "--minutes", ""), "'' is not a number in the range x>=0.1"),
        (("nonsense",), "nonsense"),
        (("report", "nowhere"), "nowhere"),
    ],
)
def test_wrong_use_is_one_sentence_and_leaves_nothing(
    arguments: tuple[str, ...], says: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert call(*arguments) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert says in told.err
    assert told.err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_somebody_elses_folder_is_refused_before_anything_runs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.tex").write_text("mine")
    assert call(*LINEAR, "-e", "fake:exact") == 2
    assert "crossbody did not write" in capsys.readouterr().err
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["thesis.tex"]


def test_report_makes_the_same_page_again() -> None:
    call(*LINEAR, "-e", "fake:exact")
    page = Path("out/index.html")
    text = page.read_text()
    page.unlink()
    assert call("report", "out") == 0
    assert page.read_text() == text


def test_bench_times_every_rung(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("bench", "--variant", "linear", "-e", "fake:exact", "-e", "fake:off", "--repeats", "2") == 0
    rows = pd.read_parquet("out/bench.parquet")
    assert set(rows["profile"]) == {"exact", "off"}
    assert (rows["repeats"] == 2).all()
    assert (rows["median_ms"] > 0).all()
    orders = pd.read_parquet("out/orders.parquet").set_index("profile")["says"]
    assert orders["exact"] == "exact at every setting"
    assert orders["off"].startswith("does not converge to the truth of the case")
    assert "work-precision" in Path("out/index.html").read_text()


@pytest.mark.parametrize(
    ("text", "line", "what"),
    [
        ("x = 1\ny = (\n", 2, "SyntaxError"),
        ("x = 1\n\nx / 0\n", 3, "ZeroDivisionError"),
        ("import sys\nsys.exit(7)\n", 2, "SystemExit"),
        ("\nimport no_such_package\n", 2, "ModuleNotFoundError"),
    ],
)
@pytest.mark.parametrize("relative", [False, True])
def test_a_case_file_that_cannot_be_imported_is_wrong_use(text, line, what, relative, tmp_path, monkeypatch, capsys):
    file = tmp_path / "broken_case.py"
    file.write_text(text)
    monkeypatch.chdir(tmp_path)
    assert call("run", file.name if relative else str(file)) == 2
    said = capsys.readouterr().err
    assert what in said
    assert f"broken_case.py, line {line}." in said
    assert said.count("\n") == 1
    assert "fault of crossbody" not in said


LIMITED = ("bouncing_ball", "--variant", "linear", "-e", "fake:exact", "--time-limit", "70")


def test_a_run_may_take_the_seconds_that_are_asked_for_and_a_truth_three_times_those(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    given: dict[str, float] = {}
    monkeypatch.setattr(watch, "limited", lambda label, seconds=None: given.update({label: seconds}))
    assert call("run", *LIMITED) == 0
    timed = {label: seconds for label, seconds in given.items() if seconds is not None}
    runs = {"bouncing_ball:linear: truth": 210.0, "bouncing_ball:linear: fake:exact": 70.0}
    assert timed == runs | {"bouncing_ball (build)": 70.0}
    assert {label.split(" of ")[1] for label in given.keys() - timed} == {"fake:exact"}  # metrics: as their run


def test_a_benchmark_may_take_the_seconds_and_minutes_that_are_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """Half of its share of the minutes an engine has to climb its ladder, and for its largest rung a quarter."""
    given: list[tuple[float, Effort]] = []

    def bench(case: Case, picks: Any, effort: Effort, tell: Any, limit: float) -> pd.DataFrame:
        given.append((limit, effort))
        return pd.DataFrame()

    monkeypatch.setattr(measure, "bench", bench)
    asked = ("bench", *LIMITED, "--full", "--minutes", "0.1")
    assert call(*asked) == call(*asked, "-e", "fake:off") == 2  # nothing was measured
    assert [limit for limit, _ in given] == [70.0, 70.0]
    assert [(e.climb, e.longest) for _, e in given] == [pytest.approx((3.0, 1.5)), pytest.approx((1.5, 0.75))]


@pytest.mark.parametrize(
    ("given", "steps"),
    [
        (("dt=4e-3",), {"exact": 4e-3, "off": 4e-3}),
        (("fake.dt=4e-3", "dt=1"), {"exact": 4e-3, "off": 4e-3}),
        (("fake:off.dt=4e-3", "fake.dt=2e-3"), {"exact": 2e-3, "off": 4e-3}),
    ],
)
def test_a_setting_is_given_to_whom_it_names(given: tuple[str, ...], steps: Mapping[str, float]) -> None:
    words = [word for setting in given for word in ("--set-engine", setting)]
    call(*LINEAR, "-e", "fake:exact", "-e", "fake:off", *words)
    rows = pd.read_parquet("out/verdicts.parquet")
    told = {profile: mine["settings"].iloc[0] for profile, mine in rows[rows["engine"] == "fake"].groupby("profile")}
    assert told == {profile: f"dt={dt:g}" for profile, dt in steps.items()}


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("fack.dt=1", "Did you mean 'fake'"), ("fake:exakt.dt=1", "Did you mean 'exact'"),
        ("fake.dd=1", "no setting 'dd' of fake"),
    ],
)  # fmt: skip
def test_a_setting_of_nobody_is_a_sentence(setting: str, words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(*LINEAR, "-e", "fake:exact", "--set-engine", setting) == 2
    assert words in capsys.readouterr().err
    assert not Path("out").exists()


def test_a_setting_that_an_engine_refuses_is_told_before_any_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jobs, "run_case", lambda *_, **__: pytest.fail("a case was run"))
    assert call(*LINEAR, "-e", "fake:exact", "--set-engine", "fake.dd=1") == 2


def test_a_folder_of_others_is_refused_before_a_case_is_built(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Who compiles first waits for that sentence."""
    Path("mine").mkdir()
    Path("mine/notes.txt").write_text("mine")
    monkeypatch.setattr(cases, "load", lambda *_, **__: pytest.fail("a case was built"))
    assert call(*LINEAR, "--out", "mine") == 2
    assert "holds files that crossbody did not write" in capsys.readouterr().err


def test_a_dry_run_tells_what_would_be_run_and_writes_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    words = ("-e", "fake", "-e", "absent", "--set", "t_end=2", "--set-engine", "fake:off.dt=4e-3", "--dry-run")
    assert call(*LINEAR, *words) == 0
    said = capsys.readouterr().out
    assert "bouncing_ball:linear: 1 velocity, 1 row, 2 s" in said
    assert "fake:exact  dt=0.001" in said
    assert "fake:off  dt=0.004" in said
    assert "absent:*  skipped: Engine 'absent' needs" in said
    assert list(Path.cwd().iterdir()) == []


def test_a_dry_run_says_once_what_variants_share(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(FakeEngine, "planned", lambda *_, **settings: {"dt": 1e-3} | settings)
    assert call("run", "bouncing_ball", "-e", "fake:exact", "-e", "fake:off", "--dry-run") == 0
    said = capsys.readouterr().out
    assert said.count("mass 1") == said.count("fake:exact  dt=0.001") == said.count("fake:off  ") == 1
    assert "  parameters: a0 10000, a2 0; all others as for bouncing_ball:listing\n" in said
    assert said.count("  all engines as for bouncing_ball:listing\n") == len(cases.variants("bouncing_ball")) - 1


def test_a_plan_as_json_says_what_the_plan_says(capsys: pytest.CaptureFixture[str]) -> None:
    words = (
        "-e",
        "fake",
        "-e",
        "absent",
        "--set",
        "t_end=2",
        "--set-engine",
        "fake:off.dt=4e-3",
        "--dry-run",
        "--json",
    )
    assert call(*LINEAR, *words) == 0
    (told,) = json.loads(capsys.readouterr().out)
    case = cases.load("bouncing_ball", "linear", t_end=2.0)
    assert (told["case"], told["variant"]) == ("bouncing_ball", "linear")
    assert (told["velocities"], told["rows"], told["t_end"]) == (1, 1, 2.0)
    assert told["parameters"] == dict(case.parameters)
    known = {f"{one['engine']}:{one['profile']}": one.get("settings", one.get("skipped")) for one in told["engines"]}
    assert (known["fake:exact"]["dt"], known["fake:off"]["dt"]) == (1e-3, 4e-3)
    assert "needs" in known["absent:*"]
    assert list(Path.cwd().iterdir()) == []


def test_a_plan_counts_velocities_where_a_quaternion_has_more_positions(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("run", "rolling_sphere", "--dry-run") == 0
    case = cases.load("rolling_sphere")
    assert len(case.q0) != len(case.v0)
    assert f" {len(case.v0)} velocities, {len(case.contacts)} rows, {case.t_end:g} s" in capsys.readouterr().out


@pytest.mark.parametrize("dry", [(), ("--dry-run",)])
@pytest.mark.parametrize("setting", [".dt=3", "fake.=3", "fake.nonsense=1", "nonsense=1"])
def test_a_setting_that_nobody_has_is_wrong_in_a_plan_too(
    setting: str, dry: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(*LINEAR, "-e", "fake:exact", "--set-engine", setting, *dry) == 2
    assert not Path("out").exists()
    assert capsys.readouterr().out == ""


WRONG = {
    "no tolerance": ("--rtol", "0"), "none either": ("--rtol", "nan"), "no folder": ("--out", "/proc/x"),
    "a file": ("--out", "mine"), "another's": ("--out", "."), "nothing to compare with": ("--against", "nowhere"),
    "no study": ("--with", "nowhere"), "no parameter": ("--set", "t_end=-1"), "no number": ("--set-engine", "fake.dt"),
    "no engine": ("-e", "none"), "no variant": ("--variant", "none"), "no time": ("--time-limit", "0"),
    "no setting": ("--set-engine", "fake.nonsense=1"),
}  # fmt: skip


@pytest.mark.parametrize("words", WRONG.values(), ids=WRONG)
def test_what_a_run_refuses_before_it_begins_a_plan_refuses_with_the_same_words(
    words: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    Path("mine").touch()
    said = []
    for dry in ((), ("--dry-run",)):
        assert call(*LINEAR, "-e", "fake:exact", *words, *dry) == 2
        told = capsys.readouterr()
        assert told.out == ""
        said.append(told.err)
    assert said[0] == said[1]
    assert [path.name for path in Path.cwd().iterdir()] == ["mine"]


def test_a_plan_shows_the_tolerance_that_is_asked_for(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def planned(_: object, case: Case, profile: str, **asked: Any) -> Mapping[str, Any]:
        return {"rtol": 1e-9} | asked

    monkeypatch.setattr(FakeEngine, "planned", planned)
    for words in (("--rtol", "1e-5"), ("--set-engine", "rtol=1e-5")):
        assert call(*LINEAR, "-e", "fake:exact", *words, "--dry-run") == 0
        assert "fake:exact  rtol=1e-05" in capsys.readouterr().out
