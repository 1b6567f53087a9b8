"""The output folder is whole or not there, and never somebody else's; motions come back as they were."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from crossbody.cases import OutputError, load
from crossbody.reports.judging.truth import truth_of
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
