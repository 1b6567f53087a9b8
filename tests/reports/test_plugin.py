"""The pytest plugin as a user meets it: pytest in a process and a folder of its own."""

from __future__ import annotations

import os
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from places import OWN
from robot_readers import ARM

pytest_plugins = ["pytester"]

REFERENCE = ("--crossbody-engine", "reference:compiled")
HEAVY = ("numpy", "pandas", "numba", "scipy", "mujoco", "pinocchio", "plotly", "pyarrow", "sksundae", "click", "rich")


CACHE = (
    os.environ.get("CROSSBODY_CACHE") or Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "crossbody"
)


@pytest.fixture(autouse=True)
def _compiled_once(monkeypatch: pytest.MonkeyPatch, pytester: pytest.Pytester) -> None:
    # pytester moves the home folder, and with it the place of compiled code.
    monkeypatch.setenv("CROSSBODY_CACHE", str(CACHE))


def run(pytester: pytest.Pytester, *arguments: str) -> pytest.RunResult:
    return pytester.runpytest_subprocess("-p", "no:cacheprovider", "-ra", *arguments)


def test_an_unrelated_run_imports_nothing_of_ours_but_the_plugin(pytester: pytest.Pytester) -> None:
    pytester.makeconftest(
        f"""
        import sys

        def pytest_unconfigure(config):
            heavy = [name for name in {HEAVY!r} if name in sys.modules]
            ours = sorted(name for name in sys.modules if name.startswith("crossbody."))
            print("heavy:", *heavy)
            print("ours:", *ours)
        """
    )
    pytester.makepyfile("def test_nothing(): pass")
    done = run(pytester, "-s")
    done.assert_outcomes(passed=1)
    done.stdout.fnmatch_lines(
        ["heavy:", "ours: crossbody.reports crossbody.reports.testing crossbody.reports.testing.plugin"]
    )


def test_one_test_for_every_limit_of_a_case_file_elsewhere(pytester: pytest.Pytester) -> None:
    done = run(pytester, "--crossbody-case", f"{OWN}:right", *REFERENCE, "-v", "--junitxml=found.xml")
    names = (
        "finished", "audit", "truth", "contacts", "start_error", "position", "velocity", "energy_drift",
        "energy_integrator", "energy_residual", "rate_residual",
    )  # fmt: skip
    done.assert_outcomes(passed=len(names))
    done.stdout.fnmatch_lines([f"crossbody::own_case:right::reference:compiled::{name} PASSED*" for name in names])
    tests = ET.parse(pytester.path / "found.xml").iter("testcase")
    told = {test.get("name"): {p.get("name"): p.get("value") for p in test.iter("property")} for test in tests}
    assert set(told) == set(names)
    position = told["position"]
    assert position["verdict"] == "within"
    assert 0.0 < float(position["value"] or "nan") < float(position["limit"] or "nan") == 1e-6
    assert position["engine"] == "reference"
    assert position["command"] == f"crossbody run {OWN} --variant right --engine reference:compiled"


def test_outside_fails_with_the_numbers_and_the_command(pytester: pytest.Pytester) -> None:
    done = run(pytester, "--crossbody-case", f"{OWN}:wrong", *REFERENCE)
    assert done.parseoutcomes()["failed"] >= 3, "position, velocity, and the truth itself"
    done.stdout.fnmatch_lines_random(["truth is *, limit *"])
    done.stdout.fnmatch_lines(
        ["position is 0.0*, limit 1e-06. tolerance", f"crossbody run {OWN} --variant wrong --engine reference:compiled"]
    )
    assert "Traceback" not in done.stdout.str()
    assert "_items.py" not in done.stdout.str()
    assert done.ret == 1


def test_known_is_an_xfail_absent_and_unsupported_are_skips_and_k_chooses(pytester: pytest.Pytester) -> None:
    pytester.makeconftest("import sys\nsys.modules['pinocchio'] = None")
    engines = [
        word for name in ("reference:compiled", "mujoco:matched", "pinocchio") for word in (*REFERENCE[:1], name)
    ]
    done = run(pytester, "--crossbody-case", f"{OWN}:known", *engines, "-k", "position or pinocchio or matched")
    done.assert_outcomes(xfailed=1, skipped=12, deselected=10)
    done.stdout.fnmatch_lines_random(
        [
            "XFAIL *position is 0.0*, limit 1e-06. The frequency of this closed form is known to be off.",
            "SKIPPED [[]1[]] *Engine 'pinocchio' needs the package 'pinocchio', which is not installed*",
            "SKIPPED [[]11[]] *MuJoCo has no model of the mechanism*",
        ]
    )


def test_fixtures_are_parametrised_over_what_the_configuration_asks_for(pytester: pytest.Pytester) -> None:
    pytester.makeini(
        f"[pytest]\ncrossbody_cases = {OWN}:right\ncrossbody_engines =\n  reference:compiled\n  reference:cvode"
    )
    pytester.makepyfile(
        test_mine="""
        import pytest
        from crossbody.reports.testing import assert_agrees, assert_energy

        def test_run(crossbody_case, crossbody_run, crossbody_truth):
            assert_energy(crossbody_run)
            assert_agrees(crossbody_run, crossbody_truth, rtol=1e-5)

        def test_engine(crossbody_case, crossbody_engine):
            loose = crossbody_engine.prepare(crossbody_case, rtol=1e-3)
            with pytest.raises(AssertionError, match="is off first at t = "):
                assert_agrees(loose, crossbody_engine.prepare(crossbody_case, rtol=1e-11), rtol=1e-12)

        def test_verdicts(crossbody_verdicts):
            assert crossbody_verdicts["position"].verdict == "within"

        @pytest.mark.crossbody("bouncing_ball:linear", engines=["reference:compiled"])
        def test_marked(crossbody_case, crossbody_engine):
            assert crossbody_case.label == "bouncing_ball:linear"
            assert (crossbody_engine.engine, crossbody_engine.profile) == ("reference", "compiled")
        """
    )
    done = run(pytester, "-v", "--strict-markers")
    done.assert_outcomes(passed=7 + 22)
    done.stdout.fnmatch_lines_random(
        [
            "test_mine.py::test_run[[]own_case:right-reference:cvode[]] PASSED*",
            "test_mine.py::test_marked[[]bouncing_ball:linear-reference:compiled[]] PASSED*",
        ]
    )


BASELINE = """
import os
import pytest

@pytest.mark.parametrize("name", ["a", "../b"])
def test_numbers(crossbody_baseline, name):
    crossbody_baseline.check({"drift": float(os.environ["DRIFT"]), "shift": float("nan")}, rtol=1e-3)
"""


def test_baselines_are_written_when_asked_and_compared_else(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytester.makepyfile(test_kept=BASELINE)
    monkeypatch.setenv("DRIFT", "1e-7")
    done = run(pytester)
    done.assert_outcomes(failed=2)
    done.stdout.fnmatch_lines(["*There is no baseline *: run once with --crossbody-update and commit it."])
    run(pytester, "--crossbody-update").assert_outcomes(passed=2)
    kept = sorted(path.name for path in (pytester.path / "baselines" / "test_kept").iterdir())
    assert len(kept) == 2
    assert "test_numbers[a].json" in kept
    monkeypatch.setenv("DRIFT", "1.0005e-7")
    run(pytester).assert_outcomes(passed=2)
    monkeypatch.setenv("DRIFT", "2e-7")
    done = run(pytester)
    done.assert_outcomes(failed=2)
    done.stdout.fnmatch_lines(["*drift was 1e-07 and is 2e-07, a difference of 1e-07."])


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--crossbody-case", "bouncing_bal"), "*There is no case 'bouncing_bal'. Did you mean 'bouncing_ball'?*"),
        (("--crossbody-case", "bouncing_ball:nope"), "*There is no variant 'nope' of bouncing_ball.*listing*"),
        (("--crossbody-case", "gone/case.py"), "*There is no case file '*"),
        (("--crossbody-case", str(OWN), "--crossbody-engine", "nope"), "*There is no engine 'nope'.*reference*"),
    ],
)
def test_wrong_use_is_one_sentence(pytester: pytest.Pytester, arguments: tuple[str, ...], says: str) -> None:
    done = run(pytester, *arguments)
    done.stdout.fnmatch_lines([says])
    assert "Traceback" not in done.stdout.str()
    assert done.ret == pytest.ExitCode.INTERRUPTED


def test_a_fixture_without_a_case_says_how_to_name_one(pytester: pytest.Pytester) -> None:
    pytester.makepyfile("def test_mine(crossbody_case): pass")
    done = run(pytester)
    done.assert_outcomes(skipped=1)
    done.stdout.fnmatch_lines(["*No case is named: use --crossbody-case CASE*"])


ENTRIES = """[crossbody.cases]
their_case = theirs
[crossbody.engines]
their_engine = their_engines
absent_engine = needs_nothing_known
[crossbody.reports.metrics]
their_metric = their_metrics
[crossbody.hw.formats]
their_format = theirs
"""
ENGINE = """
from crossbody.engines import load
ENGINE = load("reference")
"""
METRIC = '''
"""Where it ends."""
UNIT, CLAIMED = "m", False
def measure(truth, run, case):
    return float(run.q[-1, 0])
'''


def test_plug_ins_of_another_distribution_are_found_by_their_entry_points(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    about = pytester.mkdir("theirs-1.0.dist-info")
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: theirs\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(ENTRIES)
    pytester.makepyfile(theirs=OWN.read_text(), their_engines=ENGINE, their_metrics=METRIC)
    pytester.makepyfile(needs_nothing_known="import no_such_package")
    pytester.makepyfile(
        test_mine="""
        import pytest
        from crossbody import engines
        from crossbody.cases import EngineUnavailable
        from crossbody.hw import formats

        @pytest.mark.crossbody("their_case:right", engines=["their_engine:compiled"])
        def test_named(crossbody_verdicts):
            assert crossbody_verdicts["their_metric"].unit == "m"
            assert "their_format" in formats.names()
            with pytest.raises(EngineUnavailable, match="install it with: pip install 'no_such_package'"):
                engines.load("absent_engine")
        """
    )
    monkeypatch.setenv("PYTHONPATH", str(pytester.path))
    done = run(pytester, "--crossbody-case", "their_case:right", *REFERENCE, "-k", "position or named")
    done.assert_outcomes(passed=2, deselected=10)


def test_where_no_distribution_names_plug_ins_none_is_read() -> None:
    code = (
        "import sys; sys.modules.pop('importlib.metadata', None); from crossbody.cases import installed;"
        " print(installed.modules('crossbody.cases'), 'importlib.metadata' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["{}", "False"]


@pytest.mark.parametrize("by", ["option", "configuration"])
def test_plug_ins_are_files_too(pytester: pytest.Pytester, by: str) -> None:
    pytester.makepyfile(their_case=OWN.read_text(), their_engine=ENGINE, their_metric=METRIC)
    files = ["their_case.py", "their_engine.py", "their_metric.py"]
    words = [word for file in files for word in ("--crossbody-plugin", file)] if by == "option" else []
    if not words:
        pytester.makepyprojecttoml(f"[tool.crossbody]\nplugins = {files}\n[tool.pytest.ini_options]\n")
    named = ("--crossbody-case", "their_case:right", "--crossbody-engine", "their_engine:compiled")
    done = run(pytester, *words, *named, "-k", "position or finished")
    done.assert_outcomes(passed=2, deselected=9)


def test_a_plug_in_that_is_not_there_is_wrong_use(pytester: pytest.Pytester) -> None:
    done = run(pytester, "--crossbody-plugin", "absent.py")
    done.stderr.fnmatch_lines(["ERROR: There is no plug-in file '*absent.py'; there is no other [*].py in its folder."])
    assert done.ret == pytest.ExitCode.USAGE_ERROR


def test_what_is_wrong_in_a_file_is_a_sentence(pytester: pytest.Pytester) -> None:
    raising = OWN.read_text().replace("    known =", "    raise LookupError('own')\n    known =", 1)
    pytester.makepyfile(mine=raising, wrong=f"{METRIC}\nUNIT = 3\n")
    done = run(pytester, "--crossbody-case", "mine.py:right")
    done.stdout.fnmatch_lines(["*The case file *mine.py raises LookupError (own) in line *"])
    assert "Traceback" not in done.stdout.str()
    done = run(pytester, "--crossbody-plugin", "wrong.py")
    done.stderr.fnmatch_lines(["ERROR: The metric file *wrong.py: UNIT is 3; valid: a text*"])
    assert done.ret == pytest.ExitCode.USAGE_ERROR


def test_a_robot_file_of_the_configuration_is_found_from_a_folder_below(pytester: pytest.Pytester) -> None:
    pytester.makefile(".xml", arm=ARM)
    pytester.makeini("[pytest]\ncrossbody_cases = arm.xml\ncrossbody_engines = reference:compiled\n")
    os.chdir(pytester.mkdir("below"))
    done = run(pytester, "--rootdir", str(pytester.path), "-c", str(pytester.path / "tox.ini"), "--co", "-q")
    done.stdout.fnmatch_lines(["*arm:reference::reference:compiled::position*"])
