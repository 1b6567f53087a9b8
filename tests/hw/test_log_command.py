"""`crossbody log info` as a user meets it."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import click
import log_files
import numpy as np
import pytest

from crossbody import hw
from crossbody.reports.cli import cli, main


def call(*arguments: str | Path) -> int:
    with pytest.raises(SystemExit) as end:
        main([str(argument) for argument in arguments])
    return int(end.value.code or 0)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return log_files.write("csv", tmp_path, log_files.table(200))


def test_it_shows_channels_rates_gaps_and_ranges(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("log", "info", path) == 0
    said = capsys.readouterr().out
    table = log_files.table(200)
    for words in ("200 rows", "1000 Hz", "0 samples missing", "longest step 0.001 s", "angle", "float64"):
        assert words in said
    assert f"{table['torque'].min():.6g}" in said
    assert f"{table['count'].max():.6g}" in said


def test_the_draft_alone_is_a_map_that_reads_the_log(
    path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call("log", "info", path, "--draft") == 0
    (tmp_path / "map.toml").write_text(capsys.readouterr().out)
    log = hw.read(path, tmp_path / "map.toml")
    assert log.names("coordinates") == ("angle",)
    assert call("log", "info", path, "--columns", tmp_path / "map.toml") == 0
    assert "Draft" not in capsys.readouterr().out


def test_a_part_without_a_map_that_separates_parts_is_refused(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("log", "info", path, "--part", "3") == 2
    said = capsys.readouterr()
    assert "--part 3: only a column map separates runs" in " ".join(said.err.split())
    assert not said.out


def test_a_gap_is_a_note_and_no_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = {name: np.delete(values, [70, 71]) for name, values in log_files.table(200).items()}
    path = log_files.write("parquet", tmp_path, data)
    assert call("log", "info", path) == 0
    said = capsys.readouterr().out
    assert "note: dropped: time, row 70, t = 0.072 s: 2 samples are missing" in said


def test_a_fault_is_shown_with_everything_else_and_exits_with_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = log_files.table(200)
    data["angle"][31] = np.nan
    path = log_files.write("parquet", tmp_path, data)
    assert call("log", "info", path) == 2
    told = capsys.readouterr()
    assert "fault: finite: angle, row 31, t = 0.031 s" in told.out
    assert "torque" in told.out
    assert told.err.count("\n") == 1
    assert "row 31" in told.err


def test_a_map_decides_what_json_finds(path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("log", "info", path, "--draft") == 0
    drafted = capsys.readouterr().out
    (tmp_path / "map.toml").write_text(drafted.replace("[coordinates.angle]", "[coordinates.angle]\nrange = [-1, 1]"))
    assert call("log", "info", path, "--columns", tmp_path / "map.toml", "--json") == 2
    told = json.loads(capsys.readouterr().out)["findings"]
    assert [one["check"] for one in told if one["fault"]] == ["range"]
    assert [one["row"] for one in told] == [one.row for one in hw.check(path, tmp_path / "map.toml")]


@pytest.mark.parametrize("cell", ["=1+1", "@SUM(A1)", "open"])
def test_a_cell_that_is_no_number_is_a_fault_without_any_map(
    cell: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = log_files.write("csv", tmp_path, log_files.table(200))
    lines = path.read_text().splitlines()
    cells = lines[61].split(",")
    lines[61] = ",".join([cells[0], cell, *cells[2:]])
    path.write_text("\n".join(lines))
    assert call("log", "info", path) == 2
    assert f"angle, row 60: {cell!r} is" in capsys.readouterr().err


def test_names_out_of_a_file_do_not_steer_the_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    data = {"t": np.arange(5.0), "\x1b[2Jq": np.arange(5.0), "[bold]x[/bold]": np.arange(5.0)}
    pq.write_table(pa.table(data), tmp_path / "log.parquet")
    assert call("log", "info", tmp_path / "log.parquet") == 0
    said = capsys.readouterr().out
    assert "\x1b" not in said
    assert "\\x1b[2Jq" in said
    assert "[bold]x[/bold]" in said


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("log", "info"), "LOG"),
        (("log", "info", "nowhere.csv"), "No such file"),
        (("log", "info", "{path}", "--columns", "nowhere.toml"), "multiarm_double"),
        (("log", "info", "{path}", "--columns", "multiarm_double"), "does not begin"),
        (("log", "info", "{path}", "--part", "one"), "one"),
        (("log", "inspect"), "inspect"),
    ],
)
def test_wrong_use_is_one_sentence(
    arguments: tuple[str, ...], says: str, path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(*(word.format(path=path) for word in arguments)) == 2
    told = capsys.readouterr()
    assert told.err.count("\n") == 1
    assert says in told.err


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys\nfrom crossbody.reports.cli import main\n"
        "try:\n    main(['log', 'info', '--help'])\nexcept SystemExit as end:\n    assert end.code == 0, end.code\n"
        "found = [m for m in ('numpy', 'pandas', 'pyarrow', 'msgspec', 'pint', 'scipy') if m in sys.modules]\n"
        "assert not found, found\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


SPACE = {"px": "m", "pz": "m", "qw": "1", "qz": "1", "vx": "m/s", "vz": "m/s", "wx": "rad/s", "th1": "rad",
         "omega": "rad/s", "tau": "N m"}  # fmt: skip
"""Names of columns and the units that they have."""


@pytest.mark.parametrize("seed", range(5))
def test_units_are_drafted_from_names_and_marked_where_the_file_tells_none(
    seed: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    draw = np.random.default_rng(seed)
    names = [str(name) for name in draw.permutation(list(SPACE))]
    told = {name: draw.random() < 0.4 and SPACE[name] != "1" for name in names}
    data = {f"{name} [{SPACE[name]}]" if told[name] else name: draw.normal(size=50) for name in names}
    path = log_files.write("csv", tmp_path, data)
    assert call("log", "info", path, "--draft") == 0
    drafted = capsys.readouterr().out
    marked = re.findall(r'column = "(\w+)"\nunit = "([^"]*)" # guessed', drafted)
    assert dict(marked) == {name: SPACE[name] for name in names if not told[name]}
    assert drafted.count("unit = ") == len(marked), "a unit that the file tells is not drafted"
    assert "sample_time = 1.0 # no measurement: set it" in drafted
    assert hw.parse_columns(drafted) == hw.survey(path).draft()


@pytest.mark.parametrize("name", hw.maps())
def test_a_map_that_comes_along_is_named_wherever_one_is_asked_for(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    columns = hw.load_columns(name)
    wanted = {one for one in (columns.time.column, *(s.column for _, _, s in columns.signals())) if one}
    path = log_files.write("parquet", tmp_path, {one: np.arange(20.0) for one in wanted})
    assert call("log", "info", path) == 0
    (said,) = [line for line in capsys.readouterr().out.splitlines() if "comes with crossbody" in line]
    assert name in said
    assert call("list") == 0
    assert f"  {name} " in capsys.readouterr().out
    assert call("replay", path, "-m", "ball", "--out", tmp_path / "out") == 2
    assert name in " ".join(capsys.readouterr().err.split())
    for command in (cli.commands["replay"], cli.commands["identify"], cli.commands["log"].commands["info"]):
        (option,) = [one for one in command.params if one.name == "columns"]
        assert name in [item.value for item in option.shell_complete(click.Context(command), name[:4])]
