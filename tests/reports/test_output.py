"""The output folder is whole or not there, and never somebody else's; motions come back as they were."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from crossbody.cases import Outcome, OutputError, Trajectory, load
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.runs import store
from crossbody.reports.runs.output import MARKER, check, folder, replace_text
from crossbody.reports.runs.store import Trace, save
from crossbody.reports.runs.store import load as load_trace


def names(path: Path) -> list[str]:
    return sorted(p.name for p in path.iterdir())


def test_a_folder_appears_whole(tmp_path: Path) -> None:
    out = tmp_path / "deep" / "out"
    with folder(out) as made:
        (made / "a.txt").write_text("a")
        assert not (out / "a.txt").exists()
    assert names(out) == [MARKER, "a.txt"]
    assert names(out.parent) == ["out"]


def test_a_failed_run_leaves_nothing_and_keeps_the_old(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with folder(out) as made:
        (made / "old.txt").write_text("old")

    def half_way() -> None:
        with folder(out) as made:
            (made / "new.txt").write_text("new")
            raise RuntimeError("half way")

    with pytest.raises(RuntimeError, match="half"):
        half_way()
    assert names(out) == [MARKER, "old.txt"]
    assert names(tmp_path) == ["out"]


def test_our_own_folder_is_replaced(tmp_path: Path) -> None:
    out = tmp_path / "out"
    for text in ("one", "two"):
        with folder(out) as made:
            (made / text).write_text(text)
    assert names(out) == [MARKER, "two"]
    assert names(tmp_path) == ["out"]


def test_an_empty_folder_may_be_used(tmp_path: Path) -> None:
    with folder(tmp_path / "out") as made:
        (made / "a").write_text("a")
    (tmp_path / "empty").mkdir()
    check(tmp_path / "empty")


def test_somebody_elses_files_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("mine")
    with pytest.raises(OutputError, match="crossbody did not write"), folder(tmp_path):
        pytest.fail("must not start")
    assert names(tmp_path) == ["thesis.tex"]


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "file", tmp_path / "file" / "out"):
        with pytest.raises(OutputError):
            check(path)


def test_a_link_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    with pytest.raises(OutputError):
        check(tmp_path / "link")


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="needs a file system that refuses even root")
def test_a_place_that_cannot_be_written_is_said_before_anything_runs() -> None:
    with pytest.raises(OutputError, match="cannot be written"):
        check(Path("/proc/out"))


def test_a_file_is_replaced_whole(tmp_path: Path) -> None:
    path = tmp_path / "index.html"
    for text in ("one", "two"):
        replace_text(path, text)
    assert path.read_text() == "two"
    assert names(tmp_path) == ["index.html"]


def test_a_motion_comes_back_bit_for_bit(tmp_path: Path) -> None:
    case = load("bouncing_ball", "linear")
    run = truth_of(case).trajectory
    about = {"case": case.name, "engine": "fake", "number": 1.5}
    save(tmp_path / "a.parquet", Trace(about=about, run=run, truth=run))
    back = load_trace(tmp_path / "a.parquet")
    assert back.about == about
    assert back.run.events == run.events
    assert (back.run.outcome, back.run.steps) == (run.outcome, run.steps)
    for name in ("t", "q", "v", "gap", "lam", "energy", "mode"):
        np.testing.assert_array_equal(getattr(back.run, name), getattr(run, name))
    assert back.run.ledger is not None
    assert run.ledger is not None
    np.testing.assert_array_equal(back.run.ledger.contact, run.ledger.contact)
    assert back.truth is not None
    np.testing.assert_array_equal(back.truth.q, run.q)


def test_a_motion_is_read_back_within_the_memory_that_its_numbers_allow(tmp_path: Path) -> None:
    """A robot on hundreds of rows, long columns of zeros in a small file: what Arrow has at once is in the bound."""
    n, rows = 20_000, 100
    zeros = np.zeros((n, rows))
    run = Trajectory(
        t=np.linspace(0.0, 1.0, n), q=zeros[:, :1], v=zeros[:, :1], gap=zeros, lam=zeros, energy=zeros[:, :2],
        mode=zeros.astype(np.int8), outcome=Outcome.FINISHED,
    )  # fmt: skip
    about = {"case": "a", "variant": "b", "engine": "c", "profile": "d", "coordinates": ["q"],
             "contacts": [str(i) for i in range(rows)]}  # fmt: skip
    path = tmp_path / "long.parquet"
    save(path, Trace(about=about, run=run, truth=run))
    code = (
        "import sys; from pathlib import Path; from crossbody.reports.runs import store; "
        f"store.MOTION = {store.PEAK} * 8 * {n} * ({2 * (3 * rows + 4) + 1}); "
        "print(store.load(Path(sys.argv[1])).run.lam.shape)"
    )
    done = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == f"({n}, {rows})"
