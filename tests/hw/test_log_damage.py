"""Damaged logs: one sentence with the place, exit code 2, nothing written, nothing executed, memory bounded."""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
from pathlib import Path

import log_damage
import log_files
import numpy as np
import pytest

from crossbody import hw
from crossbody.cases import LogFormatError
from crossbody.reports.cli import main

DAMAGES = {damage.name: damage for damage in log_damage.damages()}


class Workshop:
    """Damaged logs, each made once in a folder of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._made: dict[str, tuple[Path, Path]] = {}

    def made(self, name: str) -> tuple[Path, Path]:
        """The damaged log, and the map to read it by."""
        damage = DAMAGES[name]
        if damage.needs:
            pytest.importorskip(damage.needs)
        if name not in self._made:
            folder = self.folder / name
            (folder / "rig").mkdir(parents=True)
            (folder / "map.toml").write_text(log_damage.column_map(damage.case))
            self._made[name] = damage.make(folder / "rig"), folder / "map.toml"
        return self._made[name]


@pytest.fixture(scope="module")
def workshop(tmp_path_factory: pytest.TempPathFactory) -> Workshop:
    return Workshop(tmp_path_factory.mktemp("damaged"))


def listing(folder: Path) -> list[str]:
    return sorted(str(path) for path in folder.rglob("*"))


def test_there_are_at_least_two_hundred() -> None:
    assert len(DAMAGES) >= 200


@pytest.mark.parametrize("case", log_files.WRITERS)
def test_the_undamaged_log_is_read(case: str, tmp_path: Path) -> None:
    (tmp_path / "map.toml").write_text(log_damage.column_map(case))
    log = hw.read(log_files.write(case, tmp_path, log_damage.motion()), tmp_path / "map.toml")
    assert len(log) == log_damage.ROWS
    assert not log.findings


@pytest.mark.parametrize("name", DAMAGES)
def test_a_damaged_log_is_refused_with_its_place_in_one_sentence_and_exit_code_2(
    name: str, workshop: Workshop, capsys: pytest.CaptureFixture[str]
) -> None:
    damage = DAMAGES[name]
    path, columns = workshop.made(name)
    before = listing(columns.parent)
    with pytest.raises(LogFormatError) as told:
        hw.read(path, columns)
    assert damage.says in str(told.value)
    assert str(told.value).startswith(str(path))
    assert str(told.value).isprintable()
    assert damage.row is None or told.value.row == damage.row
    with pytest.raises(SystemExit) as end:
        main(["log", "info", str(path), "--columns", str(columns)])
    shown = capsys.readouterr()
    assert end.value.code == 2
    assert shown.err.count("\n") == 1
    assert path.name in shown.err
    assert "\x1b" not in shown.out + shown.err
    assert listing(columns.parent) == before


@pytest.mark.parametrize("case", log_files.WRITERS)
def test_flipped_bytes_are_read_or_refused_and_nothing_else(case: str, tmp_path: Path) -> None:
    path = log_files.write(case, tmp_path, log_damage.motion())
    columns = hw.parse_columns(log_damage.column_map(case))
    file = log_damage.bytes_of(path)
    whole, random = file.read_bytes(), np.random.default_rng(17)
    for _ in range(12):
        damaged = bytearray(whole)
        for at in random.integers(0, len(damaged), 3):
            damaged[at] = random.integers(0, 256)
        file.write_bytes(bytes(damaged))
        for look in (lambda: hw.read(path, columns), lambda: hw.survey(path).draft()):
            with contextlib.suppress(LogFormatError):
                look()


CHILD = """
import json, os, resource, sys
from pathlib import Path
from crossbody import hw
from crossbody.cases import LogFormatError
work = json.loads(sys.argv[1])
clean = [pair for pair in work if Path(pair[0]).parent.name == "clean"]
for path, columns in clean:
    hw.read(path, columns)  # all libraries are imported before anything is counted
seen = []
harmful = {"os.system", "os.exec", "os.posix_spawn", "subprocess.Popen", "pickle.find_class", "socket.connect"}
def watch(event, arguments):
    if event in harmful:
        seen.append(event)
    if event == "open" and isinstance(arguments[0], str) and arguments[1] and set(arguments[1]) & set("wax+"):
        if not arguments[0].startswith("/tmp"):
            seen.append(f"{event} {arguments[0]} {arguments[1]}")
sys.addaudithook(watch)
start = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
refused = 0
for path, columns in work:
    try:
        hw.read(path, columns)
    except LogFormatError:
        refused += 1
print(json.dumps([refused, seen, (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - start) / 1024]))
"""


def test_reading_them_executes_nothing_writes_nothing_and_keeps_memory_bounded(
    tmp_path: Path, workshop: Workshop
) -> None:
    for package in sorted(set(log_files.NEEDS.values())):
        pytest.importorskip(package)
    work = []
    for case in log_files.WRITERS:
        (tmp_path / f"clean-{case}" / "clean").mkdir(parents=True)
        columns = tmp_path / f"clean-{case}" / "map.toml"
        columns.write_text(log_damage.column_map(case))
        work.append((str(log_files.write(case, columns.parent / "clean", log_damage.motion())), str(columns)))
    for name in DAMAGES:
        path, columns = workshop.made(name)
        work.append((str(path), str(columns)))
    before = listing(workshop.folder)
    done = subprocess.run([sys.executable, "-c", CHILD, json.dumps(work)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    refused, seen, megabytes = json.loads(done.stdout)
    assert refused == len(DAMAGES)
    assert seen == []
    assert megabytes < 200, "the sparse ones are 10 GB each"
    assert listing(workshop.folder) == before
    assert not [name for name in before if name.endswith("executed")]
