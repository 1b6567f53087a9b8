"""A study that is killed at any system call leaves the old one or the new one, whole, and all that is the user's."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from itertools import pairwise
from pathlib import Path

import pytest
from places import helped
from studies import FILES, MINE, STUDIES, content, expected, fresh, put
from swap_kills import everywhere

from crossbody.cases import OutputError
from crossbody.reports.runs import manifest
from crossbody.reports.runs.output import MARKER, check, folder, gather, recover


def copied(made: Callable[[Path], Path], root: Path) -> Callable[[Path], Path]:
    """Copies of one folder, which take less time than making it again."""
    one = made(root / "one")
    return lambda place: Path(shutil.copytree(one, place))


def in_a_new_process(law: Callable[[Path, int], None], root: Path, stride: int) -> None:
    """Hold a law where nothing but this file was loaded: children of a process with threads may hang."""
    code = f"import test_output_kills as t; from pathlib import Path; t.{law.__name__}(Path({str(root)!r}), {stride})"
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=Path(__file__).parent,
        env=helped(),
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("stride", [29, pytest.param(1, marks=pytest.mark.slow)])
def test_a_kill_at_any_call_loses_nothing(tmp_path: Path, stride: int) -> None:
    in_a_new_process(law_of_the_swap, tmp_path, stride)


@pytest.mark.parametrize("stride", [17, pytest.param(1, marks=pytest.mark.slow)])
def test_a_kill_during_recovery_loses_nothing(tmp_path: Path, stride: int) -> None:
    in_a_new_process(law_of_recovery, tmp_path, stride)


def law_of_the_swap(tmp_path: Path, stride: int) -> None:
    kills, ends = 0, set()
    for place in everywhere(copied(fresh, tmp_path), lambda at: put(at, "new"), tmp_path, stride):
        kills += 1
        found = content(place)
        assert found.items() >= (MINE | {"bode.json": "beside"}).items()
        recover(place)
        found = content(place)
        assert found in (expected("old"), expected("new")), kills
        ends.add(found["verdicts.json"])
        assert sorted(p.name for p in place.iterdir() if p.name.startswith(".")) == [MARKER]
        put(place, "new")
        assert content(place) == expected("new")
        shutil.rmtree(place)
    assert ends == set(STUDIES)
    assert kills > 200 / stride


def law_of_recovery(tmp_path: Path, stride: int) -> None:
    """The study was whole: wherever putting it in its place is killed, the next who looks finishes it."""

    def unfinished(place: Path) -> Path:
        fresh(place)
        with folder(place, "run") as made:
            for name in FILES["new"]:
                (made / name).parent.mkdir(exist_ok=True)
                (made / name).write_text("new")
            (made / ".plan.json").write_text(PLAN)
            shutil.copytree(made, place / ".crossbody-ready.run.x")
            raise StopIteration

    def half(place: Path) -> Path:
        with pytest.raises(StopIteration):
            unfinished(place)
        return place

    PLAN = json.dumps({"study": "run", "files": sorted(FILES["new"]), "adds": False})
    kills = 0
    for place in everywhere(copied(half, tmp_path), recover, tmp_path, stride):
        kills += 1
        recover(place)
        assert content(place) == expected("new")
    assert kills > 80 / stride


@pytest.mark.parametrize("stride", [37, pytest.param(1, marks=pytest.mark.slow)])
def test_a_kill_while_a_study_comes_beside_others_loses_nothing(tmp_path: Path, stride: int) -> None:
    in_a_new_process(law_of_other_swaps, tmp_path, stride)


def add(place: Path) -> None:
    """Add to a study, as a sweep does."""
    with folder(place, "run", adds=True) as made:
        (made / "b.json").write_text("new")


def beside(place: Path) -> None:
    """Write a study beside others, whose tables its pages show."""
    with folder(place, "bode") as made:
        (made / "bode.json").write_text("new")
        gather(made)
        (made / "index.html").write_text((made / "a.json").read_text())


def in_the_way(place: Path) -> None:
    """Find a file of the user's where one of the study should go."""
    with suppress(OutputError):
        put(place, "new")


def with_a_file_in_the_way(place: Path) -> Path:
    (fresh(place) / "b.json").write_text("by hand")
    return place


def law_of_other_swaps(tmp_path: Path, stride: int) -> None:
    """Whatever is written where, a kill leaves what was or what was to be; the same command then comes to its end."""
    old = expected("old")
    kept = {f"run-1/{name}": "new" for name in FILES["new"]}
    laws: dict[str, tuple[Callable[[Path], Path], Callable[[Path], None], dict[str, str], dict[str, str]]] = {
        "first": (lambda place: place, lambda place: put(place, "new"), {}, dict.fromkeys(FILES["new"], "new")),
        "adds": (fresh, add, old, old | {"b.json": "new"}),
        "beside": (fresh, beside, old, old | {"bode.json": "new"}),
        "exists; move it": (with_a_file_in_the_way, in_the_way, old | {"b.json": "by hand"}, old | kept),
    }
    for name, (made, work, before, after) in laws.items():
        (tmp_path / name).mkdir()
        start = made if name == "first" else copied(made, tmp_path / name)
        ends = [before, before | after]
        for place in everywhere(start, work, tmp_path / name, stride):
            recover(place)
            assert content(place) in ends, name
            if name != "exists; move it":
                work(place)
                assert content(place) == ends[1], name
        assert len(list((tmp_path / name).iterdir())) > 80 / stride


TRACED = """
import os, sys
from pathlib import Path
import test_output_kills as t
from swap_kills import reaches_the_system
place = t.fresh(Path(sys.argv[1]))
sys.setprofile(lambda _, event, called: event == "c_call" and reaches_the_system(called) and os.getpgid(0))
t.put(place, "new")
sys.setprofile(None)
"""
CHANGES = "rename,renameat,renameat2,unlink,unlinkat,mkdir,mkdirat,rmdir,link,linkat,write,chmod,fchmod,getpgid"


@pytest.mark.skipif(shutil.which("strace") is None, reason="needs strace")
def test_every_change_on_disk_has_a_kill_of_its_own_before_it(tmp_path: Path) -> None:
    command = ["strace", "-f", "-z", "-e", f"trace={CHANGES}", "-o", str(tmp_path / "calls")]
    command += [sys.executable, "-c", TRACED, str(tmp_path / "out")]
    done = subprocess.run(command, cwd=Path(__file__).parent, env=helped(), capture_output=True, text=True, check=False)
    if done.returncode and "ptrace" in done.stderr.lower():
        pytest.skip("strace may not look at a process here")
    assert done.returncode == 0, done.stderr
    calls = [line.split("(")[0].split()[-1] for line in (tmp_path / "calls").read_text().splitlines() if "(" in line]
    swap = calls[calls.index("getpgid") :]
    assert swap.count("rename") + swap.count("renameat") >= 2 + len(FILES["new"])
    assert not [one for one, next_ in pairwise(swap) if "getpgid" not in (one, next_)]


def test_what_a_killed_command_left_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    put(tmp_path / "out", "old")
    (tmp_path / "out" / ".crossbody-new.run.x").mkdir()
    check(tmp_path / "out", "run")
    assert "incomplete tables of an interrupted command have been removed" in capsys.readouterr().err
    assert content(tmp_path / "out") == dict.fromkeys(FILES["old"], "old")


def test_studies_live_side_by_side(tmp_path: Path) -> None:
    put(tmp_path / "out", "old")
    with folder(tmp_path / "out", "bode") as made:
        for name in ("verdicts.json", "bode.json"):
            (made / name).write_text("bode")
    assert content(tmp_path / "out") == dict.fromkeys(FILES["old"], "old") | {"bode.json": "bode"}
    put(tmp_path / "out", "new")
    assert content(tmp_path / "out") == dict.fromkeys(FILES["new"], "new") | {"bode.json": "bode"}


def test_verdicts_of_another_command_are_not_replaced(tmp_path: Path) -> None:
    put(tmp_path / "out", "old")
    with pytest.raises(OutputError, match=r"holds the verdicts of `crossbody run`.*--out"):
        check(tmp_path / "out", "replay")
    check(tmp_path / "out", "run")


def test_a_file_of_the_users_is_not_written_over(tmp_path: Path) -> None:
    put(tmp_path / "out", "old")
    (tmp_path / "out" / "b.json").write_text("by hand")
    with pytest.raises(OutputError, match="not written by crossbody; the results are in"):
        put(tmp_path / "out", "new")
    left = content(tmp_path / "out")
    assert left["b.json"] == "by hand"
    assert left["a.json"] == "old"
    assert left["run-1/b.json"] == "new"  # what was computed is not lost either


def test_the_folder_of_an_earlier_version_is_taken_over(tmp_path: Path) -> None:
    out = tmp_path / "out"
    (out / "traces").mkdir(parents=True)
    (out / MARKER).write_text("Written by crossbody; it may be replaced by the next run.\n")
    for name in ("verdicts.json", "verdicts.csv", "verdicts.parquet", "traces/0007.parquet"):
        (out / name).write_text("old")
    (out / "index.html").write_text('<!doctype html><meta name="generator" content="crossbody">')
    for name in ("mine.html", "data.csv"):
        (out / name).write_text("mine")
    put(out, "new")
    assert content(out) == dict.fromkeys(FILES["new"], "new") | {"mine.html": "mine", "data.csv": "mine"}


@pytest.mark.parametrize(
    "name", ["../notes.md", "/etc/passwd", "a/b/c", ".ssh", "traces/../x", "", 7, None, ["x"], "a\nb"]
)
def test_a_manifest_cannot_name_what_is_not_in_its_folder(tmp_path: Path, name: object) -> None:
    put(tmp_path / "out", "old")
    (tmp_path / "out" / MARKER).write_text(json.dumps({"studies": {"run": [name]}}))
    with pytest.raises(OutputError, match=r"manifest|no file of this folder"):
        manifest.read(tmp_path / "out")


@pytest.mark.parametrize("digest", [None, "", "0" * 32])
def test_a_stranger_cannot_make_my_files_those_of_crossbody(tmp_path: Path, digest: str | None) -> None:
    """A manifest listed files that were not there yet; the user made them, and the next study removed them."""
    out, mine = (
        tmp_path / "out",
        ["notes.md", "thesis.csv", "thesis.json", "thesis.parquet", "thesis.html", "sub/x.txt"],
    )
    put(out, "old")
    told = json.loads((out / MARKER).read_text())
    names = {**told["studies"]["run"], **dict.fromkeys(mine, digest)}
    told["studies"]["run"] = names if digest is not None else list(names)
    (out / MARKER).write_text(json.dumps(told))
    (out / "sub").mkdir()
    for name in mine:
        (out / name).write_text("mine")
    put(out, "new")
    assert {name: (out / name).read_text() for name in mine} == dict.fromkeys(mine, "mine")


def test_no_link_in_a_folder_is_followed_on_writing(tmp_path: Path) -> None:
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "0000.parquet").write_text("precious")
    (outside / "verdicts.json").write_text("precious")
    out = tmp_path / "out"
    put(out, "old")
    shutil.rmtree(out / "traces")
    (out / "traces").symlink_to(outside)
    (out / "verdicts.json").unlink()
    (out / "verdicts.json").symlink_to(outside / "verdicts.json")
    with pytest.raises(OutputError, match="follows no link"):
        put(out, "new")
    assert {path.read_text() for path in outside.iterdir()} == {"precious"}
