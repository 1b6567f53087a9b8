"""Files of a user's own as plug-ins: by --plugin, by pyproject.toml, in other processes; what is wrong is told."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from places import OWN

from crossbody import engines
from crossbody.cases import InvalidValue, installed
from crossbody.cases.errors import NoFile
from crossbody.reports import metrics
from crossbody.reports.cli import cli, main
from crossbody.reports.sweep import pools

ENGINE = '"""The reference by another name."""\nfrom crossbody.engines import load\nENGINE = load("reference")\n'
METRIC = (
    '"""Where it ends."""\nUNIT, CLAIMED = "m", False\ndef measure(truth, run, case):\n    return float(run.q[-1, 0])\n'
)
FILES = {
    "mine.py": ENGINE, "ending.py": METRIC, "raises.py": "x = 1\ny = x / 0\n", "nothing.py": "UNIT = 'm'\n",
    "mujoco.py": ENGINE, "position.py": METRIC, "balls.py": "SUITE = 1",
    "lacks.py": "import no_such_package\n", "ends.py": "raise SystemExit",
    "two words.py": ENGINE, "text.txt": "", "other/mine.py": ENGINE,
}  # fmt: skip


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, own_plugins: None) -> Path:
    """A folder with plug-ins, right and wrong ones."""
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    (tmp_path / "theirs.py").write_text(OWN.read_text())
    monkeypatch.chdir(tmp_path)
    return tmp_path


def ended(*words: str) -> int:
    with pytest.raises(SystemExit) as end:
        main(list(words))
    return int(end.value.code or 0)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ("absent.py", "There is no plug-in file "),
        (".", "is not called NAME.py"),
        ("text.txt", "is not called NAME.py"),
        ("two words.py", "is not called NAME.py"),
        ("raises.py", "raises.py cannot be imported: ZeroDivisionError (division by zero) in "),
        ("raises.py", "raises.py, line 2."),
        ("lacks.py", "cannot be imported: ModuleNotFoundError (No module named 'no_such_package')"),
        ("ends.py", "cannot be imported: SystemExit"),
        ("nothing.py", "defines none. Public names of a plug-in, by its kind: case: PARAMETERS, VARIANTS, build; "),
        ("mujoco.py", "The engine 'mujoco' already exists: rename the plug-in "),
        ("position.py", "The metric 'position' already exists: rename the plug-in "),
        ("balls.py", "The suite 'balls' already exists: rename the plug-in "),
        ("other/mine.py", "have the same name: rename one of the files."),
    ],
)  # fmt: skip
@pytest.mark.parametrize("by", ["option", "configuration"])
def test_a_wrong_file_is_one_sentence(
    given: str, says: str, by: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--plugin", "mine.py", "--plugin", given]
    if by == "configuration":
        (here / "pyproject.toml").write_text(f'[tool.crossbody]\nplugins = ["mine.py", "{given}"]\n')
        words = []
    assert ended("list", *words) == 2
    told = capsys.readouterr().err
    assert says in told
    assert told.count("\n") == 1
    assert list(installed._FILES) == [here / "mine.py"], "what is wrong leaves nothing behind"


@pytest.mark.parametrize("text", ["[tool", "tool = 3\n[tool.crossbody]", "\udcff"])
def test_a_pyproject_that_cannot_be_read_is_one_sentence(
    text: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (here / "pyproject.toml").write_bytes(text.encode(errors="surrogateescape"))
    assert ended("list") == 2
    assert "pyproject.toml cannot be read: " in capsys.readouterr().err


@pytest.mark.parametrize(
    "table", ["tool.crossbody = 3", "tool.crossbody.plugins = 'mine.py'", "tool.crossbody.plugin = ['mine.py']"]
)
def test_a_configuration_that_says_something_else_is_one_sentence(
    table: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (here / "pyproject.toml").write_text(table)
    assert ended("list") == 2
    assert 'valid: plugins = ["FILE.py", ...] alone.' in capsys.readouterr().err


def leaves() -> list[list[str]]:
    """Every command with no commands below it."""
    groups = {name: getattr(command, "commands", None) for name, command in cli.commands.items()}
    return [
        [name, *below] for name, under in groups.items() for below in ([[each] for each in under] if under else [[]])
    ]


@pytest.mark.parametrize("command", leaves(), ids=" ".join)
def test_every_command_takes_plug_ins_before_all_else(
    command: list[str], here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert ended(*command, "--plugin", "absent.py") == 2
    assert "There is no plug-in file" in capsys.readouterr().err
    (here / "pyproject.toml").write_text("[tool.crossbody]\nplugins = ['absent.py']")
    assert ended(*command, "--help") == 0, "help needs no plug-in"


def test_files_are_listed_and_judged_from_a_folder_below(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (here / "pyproject.toml").write_text('[tool.crossbody]\nplugins = ["mine.py", "ending.py"]\n')
    monkeypatch.chdir(here / "other")
    assert (
        ended("run", "theirs", "--variant", "right", "-e", "mine:compiled", "--plugin", "../theirs.py", "--json") == 0
    )
    told = capsys.readouterr().out
    assert '"metric":"ending"' in told
    assert f"--plugin {here / 'mine.py'}" in told.replace("\\/", "/"), "the command that repeats it"
    assert ended("list") == 0
    told = capsys.readouterr().out
    assert "The reference by another name." in told
    assert "Where it ends." in told


def test_other_processes_know_them(here: Path) -> None:
    installed.use(["mine.py", "ending.py", "mine.py"])
    assert list(pools.surviving(engines.summary, ["mine", "mine"], 2)) == ["The reference by another name."] * 2
    assert set(pools.surviving(metrics.summary, ["ending", "position"], 2)) == {
        "Where it ends.", metrics.summary("position"),
    }  # fmt: skip


def test_what_a_file_holds_tells_a_sweep_from_another(here: Path) -> None:
    installed.use(["mine.py"])
    before = installed.digests()
    Path("mine.py").write_text(ENGINE + "# changed\n")
    assert installed.digests().keys() == before.keys()
    assert installed.digests() != before


def test_python_is_told_as_the_command_is(here: Path) -> None:
    with pytest.raises(NoFile, match="There is no plug-in file"):
        installed.use(["absent.py"])
    with pytest.raises(InvalidValue, match="plug-in is 3"):
        installed.use([3])  # type: ignore[list-item]


def test_nothing_is_left_beside_a_file_of_the_users_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    file = tmp_path / "beside.py"
    file.write_text("A = 1\n")
    assert installed.from_file("plugin", file).A == 1
    assert [path.name for path in tmp_path.iterdir()] == ["beside.py"]
    assert not sys.dont_write_bytecode
