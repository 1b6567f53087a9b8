"""`crossbody audit`: the published robots, what it prints, and its exit codes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from places import ROBOTS, ROOT
from robot_damage import damaged
from robot_readers import ARM, HEAD, rows_of, run

from crossbody.cases import CrossbodyError, installed
from crossbody.reference import code_store
from crossbody.reports.importers.audit import audited, opened
from crossbody.reports.importers.causes import advice, explained
from crossbody.reports.importers.compare import FAILED, NONE, OK, UNSUPPORTED, WORDS, WRONG, Row, Said
from crossbody.reports.importers.told import markdown, sarif

pytest_plugins = ["pytester"]


@pytest.mark.parametrize("path", sorted(ROBOTS.glob("*/*.xml")), ids=lambda path: path.stem)
def test_mujoco_and_our_tree_agree_on_every_published_robot(path: Path) -> None:
    """The two yardsticks: whatever another reader is held to, they are the same to 1e-9."""
    [(_, _, rows)] = audited(path, ["mujoco"], seconds=60.0)
    assert {row.verdict for row in rows} <= {OK, NONE}, [row for row in rows if row.verdict not in (OK, NONE)]


@pytest.fixture(scope="module")
def ur5e() -> Path:
    path: Path = ROBOTS / "universal_robots_ur5e" / "ur5e.xml"
    if not path.is_file():
        pytest.skip(f"The robot's file {path} is not here.")
    return path


def test_what_is_known_of_pinocchio_and_a_published_robot(ur5e: Path) -> None:
    """The pose of a body that is fixed to the world is left out: all that stands on it is turned."""
    [(_, _, rows)] = audited(ur5e, ["pinocchio"], seconds=60.0)
    assert [(row.quantity, row.where) for row in rows if row.verdict == WRONG] == [("frames", "base")]


def test_a_table_of_80_columns_and_what_is_wrong_beneath_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(ARM.replace("<joint", '<joint frictionloss=".5" armature=".2"'))
    code, out, err = run(["audit", str(path), "-e", "mujoco", "-e", "pinocchio"], capsys)
    assert code == 0, out + err
    assert max(map(len, out.splitlines())) <= 80
    assert "mujoco reads the robot that the file describes" in err
    lines = {line.split()[0]: line.split()[1:] for line in out.splitlines() if line.startswith(("M ", "loops "))}
    assert lines == {"M": ["ok", "ok"], "loops": ["-", "-"]}


def test_the_first_sentence_says_who_reads_the_robot_and_one_line_what_is_not_installed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path, lacking = tmp_path / "arm.xml", [tmp_path / f"{name}.py" for name in ("one", "two")]
    path.write_text(ARM.replace("<worldbody>", '<option gravity="0 0 -3"/><worldbody>'))
    for reader in lacking:
        reader.write_text(HEAD.replace('"numpy", "numpy"', '"no-package", "no_package"') + "    import no_package\n")
    monkeypatch.setattr(installed, "_FILES", {})
    installed.use(lacking)
    code, out, _ = run(["audit", str(path), *(f"-e{name}" for name in ("one", "pinocchio", "two", "mujoco"))], capsys)
    text = " ".join(out.split())
    assert code == 1
    assert text.startswith("arm.xml: mujoco reads the robot that the file describes; pinocchio (gravity, bias and ")
    assert text.count("Not installed") == 1
    assert "Not installed: one, two. pip install no-package" in text


def test_rows_as_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    code, out, _ = run(["audit", str(path), "-e", "mujoco", "--json"], capsys)
    assert code == 0
    assert {"engine", "version", "reader", "quantity", "where", "value", "expected", "difference", "verdict", "cause",
            "file", "line"} <= set(json.loads(out)[0])  # fmt: skip


@pytest.mark.parametrize(("text", "said"), [
    ("<mujoco><worldbody/></mujoco>", "no joint"),
    ("<mujoco>", "MuJoCo's compiler refuses it"),
    ("<robot><link/></robot>", "MuJoCo's compiler refuses it"),
    ("", "MuJoCo's compiler refuses it"),
])  # fmt: skip
def test_a_file_that_is_none_is_one_sentence(
    text: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(text)
    code, out, err = run(["audit", str(path), "-e", "mujoco"], capsys)
    assert (code, out) == (2, "")
    assert said in err
    assert err.count("\n") == 1


def test_wrong_use_is_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    code, _, err = run(["audit", str(tmp_path / "none.xml")], capsys)
    assert code == 2
    assert "There is no robot file" in err
    code, _, err = run(["audit", str(path), "-e", "bullet"], capsys)
    assert code == 2
    assert "pinocchio" in err


@pytest.fixture(scope="module")
def compiled_code() -> Path:
    found = code_store.base()
    assert found is not None
    return found.parent


@pytest.fixture(scope="module")
def explained_ur5e(ur5e: Path) -> list[Row]:
    found = [row for _, _, rows in audited(ur5e, ["pinocchio"], seconds=60.0) for row in rows]
    return explained(ur5e, urdf=False, rows=found, seconds=60.0)


def test_a_difference_is_traced_to_a_feature_and_its_line(explained_ur5e: list[Row]) -> None:
    """Line 37 is the base of the arm: a body without joints that is turned."""
    [row] = [row for row in explained_ur5e if row.verdict == WRONG]
    assert (row.quantity, row.cause, row.line) == ("frames", "fixed body with a pose under the world", 37)
    assert advice(row.cause)


def test_sarif_and_markdown_tell_what_the_rows_do(explained_ur5e: list[Row]) -> None:
    path = ROBOTS / "universal_robots_ur5e" / "ur5e.xml"
    told = json.loads(sarif(path, explained_ur5e))
    [run] = told["runs"]
    rules = {rule["id"] for rule in run["tool"]["driver"]["rules"]}
    levels = [(one["ruleId"], one["level"]) for one in run["results"]]
    assert ("fixed body with a pose under the world", "error") in levels
    assert {rule for rule, _ in levels} == rules
    assert all(one["locations"][0]["physicalLocation"]["region"]["startLine"] >= 1 for one in run["results"])
    text = markdown(path, explained_ur5e)
    assert "| frames | 1.0e+00 |" in text
    assert "Line 37" in text


def test_explain_sarif_and_markdown_from_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(ARM.replace("<worldbody>", '<option gravity="0 0 -3"/><worldbody>'))
    files = ["--sarif", str(tmp_path / "a.sarif"), "--markdown", str(tmp_path / "a.md")]
    code, out, err = run(["audit", str(path), "-e", "pinocchio", "--explain", *files], capsys)
    assert code == 1, out + err
    assert "arm.xml:1: gravity (pinocchio: gravity, bias, energy)" in out
    assert max(map(len, out.splitlines())) <= 80
    assert json.loads((tmp_path / "a.sarif").read_text())["version"] == "2.1.0"
    assert (tmp_path / "a.md").read_text().startswith("### arm.xml")
    code, _, err = run(["audit", str(path), "-e", "mujoco", "--sarif", str(tmp_path / "none" / "a")], capsys)
    assert code == 2
    assert "cannot be written" in err


def test_one_pytest_item_a_reader_and_quantity(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch, compiled_code: Path
) -> None:
    monkeypatch.setenv("CROSSBODY_CACHE", str(compiled_code))  # whose place moves with the home folder
    pytester.makefile(".xml", arm=ARM.replace("<worldbody>", '<option gravity="0 0 -3"/><worldbody>'))
    found = pytester.runpytest_subprocess(
        "--crossbody-audit", "arm.xml", "--crossbody-engine", "mujoco", "--crossbody-engine", "pinocchio", "-rA"
    )
    counts = found.parseoutcomes()
    assert counts["failed"] == 3  # gravity, bias and energy
    found.stdout.fnmatch_lines(["PASSED *arm.xml::mujoco::gravity", "FAILED *arm.xml::pinocchio::gravity*"])
    asked = ("--crossbody-case", "bouncing_ball:linear", "--crossbody-audit", "arm.xml", "--crossbody-engine", "mujoco")
    found = pytester.runpytest_subprocess(*asked, "--collect-only", "-q")
    found.stdout.fnmatch_lines_random(["*bouncing_ball:linear::mujoco*::finished", "*arm.xml::mujoco::gravity"])
    found = pytester.runpytest_subprocess("--crossbody-audit", "none.xml")
    found.stdout.fnmatch_lines(["*There is no robot file*"])


@pytest.mark.parametrize(("gravity", "code"), [("0 0 -9.81", 0), ("0 0 -3", 1)])
def test_the_steps_of_the_action_run_as_a_script(gravity: str, code: int, tmp_path: Path) -> None:
    """What a GitHub runner does with a composite action: its shell, its inputs in the environment."""
    step = yaml.safe_load((ROOT / "action.yml").read_text())["runs"]["steps"][-1]
    (tmp_path / "arm.xml").write_text(ARM.replace("<worldbody>", f'<option gravity="{gravity}"/><worldbody>'))
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])  # the Action installs it there
    given = {"PATH": path} | {
        "FILES": "arm.xml",
        "ENGINES": "mujoco pinocchio",
        "SARIF": "told",
        "GITHUB_STEP_SUMMARY": "summary.md",
    }
    done = subprocess.run(["bash", "-eo", "pipefail", "-c", step["run"]], cwd=tmp_path, env=os.environ | given,
                          capture_output=True, text=True, check=False)  # fmt: skip
    assert done.returncode == code, done.stdout + done.stderr
    assert "### arm.xml" in (tmp_path / "summary.md").read_text()
    results = json.loads((tmp_path / "told" / "arm.xml.sarif").read_text())["runs"][0]["results"]
    assert bool(results) == bool(code)


@pytest.mark.slow
@pytest.mark.parametrize("path", sorted(ROBOTS.glob("*/*.xml")), ids=lambda path: path.stem)
def test_a_file_with_one_thing_changed_is_read_or_refused(path: Path, tmp_path: Path) -> None:
    """No change makes a fault of ours, and the two yardsticks agree on every one that they read: 40 a robot."""
    text, read = path.read_text(), 0
    for seed in range(40):
        changed = tmp_path / f"{path.stem}{seed}.xml"
        changed.write_text(damaged(text, seed))
        try:
            found = {engine: rows for _, engine, rows in audited(changed, ["mujoco", "pinocchio"], seconds=60.0)}
        except CrossbodyError:
            continue
        read += 1
        off = [row for row in found["mujoco"] if row.verdict not in (OK, NONE)]
        assert not off, (seed, off)
        assert found["pinocchio"][0].verdict in (OK, FAILED, UNSUPPORTED), seed
    assert read >= 10


@pytest.mark.parametrize(
    ("number", "other"), [('mass="1"', 'mass="1.5"'), ('"0 0 .5"', '"0 0 .6"'), ('"0 1 0"', '"0 0 1"')]
)
@pytest.mark.parametrize("engine", ["mujoco", "pinocchio"])
def test_a_change_is_seen_in_every_reader(engine: str, number: str, other: str, tmp_path: Path) -> None:
    """Held to what the file said before, a reader is wrong; so the audit would have told of a reader that is."""
    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    before = opened(path)
    path.write_text(ARM.replace(number, other))
    [(_, _, rows)] = audited(path, [engine], seconds=60.0, audit=before)
    assert WRONG in {row.verdict for row in rows}


TWO = """<mujoco><option gravity="0 0 -9.81"/><worldbody><body name="b1"><joint name="j1" type="{kind}" {of1}/>
<geom size=".1" mass="1"/><body name="b2" pos="0 0 1"><joint name="j2" axis="0 1 0" {of2}/>
<geom size=".1" pos="0 0 .5" mass="1"/></body></body></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("quantity", "own", "other"),
    [
        ("limits", 'limited="true" range="-1e9 1e9"', 'limited="true" range="-{} .4"'),
        ("armature", 'armature="1e6"', 'armature="{}"'), ("damping", 'damping="1e6"', 'damping="{}"'),
    ],
)  # fmt: skip
def test_a_large_number_of_one_joint_hides_no_difference_of_another(
    quantity: str, own: str, other: str, tmp_path: Path
) -> None:
    here, there = (TWO.format(kind="slide", of1=own, of2=other.format(x)) for x in (0.2, 0.0035))
    assert rows_of(tmp_path / "two.xml", "mujoco", here, there)[quantity] == WRONG


def test_a_mass_far_out_hides_no_force_of_an_actuator(tmp_path: Path) -> None:
    """Its bias is 1e18 N m, of which a force of 3 N m is no digit."""
    far = '<inertial pos="0 0 1e9" mass="1" diaginertia=".1 .1 .1"/>'
    here, there = (
        TWO.format(kind="slide", of1="", of2="").replace('<geom size=".1" pos="0 0 .5" mass="1"/>', far).replace(
            "</worldbody>", f'</worldbody><actuator><position joint="j2" kp="10" kv="{kv}" gear="3"/></actuator>')
        for kv in (1, 1.01)
    )  # fmt: skip
    assert rows_of(tmp_path / "two.xml", "mujoco", here, here)["actuators"] == OK
    assert rows_of(tmp_path / "two.xml", "mujoco", here, there)["actuators"] == WRONG


def test_a_ball_joint_has_a_bound_that_is_compared(tmp_path: Path) -> None:
    here, there = (TWO.format(kind="ball", of1=of, of2="") for of in ('limited="true" range="0 40"', ""))
    assert rows_of(tmp_path / "ball.xml", "mujoco", here, there)["limits"] == WRONG


@pytest.mark.parametrize("line", ["warning: the attribute 'inertiagrouprange' will be ignored.", "ranges are here"])
def test_a_warning_of_something_else_excuses_nothing(line: str) -> None:
    assert Said([line], {}, set()).excuse(WORDS["limits"], {"j2"}) == ""
    assert Said(["warning: the attribute 'range' is ignored."], {}, set()).excuse(WORDS["limits"], {"j2"})


def test_what_is_asked_to_be_written_changes_no_verdict(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(ARM.replace("<worldbody>", '<compiler settotalmass="6"/><worldbody>'))
    plain = run(["audit", str(path), "-e", "pinocchio", "-e", "mujoco"], capsys)[0]
    for more in (["--explain"], ["--sarif", str(tmp_path / "s")], ["--markdown", str(tmp_path / "m")]):
        assert run(["audit", str(path), "-e", "pinocchio", "-e", "mujoco", *more], capsys)[0] == plain


@pytest.mark.parametrize("words", [["--fix", "/proc/x.xml"], ["--time-limit", "nan"]])
def test_what_cannot_be_is_a_sentence(words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    assert run(["audit", str(path), "-e", "mujoco", *words], capsys)[0] == 2


def test_an_interpreter_that_cannot_start_is_a_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("CROSSBODY_PYTHON_PINOCCHIO", "/nope/python")
    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    code, out, _ = run(["audit", str(path), "-e", "pinocchio", "-e", "mujoco"], capsys)
    assert code == 1
    assert "/nope/python cannot be started" in " ".join(out.split())


def test_json_of_a_file_that_is_fixed_is_one_document(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    _, out, _ = run(["audit", str(path), "-e", "mujoco", "--json", "--fix", str(tmp_path / "plain.xml")], capsys)
    assert json.loads(out)


def test_shapes_that_may_touch_by_either_mask_or_a_pair_of_their_own_are_compared(tmp_path: Path) -> None:
    geoms = {  # contype, conaffinity
        "meets": (1, 0), "met": (0, 2), "both": (3, 1), "paired": (0, 0), "pairing": (0, 0), "ghost": (0, 0),
    }  # fmt: skip
    bodies = "".join(
        f'<body pos="{i} 0 1"><joint type="slide"/>'
        f'<geom name="{name}" size=".1" contype="{a}" conaffinity="{b}"/></body>'
        for i, (name, (a, b)) in enumerate(geoms.items())
    )
    pair = '<contact><pair geom1="paired" geom2="pairing"/></contact>'
    path = tmp_path / "robot.xml"
    path.write_text(f"<mujoco><worldbody>{bodies}</worldbody>{pair}</mujoco>")
    assert {shape[0] for shape in opened(path).wanted["shapes"]} == geoms.keys() - {"ghost"}
