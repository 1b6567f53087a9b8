"""The page of a log beside its predictions: it is a measurement, and calls itself one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from study_pages import commands
from unpacked import numbers

from crossbody.cases import Tier
from crossbody.reports.cli import main
from crossbody.reports.pages import case_page, figures
from crossbody.reports.pages.results import Results, read
from crossbody.reports.runs.study import read_json
from crossbody.reports.sections import replay


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Results:
    path = tmp_path_factory.mktemp("identified")
    with pytest.raises(SystemExit) as end:
        main(["identify", *commands(path)["identify"], "--quiet", "--out", str(path / "out")])
    assert not end.value.code
    return read(path / "out")


def test_a_log_is_measured_and_no_truth(found: Results) -> None:
    (case,) = found.cases
    page = case_page.case_page(found, case)
    assert page.about.endswith("Compared with measurement.")
    assert page.sources.startswith("measurement (")
    assert page.sources.endswith("rig.csv).")
    assert [one["shown"] for one in page.engines] == ["measured", "reference:compiled"]
    names = [section.name for section in page.sections]
    assert "audit" not in names, "nothing is audited where a log leads"
    assert page.sections[names.index("verdicts")].context["truths"] == "m: measurement"
    (motion,) = (section for section in page.sections if section.name == "motion")
    said = motion.text + motion.plots[0].figure["layout"]["title"]["text"]
    assert not any(word in said for word in ("truth", "mpact"))
    assert {line["name"] for line in motion.plots[0].figure["data"]} == {"measured", "reference:compiled"}


def test_a_difference_that_no_sensor_resolves_takes_no_room(found: Results) -> None:
    """Every window starts where the measurement is."""
    traces = found.cases[0].traces()
    below = [line for line in figures.motion(traces)["data"] if line["yaxis"] == "y2"]
    assert below
    for line in below:
        assert np.nanmin(numbers(line["y"])) > 1e-8 * np.abs(traces[0].run.q).max()


@pytest.mark.parametrize("tier", Tier)
def test_a_truth_is_named_in_plain_words_and_by_its_letter(tier: Tier) -> None:
    about, sources = case_page._about({"title": "a ball.", "tier": tier.value, "source": "two that agree."})
    assert about == f"A ball. Compared with {case_page.PLAINLY[tier]}."
    assert sources == f"Truth {tier.value[0]}: {tier.value[2:]} (two that agree)."


def test_provenance_has_a_line_for_every_fact_and_none_for_nothing(found: Results) -> None:
    rows = {row["key"]: row["value"] for row in case_page.provenance(found.told).tables[0].rows}
    assert rows["log: file"].endswith("rig.csv")
    assert len(rows["log: sha256"]) == 64
    assert "," in rows["versions"]
    assert not {"None", "[]", "{}", "False", ""} & set(rows.values())


def test_a_limit_of_a_replay_is_said_as_it_was_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["replay", *commands(tmp_path)["replay"], "--limit", "fit=99.5", "--limit", "rmse_th1=1e-6"]
    with pytest.raises(SystemExit) as end:
        main([*asked, "--out", str(tmp_path / "out")])
    assert end.value.code == 1
    said = capsys.readouterr().out
    (section,) = (one for one in replay.sections(tmp_path / "out") if one.name == "replay")
    valid = {row["metric"]: row["valid"] for row in section.tables[0].rows if row["valid"]}
    assert valid == {"fit": "at least 99.5", "rmse": "at most 1e-06"}
    for words in valid.values():
        assert f"valid: {words}. Asked for by --limit." in " ".join(said.split())
        assert f"({words})" in section.says


def test_what_is_judged_of_a_replay_comes_first_and_all_else_is_folded(tmp_path: Path) -> None:
    for limits, wanted in (((), []), (("fit=99.5", "rmse=1e9"), ["outside", "within"])):
        given = [word for limit in limits for word in ("--limit", limit)]
        with pytest.raises(SystemExit):
            main(["replay", *commands(tmp_path)["replay"], *given, "-q", "--out", str(tmp_path / "out")])
        (section,) = (one for one in replay.sections(tmp_path / "out") if one.name == "replay")
        judged = [table for table in section.tables if not table.folded]
        assert [row["verdict"] for table in judged for row in table.rows] == wanted
        (rest,) = (table for table in section.tables if table.folded)
        assert "rmse" in {row["metric"] for table in section.tables for row in table.rows}
        assert not {"within", "outside"} & {row["verdict"] for row in rest.rows}


def test_identify_says_first_what_it_found_and_what_of_the_log_it_left_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        main(["identify", *commands(tmp_path)["identify"], "--hold", "0", "--out", str(tmp_path / "out")])
    said = " ".join(capsys.readouterr().out.split())
    first = said.partition(" is identified" if " is identified" in said else " are identified")[0]
    assert len(first.split()) <= 4, "a sentence begins"
    assert "left out of the fit: nothing shows whether it holds on others." in said
    assert said.index("measurement: ") < said.index("name value")
    for row in replay_findings(tmp_path / "out"):
        assert row in said


def replay_findings(out: Path) -> list[str]:
    """What the checks of the log of a folder found."""
    return [
        " ".join(row["text"].split()) for row in read_json(out / "findings.json")["rows"] if row["what"] != "repair"
    ]
