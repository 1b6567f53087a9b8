"""Every command can be quiet and can speak JSON alone."""

from __future__ import annotations

import ctypes
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import click
import log_files
import numpy as np
import pytest

from crossbody import engines
from crossbody.cases import InvalidValue
from crossbody.reference import compiling
from crossbody.reports import voice
from crossbody.reports.cli import cli, main
from crossbody.reports.runs import choice


def leaves(group: click.Group, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], click.Command]]:
    for name, command in group.commands.items():
        if isinstance(command, click.Group):
            yield from leaves(command, (*path, name))
        else:
            yield (*path, name), command


COMMANDS = dict(leaves(cli))


@pytest.fixture(autouse=True)
def _here(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)


def call(*arguments: str) -> int:
    with pytest.raises(SystemExit) as end:
        main(list(arguments))
    return int(end.value.code or 0)


@pytest.mark.parametrize("name", COMMANDS, ids=" ".join)
def test_every_command_has_both(name: tuple[str, ...]) -> None:
    options = {text for parameter in COMMANDS[name].params for text in parameter.opts}
    assert options >= ({"--json"} if name == ("list",) else {"--json", "--quiet", "-q"})


def test_the_list_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("list", "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert {"cases", "engines", "metrics"} <= set(told)
    assert told["cases"]["bouncing_ball"].startswith("A ball dropped")


RUN = ("run", "bouncing_ball", "--variant", "linear", "-e", "mujoco:matched")


def test_quiet_says_nothing_where_nothing_is_wrong_and_that_alone_else(capsys: pytest.CaptureFixture[str]) -> None:
    assert call(*RUN, "-q") == 0
    told = capsys.readouterr()
    assert told.out == told.err == ""
    assert Path("out/index.html").is_file()
    assert call("report", "out", "--quiet") == 0
    assert capsys.readouterr().out == ""
    assert call(*RUN, "-q", "--set-engine", "dt=4e-3") == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines
    begun = ("outside: bouncing_ball:linear mujoco:matched ", "The reason of these ", "    ")
    assert all(line.startswith(begun) for line in lines)
    assert max(map(len, lines)) <= 80


def test_the_frequency_responses_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("bode", "soft_contact", "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert set(told) == {"bode", "poles", "growths"}
    assert all(told.values())


def test_a_log_as_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = log_files.table(200)
    path = log_files.write("csv", tmp_path, table)
    assert call("log", "info", str(path), "--json") == 0
    told = json.loads(capsys.readouterr().out)
    (group,) = told["groups"]
    assert (group["rows"], group["lost"]) == (200, 0)
    channels = {channel["name"]: channel for channel in group["channels"]}
    assert channels["torque"]["smallest"] == pytest.approx(table["torque"].min(), rel=1e-12)
    assert call("log", "info", str(path), "--quiet") == 0
    assert capsys.readouterr().out == ""


def test_a_faulty_log_tells_the_fault_even_quietly(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    t = np.arange(200) * 1e-3
    t[70] = t[69]
    rows = "\n".join(f"{a:.6f},{b:.6f}" for a, b in zip(t, np.sin(t), strict=True))
    (tmp_path / "log.csv").write_text(f"t,x\n{rows}\n")
    (tmp_path / "map.toml").write_text('[time]\ncolumn = "t"\nunit = "s"\n[coordinates.x]\ncolumn = "x"\nunit = "m"\n')
    assert call("log", "info", "log.csv", "--columns", "map.toml", "--json") == 2
    told = json.loads(capsys.readouterr().out)
    assert [(one["check"], one["row"]) for one in told["findings"] if one["fault"]] == [("time", 70)]
    assert call("log", "info", "log.csv", "--columns", "map.toml", "-q") == 2
    said = capsys.readouterr().out.strip()
    assert said.startswith("fault: time: time, row 70")
    assert all(line.startswith("    ") for line in said.splitlines()[1:])


def test_progress_tells_the_time_left_to_a_terminal_only(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with voice.progress(2) as tell:
        tell("one")
    assert capsys.readouterr().err == ""
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("FORCE_COLOR", "1")
    with voice.progress(2) as tell:
        tell("one")
        tell("two")
    said = capsys.readouterr().err
    assert "left" in said
    assert "two" in said


@pytest.mark.parametrize(("options", "told"), [((), True), (("--quiet",), False), (("--json",), False)])
def test_what_is_compiled_is_told_unless_nothing_is_to_be(
    options: tuple[str, ...], told: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def compiles(*_given: object, **_asked: object) -> None:
        counted.tell()
        raise InvalidValue("Enough.")

    counted = compiling.Count()
    monkeypatch.setattr(voice, "count", counted)
    monkeypatch.setattr(choice, "load_cases", compiles)
    call("run", "bouncing_ball", *options)
    assert ("compiling the reference" in capsys.readouterr().err) == told
    counted.tell()
    assert "compiling the reference" in capsys.readouterr().err, "for the command alone"


@pytest.mark.parametrize("name", ["run", "list"])
def test_what_compiled_code_prints_is_no_result(
    name: str, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """By C's own buffer, which is written when it is full or the process ends, and by the descriptor."""
    c, real = ctypes.CDLL(None), engines.load

    def load(engine: str) -> engines.Engine:
        c.puts(b"from C")
        os.write(1, b"by descriptor\n")
        return real(engine)

    monkeypatch.setattr(engines, "load", load)
    words = {"run": ("-e", "reference:compiled", "--variant", "linear"), "list": ()}[name]
    assert call(name, "bouncing_ball" if name == "run" else "reference", *words, "--json") == 0
    c.fflush(None)
    told = capfd.readouterr()
    assert json.loads(told.out)
    assert "from C" in told.err
    assert "by descriptor" in told.err
    print("on it goes")
    assert capfd.readouterr().out == "on it goes\n"


def test_json_is_whole_where_nobody_listens_to_errors(tmp_path: Path) -> None:
    command = f"{sys.executable} -c 'from crossbody.reports.entry import main; main()' list --json 2>&-"
    done = subprocess.run(["sh", "-c", command], cwd=tmp_path, stdout=subprocess.PIPE, timeout=60)
    assert done.returncode == 0
    assert json.loads(done.stdout)


SLEEPS = """
import sys, time
from crossbody.reports import voice
from crossbody.reports.runs import watch
watch.SLOW = 0.3
def work():
    with voice.progress(3) as tell:
        for name, seconds in (("short", 0.0), ("long", 1.2), ("last", 0.0)):
            tell(name)
            time.sleep(seconds)
    time.sleep(0.7)
    return 0
sys.exit(watch.watched(work))
"""


def test_what_takes_long_is_told_once_where_stderr_is_no_terminal() -> None:
    """Compiled code gives no other thread a turn: it is the process beside it that says so."""
    found = subprocess.run([sys.executable, "-c", SLEEPS], capture_output=True, text=True, timeout=60, check=True)
    assert found.stderr == "crossbody: long has taken 0.3 s and goes on.\n"
