"""Sweeps: the same table whatever the workers, the interruptions and the cluster; wrong folders are told at once."""

from __future__ import annotations

import json
import os
import random
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from crossbody.cases import OutputError, SchedulerUnavailable
from crossbody.reports.cli import main
from crossbody.reports.commands.stress import Ask, Pool, plan, sweep
from crossbody.reports.runs.output import folder
from crossbody.reports.suites.axis import Log
from crossbody.reports.suites.contract import Family, Suite
from crossbody.reports.sweep import draw, pools
from crossbody.reports.sweep.spec import Spec
from crossbody.reports.sweep.store import Store, identity

TABLES = ("stress", "reproducers", "stress_map")
WORDS = ("stress", "damping", "--runs", "60")
"""Balls of which only the end is asked for: no engine is needed, and a run takes microseconds."""


def call(*arguments: str) -> int:
    with pytest.raises(SystemExit) as end:
        main(list(arguments))
    return int(end.value.code or 0)


def tables(out: Path) -> dict[str, pd.DataFrame]:
    return {name: pd.read_parquet(out / f"{name}.parquet") for name in TABLES}


def same(a: Path, b: Path) -> None:
    for name, table in tables(a).items():
        pd.testing.assert_frame_equal(table, tables(b)[name], check_exact=True)


@pytest.fixture(scope="session")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sweep that nothing disturbed."""
    out = tmp_path_factory.mktemp("sweep") / "whole"
    assert call(*WORDS, "--jobs", "1", "--out", str(out), "-e", "reference:compiled") == 0
    return out


def test_the_folder_holds_every_row_its_page_and_its_provenance(whole: Path) -> None:
    rows = pd.read_parquet(whole / "stress.parquet")
    assert len(rows) == 60
    assert rows["index"].tolist() == list(range(60))
    assert set(rows["verdict"]) == {"within"}
    assert rows["error"].max() < 1e-9
    assert json.loads((whole / "provenance.json").read_text())["seed"] == 0
    assert (whole / "index.html").is_file()
    assert not list((whole / "parts").glob(".*"))


def test_json_is_one_list_of_reproducers(capsys: pytest.CaptureFixture[str], whole: Path) -> None:
    assert call(*WORDS, "--jobs", "1", "--out", str(whole), "-e", "reference:compiled", "--json") == 0
    assert json.loads(capsys.readouterr().out) == []


@pytest.mark.parametrize("lost", [{0}, {3, 7}, set(range(15))], ids=str)
def test_lost_parts_are_made_again_and_nothing_else(whole: Path, tmp_path: Path, lost: set[int]) -> None:
    import shutil

    out = tmp_path / "again"
    shutil.copytree(whole, out)
    for number in lost:
        (out / "parts" / f"{number:06d}.parquet").unlink()
    kept = {path.name: path.stat().st_mtime_ns for path in (out / "parts").iterdir()}
    assert call(*WORDS, "--jobs", "1", "--resume", "--out", str(out), "-e", "reference:compiled") == 0
    same(whole, out)
    for name, stamp in kept.items():
        assert (out / "parts" / name).stat().st_mtime_ns == stamp


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ((*WORDS, "--seed", "1"), "of other parameters"),
        (("stress", "damping", "--runs", "61"), "of other parameters"),
        ((*WORDS, "-e", "reference:cvode"), "of other parameters"),
        (("stress", "dampin"), "Did you mean 'damping'"),
        (("stress", "damping", "--runs", "0"), "at least 1"),
        (("stress", "damping", "--runs", "-3"), "at least 1"),
        (("stress", "damping", "-e", "nobody"), "nobody"),
        (("stress", "damping", "-e", "reference:nope"), "nope"),
        (("stress", "damping", "--seed", "-1"), "-1"),
    ],
)
def test_wrong_use_is_one_sentence_and_changes_nothing(
    whole: Path, arguments: tuple[str, ...], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    before = {path: path.stat().st_mtime_ns for path in whole.rglob("*")}
    assert call(*arguments, "--out", str(whole)) == 2
    told = capsys.readouterr()
    assert says in told.err
    assert told.err.count("\n") == 1
    assert {path: path.stat().st_mtime_ns for path in whole.rglob("*")} == before


@pytest.mark.parametrize(
    ("axes", "says"),
    [
        ("axes={'a0': Log(1.0, 2.0)}, grid={'a0': Levels((1.0,))}", "a0 is given twice"),
        ("axes={'a0': Log(2.0, 1.0)}", "its low end must be finite and below its high end"),
        ("grid={'a0': Levels(())}", "at least one value"),
        ("", "needs an axis, a grid or a ladder"),
    ],
)
def test_a_contradictory_grid_is_one_sentence(
    tmp_path: Path, axes: str, says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "mine.py"
    path.write_text(
        "from crossbody.reports.suites.axis import Levels, Log\n"
        "from crossbody.reports.suites.contract import Family, Suite\n"
        f"SUITE = Suite(families=(Family(case='bouncing_ball', variant='linear', {axes}),))\n"
    )
    assert call("stress", str(path), "--out", str(tmp_path / "out")) == 2
    told = capsys.readouterr().err
    assert says in told
    assert told.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_another_version_and_foreign_folders_are_not_touched(whole: Path, tmp_path: Path) -> None:
    specs = plan(Ask(names=("damping",), runs=5, wanted=("reference:compiled",)))
    about = identity(specs, 4, {"seed": 0})
    store = Store(tmp_path / "new", about)
    assert store.missing(2) == [0, 1]
    with pytest.raises(OutputError, match=r'version "[0-9.]+" there, "next" now'):
        Store(tmp_path / "new", about | {"version": "next"})
    with pytest.raises(OutputError, match="code"):
        Store(tmp_path / "new", about | {"code": "other"})
    (tmp_path / "foreign").mkdir()
    (tmp_path / "foreign" / "thesis.tex").write_text("mine")
    with pytest.raises(OutputError, match="did not write"):
        Store(tmp_path / "foreign", about)
    report = tmp_path / "report"
    report.mkdir()
    (report / ".crossbody").write_text("")
    (report / "verdicts.json").write_text("{}")
    with pytest.raises(OutputError, match="exists and was not written by crossbody"):
        Store(report, about)
    (report / "verdicts.json").unlink()
    with folder(report, "run") as made:
        (made / "verdicts.json").write_text("theirs")
    Store(report, about)  # a sweep stands beside the studies of other commands
    assert (report / "verdicts.json").read_text() == "theirs"
    assert call("stress", "damping", "--resume", "--out", str(tmp_path / "none")) == 2
    assert not (tmp_path / "none").exists()


def test_a_folder_without_a_sweep_has_none_to_continue(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "own").write_text("mine")
    for out in (tmp_path, tmp_path / "none"):
        assert call("stress", "damping", "--resume", "--out", str(out)) == 2
        assert f"{out} contains no sweep to continue" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["own"]


def balls(runs: int, **changed: Any) -> list[Spec]:
    family = Family(case="bouncing_ball", variant="linear", axes={"a0": Log(1e2, 1e6)}, fixed={"t_end": 0.5})
    picks = plan_picks()
    specs = draw.specs([("one", Suite(families=(family,)))], {"one": picks}, runs, 0, share=False)
    return [replace(spec, **changed) for spec in specs]


def plan_picks() -> Any:
    from crossbody.reports.runs.choice import picks

    return picks(["reference:compiled"])


def timeless(rows: list[dict[str, Any]]) -> pd.DataFrame:
    return pd.DataFrame(rows).drop(columns="wall_ms")


def test_processes_give_the_rows_of_one_process() -> None:
    specs = balls(12)
    chunks = [(i, specs[4 * i : 4 * i + 4]) for i in range(3)]
    here = dict(pools.surviving(pools.work, chunks, 1))
    beside = dict(pools.processes(chunks, 2))
    assert here.keys() == beside.keys()
    for number, rows in here.items():
        pd.testing.assert_frame_equal(timeless(rows), timeless(beside[number]), check_exact=True)


def dying(index: int) -> Any:
    """Work of a process that is gone when it meets a run; a closure, because processes do not know this file."""

    def work(chunk: Any, alone: bool = False) -> Any:
        import os
        import signal

        from crossbody.reports.sweep.execute import execute

        rows = []
        for spec in chunk[1]:
            if spec.index == index:
                os.kill(os.getpid(), signal.SIGKILL)
            rows.append(execute(spec))
        return chunk[0], rows

    return work


def test_a_run_that_takes_its_process_with_it_is_a_row(monkeypatch: pytest.MonkeyPatch) -> None:
    specs = balls(8)
    monkeypatch.setattr(pools, "work", dying(5))
    rows = [row for _, part in pools.processes([(0, specs[:4]), (1, specs[4:])], 2) for row in part]
    assert sorted(row["index"] for row in rows) == list(range(8))
    ended = {row["index"]: row["outcome"] for row in rows}
    assert ended.pop(5) == "crashed"
    assert set(ended.values()) == {"finished"}


def test_a_scheduler_that_does_not_answer_is_told_within_its_time(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        silent.listen()
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        began = time.monotonic()
        with pytest.raises(SchedulerUnavailable, match="No dask scheduler answers"):
            pools.connect(address)
        assert time.monotonic() - began < 10.0
    with socket.create_server(("127.0.0.1", 0)) as stranger:
        threading.Thread(target=_refuse_in_http, args=(stranger,), daemon=True).start()
        with pytest.raises(SchedulerUnavailable, match="No dask scheduler answers"):
            pools.connect(f"tcp://127.0.0.1:{stranger.getsockname()[1]}")
    with pytest.raises(SchedulerUnavailable):
        pools.connect("nonsense://")
    assert call(*WORDS, "--scheduler", "tcp://127.0.0.1:1", "--out", str(tmp_path / "out")) == 2
    assert not (tmp_path / "out").exists()


def _refuse_in_http(server: socket.socket) -> None:
    connection, _ = server.accept()
    with connection:
        connection.sendall(b"HTTP/1.1 400 Bad Request\r\nContent-Length: 0\r\nConnection: close\r\n\r\n" + bytes(64))
        connection.recv(4096)


def begun(out: Path, suite: str, runs: int, jobs: int) -> subprocess.Popen[bytes]:
    words = ["stress", suite, "--runs", str(runs), "--jobs", str(jobs), "--out", str(out), "-e", "reference:compiled"]
    code = "from crossbody.reports.cli import main; import sys; main(sys.argv[1:])"
    return subprocess.Popen([sys.executable, "-c", code, *words], stdout=subprocess.DEVNULL, start_new_session=True)


def ended(out: Path, suite: str, runs: int, jobs: int = 1) -> None:
    """Let it come to its end, whatever it finds."""
    assert begun(out, suite, runs, jobs).wait() in (0, 1)


def strike(out: Path, suite: str, runs: int, jobs: int, rng: random.Random) -> bool:
    """Kill a sweep and all its processes, at any moment of its start or behind a part; whether it still ran."""
    parts = out / "parts"
    had = len(list(parts.glob("*.parquet")))
    process = begun(out, suite, runs, jobs)
    late = time.monotonic() + rng.random() * 3.0
    came = rng.random() < 0.7
    while process.poll() is None:
        if (len(list(parts.glob("*.parquet"))) > had) if came else time.monotonic() > late:
            break
        time.sleep(0.002)
    time.sleep(rng.random() * 0.2)
    running = process.poll() is None
    if running:
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    return running


def test_a_sweep_that_is_killed_goes_on_to_the_same_table(tmp_path: Path) -> None:
    ended(tmp_path / "whole", "damping", 40)
    rng = random.Random(3)
    hits = sum(strike(tmp_path / "killed", "damping", 40, 1, rng) for _ in range(2))
    assert hits
    ended(tmp_path / "killed", "damping", 40)
    same(tmp_path / "whole", tmp_path / "killed")


@pytest.mark.slow
def test_twenty_kills_change_nothing(tmp_path: Path) -> None:
    ended(tmp_path / "whole", "speed", 1500, 2)
    rng, hits, place = random.Random(5), 0, 0
    while hits < 20:
        out = tmp_path / f"killed{place}"
        hits += strike(out, "speed", 1500, 2, rng)
        if (out / "stress.parquet").is_file():
            same(tmp_path / "whole", out)
            place += 1
    ended(out, "speed", 1500, 2)
    same(tmp_path / "whole", out)


@pytest.fixture
def cluster() -> Iterator[Any]:
    """Two workers on loopback, each a process."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address=None
    ) as made:
        yield made


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_worker_killed_in_a_cluster_loses_no_result(cluster: Any, tmp_path: Path) -> None:
    specs = plan(Ask(names=("speed",), runs=800, wanted=("reference:compiled",)))
    stores = {name: Store(tmp_path / name, identity(specs, 20, {"seed": 0})) for name in ("here", "there")}
    sweep(stores["here"], specs, 20, Pool(count=1))
    client = pools.connect(cluster.scheduler_address)
    pids = list(client.run(os.getpid).values())
    struck = False
    try:
        parts = [(i, specs[20 * i : 20 * i + 20]) for i in range(-(-len(specs) // 20))]
        for done, (number, rows) in enumerate(pools.cluster(parts, client)):
            stores["there"].put(number, rows)
            if done == 3:
                os.kill(pids[0], signal.SIGKILL)
                struck = True
    finally:
        client.close()
    assert struck
    here, there = (stores[name].table()[0] for name in ("here", "there"))
    assert len(there) == len(specs)
    pd.testing.assert_frame_equal(here, there, check_exact=True)


def test_the_time_of_a_run_is_the_suites_own_or_what_is_asked_for() -> None:
    ask = Ask(names=("damping",), runs=3, wanted=("reference:compiled",))
    assert {spec.time_limit for spec in plan(replace(ask, limit=7.5))} == {7.5}
    assert 7.5 not in {spec.time_limit for spec in plan(ask)}
