"""Ctrl-C stops a command within a second, keeps what is complete and says how to go on; what hangs is ended."""

from __future__ import annotations

import ctypes
import json
import os
import random
import re
import signal
import subprocess
import sys
import time
import weakref
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import study_pages
from joblib.externals.loky import get_reusable_executor
from places import STUCK
from rig_data import run_as_log

from crossbody import cases, hw
from crossbody.cases import InvalidValue, Outcome, OutputError
from crossbody.hw.replaying.comparison import Prediction
from crossbody.reports import cli
from crossbody.reports.replay.kept import keeper
from crossbody.reports.runs import watch
from crossbody.reports.runs.parts import Parts

ARM = """<mujoco><worldbody><body name="arm"><joint name="shoulder" axis="0 1 0"/>
<inertial pos="0 0 .5" mass="1" diaginertia=".1 .1 .01"/></body></worldbody></mujoco>
"""


@pytest.fixture(autouse=True, scope="module")
def alone() -> None:
    """End the workers that tests before have left: what is forked here would take them for its own and wait."""
    get_reusable_executor(max_workers=1).shutdown(wait=True, kill_workers=True)


SECOND = 1.0
"""Within this a command has stopped, s; start-up of the interpreter is no part of it."""


BALLS = """from crossbody.cases.library.bouncing_ball import PARAMETERS, build

VARIANTS = {"linear": {"a0": 1e4, "a1": 20.0, "a2": 0.0}, "resting": {"a2": 0.0}}
"""


def begun(*words: str, cwd: Path) -> subprocess.Popen[str]:
    (cwd / "balls.py").write_text(BALLS)
    command = [sys.executable, str(STUCK), *words]
    return subprocess.Popen(command, cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def finished(process: subprocess.Popen[str]) -> tuple[int, str]:
    """Exit code and what was said on stderr, of a command that comes to its end."""
    _, said = process.communicate(timeout=180)
    return process.returncode, said


def interrupted(process: subprocess.Popen[str]) -> tuple[int, str]:
    """Exit code and what was said on stderr."""
    process.send_signal(signal.SIGINT)
    began = time.monotonic()
    _, said = process.communicate(timeout=20)
    assert time.monotonic() - began < SECOND + 0.5 * load()
    return process.returncode, said


def load() -> float:
    """Of a machine that is shared, processes a processor."""
    return max(0.0, float(Path("/proc/loadavg").read_text().split()[0]) / 2.0 - 1.0)


def wait_for(path: Path, pattern: str, process: subprocess.Popen[str], count: int = 1) -> None:
    while len(list(path.glob(pattern))) < count:
        assert process.poll() is None, process.communicate()
        time.sleep(0.01)


def content(out: Path) -> dict[str, bytes]:
    return {str(p.relative_to(out)): p.read_bytes() for p in out.rglob("*") if p.is_file() and p.name[0] != "."}


PARTS = ".crossbody-parts.*/" + 16 * "[0-9a-f]"


def test_what_is_complete_is_kept_and_the_same_command_goes_on(tmp_path: Path) -> None:
    out = tmp_path / "out"
    code, said = finished(begun("run", "balls.py", "--variant", "linear", "-e", "fake:exact", cwd=tmp_path))
    assert code == 0, said
    (out / "notes.md").write_text("mine")
    before = {name: text for name, text in content(out).items()}
    words = ("run", "balls.py", "-e", "fake:slow")
    process = begun(*words, cwd=tmp_path)
    wait_for(out, PARTS, process)
    code, said = interrupted(process)
    assert code == 130
    assert "what is complete is kept in" in said
    assert "the same command continues" in said
    assert content(out).items() >= before.items()
    kept = len(list(out.glob(PARTS)))
    code, said = finished(begun(*words, cwd=tmp_path))
    assert code in (0, 1)
    assert f"{kept} parts of an interrupted run" in said
    assert set(pd.read_parquet(out / "verdicts.parquet")["variant"]) > {"linear"}
    assert (out / "notes.md").read_text() == "mine"
    assert not list(out.glob(".crossbody-*"))


BENCH = ("bench", "balls.py", "-e", "fake:slow", "--repeats", "1")


@pytest.mark.slow
def test_a_benchmark_goes_on_where_it_was_interrupted(tmp_path: Path) -> None:
    out = tmp_path / "out"
    process = begun(*BENCH, cwd=tmp_path)
    wait_for(out, PARTS, process)
    code, said = interrupted(process)
    assert code == 130
    assert "what is complete is kept in" in said
    assert "the same command continues" in said
    (part,) = out.glob(PARTS)
    kept = pd.read_parquet(part / "bench.parquet")
    code, said = finished(begun(*BENCH, cwd=tmp_path))
    assert code == 0, said
    assert "1 parts of an interrupted run" in said
    rows = pd.read_parquet(out / "bench.parquet")
    assert rows["case"].nunique() == 2
    pd.testing.assert_frame_equal(rows[rows["case"].isin(kept["case"])], kept)  # times too: it was not run again
    assert not list(out.glob(".crossbody-*"))


@pytest.mark.slow
def test_a_replay_goes_on_with_the_engines_that_were_complete(tmp_path: Path) -> None:
    out, given = tmp_path / "deep" / "out", {"a0": 1e4, "a1": 20.0, "a2": 0.0}
    case = cases.load("bouncing_ball", "linear", t_end=0.5, **given)
    hw.store(run_as_log(case, {"height": 0}, 1e-4), tmp_path / "log.parquet")
    pairs = [word for name, value in given.items() for word in ("--set", f"{name}={value}")]
    words = ("replay", "log.parquet", "-m", "ball", "-e", "reference", "-e", "fake:slow", *pairs, "--out", str(out))
    process = begun(*words, cwd=tmp_path)
    wait_for(out, PARTS, process)
    code, said = interrupted(process)
    assert code == 130
    assert "the same command continues" in said
    (part,) = out.glob(PARTS)
    kept = part.stat().st_ino
    process = begun(*words, cwd=tmp_path)
    wait_for(out, PARTS, process, 2)
    assert part.stat().st_ino == kept
    code, said = finished(process)
    assert code == 0, said
    assert "1 parts of an interrupted run" in said
    rows = pd.read_parquet(out / "replay.parquet")
    errors = rows[rows["metric"] == "rmse"].set_index("who")["value"]
    assert errors["reference:compiled"] == pytest.approx(errors["fake:slow"], rel=1e-6)
    assert not list(out.glob(".crossbody-*"))


def test_a_prediction_comes_back_as_it_was(tmp_path: Path) -> None:
    case = cases.load("bouncing_ball", "linear", t_end=0.5)
    log = run_as_log(case, {"height": 0}, 1e-4)
    made: list[Prediction] = []

    def never() -> Prediction:
        raise AssertionError("it is there already")

    def put(words: str, predict: Callable[[], Prediction]) -> Prediction:
        with suppress(KeyboardInterrupt), Parts(tmp_path, "replay", {}) as parts:
            made.append(keeper(parts)(words, predict))
            made.append(keeper(parts)(words, never))
            raise KeyboardInterrupt
        return made[1]

    hw.replay(log, "ball", restart=0.1, keep=put)
    one, other = made
    assert len(one.y) == len(other.y) == 4
    for name in ("y", "yd"):
        for mine, theirs in zip(getattr(one, name), getattr(other, name), strict=True):
            assert mine.tobytes() == theirs.tobytes()
    for name in ("engine", "profile", "settings", "outcomes", "messages", "wall_s", "steps"):
        assert getattr(one, name) == getattr(other, name)


def test_a_part_that_somebody_made_is_read_or_refused_in_a_sentence(tmp_path: Path) -> None:
    """A folder of results may come from anybody, and with it the parts of a replay."""
    rows = (np.ones((3, 2)), np.zeros((4, 2)))
    outcomes = (Outcome.FINISHED, Outcome.FINISHED)
    made = Prediction(engine="a", profile="b", settings={"dt": 0.1}, y=rows, yd=rows, outcomes=outcomes)
    rng, told = random.Random(1), json.dumps({"rows": [10**12], "width": 10**9}).encode()
    with Parts(tmp_path, "replay", {}) as parts:
        keep = keeper(parts)
        keep("whole", lambda: made)
        files = {path.name: path.read_bytes() for path in parts.part("whole").iterdir()}
        for i in range(200):
            for name, whole in files.items():
                raw = bytearray(rng.choice((whole, whole[: rng.randrange(len(whole))], b"3", b"[]", b"", told)))
                for _ in range(rng.randrange(3) if raw else 0):
                    raw[rng.randrange(len(raw))] = rng.randrange(256)
                (parts.part("whole") / name).write_bytes(raw if i % 2 or name.endswith("json") else whole)
            with suppress(OutputError):
                found = keep("whole", lambda: made)
                assert [len(y) for y in found.y] == [len(y) for y in found.yd]


@pytest.mark.parametrize("error", [ImportError, InvalidValue, None])
def test_an_interrupt_that_a_library_takes_for_its_own_fault_is_one(
    error: type[Exception] | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """And what was done meanwhile is not kept."""

    def command(**_: object) -> int:
        with Parts(tmp_path, "replay", {}) as parts, parts.put("half"):
            with suppress(watch.Stopped):
                os.kill(os.getpid(), signal.SIGINT)
                time.sleep(1.0)
            if error:
                raise error("initialization failed")
        return 0

    monkeypatch.setattr(cli.cli, "main", command)
    assert watch.watched(lambda: cli._obey([])) == 130
    assert capfd.readouterr().err == ""
    assert not list(tmp_path.glob("*/[0-9a-f]*"))


class Callbacks:
    """Where Python can raise nothing: it prints what arrives there, and goes on."""

    @staticmethod
    def weakref(call: Callable[[], None]) -> None:
        thing = Callbacks()
        kept = weakref.ref(thing, lambda _: call())
        del thing, kept

    @staticmethod
    def finaliser(call: Callable[[], None]) -> None:
        type("Thing", (), {"__del__": lambda _: call()})()

    @staticmethod
    def ctypes(call: Callable[[], None]) -> None:
        ctypes.CFUNCTYPE(None)(call)()


@pytest.mark.parametrize("place", ["weakref", "finaliser", "ctypes"])
def test_an_interrupt_that_is_swallowed_stops_all_the_same(place: str, capfd: pytest.CaptureFixture[str]) -> None:
    def command() -> int:
        getattr(Callbacks, place)(lambda: os.kill(os.getpid(), signal.SIGINT))
        time.sleep(5.0)
        return 0

    assert watch.watched(command) == 130
    assert capfd.readouterr().err == ""


def test_compiled_code_that_never_comes_back_is_stopped(tmp_path: Path) -> None:
    """And nothing is said to be kept, nor left, where nothing was complete."""
    process = begun("run", "balls.py", "--variant", "linear", "-e", "fake:stuck", cwd=tmp_path)
    wait_for(tmp_path, "stuck", process)
    code, said = interrupted(process)
    assert code == 130
    assert said.splitlines()[-1] == "crossbody: interrupted. Nothing was replaced."
    assert not (tmp_path / "out").exists()


def test_what_is_killed_before_anything_is_complete_leaves_nothing(tmp_path: Path) -> None:
    process = begun("run", "balls.py", "--variant", "linear", "-e", "fake:stuck", "--out", "a/b", cwd=tmp_path)
    wait_for(tmp_path, "stuck", process)
    process.kill()
    process.communicate(timeout=20)
    assert {path.name for path in tmp_path.iterdir()} <= {"balls.py", "stuck", "__pycache__"}


HANGS = """import ctypes
from dataclasses import replace

from crossbody import cases
from crossbody.cases.case import CaseMetric

PARAMETERS = {}
VARIANTS = {"one": {}, "two": {}}


def sleep(*_):
    ctypes.PyDLL(None).sleep(1000)


def build(variant, p):
    if WHERE == "build" and variant == "two":
        sleep()
    never = {"never": CaseMetric(doc="", unit="m", number=sleep, always=True)}
    metrics = never if WHERE == "metric" and variant == "two" else {}
    return replace(cases.load("bouncing_ball", "linear"), name="hangs", variant=variant, metrics=metrics)
"""


def test_a_metric_that_never_comes_back_is_a_row_that_crashed(tmp_path: Path) -> None:
    (tmp_path / "hangs.py").write_text(f"WHERE = 'metric'\n{HANGS}")
    limit = str(4 + round(4 * load()))
    code, said = finished(begun("run", "hangs.py", "-e", "fake:exact", "--time-limit", limit, cwd=tmp_path))
    assert code == 1, said
    assert f"hangs:two: never of fake:exact: It did not return within {limit} s" in said
    rows = pd.read_parquet(tmp_path / "out" / "verdicts.parquet")
    crashed = rows[rows["verdict"] == "crashed"]
    assert set(crashed["metric"]) == {"never"}
    assert crashed["why"].str.contains("did not return").all()
    assert {"position", "velocity"} <= set(rows.loc[rows["variant"] == "two", "metric"])


@pytest.mark.parametrize("dry", [pytest.param((), marks=pytest.mark.slow), ("--dry-run",)])
def test_a_case_that_is_never_built_is_told_in_a_sentence(dry: tuple[str, ...], tmp_path: Path) -> None:
    (tmp_path / "hangs.py").write_text(f"WHERE = 'build'\n{HANGS}")
    code, said = finished(begun("run", "hangs.py", "-e", "fake:exact", "--time-limit", "1", *dry, cwd=tmp_path))
    assert code == 2, said
    assert "hangs.py cannot be built. It did not return within 1 s and was terminated" in said
    assert not (tmp_path / "out").exists()


def test_compiled_code_that_never_comes_back_is_ended_and_the_rest_goes_on(tmp_path: Path) -> None:
    limit = str(4 + round(4 * load()))  # what is not stuck needs more of it on a busy machine
    words = ("-e", "fake:stuck", "-e", "fake:exact", "-e", "fake:crash", "--time-limit", limit)
    code, said = finished(begun("run", "balls.py", "--variant", "linear", *words, cwd=tmp_path))
    assert code == 1, said
    assert f"fake:stuck: It did not return within {limit} s and was terminated" in said
    assert "fake:crash: Its process was ended by SIGSEGV" in said
    assert "CROSSBODY_DEBUG=1" in said
    rows = pd.read_parquet(tmp_path / "out" / "verdicts.parquet").set_index("profile")
    for profile, why in (("stuck", "did not return"), ("crash", "SIGSEGV")):
        mine = rows.loc[[profile]]
        assert (mine["verdict"] == "outside").any()
        assert mine["why"].str.contains(why).any()
    assert not (rows.loc[["exact"], "verdict"] == "outside").any()


@pytest.mark.slow
def test_an_identification_that_never_comes_back_is_ended(tmp_path: Path) -> None:
    log = run_as_log(cases.load("bouncing_ball", "linear", t_end=0.5), {"height": 0}, 1e-4)
    hw.store(log, tmp_path / "log.parquet")
    words = ("identify", "log.parquet", "-m", "ball", "-f", "a1", "--set", "a1=20", "--time-limit", "0.25")
    code, said = finished(begun(*words, cwd=tmp_path))  # waits less than an hour, which is what it may take unasked
    assert (code, said.count("\n")) == (2, 2)
    assert "ball identified from log.parquet: It did not return within 2.5 s and was terminated" in said
    said = said.splitlines()[1]
    assert said.startswith("crossbody: ball identified from log.parquet: It did not return")
    assert not (tmp_path / "out").exists()


def test_a_fault_of_ours_has_a_code_and_a_file_of_its_own(tmp_path: Path) -> None:
    code, said = finished(begun("run", "balls.py", "--variant", "linear", "-e", "broken", cwd=tmp_path))
    assert code == 3
    found = re.fullmatch(
        r"crossbody: This is a fault of crossbody \(LookupError: .*\)\. Please report it with (.*)\.\n", said
    )
    assert found, said
    told = Path(found[1])
    assert "Traceback" in told.read_text()
    told.unlink()
    assert not (tmp_path / "out").exists()


def test_a_fault_in_an_engine_is_a_row_that_crashed(tmp_path: Path) -> None:
    code, _ = finished(begun("run", "balls.py", "--variant", "linear", "-e", "fake:fault", cwd=tmp_path))
    assert code == 1
    rows = pd.read_parquet(tmp_path / "out" / "verdicts.parquet")
    assert (rows.loc[rows["profile"] == "fault", "verdict"] == "crashed").all()


@pytest.mark.parametrize("count", [1, pytest.param(20, marks=pytest.mark.slow)])
def test_an_interrupt_at_any_instant_stops_and_loses_nothing(tmp_path: Path, count: int) -> None:
    rng, out = random.Random(11), tmp_path / "out"
    (tmp_path / "keep").mkdir()
    codes = []
    for i in range(count):
        process = begun("run", "balls.py", "-e", "fake:exact", "--quiet", cwd=tmp_path)
        time.sleep(0.2 + rng.random() * 6.0)
        code, said = interrupted(process) if process.poll() is None else finished(process)
        codes.append(code)
        assert code in (0, 1, 130, -signal.SIGINT), (i, said)  # the last: before the interpreter had begun
        assert "Traceback" not in said or code == -signal.SIGINT, said
        if out.is_dir():
            (out / "notes.md").touch() if (out / ".crossbody").exists() else None
    code, said = finished(begun("run", "balls.py", "-e", "fake:exact", "--quiet", cwd=tmp_path))
    assert code in (0, 1), said
    assert len(pd.read_parquet(out / "verdicts.parquet"))
    assert not list(out.glob(".crossbody-*"))


ENTRY = (
    "import sys; sys.argv[0] = 'crossbody'; from crossbody.reports.entry import main; print('.', flush=True); main()"
)


@pytest.mark.parametrize("after", [0.02, 0.1, 0.3])
def test_an_interrupt_while_the_command_is_imported_is_one_sentence(after: float, tmp_path: Path) -> None:
    command = [sys.executable, "-c", ENTRY, "analyse", "bouncing_ball"]
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    process.stdout.readline()
    time.sleep(after)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=20)
    assert process.returncode == 130
    assert re.fullmatch(r"crossbody: interrupted\..*\n", said)


def test_a_child_that_has_ended_already_is_not_told_to(monkeypatch: pytest.MonkeyPatch) -> None:
    def gone(*_: int) -> None:
        raise ProcessLookupError

    monkeypatch.setattr(watch.os, "kill", gone)
    one = watch._Watch(lambda: 0, watch._Diary())
    one.child = 2**22 + 1
    one._stop(signal.SIGINT, None)
    assert one.signalled == signal.SIGINT


@pytest.mark.slow
def test_a_reader_that_has_enough_is_no_fault_and_the_work_is_done(tmp_path: Path) -> None:
    """Of every command: nobody reads a word of it, and it ends as it would, with all that it has to write."""
    (tmp_path / "arm.xml").write_text(ARM)
    one = ("bouncing_ball", "--variant", "linear", "-e", "reference:compiled")
    asked = {name: (*words, "--out", name) for name, words in study_pages.commands(tmp_path).items()}
    asked |= {
        "run": (*one, "--out", "run"), "bench": (*one, "--repeats", "1", "--minutes", "0.1", "--out", "bench"),
        "report": ("run",), "picture": ("run", "ball.svg"), "list": (), "cache": (),
        "audit": ("arm.xml", "-e", "mujoco", "--markdown", "told.md"), "log": ("info", "rig.csv"),
    }  # fmt: skip
    assert set(asked) == set(cli.cli.commands) - {"stability", "warm"}  # which take minutes
    for name, words in asked.items():
        here, there = os.pipe()
        os.close(here)
        command = [sys.executable, "-c", ENTRY.replace("print('.', flush=True); ", ""), name, *words]
        process = subprocess.run(command, cwd=tmp_path, stdout=there, stderr=subprocess.PIPE, text=True, timeout=300)
        os.close(there)
        assert (process.returncode, process.stderr) == (0, ""), name
        assert "--out" not in words or (tmp_path / name / "index.html").is_file(), name
    assert (tmp_path / "ball.svg").is_file()
    assert (tmp_path / "told.md").is_file()


LATE = """
class Late:
    def __del__(self, end=__import__("os").kill, own=__import__("os").getpid(), number=2):
        end(own, number)

late = Late()
"""


def test_an_interrupt_while_the_interpreter_ends_does_not_end_it_by_a_signal(tmp_path: Path) -> None:
    command = [sys.executable, "-c", LATE + ENTRY, "list"]
    assert subprocess.run(command, cwd=tmp_path, capture_output=True, timeout=60).returncode == 0


@pytest.mark.parametrize(("ended", "wanted"), [(0, 0), (1, 1), (130, 130), (3, 130)])
def test_a_command_that_was_at_its_end_was_not_interrupted(
    ended: int, wanted: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What it wrote stands: to say that nothing was replaced would be wrong."""
    monkeypatch.setattr(watch._Watch, "wait", lambda _: (ended << 8, signal.SIGINT))
    assert watch.watched(lambda: 0) == wanted


@pytest.mark.slow
def test_a_report_is_interrupted_in_a_sentence_at_any_instant(tmp_path: Path) -> None:
    rng = random.Random(5)
    code, said = finished(begun("run", "balls.py", "-e", "fake:exact", "--quiet", cwd=tmp_path))
    assert code in (0, 1), said
    command = [sys.executable, "-c", ENTRY, "report", "out"]
    spent = time.monotonic()
    subprocess.run(command, cwd=tmp_path, capture_output=True, timeout=120)
    spent = time.monotonic() - spent
    before = content(tmp_path / "out")
    for _ in range(20):
        process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert process.stdout is not None
        process.stdout.readline()
        time.sleep(spent * rng.choice((rng.random(), rng.uniform(0.9, 1.0))))
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=20)
        assert process.returncode in (0, 130), said
        assert (process.returncode == 0) == ("interrupted" not in said), said
        assert content(tmp_path / "out").keys() == before.keys()
