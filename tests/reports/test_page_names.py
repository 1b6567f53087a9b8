"""Lines over time are named where they end, apart from each other; on a narrow screen below the title."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import chromium
import numpy as np
import pandas as pd
import pytest

from crossbody.cases import load
from crossbody.reports.figures.section import Figure, Plot, Section
from crossbody.reports.figures.styles import logarithmic
from crossbody.reports.judging.run_verdicts import Entry
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.pages import figures, html, precision, site
from crossbody.reports.replay import figure as replays
from crossbody.reports.runs import study
from crossbody.reports.runs.jobs import CaseResult
from crossbody.reports.runs.output import folder
from crossbody.reports.runs.store import Trace

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(
        chromium.binary() is None, reason="Chromium is not installed (Debian: apt-get install chromium)."
    ),
]
SHORT = "early:stops"  # a run that ends before the others
DRAW = """document.querySelectorAll('.plot[data-time]').forEach((box) => box.scrollIntoView()),
    [...document.querySelectorAll('.plot[data-time]')].every((box) => {
        if (!('drawn' in box.dataset)) box.scrollIntoView();
        return 'drawn' in box.dataset; })"""
NAMES = """[...document.querySelectorAll('.plot[data-time]')]
    .filter((box) => box.data.some((one) => one.type !== 'bar')).map((box) =>
    [[...box.querySelectorAll('.names [data-all]')].flatMap((text) => text.dataset.all.split('|')),
                   box.data.filter((one) => one.visible !== false).map((one) => one.name)])"""
OVERLAPS = """[...document.querySelectorAll('.names')].flatMap((over) => {
    const boxes = [...over.querySelectorAll('text')].map((text) => [text.textContent, text.getBoundingClientRect()]);
    const meet = (a, b) => a.left < b.right && b.left < a.right && a.top + 2.5 < b.bottom && b.top + 2.5 < a.bottom;
    return boxes.flatMap(([one, a], i) => boxes.slice(0, i).filter(([, b]) => meet(a, b)).map(([two]) => [one, two]));
})"""
"""Names that meet; the box of a letter is higher than what is drawn of it."""


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Eight runs that end nearly together, as those of engines that agree do, and one that ends early."""
    case = load("bouncing_ball", "linear")
    truth = truth_of(case)
    exact = truth.trajectory
    runs = {f"p{k}": replace(exact, q=exact.q * (1.0 + 1e-9 * k)) for k in range(8)}
    kept = exact.t < 0.4 * exact.t[-1]
    parts = {name: getattr(exact, name)[kept] for name in ("t", "q", "v", "gap", "lam", "energy", "mode")}
    entries = [Entry(engine="fake", profile=name, run=run) for name, run in runs.items()]
    entries.append(Entry(engine="early", profile="stops", run=replace(exact, ledger=None, **parts)))
    results = [CaseResult(case=case, truth=truth, entries=tuple(entries))]
    out = tmp_path_factory.mktemp("names") / "out"
    with folder(out) as made:
        study.write(made, results, study.judge(results, {case.label: "crossbody run"}), {"command": "test", "time": ""})
        site.write(made)
    return out / "case-bouncing_ball.linear.html"


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_every_line_over_time_has_its_name_at_its_end(page: Path, browser: chromium.Browser, theme: str) -> None:
    browser.open(page, theme=theme)
    browser.wait(DRAW)
    told = browser.js(NAMES)
    assert len(told) >= 4
    for texts, names in told:
        assert sorted(text.partition(" until")[0] for text in texts) == sorted(names)
        assert [text for text in texts if text.startswith(SHORT)] == [text for text in texts if "until" in text]
    assert browser.js(OVERLAPS) == []
    right = "Math.max(...[...document.querySelectorAll('.names text')].map((one) => one.getBoundingClientRect().right))"
    assert browser.js(f"{right} <= document.querySelector('.plot[data-time]').getBoundingClientRect().right")
    assert browser.complaints() == []


def test_a_name_stands_at_the_height_of_its_line(page: Path, browser: chromium.Browser) -> None:
    """The paths that lead there begin at the last sample."""
    browser.open(page)
    browser.wait(DRAW)
    starts, wanted = browser.js(
        "(() => { const box = document.querySelector('.plot[data-time]'); const all = box._fullLayout;"
        " const from = (d) => d.match(/M([-\\d.]+) ([-\\d.]+)/).slice(1).map(Number);"
        " const end = (line) => { const y = all[line.yaxis.replace('y', 'yaxis')]; let i = line.y.length - 1;"
        " while (!Number.isFinite(line.y[i])) i -= 1;"
        " return [all.xaxis._offset + all.xaxis.d2p(line.x[i]), y._offset + y.d2p(line.y[i])]; };"
        " return [[...box.querySelectorAll('.names path')].map((one) => from(one.getAttribute('d'))),"
        " box.data.map(end)]; })()"
    )
    apart = np.abs(np.array(starts)[:, None] - np.array(wanted)[None]).max(axis=2)
    assert np.all(apart.min(axis=1) < 0.6), "a name stands where a line ends"
    assert np.all(apart.min(axis=0) < 3.2), "a line ends within its width of one that has a name"


TICKS = """(() => { const box = document.querySelector('.plot[data-time]');
    const [key, axis] = Object.entries(box._fullLayout).find(([name, one]) => name[0] === 'y' && one.type === 'log');
    const told = Object.fromEntries(Object.entries(AXIS).map(([name, value]) => [`${key}.${name}`, value]));
    return Plotly.relayout(box, told).then(() => [...box.querySelectorAll(`.${axis._id}tick text`)].map((one) =>
        one.textContent)); })()"""


def test_a_logarithmic_axis_has_few_labels_however_many_decades_it_spans(page: Path, browser: chromium.Browser) -> None:
    """Of two decades and more whole powers of ten alone; of less, no digit between two that are not told apart."""
    browser.open(page)
    browser.wait(DRAW)
    rng = np.random.default_rng(3)
    for decades in [0.3, 0.9, 1.1, 1.9, *rng.uniform(2.0, 16.0, 12)]:
        low = rng.uniform(-12.0, -2.0)
        axis = logarithmic(10.0 ** np.array([low, low + decades]))
        labels = browser.js(TICKS.replace("AXIS", json.dumps(axis | {"range": [low, low + decades]})))
        assert 1 <= len(labels) <= 9, (decades, labels)
        if decades > 2.0:
            assert all(label.startswith("10") or label == "1" for label in labels), (decades, labels)


def test_names_follow_what_is_shown(page: Path, browser: chromium.Browser) -> None:
    browser.open(page)
    browser.wait(DRAW)
    browser.js("document.querySelector('[data-show=\"fake:p3\"]').click()")
    shown = "[...document.querySelectorAll('.names [data-all]')].some((one) => one.dataset.all.includes('fake:p3'))"
    browser.wait(f"!{shown}")
    browser.js("document.querySelector('[data-show=\"fake:p3\"]').click()")
    browser.wait(shown)
    browser.js(
        "Plotly.relayout(document.querySelector('.plot[data-time]'), { 'xaxis.range': [2.5, 3.0] }).then(() => 0)"
    )
    names = "document.querySelector('.plot[data-time]').querySelectorAll('.names [data-all]')"
    seen = f"[...{names}].map((one) => one.dataset.all)"
    browser.wait(f"{seen}.length && !{seen}.some((text) => text.startsWith('{SHORT}'))")


def test_limits_are_named_in_full_over_the_lines(page: Path, browser: chromium.Browser) -> None:
    browser.open(page)
    browser.wait(DRAW)
    told = browser.js("[...document.querySelectorAll('.names .limit')].map((text) => text.textContent)")
    drawn = browser.js("[...document.querySelectorAll('.plot[data-time]')].flatMap(({ layout }) =>"
                       " (layout.shapes || []).map(({ name }) => name))")  # fmt: skip
    assert drawn
    assert sorted(told) == sorted(drawn)


def test_lines_over_a_force_are_named_beside_their_plot(page: Path, browser: chromium.Browser) -> None:
    browser.open(page)
    box = "document.querySelector('[id$=plot-hysteresis]')"
    browser.wait(f"({box}.scrollIntoView(), 'drawn' in {box}.dataset)")
    key = f"{box}.parentElement.querySelectorAll('.curves [data-line]')"
    drawn = browser.js(f"{box}.data.map(({{ meta }}) => meta)")
    assert len(drawn) > 1
    assert browser.js(f"[...{key}].map((one) => one.textContent)") == drawn
    for hidden in (True, False):
        browser.js(f"document.querySelector('[data-show=\"{drawn[0]}\"]').click()")
        assert browser.js(f"[...{key}].find((one) => one.dataset.line === '{drawn[0]}').hidden") is hidden


def test_an_engine_that_is_hidden_has_no_column(page: Path, browser: chromium.Browser) -> None:
    browser.open(page)
    seen = """(() => { const table = document.querySelector('.matrix');
        const shown = (cells) => [...cells].filter((cell) => !cell.hidden);
        const groups = shown(table.querySelectorAll('[scope=colgroup]')).map((one) => [one.textContent, one.colSpan]);
        const rows = [...table.querySelectorAll('tr')].slice(1);
        return [Object.fromEntries(groups), rows.map((row) => shown(row.cells).length)];
    })()"""
    hide = (
        'document.querySelectorAll(\'[data-show="fake:p3"], [data-show="early:stops"]\').forEach((one) => one.click())'
    )
    before, all_ = browser.js(seen)
    browser.js(hide)
    after, left = browser.js(seen)
    assert before == after | {"fake": 8, "early": 1}
    assert after["fake"] == 7
    assert left == [count - 2 for count in all_]
    browser.js(hide)
    assert browser.js(seen) == [before, all_]


def test_a_narrow_screen_has_names_below_the_title(page: Path, browser: chromium.Browser) -> None:
    browser.open(page, width=400)
    browser.wait(DRAW)
    assert browser.js("document.querySelectorAll('.names text:not(.limit)').length") == 0
    keys = browser.js(
        "[...document.querySelectorAll('.curves')].map((key) => [...key.children].map((one) => one.textContent))"
    )
    assert len(keys) >= 4
    assert all({f"fake:p{k}" for k in range(8)} <= set(key) for key in keys), keys
    browser.js("document.querySelector('[data-show=\"fake:p3\"]').click()")
    hidden = "[...document.querySelectorAll('.curves [data-line=\"fake:p3\"]')].map((one) => one.hidden)"
    assert all(browser.js(hidden))
    assert browser.js("document.documentElement.scrollWidth <= innerWidth")
    assert browser.complaints() == []


def drawn(folder: Path, figure: Figure, browser: chromium.Browser, width: int = 1400, time: bool = False) -> None:
    """Open a page of one figure."""
    section = Section(name="s", title="S", plots=(Plot(name="p", figure=figure, time=time),))
    page = html.render([html.Page(name="p", title="P", sections=[section])], (), "")
    for name, content in ({"p.html": page} | html.assets()).items():
        (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)
    browser.open(folder / "p.html", width)
    browser.wait("'drawn' in document.querySelector('.plot').dataset")


TEXTS = "[...document.querySelectorAll('.names text:not(.limit)')].map((text) => text.textContent)"
LEGEND = "document.querySelectorAll('.legend .traces').length"


@pytest.mark.parametrize("seed", range(3))
def test_marks_of_an_engine_are_named_beside_the_last(seed: int, tmp_path: Path, browser: chromium.Browser) -> None:
    rng = np.random.default_rng(seed)
    engines = [f"engine {k}:profile" for k in range(12)]
    points = {
        who: [(f"case {i}", 10.0 ** rng.uniform(-12, 0), 10.0 ** rng.uniform(-1, 3)) for i in range(6)]
        for who in engines
    }
    cloud = precision.cloud(points)
    drawn(tmp_path, cloud, browser)
    assert sorted(browser.js(TEXTS)) == sorted(engines)
    assert browser.js(LEGEND) == 0
    assert browser.js(OVERLAPS) == []
    starts, axes = browser.js(
        "(() => { const box = document.querySelector('.plot'), { xaxis: x, yaxis: y } = box._fullLayout;"
        " const from = (d) => d.match(/M([-\\d.]+) ([-\\d.]+)/).slice(1).map(Number);"
        " return [[...document.querySelectorAll('.names path')].map((one) => from(one.getAttribute('d'))),"
        " box.data.map((one) => [x._offset + x.d2p(one.x.at(-1)), y._offset + y.d2p(one.y.at(-1))])]; })()"
    )
    assert np.allclose(sorted(starts), sorted(axes), atol=0.6)
    assert all(line["x"] == sorted(line["x"]) for line in cloud["data"])
    inside = (
        "[...document.querySelectorAll('.names text')].every((text) => {"
        " const [a, b] = [text, document.querySelector('.plot')].map((one) => one.getBoundingClientRect());"
        " return a.left >= b.left && a.right <= b.right; })"
    )
    assert browser.js(inside)
    drawn(tmp_path, precision.cloud(points), browser, width=400)
    assert (browser.js(TEXTS), browser.js(LEGEND)) == ([], len(engines))
    assert browser.complaints() == []


def test_lines_over_lags_are_named_at_their_ends(tmp_path: Path, browser: chromium.Browser) -> None:
    rng = np.random.default_rng(0)
    engines = ["reference:compiled", "mujoco:default", "pinocchio:law"]
    rows = pd.DataFrame([
        {"who": who, "channel": "th1", "input": given, "lag": lag, "value": rng.uniform(-1, 1), "band": 0.3}
        for given in ("", "input 1") for who in engines for lag in range(20)
    ])  # fmt: skip
    drawn(tmp_path, replays.correlation(rows), browser)
    assert sorted(browser.js(TEXTS)) == sorted(2 * engines)
    assert browser.js(LEGEND) == 0
    assert browser.js(OVERLAPS) == []
    assert browser.complaints() == []


def test_a_band_lies_around_the_truth_and_goes_with_it(tmp_path: Path, browser: chromium.Browser) -> None:
    case = load("bouncing_ball", "linear")
    run = truth_of(case).trajectory
    about = {"coordinates": [{"name": "height", "unit": "m"}], "engine": "truth", "profile": "", "scales": [2.0]}
    broken = replace(run, q=np.where((run.t > 1.0) & (run.t < 1.2), np.nan, run.q[:, 0])[:, None])
    traces = [Trace(about=about, run=broken)]
    drawn(tmp_path, figures.motion(traces, 500, {"position": {0.05: "limit"}}), browser, time=True)
    line, band = browser.js("document.querySelector('.plot').data.map(({ x, y }) => [[...x], [...y]])")
    known = np.isfinite(np.array(line[1], float))
    edges = np.array([y for y in band[1] if y is not None])
    assert known.any()
    assert not known.all()
    wanted = np.array(line[1], float)[known]
    assert np.allclose(sorted(edges), sorted(np.r_[wanted + 0.1, wanted - 0.1]), atol=1e-6)
    assert band[1].count(None) == 2
    assert browser.js(TEXTS) == ["truth"]
    hide = "crossbody.hidden.add('truth'); crossbody.tell('engines'); document.querySelector('.plot').data"
    assert browser.js(f"{hide}.map(({{ visible }}) => visible)") == [False, False]
    assert browser.complaints() == []


@pytest.mark.parametrize("name", ["", "index.html"])
def test_an_engine_that_is_hidden_leaves_every_table(name: str, page: Path, browser: chromium.Browser) -> None:
    browser.open(page.with_name(name) if name else page)
    rows = "[...document.querySelectorAll('.table tr')].filter((row) => row.textContent.includes('fake:p3'))"
    assert browser.js(f"{rows}.length && {rows}.every((row) => !row.hidden)")
    browser.js("document.querySelector('[data-show=\"fake:p3\"]').click()")
    assert browser.js(f"{rows}.every((row) => row.hidden)")
    assert browser.js("document.querySelectorAll('.table tr[data-engine]:not([hidden])').length") > 1
    browser.js("document.querySelector('[data-show-all]').click()")
    assert browser.js(f"{rows}.every((row) => !row.hidden)")


@pytest.mark.parametrize("width", [1400, 400])
def test_marks_that_are_near_have_names_apart(width: int, tmp_path: Path, browser: chromium.Browser) -> None:
    engines = [f"engine:profile {k}" for k in range(6)]
    marks = [(who, 1e-9 * (1.0 + 0.02 * k), 5.0 + 0.1 * k) for k, who in enumerate(engines)]
    figure = precision.scatter([*marks, ("far:off", float("inf"), 5.0)])
    drawn(tmp_path, figure, browser, width)
    assert sorted(browser.js(TEXTS)) == sorted([*engines, "far:off"])
    assert browser.js(OVERLAPS) == []
    assert browser.complaints() == []


@pytest.mark.parametrize("other", [1.3e-9, 0.7e-9])
def test_a_name_covers_no_mark_where_its_other_side_is_free(
    other: float, tmp_path: Path, browser: chromium.Browser
) -> None:
    """A mark stands beside another one, on either side, at its height."""
    marks = [
        ("one:profile", 1e-9, 5.0),
        ("two:profile", other, 5.0),
        ("far:off", 1e-3, 500.0),
        ("near:by", 1e-14, 0.05),
    ]
    drawn(tmp_path, precision.scatter(marks), browser)
    ends = browser.js(
        "Object.fromEntries([...document.querySelectorAll('.names text:not(.limit)')]"
        ".map((text) => [text.textContent, text.getAttribute('text-anchor')]))"
    )
    left, right = ("one:profile", "two:profile") if other > 1e-9 else ("two:profile", "one:profile")
    assert ends == {left: "end", right: "start", "far:off": "start", "near:by": "start"}
    assert browser.js(OVERLAPS) == []


def test_one_instant_is_at_one_place_in_all_figures(page: Path, browser: chromium.Browser) -> None:
    browser.open(page)
    browser.wait(DRAW)
    ends = browser.js(
        "[...document.querySelectorAll('.plot[data-time]')].map((box) => box._fullLayout.xaxis._offset"
        " + box._fullLayout.xaxis._length)"
    )
    assert len(ends) >= 4
    assert len(set(ends)) == 1


def test_a_hidden_engine_leaves_the_figures_of_a_replay(tmp_path: Path, browser: chromium.Browser) -> None:
    t = np.linspace(0.0, 1.0, 20)
    rows = pd.concat([
        pd.DataFrame({"who": who, "channel": "th1", "unit": "rad", "window": 0, "t": t, "measured": t, "value": t})
        for who in ("reference:compiled", "mujoco:default")
    ])  # fmt: skip
    for draw in (replays.motion, replays.residual):
        drawn(tmp_path, draw(rows, {"th1": 0.1}), browser, time=True)
        hide = "crossbody.hidden.add('mujoco:default'); crossbody.tell('engines'); document.querySelector('.plot').data"
        left = browser.js(f"{hide}.filter(({{ visible }}) => visible).map(({{ name }}) => name)")
        assert "reference:compiled" in left
        assert "mujoco:default" not in left


def test_bars_to_measure_by_lie_over_nothing_on_a_narrow_screen(page: Path, browser: chromium.Browser) -> None:
    browser.open(page, width=400)
    browser.js("document.querySelector('.player').scrollIntoView()")
    browser.wait("document.querySelector('[data-speed]').options.length > 0")
    colours = browser.js(
        "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => {"
        " const c = document.querySelector('.player canvas'), k = c.width / c.clientWidth;"
        " const found = c.getContext('2d').getImageData(0.65 * c.width, c.height - 48 * k, 0.1 * c.width, 48 * k);"
        " done(new Set(new Uint32Array(found.data.buffer)).size); })))"
    )
    assert colours == 1


@pytest.mark.parametrize("count", [2, 3, 9])
def test_lines_that_end_together_have_one_name_in_their_colours_or_by_how_many_they_are(
    count: int, tmp_path: Path, browser: chromium.Browser
) -> None:
    exact = truth_of(load("bouncing_ball", "linear")).trajectory
    about = {"contacts": ["floor"], "coordinates": [{"name": "height", "unit": "m"}]}
    traces = [
        Trace(about=about | {"engine": "truth" if not k else "fake", "profile": "truth" if not k else f"p{k}"},
              run=replace(exact, q=exact.q * (1.0 + 1e-9 * k)), truth=exact)
        for k in range(count)
    ]  # fmt: skip
    far = replace(exact, q=exact.q + 0.5 * exact.t[:, None] / exact.t[-1])
    traces.append(Trace(about=about | {"engine": "far", "profile": "off"}, run=far, truth=exact))
    drawn(tmp_path, figures.motion(traces), browser, time=True)
    browser.wait("document.querySelectorAll('.names [data-all]').length")
    told = browser.js(
        "[...document.querySelectorAll('.names text:not(.limit)')].filter((one) => one.getBoundingClientRect().top <"
        " document.querySelector('.plot').getBoundingClientRect().top + 160)"
        ".map((one) => [one.textContent, [...one.children].map((part) => getComputedStyle(part).fill)])"
    )
    texts = [text for text, _ in told]
    assert "far:off" in texts, "a line that parts has its own"
    texts.remove("far:off")
    if count == 9:
        assert texts == ["truth and 8 engines"]
        return
    names = ["truth", *(f"fake:p{k}" for k in range(1, count))]
    assert sorted(", ".join(texts).split(", ")) == sorted(names)
    colours = [colour for text, parts in told for colour in parts if "far" not in text]
    assert len(set(colours)) == count
    assert len(texts) <= 3
