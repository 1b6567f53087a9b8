"""The page: every figure is there with its units, thinning keeps what matters, nothing is fetched from outside."""

from __future__ import annotations

import base64
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from crossbody.cases import OutputError, load
from crossbody.reports import figures, page, study
from crossbody.reports.bench import observed_order
from crossbody.reports.comparison import Entry
from crossbody.reports.jobs import CaseResult
from crossbody.reports.output import folder
from crossbody.reports.thin import keep
from crossbody.reports.truth import truth_of


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    case = load("bouncing_ball", "linear")
    truth = truth_of(case)
    off = replace(truth.trajectory, q=truth.trajectory.q + 1e-6)
    entries = (
        Entry(engine="fake", profile="<b>off</b>", run=off, settings={"dt": 1e-3}),
        Entry(engine="absent", profile="*", skipped="It is not installed."),
    )
    results = [CaseResult(case=case, truth=truth, entries=entries)]
    path = tmp_path_factory.mktemp("page") / "out"
    with folder(path) as made:
        study.write(made, results, study.judge(results, {case.label: "crossbody run"}), {"command": "test", "time": ""})
        page.write(made)
    return path


class Tags(HTMLParser):
    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))


def plots(out: Path) -> dict[str, dict]:
    text = (out / "index.html").read_text()
    found = re.findall(r'<script type="application/json" data-plot="([^"]+)">(.*?)</script>', text, re.DOTALL)
    return {name: json.loads(content) for name, content in found}


def test_every_figure_is_there_and_has_data(out: Path) -> None:
    found = plots(out)
    assert set(found) == {f"bouncing-ball-linear-{name}" for name in figures.FIGURES}
    for name, figure in found.items():
        assert figure["data"], name


def test_every_axis_has_its_unit(out: Path) -> None:
    for name, figure in plots(out).items():
        axes = {k: v for k, v in figure["layout"].items() if re.fullmatch(r"[xy]axis\d*", k)}
        titled = [axis["title"]["text"] for axis in axes.values() if "title" in axis]
        hidden = [k for k, axis in axes.items() if "title" not in axis and axis.get("showticklabels") is not False]
        assert titled
        assert not hidden, f"{name}: {hidden} has no title"
        assert all(re.search(r"\[.+\]", text) for text in titled), titled


def test_nothing_is_fetched_from_outside(out: Path) -> None:
    text = (out / "index.html").read_text()
    for tag, attributes in Tags(text).found:
        for key in ("src", "href"):
            value = attributes.get(key)
            assert value is None or value.startswith(("#", "data:")) or value == page.SCRIPT, (tag, value)
    assert not re.search(r"https?://", text)
    assert not re.search(r"@import|url\(", text)
    assert (out / page.SCRIPT).stat().st_size > 1e6


def test_names_are_escaped(out: Path) -> None:
    text = (out / "index.html").read_text()
    assert "<b>off</b>" not in text
    assert "&lt;b&gt;off&lt;/b&gt;" in text


def test_the_verdict_table_comes_first_and_is_complete(out: Path) -> None:
    text = (out / "index.html").read_text()
    assert text.index('id="verdict-table"') < text.index("<figure>")
    rows = json.loads((out / "verdicts.json").read_text())["rows"]
    assert text.count("<tr data-verdict=") == len(rows)
    assert "It is not installed." in text


def test_difference_to_the_truth_is_what_was_put_in(out: Path) -> None:
    motion = plots(out)["bouncing-ball-linear-motion"]
    coded = [trace["y"] for trace in motion["data"] if trace["yaxis"] == "y2"]
    apart = [np.frombuffer(base64.b64decode(y["bdata"]), dtype=y["dtype"]) for y in coded]
    assert len(apart) == 1
    assert np.allclose(apart[0], 1e-6, rtol=1e-6)


def test_a_folder_without_a_study_is_told(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="was not written by crossbody"):
        page.write(tmp_path)


def test_thinning_keeps_spikes_and_all_samples_around_events() -> None:
    t = np.linspace(0.0, 1.0, 100_001)
    y = np.sin(7 * t)
    y[31_415] = 40.0
    kept = keep(t, y, np.array([0.25]), points=500)
    assert len(kept) < 600
    assert 31_415 in kept
    event = np.searchsorted(t, 0.25)
    assert set(range(event - 5, event + 6)) <= set(kept)
    assert kept[0] == 0
    assert kept[-1] == len(t) - 1


def test_thinning_leaves_short_signals_alone() -> None:
    t = np.linspace(0, 1, 50)
    assert np.array_equal(keep(t, t, np.zeros(0)), np.arange(50))


@pytest.mark.parametrize("order", [1.0, 4.0, 8.0])
def test_observed_order_is_the_slope(order: float) -> None:
    steps = np.array([0.4, 0.2, 0.1, 0.05])
    assert observed_order(steps, 3.0 * steps**order) == pytest.approx(order, rel=1e-9)
    assert np.isnan(observed_order(steps, [np.inf, np.nan, 1e-3, 1e-4]))
