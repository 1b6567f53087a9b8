"""The pages: every figure is there with its units, thinning keeps what matters, nothing is fetched from outside."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from html import escape, unescape
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import unquote

import numpy as np
import plotly.graph_objects as go
import pytest
from jinja2 import Environment, FileSystemLoader
from ladder import ladder
from unpacked import numbers, value_of, whole

from crossbody import engines
from crossbody.cases import CrossbodyError, OutputError, load
from crossbody.reports.bench.order import observed_order
from crossbody.reports.figures.section import Kind, Plot, Section, Table, columns
from crossbody.reports.figures.styles import LOOKS, look, style
from crossbody.reports.judging.clocks import Clock
from crossbody.reports.judging.run_verdicts import Entry
from crossbody.reports.judging.told import QUANTITIES, share
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.judging.verdict import LACKS, Row, Verdict, Word
from crossbody.reports.pages import figures, grid, html, precision, site
from crossbody.reports.pages.filled import filled
from crossbody.reports.pages.html import KeptTemplates, Page, plot
from crossbody.reports.runs import study
from crossbody.reports.runs.files import file_name
from crossbody.reports.runs.jobs import CaseResult
from crossbody.reports.runs.output import folder
from crossbody.reports.runs.store import Trace
from crossbody.reports.runs.thin import keep

HOSTILE = "<script>alert(1)</script>"
LIMIT = 0.8e6
"""Largest page of a case beside the shared script, bytes."""


def made(path: Path, results: Sequence[CaseResult], rows: Sequence[Row] | None = None) -> Path:
    commands = {result.case.label: f"crossbody run {result.case.name}" for result in results}
    told = {"command": f"crossbody run {HOSTILE}", "time": "", "versions": {"crossbody": "0.0.1"}}
    with folder(path) as out:
        study.write(out, results, study.judge(results, commands) if rows is None else rows, told)
        site.write(out)
    return path


@pytest.fixture(scope="module")
def result() -> CaseResult:
    case = load("bouncing_ball", "linear")
    truth = truth_of(case)
    off = replace(truth.trajectory, q=truth.trajectory.q + 1e-6, wall_s=2e-3)
    entries = (
        Entry(engine="fake", profile=HOSTILE, run=off, settings={"dt": 1e-3}),
        Entry(engine="absent", profile="*", skipped="It is not installed."),
    )
    return CaseResult(case=case, truth=truth, entries=entries)


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory, result: CaseResult) -> Path:
    return made(tmp_path_factory.mktemp("page") / "out", [result])


CASE = "case-bouncing_ball.linear.html"


class Tags(HTMLParser):
    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))


def all_plots(page: Path) -> dict[str, dict]:
    found = re.findall(r'<script type="text/plain" data-plot="([^"]+)">(.*?)</script>', page.read_text(), re.DOTALL)
    return {name.partition("--plot-")[2]: value_of(content) for name, content in found}


def plots(out: Path) -> dict[str, dict]:
    return all_plots(out / CASE)


def test_every_figure_is_there_and_has_data(out: Path) -> None:
    found = plots(out)
    assert set(found) == {*figures.FIGURES, "hysteresis", "precision"} - {"inputs"}  # nothing drives a ball
    for name, figure in found.items():
        assert figure["data"], name


def test_a_window_is_named_by_the_cases_and_the_verdict(out: Path, tmp_path: Path) -> None:
    def title(page: Path) -> str:
        return unescape(re.findall("<title>(.*?)</title>", page.read_text())[0])

    assert title(out / "index.html") == title(out / CASE) == "bouncing_ball:linear: 1 outside · crossbody"
    many = made(tmp_path / "many", [], fake_rows(4))
    assert title(many / "index.html") == "case 0, case 1 and 2 more: all within · crossbody"


def test_engines_that_did_not_run_have_no_column_on_the_page_of_the_case(out: Path) -> None:
    def named(page: str) -> list[str]:
        heads = [attrs["data-name"] for tag, attrs in Tags((out / page).read_text()).found if "data-name" in attrs]
        return [name for name in heads if name and ":" in name]

    assert f"fake:{HOSTILE}" in named(CASE)
    assert "absent:*" not in named(CASE)
    assert "absent:*" not in named("index.html")
    assert "Run on no case: absent:*." in (out / "index.html").read_text()


@pytest.mark.parametrize("seed", range(3))
def test_an_engine_has_one_colour_on_all_pages(seed: int, result: CaseResult, tmp_path: Path) -> None:
    """Cases have some engines each, and some of these have no run time, so no mark in the plot of run times."""
    rng = np.random.default_rng(seed)
    names = [f"p{k}" for k in range(6)]
    run = replace(result.truth.trajectory, q=result.truth.trajectory.q + 1e-9)
    results = [
        replace(result, case=replace(result.case, name=f"case{k}"), entries=tuple(
            Entry(engine="fake", profile=name, run=replace(run, wall_s=rng.choice([0.0, 1.0])))
            for name in rng.permutation(names)[:3]
        )) for k in range(4)
    ]  # fmt: skip
    seen: dict[str, set[str]] = {}
    for page in made(tmp_path / "out", results).glob("*.html"):
        for figure in all_plots(page).values():
            for line in (line for line in figure["data"] if "meta" in line and line["type"] == "scatter"):
                seen.setdefault(line["meta"], set()).add(line.get("line", line.get("marker"))["color"])
    assert set(seen) == {"truth", *(f"fake:{entry.profile}" for one in results for entry in one.entries)}
    assert all(len(colours) == 1 for colours in seen.values())
    assert len(set.union(*seen.values())) == len(seen)


@pytest.mark.parametrize("seed", range(5))
def test_what_is_left_before_an_event_does_not_stretch_the_plot_of_steps(seed: int, result: CaseResult) -> None:
    """Steps of a collision are drawn; one in a thousand that is left over is not."""
    draw = np.random.default_rng(seed)
    lengths = 10.0 ** draw.uniform(-6.0, -3.0, 1000)
    lengths[draw.integers(1000)] = 1e-16
    truth = result.truth.trajectory
    about = study.traces(result)[0].about | {"steps": [np.cumsum(lengths).tolist(), lengths.tolist()]}
    low, high = figures.steps([Trace(about=about, run=truth)])["layout"]["yaxis"]["range"]
    assert -7.0 < low < -5.0
    assert -3.0 < high < -2.0


def test_work_of_contacts_that_is_rounding_is_not_drawn(result: CaseResult) -> None:
    trace = Trace(about={"engine": "truth", "profile": ""}, run=result.entries[0].run)  # type: ignore[arg-type]
    ledger = trace.run.ledger
    assert ledger is not None
    small = 1e-18 * np.sin(np.arange(len(ledger.contact)))[:, None] * float(np.abs(trace.run.energy).max())
    drawn = figures.energy([replace(trace, run=replace(trace.run, ledger=replace(ledger, contact=small)))])
    assert "work of contacts" in drawn["layout"]["title"]["text"]  # empty and left out


def test_without_a_force_no_work_of_contacts_is_drawn(result: CaseResult) -> None:
    trace = study.traces(result)[0]
    assert trace.run.ledger is not None
    still = replace(trace.run.ledger, contact=0.0 * trace.run.ledger.contact)
    titles = [
        figures.energy([replace(trace, run=replace(trace.run, ledger=ledger))])["layout"]["title"]["text"]
        for ledger in (trace.run.ledger, still)
    ]
    assert ["work of contacts" in title for title in titles] == [False, True]


def test_numbers_and_their_heads_end_at_the_same_side(out: Path) -> None:
    compared = 0
    for page in every(out):
        for table in re.findall(r"<table data-csv.*?</table>", page.read_text(), re.DOTALL):
            head, _, body = table.partition("<tbody>")
            sides = [
                ["num" in (attrs.get("class") or "").split() for name, attrs in Tags(part).found if name == tag]
                for part, tag in ((head, "th"), (body.partition("</tr>")[0], "td"))
            ]
            assert sides[0] == sides[1] or len(sides[0]) != len(sides[1])
            compared += sum(sides[0])
    assert compared > 5


def test_every_axis_has_its_unit(out: Path) -> None:
    for name, figure in plots(out).items():
        axes = {k: v for k, v in figure["layout"].items() if re.fullmatch(r"[xy]axis\d*", k)}
        titled = [axis["title"]["text"] for axis in axes.values() if "title" in axis]
        hidden = [k for k, axis in axes.items() if "title" not in axis and axis.get("showticklabels") is not False]
        assert titled
        assert hidden == (["yaxis"] if name == "modes" else []), f"{name}: {hidden} has no title"
        assert all(re.search(r"\[.+\]|^relative ", text) for text in titled), titled


@pytest.mark.parametrize("unit", ["<br>[1]", " [1]", "\n[1]"])
def test_an_axis_without_a_unit_has_none(unit: str) -> None:
    axes = {"yaxis": {"title": {"text": f"q1{unit}"}}, "xaxis3": {"title": {"text": "a[1] [m]"}}, "yaxis2": {}}
    found = plot({"data": [], "layout": {"title": {"text": "a [1]"}, "height": 1} | axes})
    assert found["value"]["layout"]["yaxis"]["title"]["text"] == "q1"
    assert found["value"]["layout"]["xaxis3"]["title"]["text"] == "a[1] [m]"
    assert found["title"] == "a [1]"


def test_lines_are_told_apart_by_dashes_too(out: Path) -> None:
    looks = {(line["line"]["color"], line["line"]["dash"]) for line in plots(out)["motion"]["data"]}
    assert len({colour for colour, _ in looks}) == len({dash for _, dash in looks}) == 2


def every(out: Path) -> list[Path]:
    return sorted(out.glob("*.html"))


def test_nothing_is_fetched_from_outside(out: Path) -> None:
    for path in every(out):
        text = path.read_text()
        for tag, attributes in Tags(text).found:
            for key in ("src", "href"):
                value = attributes.get(key) or ""
                assert not re.match(r"[a-z]+:|//", value.removeprefix("data:,")), (tag, value)
        assert not re.search(r"https?://", text)
    assert not re.search(r"@import|url\(", (out / "crossbody.css").read_text())
    assert not re.search(r"https?://|import\(|fetch\(", (out / "crossbody.js").read_text())
    assert (out / "plotly.min.js").stat().st_size > 1e6


def assert_links_resolve(out: Path) -> None:
    ids = {path.name: {a.get("id") for _, a in Tags(path.read_text()).found} for path in every(out)}
    for path in every(out):
        for _, attributes in Tags(path.read_text()).found:
            for key in ("src", "href"):
                value = attributes.get(key) or ""
                if not value or value.startswith("data:"):
                    continue
                name, _, anchor = value.partition("#")
                assert not name or (out / name).is_file(), value
                if anchor and (name or path.name) in ids:
                    assert unquote(anchor.partition("~")[0]) in ids[name or path.name], value


def test_links_resolve_and_ids_are_unique(out: Path) -> None:
    assert_links_resolve(out)
    for path in every(out):
        ids = [a["id"] for _, a in Tags(path.read_text()).found if "id" in a]
        assert len(ids) == len(set(ids))


def test_names_are_escaped(out: Path) -> None:
    for path in every(out):
        assert "<script>alert" not in path.read_text()
    assert "&lt;script&gt;alert" in (out / CASE).read_text()


def test_a_page_stays_small(out: Path) -> None:
    assert (out / CASE).stat().st_size < LIMIT


def test_a_case_begins_with_what_is_off_and_its_motion_and_its_verdicts_are_complete(out: Path) -> None:
    text = (out / CASE).read_text()
    order = ['class="lead first"', '<details class="lead">', 'class="engines"', 'class="player"', 'class="inside"',
             'class="matrix"', 'class="verdicts"', "<figure>"]  # fmt: skip
    places = [text.index(part) for part in order]
    assert places == sorted(places)
    rows = json.loads((out / "verdicts.json").read_text())["rows"]
    assert text.count("<tr data-verdict=") == len(rows)
    assert "It is not installed." in text
    assert all(row["command"].replace("<", "&lt;").replace(">", "&gt;") in text.replace("&#39;", "'") for row in rows)


def test_tables_carry_all_digits(out: Path) -> None:
    shown = {a["data-v"] for _, a in Tags((out / CASE).read_text()).found if "data-v" in a}
    for row in json.loads((out / "verdicts.json").read_text())["rows"]:
        if row["value"] is not None:
            assert str(float(row["value"])) in shown or str(row["value"]) in shown


def test_the_index_says_which_engine_is_right(out: Path) -> None:
    text = (out / "index.html").read_text()
    cells = [a for tag, a in Tags(text).found if tag == "td" and "cell" in (a.get("class") or "")]
    assert len(cells) == 2, "an engine that ran nowhere has no column"
    assert "outside" in (cells[0]["class"] or "")
    assert "within" in (cells[1]["class"] or ""), "the truth"
    assert "Run on no case: " in text
    assert "\u2717" in text
    assert "computed by crossbody 0.0.1" in text


def test_difference_to_the_truth_is_what_was_put_in(out: Path) -> None:
    errors = [numbers(line["y"]) for line in plots(out)["motion"]["data"] if line["yaxis"] == "y2"]
    assert len(errors) == 1
    assert np.allclose(errors[0], 1e-6, rtol=1e-6)


def test_one_file_holds_all_pages(tmp_path: Path, result: CaseResult) -> None:
    out = made(tmp_path / "out", [result])
    site.write(out, single_file=True)
    assert [path.name for path in every(out)] == ["index.html"]
    index = out / "index.html"
    folded = index.read_text()
    assert 'class="verdicts"' not in folded, "the case's page is not folded"
    index.write_text(whole(folded))
    tags = Tags(index.read_text()).found
    assert not [
        a for tag, a in tags if tag in ("script", "link") and (a.get("src") or "crossbody" in (a.get("href") or ""))
    ]
    assert {a["id"] for _, a in tags if "data-page" in a} == {"index", CASE.removesuffix(".html")}
    assert_links_resolve(out)
    site.write(out)
    assert (out / CASE).is_file()


def cells(out: Path, section: str) -> list[list[str]]:
    """Text of every cell of a table of engines, line by line."""
    text = (out / ("index.html" if section == "matrix" else CASE)).read_text()
    part = text[text.index(f'--{section}">') :]
    body = part[part.index("<tbody>") : part.index("</tbody>")]
    return [re.findall(r'data-v="([^"]*)"', line) for line in body.split("</tr>")[:-1]]


def test_a_case_begins_with_every_metric_of_every_engine(out: Path) -> None:
    rows = [row for row in json.loads((out / "verdicts.json").read_text())["rows"] if row["engine"] == "fake"]
    judged = [row for row in rows if row["verdict"] in ("within", "outside", "expected-outside")]
    shown = cells(out, "glance")
    assert len(shown) == 2 + len(judged) + 1, "the truth has a line of its own"
    told = sorted(cell[0].split()[0] for cell in shown[2:] if cell[0].strip())
    assert told == sorted(row["verdict"] for row in judged)
    text = (out / CASE).read_text()
    assert text.index("At a glance") < text.index('class="verdicts"')


def test_the_index_tells_error_and_cost_of_every_engine(out: Path) -> None:
    text = (out / "index.html").read_text()
    part = text[text.index('id="index--engines"') : text.index('id="index--provenance"')]
    errors = {row["engine"]: row["value"] for row in json.loads((out / "verdicts.json").read_text())["rows"]
              if row["metric"] == "position"}  # fmt: skip
    assert f'data-v="{errors["fake"]}"' in part
    assert "skipped" in part


@pytest.mark.parametrize("word", [Word.WITHIN, Word.EXPECTED, Word.OUTSIDE])
def test_a_cell_is_the_warmer_the_farther_out(word: Word) -> None:
    def heat(value: float, limit: float = 1e-6) -> int:
        row = Verdict(case="c", variant="v", engine="e", profile="p", metric="m", value=value, unit="1", limit=limit,
                      tier="A", verdict=word).row()  # fmt: skip
        return grid.heat_of(row)

    sizes = [0.0, *(1e-6 * 10.0 ** (np.arange(-28, 29) / 2.0 - (7.0 if word is Word.WITHIN else -7.0)))]
    assert heat(0.0 if word is Word.WITHIN else 2.0, limit=0.0) == (0 if word is Word.WITHIN else -1)
    steps = [heat(size) for size in sizes]
    assert steps == sorted(steps)
    most = 6 if word is Word.WITHIN else 12
    assert {0, most} <= set(steps) <= set(range(most + 1))
    for none in (np.nan, np.inf):  # of what is expected-outside without a number nobody knows how far it is
        assert heat(none) == (-1 if word is Word.EXPECTED else most)


@pytest.mark.parametrize("seed", range(50))
def test_what_is_beyond_a_limit_for_a_known_cause_is_as_warm_and_as_high_as_what_is_outside(seed: int) -> None:
    """The word of a number says who is to blame; its colour and its place say how far out it is."""
    rng = np.random.default_rng(seed)
    times = 10.0 ** rng.uniform(-3.0, 5.0, 8)
    words = [(Word.INFO, Word.OUTSIDE)[rng.integers(2)] if size > 1.0 else Word.WITHIN for size in times]
    rows = [
        Verdict(case="c", variant="v", engine="e", profile="p", metric=f"m{i}", value=size, unit="1", limit=1.0,
                tier="A", verdict=word).row() | {"who": "e:p"}
        for i, (size, word) in enumerate(zip(times, words, strict=True))
    ]  # fmt: skip
    lines = grid.of_case(rows, "page", "c:v", {})[2:]
    assert [line.text for line in lines] == [f"m{i}" for i in np.argsort(-times)]
    for line in lines:
        size = times[int(line.text[1:])]
        assert size < 1.0 or line.cells[0].heat == int(np.log10(size))
        assert line.cells[0].heat >= 0


@pytest.mark.parametrize("loose", [0, 1, 3])
def test_the_index_counts_what_is_beyond_a_limit_though_it_is_not_judged(
    tmp_path: Path, result: CaseResult, loose: int
) -> None:
    """Else a run of which nothing is outside would look as if all of it were within."""
    rows = study.judge([result], {result.case.label: "crossbody run"})
    held = [i for i, row in enumerate(rows) if row["verdict"] in grid.WORST and row["limit"]]
    for i, row in enumerate(rows):
        if i in held[:loose]:
            rows[i] = row | {"verdict": Word.INFO, "value": 7.0 * row["limit"]}
        elif row["verdict"] == Word.INFO:
            rows[i] = row | {"limit": None}
    text = (made(tmp_path / "out", [result], rows) / "index.html").read_text()
    told = re.findall(r"<strong>(\d+)</strong> beyond a limit, not judged", text)
    assert told == ([str(loose)] if loose else [])


@pytest.mark.parametrize("seed", range(30))
def test_quantities_beyond_their_limits_stand_before_identities_and_counts(seed: int) -> None:
    """A count that must be exact is no multiple of a limit: it says less than a position that is far off."""
    rng = np.random.default_rng(seed)
    tells = {"position": 0, "velocity": 1, "event_times": 1, "law_residual": 2, "rate_residual": 2, "touch_count": 3}
    times = {str(name): math.inf if name == "touch_count" else 10.0 ** rng.uniform(-3.0, 9.0)
             for name in rng.permutation(list(tells))}  # fmt: skip
    rows = [
        Verdict(
            case="c", variant="v", engine="e", profile="p", metric=name, value=min(size, 1e9), unit="1",
            limit=0.0 if size == math.inf else 1.0, tier="A", verdict=Word.EXPECTED if size > 1.0 else Word.WITHIN,
        ).row() | {"who": "e:p"} for name, size in times.items()
    ]  # fmt: skip
    shown = [line.text for line in grid.of_case(rows, "page", "c:v", {})[2:]]
    assert shown == sorted(times, key=lambda name: (times[name] < 1.0, tells[name], -times[name]))


def test_the_index_names_the_number_of_a_case_that_tells_most_of_those_of_the_worst_word(out: Path) -> None:
    text = (out / "index.html").read_text().replace("<wbr>", "")
    rows = [row for row in json.loads((out / "verdicts.json").read_text())["rows"] if grid.held(row)]
    worst = min(grid.RANKED.index(row["verdict"]) for row in rows)
    of_worst = [row for row in rows if grid.RANKED.index(row["verdict"]) == worst and share(row) > 0.0]
    far = max(of_worst, key=lambda row: (row["metric"] == "position", row["metric"] in QUANTITIES,
                                         share(row) < math.inf, share(row)))  # fmt: skip
    named = escape(f"{far['engine']}:{far['profile']}: {far['metric']} {grid.short(far['value'])}")
    assert f"<small>{named}</small>" in text


def test_every_engine_has_a_colour_of_its_own() -> None:
    """By its name, so it is the same in every report."""
    for name in engines.names():
        with suppress(CrossbodyError):  # one that is not installed
            assert {f"{name}:{profile}" for profile in engines.load(name).profiles} <= set(LOOKS)
    assert len({look(who)["color"].upper() for who in LOOKS}) == len(LOOKS)


def test_an_engine_looks_the_same_wherever_it_stands(result: CaseResult) -> None:
    trace = next(one for one in study.traces(result) if one.truth is not None)
    for who in ("mujoco:default", "mine:own"):
        engine, _, profile = who.partition(":")
        one = replace(trace, about=dict(trace.about) | {"engine": engine, "profile": profile})
        assert style(one) == look(who)
        (mark,) = precision.scatter([(who, 1e-3, 1.0)])["data"]
        alone = precision.cloud({who: [("a", 1e-3, 1.0)], "pinocchio:law": [("a", 1e-6, 2.0)]})["data"]
        colours = {line["meta"]: line["marker"]["color"] for line in [mark, *alone]}
        assert colours[who] == look(who)["color"]
    assert look("mine:own") != look("mine:other")


def test_run_time_is_drawn_against_error(out: Path) -> None:
    (mark,) = plots(out)["precision"]["data"]
    assert mark["name"] == "fake:&lt;script>alert(1)&lt;/script>"
    assert mark["x"][0] == pytest.approx(1e-6, rel=0.1)


def test_studies_of_other_folders_stand_beside(tmp_path: Path, result: CaseResult) -> None:
    out, bench = made(tmp_path / "out", [result]), ladder(tmp_path / "bench", "bouncing_ball:linear", HOSTILE)
    site.write(out, others=[bench])
    assert "crossbody bench" in (out / "bench.html").read_text()
    assert 'data-v="42.0"' in (out / "index.html").read_text()
    drawn = plots(out)["precision"]["data"]
    assert "lines" in drawn[0]["mode"]
    assert_links_resolve(out)
    before = (out / "verdicts.json").read_text()
    site.write(out)
    assert (out / "bench.html").is_file()
    assert (out / "verdicts.json").read_text() == before


def test_a_study_of_another_version_is_told(tmp_path: Path, result: CaseResult) -> None:
    out = made(tmp_path / "out", [result])
    (out / "gapmap.json").write_text(json.dumps({"provenance": {}, "rows": [{"n": 3}]}))
    site.write(out)
    assert "Another version of crossbody wrote these tables" in (out / "gapmap.html").read_text()
    assert (out / CASE).is_file()


@pytest.mark.parametrize(("make", "says"), [(Path.mkdir, "was not written by crossbody"), (None, "contains no study")])
def test_a_folder_without_a_study_cannot_stand_beside(
    tmp_path: Path, result: CaseResult, make: Callable[[Path], None] | None, says: str
) -> None:
    out, other = made(tmp_path / "out", [result]), tmp_path / "other"
    if make is None:
        made(other, [result])
    else:
        make(other)
    with pytest.raises(OutputError, match=says):
        site.write(out, others=[other])


def test_what_changed_is_told(tmp_path: Path, result: CaseResult) -> None:
    before = made(tmp_path / "before", [result])
    entry = replace(result.entries[0], run=result.truth.trajectory)
    now = made(tmp_path / "now", [replace(result, entries=(entry, *result.entries[1:]))])
    assert "0 of" in changed(now, now)
    assert "0 of" not in changed(now, before)
    text = (now / "index.html").read_text()
    section = text[text.index("Verdicts that changed") :]
    assert section.index("outside") < section.index("within")


def changed(out: Path, base: Path) -> str:
    site.write(out, against=base)
    found = re.search(r"Against .*? gone\.", (out / "index.html").read_text())
    assert found
    return found.group()


def fake_rows(count: int, name: str = "case {}") -> list[Row]:
    return [
        Verdict(
            case=name.format(i), variant="v", engine="e", profile=f"p{k}", metric="m", value=1.0, unit="1", limit=2.0,
            tier="A", verdict=Word.WITHIN, command="crossbody run",
        ).row() for i in range(count) for k in range(3)
    ]  # fmt: skip


@pytest.mark.slow
def test_a_thousand_cases_are_paged(tmp_path: Path) -> None:
    out = made(tmp_path / "out", [], fake_rows(1000))
    assert len(list(out.glob("index*.html"))) == 10
    assert len(list(out.glob("case-*.html"))) == 1000
    assert max(path.stat().st_size for path in out.glob("index*.html")) < 300e3
    first = (out / "index.html").read_text()
    assert "index-10.html" in first
    assert "No motion is stored" in next(out.glob("case-*.html")).read_text()


@pytest.mark.parametrize("name", ["../../etc/passwd", HOSTILE, "a/b", "a b", "A" * 500, "..", "\0", "ü"])
def test_a_hostile_case_stays_in_its_folder(tmp_path: Path, name: str) -> None:
    out = made(tmp_path / "deep" / "out", [], fake_rows(1, name))
    written = sorted(path.name for path in (tmp_path / "deep").rglob("*.html"))
    assert len(written) == len(every(out)) == 2
    assert_links_resolve(out)
    for path in every(out):
        assert HOSTILE not in path.read_text()


def test_labels_have_distinct_files() -> None:
    labels = ["a-b:c", "a:b-c", "a.b:c", "a:b.c", "a/b:c", "a b:c", "A" * 99, "A" * 98, "a:b:c"]
    assert len({file_name(label).lower() for label in labels}) == len(labels)


@pytest.mark.parametrize("spoil", [Path.unlink, lambda path: path.write_bytes(b"PAR1 broken")], ids=["gone", "broken"])
def test_a_motion_that_cannot_be_read_is_told(
    tmp_path: Path, result: CaseResult, spoil: Callable[[Path], object]
) -> None:
    out = made(tmp_path / "out", [result])
    spoil(out / "traces" / "0001.parquet")
    site.write(out)
    text = (out / CASE).read_text()
    assert "No motion is stored for fake:" in text
    assert 'id="case-bouncing_ball.linear--plot-motion"' in text


def test_results_of_another_version_are_told(tmp_path: Path, result: CaseResult) -> None:
    out = made(tmp_path / "out", [result])
    rows = json.loads((out / "verdicts.json").read_text())
    for row in rows["rows"]:
        del row["tier"]
    (out / "verdicts.json").write_text(json.dumps(rows))
    with pytest.raises(OutputError, match=r"written by crossbody 0\.0\.1: its verdicts have no tier"):
        site.write(out)


def test_a_page_needs_no_engine(out: Path) -> None:
    code = (
        "import sys; from pathlib import Path; from crossbody.reports.pages import site; "
        "site.write(Path(sys.argv[1])); "
        "print(sorted({'mujoco', 'pinocchio', 'sksundae', 'numba'} & set(sys.modules)))"
    )
    said = subprocess.run([sys.executable, "-c", code, str(out)], capture_output=True, text=True, check=True).stdout
    assert said.strip() == "[]"


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (36834.6, "36830"),
        (-12345.0, "-12340"),
        (1.5e6, "1.5e+06"),
        (9999.0, "9999"),
        (1e-5, "1e-05"),
        (-0.0, "0"),
        (7, "7"),
    ],
)
def test_four_digits_have_an_exponent_where_they_need_one(value: float, said: str) -> None:
    assert html.number(value) == said


def test_a_page_of_given_sections() -> None:
    rows = [{"a": HOSTILE, "b": 1 / 3}, {"a": "x", "b": float("nan")}]
    given = Table(title="Numbers", columns=columns(a="A", b=("B [m]", Kind.NUMBER)), rows=rows)
    figure = go.Figure({"data": [{"y": [1, 2], "name": HOSTILE}], "layout": {"title": {"text": "T"}, "height": 300}})
    section = Section(name="s", title="S", plots=(Plot(name="p", figure=figure),), tables=(given,))
    text = html.render([Page(name="replay", title="Replay", sections=[section])], (), "")
    assert "0.3333" in text
    assert 'data-v="0.3333333333333333"' in text
    assert HOSTILE not in text
    (drawn,) = re.findall(r'<script type="text/plain" data-plot="[^"]+">(.*?)</script>', text, re.DOTALL)
    assert value_of(drawn)["data"][0]["name"] == HOSTILE


def test_a_long_text_is_folded_and_a_short_one_keeps_its_lines() -> None:
    rows = [{"a": "one\ntwo\n"}, {"a": "0\n1\n" * 500}]
    given = Table(title="Files", columns=columns(a=("A", Kind.CODE)), rows=rows)
    text = html.render(
        [Page(name="some", title="Some", sections=[Section(name="s", title="S", tables=(given,))])], (), ""
    )
    assert '<td class="code"><code>one\ntwo</code></td>' in text
    assert '<td class="code"><details><summary>1999 characters</summary><code>0\n1\n' in text


def test_a_column_without_a_value_is_left_out() -> None:
    rows = [{"a": "x", "b": None, "c": float("nan"), "d": 0.0}, {"a": "y", "b": "", "c": None, "d": None}]
    given = Table(title="Numbers", columns=columns(a="A", b="B", c=("C", Kind.NUMBER), d=("D", Kind.NUMBER)), rows=rows)
    section = Section(name="s", title="S", tables=(given,))
    text = html.render([Page(name="some", title="Some", sections=[section])], (), "")
    assert re.findall(r"<th scope=.col.[^>]*>(.)</th>", text) == ["A", "D"]


def test_long_steps_are_drawn_as_cubics(result: CaseResult) -> None:
    run = result.truth.trajectory
    t = np.linspace(0.0, 0.4, 5)
    fall = replace(
        run, t=t, q=(1.0 - 4.905 * t**2)[:, None], v=(-9.81 * t)[:, None], events=(), ledger=None,
        **{name: getattr(run, name)[: len(t)] for name in ("gap", "lam", "energy", "mode")},
    )  # fmt: skip
    dense, q = filled(fall)
    assert len(dense) > 300
    assert np.allclose(q[:, 0], 1.0 - 4.905 * dense**2, atol=1e-14)
    assert set(t) <= set(dense)


def test_a_folder_without_a_study_is_told(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="was not written by crossbody"):
        site.write(tmp_path)


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


@pytest.mark.parametrize("count", [1, 2, 7, 20_000])
def test_steps_of_a_run_begin_where_the_one_before_ended(count: int) -> None:
    """Each of those that are drawn is from an instant of the run to its next one; of few, all are."""
    rng = np.random.default_rng(count)
    t = np.repeat(np.cumsum(rng.uniform(1e-3, 1.0, count)), rng.integers(1, 3, count))
    case = load("bouncing_ball", "linear")
    truth = truth_of(case)
    own: Any = SimpleNamespace(t=t)
    clock = Clock(run=own, around_s=1.0, compiled_s=0.0)
    steps = study._trace(case, Entry(engine="reference", profile="compiled", run=truth.trajectory, clock=clock), truth)
    starts, lengths = (np.array(part) for part in steps.about["steps"])
    behind = dict(zip(np.unique(t)[:-1].tolist(), np.diff(np.unique(t)).tolist(), strict=True))
    assert [behind[start] for start in starts.tolist()] == lengths.tolist()
    assert len(starts) == count - 1 if count < 10 else 100 < len(starts) < count


def test_a_template_is_compiled_once_and_again_when_it_changes(tmp_path, monkeypatch):
    monkeypatch.setenv("CROSSBODY_CACHE", str(tmp_path / "cache"))

    def shown(text: str) -> str:
        (tmp_path / "one.html").write_text(text)
        made = Environment(loader=FileSystemLoader(tmp_path), bytecode_cache=KeptTemplates())
        return made.get_template("one.html").render(name="<crossbody>")

    first = shown("{{ name }}")
    with monkeypatch.context() as changed:
        changed.setattr(Environment, "compile", None)
        assert shown("{{ name }}") == first
    assert shown("{{ name | length }}") == "11"


def test_the_limits_of_position_stand_in_the_picture_of_run_time_over_error(out: Path) -> None:
    rows = [row for row in json.loads((out / "verdicts.json").read_text())["rows"] if row["metric"] == "position"]
    limits = sorted({row["limit"] for row in rows if row["limit"]})
    for page in (out / CASE, out / "index.html"):
        figure = all_plots(page)["precision"]
        assert [shape["x0"] for shape in figure["layout"]["shapes"]] == limits
        assert "Dashed: limit of the error" in page.read_text()


@pytest.mark.parametrize("seed", range(30))
def test_a_name_that_may_break_is_the_same_name(seed: int) -> None:
    draw = np.random.default_rng(seed)
    name = "".join(draw.choice(list("ab:_<>&'\"; #"), 12))
    shown = html.breakable(name)
    assert unescape(shown.replace("<wbr>", "")) == name
    assert shown.count("<wbr>") == name.count(":") + name.count("_")


@pytest.mark.parametrize(
    ("verdict", "metric", "why", "said"),
    [
        (Word.INFO, "event_times", f"{LACKS} Known: soft.", "no such event"),
        (Word.INFO, "position", f"{LACKS} Known: soft.", "no number"),
        (Word.INFO, "position", "Not measured. It would take 55 s.", "not measured"),
        (Word.EXPECTED, "mode_times", "There is no contact phase.", "no such event"),
        (Word.OUTSIDE, "velocity", "The value is not finite.", "no number"),
    ],
)  # fmt: skip
def test_a_cell_without_a_number_says_why(verdict: Word, metric: str, why: str, said: str) -> None:
    def told(metric: str, value: float, who: str, word: Word, why: str) -> Row:
        engine, _, profile = who.partition(":")
        return Verdict(case="c", variant="v", engine=engine, profile=profile, metric=metric, value=value, unit="1",
                       limit=1.0, tier="A", verdict=word, why=why).row() | {"who": who}  # fmt: skip

    rows = [told(metric, math.nan, "a:p", verdict, why), told(metric, 0.5, "b:p", Word.WITHIN, ""),
            told("own", 0.5, "b:p", Word.WITHIN, ""), told("run", math.nan, "c:p", Word.SKIPPED, "absent")]  # fmt: skip
    lines = {line.text: [cell.told for cell in line.cells] for line in grid.of_case(rows, "page", "c:v", {"a:p": 1.0})}
    assert lines[metric] == [said, ""]
    assert lines["own"] == ["none", ""]
    assert lines["run time"] == ["", "none"]
    assert grid.whole("c:v", "page", "c:p", rows[3:], None).told == "not run"
    assert grid.whole("c:v", "page", "d:p", [], None).told == "not selected"
    assert html.number(None) == html.number(math.nan) == "none"


def test_what_is_the_same_in_every_row_is_said_once_above_the_table() -> None:
    shown = Table(
        title="T", columns=columns(case="Case", who="Engine", x=("X", Kind.NUMBER), empty="Empty"),
        rows=[{"case": "ball:hard", "who": who, "x": 1.0, "empty": ""} for who in ("a:p", "b:p")], once=True,
    )  # fmt: skip
    assert html.same(shown) == {"Case": "ball:hard"}
    assert [column.title for column in html.told(shown)] == ["Engine", "X"]
    alone = replace(shown, rows=shown.rows[:1])
    assert html.same(alone) == {}
    assert [column.title for column in html.told(alone)] == ["Case", "Engine", "X"]


def test_a_run_far_beyond_a_limit_that_is_not_judged_is_seen_to_be(tmp_path: Path, result: CaseResult) -> None:
    """It was a grey dot beside ticks."""
    rows = study.judge([result], {result.case.label: "crossbody run"})
    rows = [row | {"verdict": Word.WITHIN.value, "value": 0.0, "expected": math.nan, "limit": 1.0} for row in rows]
    rows = [row | {"verdict": Word.INFO.value, "value": 6e5} if row["metric"] == "position" else row for row in rows]
    out = made(tmp_path / "out", [result], rows)
    index, (page,) = (out / "index.html").read_text(), [path.read_text() for path in out.glob("case-*.html")]
    assert re.search(r'class="cell beyond-not-judged heat-5".*?▲</span>.*? 1 beyond, not judged<', index)
    assert re.search(
        r'class="word beyond-not-judged"><span aria-hidden="true">▲</span> <span class="said">beyond', index
    )
    assert '<tr data-verdict="not judged" data-beyond' in page
    assert '▲</span> <span class="said">beyond, not judged' in page


def test_a_report_says_of_every_folder_what_is_wrong_with_it(tmp_path: Path) -> None:
    gone, empty = tmp_path / "gone", tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(OutputError) as told:
        site.write(gone, others=[empty])
    assert str(gone) in str(told.value)
    assert str(empty) in str(told.value)
