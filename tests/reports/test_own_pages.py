"""What cannot be shown is a fault of crossbody's own (exit code 3), unless somebody else had a hand in it."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path
from typing import Any, NoReturn

import pandas as pd
import pytest
from jinja2 import TemplateError

from crossbody.cases import InvalidValue, OutputError, load
from crossbody.cases.errors import OwnFault
from crossbody.reports import sections
from crossbody.reports.cli import main
from crossbody.reports.judging.run_verdicts import Entry
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.pages import case_page, index_page, results, site
from crossbody.reports.runs import study
from crossbody.reports.runs.jobs import CaseResult
from crossbody.reports.runs.output import folder
from crossbody.reports.runs.provenance import provenance

PLACES = [
    (case_page, "playback"), (case_page, "friction"), (case_page, "precision"), (case_page, "hysteresis"),
    (case_page, "sentence"), (case_page.figures, "plots"), (case_page.grid, "of_case"), (site, "index_pages"),
    (index_page, "sketched"), (site, "render"), (site, "_links"), (results, "check_fields"), (results, "engines_of"),
]  # fmt: skip
"""Of what pages of a run are made, and what reads their tables."""
KINDS = [
    KeyError("k"), ValueError("v"), ZeroDivisionError("z"), IndexError("i"), TypeError("t"), RuntimeError("r"),
    TemplateError("j"), AssertionError("a"), InvalidValue("w"), OutputError("o"),
]  # fmt: skip


@pytest.fixture(scope="module")
def result() -> CaseResult:
    case = load("bouncing_ball", "linear")
    truth = truth_of(case)
    return CaseResult(case=case, truth=truth, entries=(Entry(engine="fake", profile="p", run=truth.trajectory),))


def write(out: Path, result: CaseResult, **tables: pd.DataFrame) -> Path:
    """Write a run and its pages, with tables of studies."""
    told = provenance("crossbody run")
    with folder(out, "run") as made:
        study.write(made, [result], study.judge([result], {result.case.label: "crossbody run"}), told)
        for name, rows in tables.items():
            study.write_table(made / name, rows, told)
        site.write(made)
    return out


def raising(error: Exception) -> Any:
    def fails(*_given: Any, **_more: Any) -> NoReturn:
        raise error

    return fails


RAISED = [(*place, KINDS[i % len(KINDS)]) for i, place in enumerate(PLACES)]
RAISED += [(case_page, "precision", kind) for kind in KINDS]


@pytest.mark.parametrize(("module", "name", "error"), RAISED, ids=[f"{name} {kind!r}" for _, name, kind in RAISED])
def test_pages_of_what_was_just_written_cannot_be_the_users_fault(
    module: Any, name: str, error: Exception, tmp_path: Path, result: CaseResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, name, raising(error))
    with pytest.raises((OwnFault, RuntimeError, AssertionError)) as caught:
        write(tmp_path / "out", result)
    assert str(error) in str(caught.value)
    assert not (tmp_path / "out" / "index.html").exists()


def test_a_report_of_what_nobody_has_changed_cannot_either(
    tmp_path: Path, result: CaseResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = write(tmp_path / "out", result)
    for name, error in zip(("precision", "playback", "friction"), KINDS, strict=False):
        monkeypatch.setattr(case_page, name, raising(error))
        with pytest.raises(SystemExit) as end:
            main(["report", str(out)])
        assert end.value.code == 3
        monkeypatch.undo()


@pytest.mark.parametrize("name", sections.names())
def test_sections_of_studies_that_were_just_written_cannot_either(
    name: str, tmp_path: Path, result: CaseResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = pd.DataFrame({"case": ["bouncing_ball"], "n": [3]})
    error = KINDS[sections.names().index(name) % 5]
    monkeypatch.setattr(sections, "load", lambda _: type("Study", (), {"TITLE": "t", "sections": raising(error)}))
    with pytest.raises(OwnFault, match=re.escape(str(error))):
        write(tmp_path / "out", result, **{name: rows})


def test_what_somebody_else_changed_is_theirs(
    tmp_path: Path, result: CaseResult, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Whatever file it is: a page that cannot be made of it is a sentence, with exit code 2."""
    whole = write(tmp_path / "whole", result)
    monkeypatch.setattr(case_page, "precision", raising(KeyError("k")))
    for name in ("verdicts.json", "audit.json", "provenance.json", "traces/0001.parquet"):
        out = Path(shutil.copytree(whole, tmp_path / name.replace("/", "-")))
        if name.endswith(".json"):
            (out / name).write_text(json.dumps(json.loads((out / name).read_text())))
        else:
            shutil.copy(out / "traces" / "0000.parquet", out / name)
        with pytest.raises(SystemExit) as end:
            main(["report", str(out)])
        assert end.value.code == 2
        assert "cannot be shown" in capsys.readouterr().err
