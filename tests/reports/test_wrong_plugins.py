"""Plug-ins of a user's own that cannot be one: one sentence with the file, what is wrong and what would be valid."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from places import OWN

from crossbody.cases.public_names import KINDS
from crossbody.reports.cli import main

HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"


def block(page: str, title: str) -> str:
    """A file that a page of the documentation shows."""
    found = re.search(rf'```python title="{title}"\n(.*?)^```', (HOW_TO / page).read_text(), re.DOTALL | re.MULTILINE)
    assert found
    return found[1]


METRIC = block("metric.md", "rebound_error.py").replace("CLAIMED = True", "CLAIMED = False")
EULER, NPZ = block("engine.md", "euler.py"), block("log-format.md", "npz.py")
GOOD = {
    "crossbody.cases": OWN.read_text(),
    "crossbody.engines": EULER,
    "crossbody.engines.importers": "FORMATS, PACKAGE, MODULE = ('mjcf',), 'numpy', 'numpy'\n"
    "def open_robot(path, urdf): ...\n",
    "crossbody.hw.formats": NPZ,
    "crossbody.hw.models": "from crossbody.hw.models import load\nMODEL = load('ball')\n",
    "crossbody.reports.metrics": METRIC,
    "crossbody.reports.scenes": "def stage(p): ...\ndef poses(q, p): ...\ndef arrows(q, lam, p): ...\n",
    "crossbody.reports.sections": "TITLE = 'mine'\ndef sections(out): return ()\n",
    "crossbody.reports.suites": block("stress.md", "slopes.py"),
}
NAMES = [(group, name) for group, kind in KINDS.items() for name in kind.defines]


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, own_plugins: None) -> Path:
    """A folder to be in, with a log."""
    monkeypatch.chdir(tmp_path)
    t = np.arange(50) * 1e-2
    np.savez("swing.npz", t=t, angle=np.sin(t))
    Path("swing.toml").write_text('[time]\ncolumn="t"\nunit="s"\n[coordinates.a]\ncolumn="angle"\nunit="rad"\n')
    return tmp_path


def sentence(capsys: pytest.CaptureFixture[str], *words: str, code: int = 2) -> str:
    """What a command says of wrong use, in one line."""
    capsys.readouterr()
    with pytest.raises(SystemExit) as end:
        main(list(words))
    told = capsys.readouterr()
    assert end.value.code == code, told
    assert told.err.count("\n") == 1, told.err
    assert told.err.startswith("crossbody: ")
    return told.err


@pytest.mark.parametrize("group", KINDS)
def test_a_right_one_of_every_kind_is_taken(group: str, here: Path) -> None:
    Path("mine.py").write_text(GOOD[group])
    with pytest.raises(SystemExit) as end:
        main(["list", "--plugin", "mine.py"])
    assert end.value.code == 0


@pytest.mark.parametrize("value", ["3", "[1.5]", "b'x'", "lambda *, only: 0", "object"])
@pytest.mark.parametrize(("group", "name"), NAMES)
def test_no_public_name_is_taken_for_what_it_is_not(
    group: str, name: str, value: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("mine.py").write_text(f"{GOOD[group]}\n{name} = {value}\n")
    told = sentence(capsys, "list", "--plugin", "mine.py")
    assert f"The {KINDS[group].name} file {here / 'mine.py'}: {name} is " in told
    assert f"; valid: {KINDS[group].defines[name].valid}." in told


@pytest.mark.parametrize(("group", "name"), [pair for pair in NAMES if len(KINDS[pair[0]].defines) > 1])
def test_what_lacks_one_name_of_its_kind_is_told_which(
    group: str, name: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("mine.py").write_text(f"{GOOD[group]}\ndel {name}\n")
    told = sentence(capsys, "list", "--plugin", "mine.py")
    kind = KINDS[group]
    also = f"{name} ({kind.defines[name].valid})"
    assert told.endswith(f"mine.py is not yet a plug-in: a {kind.name} also defines {also}.\n")


def test_a_case_file_is_checked_as_a_plug_in_is(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for wrong, says in (
        ("VARIANTS = {}", "VARIANTS is {}; valid: "),
        ("VARIANTS = {'right': {'nonsense': 1.0}}", "There is no parameter 'nonsense' of mine:right. Known: error, "),
        ("def build(p): ...", "build is a function of (p); valid: a function of (variant, parameters)."),
    ):
        Path("mine.py").write_text(f"{GOOD['crossbody.cases']}\n{wrong}\n")
        assert says in sentence(capsys, "run", "mine.py", "-e", "reference:compiled")


RAISES = ("raise LookupError('own')", "raise SystemExit(0)", "1 / 0", "int('x')", "None.x", "import no_such_package_x")


@pytest.mark.parametrize("what", RAISES)
@pytest.mark.parametrize(
    ("text", "before", "words"),
    [
        (OWN.read_text(), "    known =", "run mine.py -e reference:compiled"),
        (NPZ, '    return head.startswith(b"PK', "log info swing.npz --plugin mine.py"),
        (NPZ, "        for start in", "log info swing.npz --plugin mine.py"),
    ],
)
def test_what_it_raises_is_no_fault_of_crossbody(
    text: str, before: str, words: str, what: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    indent = before[: len(before) - len(before.lstrip())]
    assert before in text
    Path("mine.py").write_text(text.replace(before, f"{indent}{what}\n{before}", 1))
    told = sentence(capsys, *words.split())
    assert "mine.py raises " in told or "no scene has these parameters" in told or "needs the package" in told


@pytest.mark.parametrize(
    ("before", "after", "says"),
    [
        ("    profiles = {", "    profiles = {}\n    others = {", "ENGINE.profiles is {}; valid: a mapping"),
        ('    name = "euler"\n', "", "does not define ENGINE.name; valid: a text."),
        ('hidden = {"*": {', 'hidden = {"*": 3}; _ = {"*": {', "ENGINE.hidden is {'*': 3}; valid: "),
        ("ENGINE = Euler()", "ENGINE = Euler", "Euler'>; valid: a crossbody.engines.Engine."),
        ("        return EulerRun(", "        EulerRun(", "prepare of the engine 'mine' returns is None; it must be a"),
        ("        return Trajectory(", "        Trajectory(", "run of the engine 'mine' returns is None; it must be a"),
        ("        return {\n", "        return None and {\n", "audit of the engine 'mine' returns is None; it must"),
        ("q=q[:, None]", "q=q", "Trajectory.q has shape (5001,); it must have shape (5001, any). It was raised in "),
        ("q=q[:, None]", "q=np.stack([q, q], 1)", "run of the engine 'mine' returns has 2 columns of q; valid: 1, as "),
        ("outcome=outcome", "outcome='done'", "Trajectory.outcome is 'done'; it must be an Outcome. It was raised in "),
        ("self.settings = case", "self.s = case", "does not define settings; valid: a mapping from names to values."),
    ],
)  # fmt: skip
def test_what_an_engine_returns_is_looked_at(
    before: str, after: str, says: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert before in EULER
    Path("mine.py").write_text(EULER.replace(before, after).replace('"euler"', '"mine"'))
    words = "run bouncing_ball --variant linear -e mine --plugin mine.py --out out --quiet"
    assert says in sentence(capsys, *words.split())
    assert not Path("out").exists(), "nothing is half written"


@pytest.mark.parametrize(
    ("before", "after", "says"),
    [
        ("    return NpzReader", "    NpzReader", "of the log format 'mine' returns does not define groups; valid"),
        ("    library =", "    _library =", "returns does not define library; valid: a text."),
        ("rows=n", "rows=str(n)", "Group.rows is '50'; it must be a whole number from 0 on. It was raised in "),
        ("            yield {", "            yield 3, {", "with an array (n,) for each of t, angle."),
        ("self._arrays[name][s", "self._arrays[name][:, None][s", " is {'t': (50, 1), 'angle': (50, 1)}; valid: a"),
        ("    return NpzReader", "    import no_such_x\n    return NpzReader", "it with: pip install 'no_such_x'"),
    ],
)  # fmt: skip
def test_what_a_log_format_returns_is_looked_at(
    before: str, after: str, says: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert before in NPZ
    Path("mine.py").write_text(NPZ.replace(before, after))
    assert says in sentence(capsys, "log", "info", "swing.npz", "--columns", "swing.toml", "--plugin", "mine.py", "-q")


@pytest.mark.parametrize("given", ["'3'", "np.zeros(3)", "np.zeros(1)", "1j", "True", "float('nan')", "exit()"])
def test_a_number_of_a_metric_is_one_or_its_row_says_so(
    given: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("mine.py").write_text(re.sub(r"    mine, theirs = .*\n", f"    return {given}\n", METRIC))
    words = "run bouncing_ball --variant linear -e reference:compiled --plugin mine.py --json --out out"
    with pytest.raises(SystemExit) as end:
        main(words.split())
    (row,) = (row for row in json.loads(capsys.readouterr().out) if row["metric"] == "mine")
    good = {"True": "not judged", "float('nan')": "outside"}.get(given, "crashed")
    assert (row["verdict"], end.value.code) == (good, int(good != "not judged")), row
    if good == "crashed" and "exit" not in given:
        assert "What measure of 'mine' returns is " in row["why"]
        assert "it must be a number, NaN or None." in row["why"]


def test_what_it_prints_is_not_in_the_result(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    loud = "    print('noise')\n"
    Path("mine.py").write_text(METRIC.replace("    mine, theirs", f"{loud}    mine, theirs") + loud.strip())
    Path("own.py").write_text(OWN.read_text().replace("    known =", f"{loud}    known =", 1))
    run = "run own.py --variant right -e reference:compiled --plugin mine.py --out out --json"
    for words in (run, "list own.py --json"):
        with pytest.raises(SystemExit) as end:
            main(words.split())
        told = capsys.readouterr()
        assert end.value.code == 0
        assert json.loads(told.out)
        assert "noise" in told.err
