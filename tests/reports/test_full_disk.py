"""A disk that is full, or a file that may not grow: one sentence, and nothing that was whole is lost."""

from __future__ import annotations

import random
import resource
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from places import STUCK, helped
from rig_data import channels, log_of
from studies import MINE, content, expected, fresh, put
from swap_kills import refused_before

from crossbody import hw
from crossbody.cases import OutputError
from crossbody.reference import code_store
from crossbody.reference.code_store import CODE, Store
from crossbody.reports.runs.output import MARKER, folder, recover
from crossbody.reports.runs.parts import ABOUT, Parts


@contextmanager
def no_file_above(size: int) -> Iterator[None]:
    """Let no file of this process grow beyond a size, bytes; Python ignores the signal, and writing fails."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def names(path: Path) -> list[str]:
    return sorted(p.name for p in path.iterdir())


def noise(seed: int) -> hw.Log:
    values = np.random.default_rng(seed).standard_normal(5000)
    return log_of(1e-3 * np.arange(5000.0), channels("coordinates", "rad", {"a": values}))


def test_a_log_is_stored_whole_or_the_old_one_stays(tmp_path: Path) -> None:
    path, draw = tmp_path / "log.parquet", random.Random(1)
    old = hw.store(noise(0), path)
    before, size = path.read_bytes(), path.stat().st_size
    for limit in (0, 1, size - 1, *(draw.randrange(size) for _ in range(12))):
        with no_file_above(limit), pytest.raises(OutputError, match=r"log\.parquet cannot be written: .*too large"):
            hw.store(noise(1), path)
        assert path.read_bytes() == before
        assert names(tmp_path) == ["log.parquet"]
    assert hw.store(hw.read(path), path) == old


def test_compiled_code_that_finds_no_room_is_told_and_not_believed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tmp_path.chmod(0o700)
    store, draw = Store(tmp_path), random.Random(2)
    old, data = draw.randbytes(9000), draw.randbytes(9000)
    for kept in (None, old):
        if kept is not None:
            store.write("name", kept)
        for limit in (0, 1, 9000, *(draw.randrange(9000) for _ in range(12))):
            code_store._told.clear()
            with no_file_above(limit):
                store.write("name", data)
            assert "it is used only by this process" in capsys.readouterr().err
            assert store.read("name") == kept
            assert names(tmp_path) == ([] if kept is None else [f"name{CODE}"])
    code_store._told.clear()


KERNEL = """
import resource, sys
import numpy as np
from crossbody.reference import kernels

if len(sys.argv) > 1:
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, resource.RLIM_INFINITY))

@kernels.energy
def energy(q, v, p, e):
    e[0], e[1] = 3.0, 0.0

z, e = np.zeros(1), np.zeros(2)
energy(z, z, z, e)
print(e[0], sum(energy._cache_hits.values()))
"""


def test_a_kernel_runs_where_its_code_cannot_be_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CROSSBODY_CACHE", str(tmp_path / "cache"))
    (tmp_path / "kernel.py").write_text(KERNEL)
    for words, printed, told in ((["full"], "3.0 0", 1), ([], "3.0 0", 0), (["full"], "3.0 1", 0)):
        done = subprocess.run(
            [sys.executable, "kernel.py", *words], cwd=tmp_path, capture_output=True, text=True, check=True
        )
        assert done.stdout.strip() == printed
        assert done.stderr.count("cannot be kept in") == done.stderr.count("\n") == told, done.stderr
        assert all(name.endswith(CODE) for name in names(tmp_path / "cache" / "compiled"))


def test_results_that_find_no_room_leave_the_old_ones(tmp_path: Path) -> None:
    sizes = {"verdicts.json": 300, "traces/0000.parquet": 4000, "index.html": 2500}
    draw, whole = random.Random(3), 0
    for limit in (0, 100, 3999, *(draw.randrange(4500) for _ in range(12))):
        out = fresh(tmp_path / f"{limit}")
        try:
            with no_file_above(limit), folder(out, "run") as made:
                for name, size in sizes.items():
                    (made / name).parent.mkdir(exist_ok=True)
                    (made / name).write_text("x" * size)
        except OutputError:
            assert content(out) == expected("old")
        else:
            whole += 1
            assert content(out) == {name: "x" * size for name, size in sizes.items()} | MINE | {"bode.json": "beside"}
        assert [name for name in names(out) if name.startswith(".")] == [MARKER]
    assert 0 < whole < 8


def every_refusal(root: Path) -> None:
    """Refuse every call that may find no room, one after another: the old study or the new one, no other error."""
    one, refused, ends = fresh(root / "one"), 0, set()
    for call in range(1, 10_000):
        place = Path(shutil.copytree(one, root / f"{call:05d}"))
        try:
            came_to_its_end = refused_before(call, lambda place=place: put(place, "new"))
        except OutputError:
            came_to_its_end = False
            refused += 1
        recover(place)
        found = content(place)
        assert found in (expected("old"), expected("new")), call
        ends.add(found["verdicts.json"])
        assert [name for name in names(place) if name.startswith(".")] == [MARKER]
        shutil.rmtree(place)
        if came_to_its_end:
            break
    assert refused > 20
    assert ends == {"old", "new"}


def test_a_call_that_is_refused_loses_nothing(tmp_path: Path) -> None:
    # An interpreter of its own: a profile function that raises has hung one that had run thousands of tests.
    code = (
        "import sys; from pathlib import Path; import test_full_disk; test_full_disk.every_refusal(Path(sys.argv[1]))"
    )
    words = [sys.executable, "-c", code, str(tmp_path)]
    done = subprocess.run(
        words,
        cwd=Path(__file__).parent,
        env=helped(),
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def test_a_part_that_finds_no_room_does_not_count(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def begin(limit: int) -> None:
        with no_file_above(limit), Parts(tmp_path / "out", "crossbody x", {"a": 1}) as parts:
            for key in "ab":
                if not parts.has(key):
                    with parts.put(key) as made:
                        (made / "rows").write_bytes(bytes(500 if key == "a" else 5000))

    for limit in (0, 10):
        with pytest.raises(OutputError, match="too large"):
            begin(limit)
        assert names(tmp_path) == []
    with pytest.raises(OutputError, match="too large"):
        begin(1000)
    assert "what is complete is kept in" in " ".join(capsys.readouterr().err.split())
    (parts,) = (tmp_path / "out").iterdir()
    assert len(names(parts)) == len({ABOUT, "a"})
    begin(10_000)
    assert "1 parts of an interrupted run" in " ".join(capsys.readouterr().err.split())


LIMITED = """
import resource, runpy, sys
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv.pop(1)), resource.RLIM_INFINITY))
runpy.run_path(sys.argv.pop(1), run_name="__main__")
"""
WORDS = ("run", "bouncing_ball", "--variant", "linear", "-e", "fake:exact")


def test_a_run_that_finds_no_room_is_a_sentence_and_goes_on(tmp_path: Path) -> None:
    def done(limit: int) -> tuple[int, list[str]]:
        command = [sys.executable, "-c", LIMITED, str(limit), str(STUCK), *WORDS]
        ended = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        return ended.returncode, ended.stderr.splitlines()

    code, said = done(3_000_000)  # room for tables, none for the pages
    assert code == 2
    assert "cannot be written: File too large" in said[-1]
    assert "what is complete is kept" in " ".join(" ".join(said).split())
    (parts,) = (tmp_path / "out").iterdir()
    assert parts.name.startswith(".crossbody-parts.")
    code, said = done(100_000_000)
    assert code == 0
    assert "1 parts of an interrupted run" in " ".join(" ".join(said).split())
    assert (tmp_path / "out" / "index.html").is_file()


ENTRY = "import sys; sys.argv[0] = 'crossbody'; from crossbody.reports.entry import main; main()"


@pytest.mark.parametrize("words", [("list",), ("cache", "show", "--json")])
@pytest.mark.parametrize("mute", [False, True])
def test_what_cannot_be_printed_is_told_by_the_exit_code(words: tuple[str, ...], mute: bool, tmp_path: Path) -> None:
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-c", ENTRY, *words], cwd=tmp_path, stdout=full,
            stderr=full if mute else subprocess.PIPE, text=True, check=False,
        )  # fmt: skip
    assert done.returncode == 2
    assert mute or done.stderr == "crossbody: The system refuses: No space left on device.\n"


def test_results_are_whole_where_their_json_cannot_be_printed(tmp_path: Path) -> None:
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, str(STUCK), *WORDS, "--json"], cwd=tmp_path, stdout=full, stderr=subprocess.PIPE,
            text=True, check=False,
        )  # fmt: skip
    assert (done.returncode, done.stderr) == (2, "crossbody: The system refuses: No space left on device.\n")
    assert (tmp_path / "out" / "verdicts.json").is_file()
    assert [name for name in names(tmp_path / "out") if name.startswith(".")] == [MARKER]
