"""The first run, with nothing compiled: whatever becomes of the process beside it changes nothing but the time."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from crossbody.reference.ahead import processors
from crossbody.reference.code_store import CODE

COMMAND = [str(Path(sys.executable).parent / "crossbody"), "run", "bouncing_ball:listing", "-e", "reference:compiled"]
PATIENCE = 300.0  # for what a loaded machine takes, s
pytestmark = [
    pytest.mark.slow, pytest.mark.timeout(1200),
    pytest.mark.skipif(not hasattr(os, "sched_setaffinity") or processors() < 2, reason="needs two processors"),
]  # fmt: skip


def begun(folder: Path, **how: object) -> subprocess.Popen[bytes]:
    """A run with an empty cache, as a shell starts it: in a group of its own."""
    return subprocess.Popen(
        [*COMMAND, "-q", "--out", str(folder / "out")], env={**os.environ, "CROSSBODY_CACHE": str(folder / "cache")},
        start_new_session=True, **how,
    )  # type: ignore[call-overload, no-any-return]  # fmt: skip


def beside(session: int) -> list[int]:
    """The processes of a session that compile beside another."""
    found = []
    for process in (path for path in Path("/proc").iterdir() if path.name.isdigit()):
        try:
            of_session = int((process / "stat").read_text().rpartition(")")[2].split()[3]) == session
            if of_session and b"compile_beside" in (process / "cmdline").read_bytes():
                found.append(int(process.name))
        except (OSError, ValueError, IndexError):
            continue
    return found


def awaited(what: Callable[[], object], seconds: float = PATIENCE) -> bool:
    """Whether something comes true in time."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if what():
            return True
        time.sleep(0.02)
    return False


def results(folder: Path) -> dict[str, bytes]:
    """What a run says of its numbers, which tells nothing of its time."""
    return {name: (folder / "out" / name).read_bytes() for name in ("verdicts.csv", "audit.csv")}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, float]:
    """The folder of a run whose other process is left alone, and the time that it took, s."""
    folder, began = tmp_path_factory.mktemp("whole"), time.monotonic()
    run = begun(folder)
    assert awaited(lambda: beside(run.pid))
    assert run.wait(PATIENCE) == 0
    assert beside(run.pid) == []
    return folder, time.monotonic() - began


def test_one_processor_begins_no_other_process_and_finds_the_same(whole: tuple[Path, float], tmp_path: Path) -> None:
    one = {min(os.sched_getaffinity(0))}
    run = begun(tmp_path, preexec_fn=lambda: os.sched_setaffinity(0, one))
    seen = list[int]()
    assert awaited(lambda: seen.extend(beside(run.pid)) or run.poll() is not None)
    assert (run.returncode, seen) == (0, [])
    assert results(tmp_path) == results(whole[0])


@pytest.mark.parametrize("seed", range(3))
def test_a_process_that_is_killed_costs_time_alone(whole: tuple[Path, float], seed: int, tmp_path: Path) -> None:
    run = begun(tmp_path)
    assert awaited(lambda: beside(run.pid))
    time.sleep(random.Random(seed).uniform(0.0, 0.7) * whole[1])
    for process in beside(run.pid):
        os.kill(process, signal.SIGKILL)
    assert run.wait(PATIENCE) == 0
    assert results(tmp_path) == results(whole[0])
    again = begun(tmp_path)
    assert awaited(lambda: again.poll() is not None)
    assert (again.returncode, results(tmp_path)) == (0, results(whole[0]))
    compiled = {path.suffix for path in (tmp_path / "cache" / "compiled").iterdir() if path.suffix != ".part"}
    assert compiled == {CODE}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_a_run_that_is_ended_leaves_no_process(number: int, tmp_path: Path) -> None:
    run = begun(tmp_path, stderr=subprocess.DEVNULL)
    assert awaited(lambda: beside(run.pid))
    os.kill(run.pid, number)
    assert run.wait(PATIENCE) != 0
    assert awaited(lambda: beside(run.pid) == [], 10.0)
