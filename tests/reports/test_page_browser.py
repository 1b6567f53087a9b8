"""The pages in a browser: quiet console, no request, plots drawn, motion that moves, both themes readable by all."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

import chromium
import numpy as np
import pytest
from ladder import ladder
from resting import plate
from study_pages import page_of, studies

from crossbody.cases import from_scene, load
from crossbody.cases.scene import Body, Joint, Scene, Shape
from crossbody.engines import load as load_engine
from crossbody.reports import sections
from crossbody.reports.figures.section import Plot, Section
from crossbody.reports.judging.run_verdicts import Entry
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.pages import figures, html, site
from crossbody.reports.pages.html import Page
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
INDEX, CASE = "index.html", "case-bouncing_ball.linear.html"
MEASURED = ("skip", "stability", "throughput")
"""Studies whose tables take minutes to make; their pages have no template of their own."""


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    case = load("bouncing_ball", "linear")
    truth = truth_of(case)
    runs = [
        replace(truth.trajectory, q=truth.trajectory.q * (1 + 1e-3 * np.sin(k * truth.trajectory.t))[:, None])
        for k in (1, 2)
    ]
    entries = tuple(Entry(engine="fake", profile=f"p{k}", run=run) for k, run in enumerate(runs))
    results = [CaseResult(case=case, truth=truth, entries=entries)]
    path = tmp_path_factory.mktemp("browser") / "out"
    with folder(path) as made:
        study.write(made, results, study.judge(results, {case.label: "crossbody run"}), {"command": "test", "time": ""})
        site.write(made)
    return path


@pytest.fixture(scope="module")
def whole(out: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same with every study beside it."""
    path = tmp_path_factory.mktemp("whole")
    shutil.copytree(out, path / "out")
    site.write(path / "out", others=[*studies(path), ladder(path / "bench", "bouncing_ball:linear")], against=out)
    return path / "out"


NEXT_FRAME = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
DRAWN = "[...document.querySelectorAll('.plot')].filter((box) => 'drawn' in box.dataset).length"


def draw_all(browser: chromium.Browser) -> None:
    browser.js("document.querySelectorAll('.fold').forEach((each) => { each.open = true; })")
    browser.js("document.querySelectorAll('[data-of]').forEach((each) => { each.hidden = false; })")
    browser.js("document.querySelectorAll('.plot').forEach((box) => box.scrollIntoView())")
    browser.wait(
        "[...document.querySelectorAll('.plot')].every((box) => { if (!('drawn' in box.dataset)) box.scrollIntoView();"
        " return 'drawn' in box.dataset; })"
    )


def test_plots_have_lines(out: Path, browser: chromium.Browser) -> None:
    browser.open(out / CASE)
    draw_all(browser)
    assert browser.js(
        "[...document.querySelectorAll('.plot')].every((p) => p.querySelector('path.js-line, .bars path'))"
    )


def test_a_heat_map_has_a_colour_for_each_pair_of_its_axes(whole: Path, browser: chromium.Browser) -> None:
    """What plotly is given as one row has colours on its diagonal alone."""
    seen = 0
    for page in [page for page in whole.glob("*.html") if not page.name.startswith(("case-", "index"))]:
        browser.open(page)
        draw_all(browser)
        tables = browser.js(
            "[...document.querySelectorAll('.plot')].flatMap(({ data }) => data)"
            ".filter(({ type }) => type === 'heatmap')"
            ".map(({ x, y, z }) => [x.length, y.length, z.length, ...new Set([...z].map((row) => row.length))])"
        )
        assert all((z, *rows) == (y, x) for x, y, z, *rows in tables)
        seen += len(tables)
    assert seen


def test_playback_moves_and_shares_its_clock(out: Path, browser: chromium.Browser) -> None:
    browser.open(out / CASE)
    browser.js("document.querySelector('.plot').scrollIntoView()")
    browser.wait(DRAWN)
    first = browser.picture(".player canvas")
    browser.js("document.querySelector('[data-play]').click()")
    browser.wait("Number(document.querySelector('[data-clock]').value) > 50")
    browser.js("document.querySelector('[data-play]').click()")
    assert browser.picture(".player canvas") != first
    at = "document.querySelector('.plot[data-drawn] .cursor').getBoundingClientRect().x"
    before = browser.js(at)
    browser.js(
        "(() => { const clock = document.querySelector('[data-clock]'); clock.value = 900;"
        " clock.dispatchEvent(new Event('input')); })()"
    )
    assert browser.js(at) > before + 100
    side = browser.picture(".player canvas")
    browser.js(
        "(() => { const view = document.querySelector('[data-view]'); view.value = 'beside';"
        " view.dispatchEvent(new Event('change')); })()"
    )
    browser.js(NEXT_FRAME)
    assert browser.picture(".player canvas") != side
    assert browser.complaints() == []


ARROWS = """(() => {
    const g = CanvasRenderingContext2D.prototype, seen = window.arrows = [];
    const [begin, move, line, fill] = [g.beginPath, g.moveTo, g.lineTo, g.fill];
    let path = [], last = [];
    g.beginPath = function () { last = path; path = []; begin.call(this); };
    g.moveTo = function (x, y) { path.push([x, y]); move.call(this, x, y); };
    g.lineTo = function (x, y) { path.push([x, y]); line.call(this, x, y); };
    g.fill = function () {
        if (path.length === 3 && last.length === 2 && String(path[0]) === String(last[1])) seen.push(last);
        fill.apply(this, arguments);
    };
})()"""
"""Keep the ends of every shaft whose head is filled."""


def test_arrows_of_a_floor_that_carries_a_ball_point_up_from_where_they_touch(
    out: Path, browser: chromium.Browser
) -> None:
    browser.open(out / CASE)
    browser.js("document.querySelector('.plot').scrollIntoView()")
    browser.wait(DRAWN)
    browser.js(ARROWS)
    run = truth_of(load("bouncing_ball", "linear")).trajectory
    pressed = float(run.t[np.argmax(run.lam[:, 0])])
    browser.js(
        f"(() => {{ const clock = document.querySelector('[data-clock]'); clock.value = {1000.0 * pressed / run.t[-1]};"
        " window.arrows.length = 0; clock.dispatchEvent(new Event('input')); })()"
    )
    browser.js(NEXT_FRAME)
    arrows = np.array(browser.js("window.arrows"))
    assert len(arrows)
    assert np.all(arrows[:, 1, 1] < arrows[:, 0, 1] - 2.0), "a canvas counts downwards"
    assert np.allclose(arrows[:, 1, 0], arrows[:, 0, 0], atol=1e-6)


SIXTY = """(async () => {
    const began = performance.now();
    for (let k = 0; k < 60; k += 1) await new Promise(requestAnimationFrame);
    return performance.now() - began;
})()"""
"""How long sixty frames take, ms."""


def layouts(browser: chromium.Browser) -> int:
    """How often the page has been laid out."""
    told = browser.call("Performance.getMetrics")["metrics"]
    return next(one["value"] for one in told if one["name"] == "LayoutCount")


def test_a_picture_that_moves_leaves_the_page_as_it_is(out: Path, browser: chromium.Browser) -> None:
    """Each layout of a page takes time from the picture; the readout alone needs one, ten times a second."""
    browser.open(out / CASE)
    draw_all(browser)
    browser.js("document.querySelector('.player').scrollIntoView()")
    browser.call("Performance.enable")
    browser.js("document.querySelector('[data-play]').click()")
    browser.js(NEXT_FRAME)
    before = layouts(browser)
    took = browser.js(SIXTY)
    assert layouts(browser) - before <= took / 100.0 + 2.0
    assert browser.complaints() == []


def test_one_steps_from_event_to_event_and_sees_differences_larger(out: Path, browser: chromium.Browser) -> None:
    browser.open(out / CASE)
    browser.js("document.querySelector('.plot').scrollIntoView()")
    browser.wait(DRAWN)

    def step(way: str) -> float:
        browser.js(f"document.querySelector('[data-{way}]').click()")
        browser.js(NEXT_FRAME)
        return float(str(browser.js("document.querySelector('[data-readout]').textContent")).split()[2])

    events = sorted({event.t for event in truth_of(load("bouncing_ball", "linear")).trajectory.events})
    seen = [step("after") for _ in events]
    assert seen == pytest.approx(events, abs=2e-3)
    assert step("after") == seen[-1], "there is none behind the last"
    assert step("before") == pytest.approx(events[-2], abs=2e-3)
    plain = browser.picture(".player canvas")
    browser.js(
        "(() => { const field = document.querySelector('[data-differences]'); field.value = '100';"
        " field.dispatchEvent(new Event('change')); })()"
    )
    browser.js(NEXT_FRAME)
    assert browser.picture(".player canvas") != plain
    assert browser.complaints() == []


@pytest.fixture(scope="module")
def solids(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of a scene: a plate that lies on a floor."""
    case = plate([(x, y, 0.0) for x in (-0.1, 0.1) for y in (-0.1, 0.1)], height=0.02, t_end=0.1)
    return page_of(case, tmp_path_factory.mktemp("solids") / "out", load_engine("reference").prepare(case, "compiled"))


def test_a_scene_is_turned_and_looked_at_from_near(solids: Path, browser: chromium.Browser) -> None:
    browser.open(solids)
    browser.js("document.querySelector('.player').scrollIntoView()")
    canvas = "document.querySelector('.player canvas')"
    browser.js(NEXT_FRAME)
    first = browser.picture(".player canvas")

    def after(action: str) -> bytes:
        browser.js(f"{{ const canvas = {canvas}; {action} }}")
        browser.js(NEXT_FRAME)
        return browser.picture(".player canvas")

    wheel = "canvas.dispatchEvent(new WheelEvent('wheel', {deltaY: -400, cancelable: true}));"
    assert after(wheel) == first, "a page is scrolled past a picture that nobody has touched"
    ways = [f"canvas.dispatchEvent(new KeyboardEvent('keydown', {{key: '{key}'}}));" for key in ("ArrowLeft", "+")]
    for way in (*ways, f"canvas.focus(); {wheel}", "document.querySelector('[data-axes]').click();"):
        seen = after(way)
        assert seen != first, way
        first = seen
    assert browser.complaints() == []


@pytest.mark.parametrize("seed", range(5))
def test_a_plane_that_a_body_carries_is_where_the_body_is(solids: Path, browser: chromium.Browser, seed: int) -> None:
    draw = np.random.default_rng(seed)
    turn, inner = (np.linalg.qr(draw.normal(size=(3, 3)))[0] for _ in range(2))
    at, own = draw.normal(size=(2, 3))
    browser.open(solids)
    given = {"origin": at.tolist(), "axes": turn.T.tolist()}, [*own, *inner[:, 0], *inner[:, 1]]
    moved = browser.js(f"crossbody.solids.carried({json.dumps(given[0])}, {json.dumps(given[1])})")
    wanted = [*(at + turn @ own), *(turn @ inner[:, 0]), *(turn @ inner[:, 1])]
    assert moved == pytest.approx(wanted, abs=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_axes_of_a_body_are_those_of_its_pose_and_right_handed(
    solids: Path, browser: chromium.Browser, seed: int
) -> None:
    """Of a pose between two pictures too, whose axes are shorter and lean; and corners are where these have them."""
    draw = np.random.default_rng(seed)
    turn, skew = np.linalg.qr(draw.normal(size=(3, 3)))[0], draw.uniform(0.2, 0.9)
    turn *= np.linalg.det(turn)
    at, corner, radius = draw.normal(size=3), draw.normal(size=3), float(draw.uniform(0.1, 0.9))
    browser.open(solids)
    for second in (turn[:, 1], 0.7 * turn[:, 1] + skew * turn[:, 0]):
        numbers = [0.0] * 9 + [*at, *(skew * turn[:, 0]), *second]
        browser.js(f"window.posed = (i) => {json.dumps(numbers)}[i]")
        found = browser.js("crossbody.solids.frame(window.posed, 1)")
        assert found["origin"] == pytest.approx(at.tolist(), abs=1e-12)
        assert np.array(found["axes"]) == pytest.approx(turn.T, abs=1e-12)
        solid = json.dumps({"body": 1, "points": [corner.tolist()], "radius": radius})
        low, high = browser.js(f"crossbody.solids.extent(window.posed, {solid})")
        assert low == pytest.approx((at + turn @ corner - radius).tolist(), abs=1e-12)
        assert high == pytest.approx((at + turn @ corner + radius).tolist(), abs=1e-12)


EDGE = (
    "(() => { const c = document.querySelector('.player canvas'); const g = c.getContext('2d');"
    " const seen = new Set();"
    " for (const [x, y, w, h] of [[0, 0, c.width, 1], [0, c.height - 1, c.width, 1], [0, 0, 1, c.height],"
    " [c.width - 1, 0, 1, c.height]])"
    " new Uint32Array(g.getImageData(x, y, w, h).data.buffer).forEach((p) => seen.add(p));"
    " const all = new Set(new Uint32Array(g.getImageData(0, 0, c.width, c.height).data.buffer));"
    " return [seen.size, all.size]; })()"
)
"""How many colours are on the edge of the picture, and in it."""


def test_a_scene_has_room_however_it_is_turned(tmp_path: Path, browser: chromium.Browser) -> None:
    """Nothing but the ground is on the edge of the picture."""
    rod = Body(name="rod", mass=1.0, com=(0.0, 0.0, 0.5), inertia=(0.1, 0.1, 0.01, 0.0, 0.0, 0.0))
    shape = Shape(name="bar", body="rod", type="capsule", size=(0.05, 0.5, 0.0), position=(0.0, 0.0, 0.5))
    hinge = Joint(name="hinge", body="rod", type="hinge", axis=(0.0, 1.0, 0.0))
    case = from_scene(Scene(bodies=(rod,), joints=(hinge,), shapes=(shape,)), q0=[0.1], t_end=0.5)
    browser.open(page_of(case, tmp_path / "out"))
    browser.js("document.querySelector('.player').scrollIntoView()")
    for key in ("", "ArrowLeft", "ArrowUp", "ArrowUp", "ArrowUp", "ArrowUp", "ArrowLeft"):
        press = f"new KeyboardEvent('keydown', {{key: '{key}'}})"
        browser.js(f"document.querySelector('.player canvas').dispatchEvent({press})")
        browser.js(NEXT_FRAME)
        at_edge, drawn = browser.js(EDGE)
        assert at_edge == 1
        assert drawn > 10


BARS = """(() => {
    const g = CanvasRenderingContext2D.prototype, seen = window.bars = [], fill = g.fillText;
    g.fillText = function (text, x, y) { seen.push([text, x]); fill.apply(this, arguments); };
})()"""
"""Keep what is written beside the bars to measure by, and where they end."""


@pytest.mark.parametrize("followed", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_larger_differences_leave_the_scale_of_the_picture(
    tmp_path: Path, browser: chromium.Browser, seed: int, followed: bool
) -> None:
    """A run that is off by a part of its body is out of a picture of the truth when that is drawn a hundred times."""
    rng = np.random.default_rng(seed)
    body = Body(name="box", mass=1.0, inertia=(0.1, 0.1, 0.1, 0.0, 0.0, 0.0))
    shape = Shape(name="box", body="box", type="box", size=(0.1, 0.2, 0.3))
    scene = Scene(bodies=(body,), joints=(Joint(name="free", body="box", type="free"),), shapes=(shape,))
    case = from_scene(scene, q0=[0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0], t_end=0.2)
    run = load_engine("reference").prepare(case, "compiled").run()
    off = np.zeros(7)
    off[:3] = 0.02 * (v := rng.normal(size=3)) / np.linalg.norm(v)
    moved = replace(run, q=run.q + (run.t / run.t[-1])[:, None] * off)
    given = SimpleNamespace(engine="fake", profile="moved", run=lambda: moved)
    browser.open(page_of(case, tmp_path / "out", given))
    browser.js(BARS)
    browser.js(f"if ({str(followed).lower()}) document.querySelector('[data-follow]').click()")
    # At once: a picture that is drawn between sets the clock back to its own time.
    browser.js(
        "(c => { c.value = 1000; c.dispatchEvent(new Event('input')); })(document.querySelector('[data-clock]'))"
    )
    bars, pictures = set(), set()
    for factor in ("1", "10", "100"):
        browser.js("window.bars.length = 0")
        browser.js(f"document.querySelector('[data-differences]').value = '{factor}'")
        browser.js("document.querySelector('[data-differences]').dispatchEvent(new Event('change'))")
        browser.js(NEXT_FRAME)
        bars.add(json.dumps(browser.js("window.bars.at(-1)")))
        pictures.add(browser.picture(".player canvas"))
    assert len(bars) == 1
    assert len(pictures) == 3


@pytest.mark.parametrize(("t_end", "far"), [(0.1, False), (2.0, True)])
def test_a_body_that_goes_far_is_followed(tmp_path: Path, browser: chromium.Browser, t_end: float, far: bool) -> None:
    """It would be a few pixels of the way that it falls."""
    body = Body(name="ball", mass=1.0, inertia=(0.1, 0.1, 0.1, 0.0, 0.0, 0.0))
    ball = Shape(name="ball", body="ball", type="sphere", size=(0.1, 0.0, 0.0))
    scene = Scene(bodies=(body,), joints=(Joint(name="free", body="ball", type="free"),), shapes=(ball,))
    case = from_scene(scene, q0=[0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0], t_end=t_end)
    browser.open(page_of(case, tmp_path / "out", load_engine("reference").prepare(case, "compiled")))
    browser.wait("document.querySelector('[data-speed]').options.length > 0")
    assert browser.js("document.querySelector('[data-follow]').checked") is far


FRAMES = """new Promise((done) => {
    const draw = requestAnimationFrame, began = performance.now();
    let [frames, busy] = [0, 0];
    window.requestAnimationFrame = (task) => draw((t) => {
        const from = performance.now();
        task(t);
        busy += performance.now() - from;
    });
    const count = () => {
        frames += 1;
        if (performance.now() - began < 3000) return draw(count);
        window.requestAnimationFrame = draw;
        done([frames / 3, busy / frames]);
    };
    draw(count);
})"""
"""Frames a second for three seconds, and what scripts take of each, ms."""


@pytest.mark.bench
def test_thirty_bodies_play_as_smoothly_as_a_page_that_does_nothing(tmp_path: Path, browser: chromium.Browser) -> None:
    kinds = {"box": (0.1, 0.05, 0.02), "capsule": (0.03, 0.1, 0.0), "sphere": (0.06, 0.0, 0.0)}
    names = [f"{kind} {i}" for i in range(10) for kind in kinds]
    bodies = tuple(Body(name=name, mass=1.0, inertia=(0.1, 0.2, 0.3, 0.0, 0.0, 0.0)) for name in names)
    joints = tuple(Joint(name=name, body=name, type="free") for name in names)
    shapes = tuple(Shape(name=name, body=name, type=name.split()[0], size=kinds[name.split()[0]]) for name in names)
    places = [(0.3 * (i % 6), 0.3 * (i // 6), 1.0) for i in range(len(names))]
    case = from_scene(
        Scene(bodies=bodies, joints=joints, shapes=shapes), t_end=0.5,
        q0=[x for place in places for x in (*place, 1.0, 0.0, 0.0, 0.0)],
        v0=np.tile([0.0, 0.0, 1.0, 2.0, 1.0, 3.0], 30),
    )  # fmt: skip
    browser.open(page_of(case, tmp_path / "out", load_engine("reference").prepare(case, "compiled")))
    browser.js("document.querySelector('.player').scrollIntoView()")
    still, _ = browser.js(FRAMES)
    browser.js("document.querySelector('[data-play]').click()")
    moving, busy = browser.js(FRAMES)
    print(f"{moving:.0f} frames a second of {still:.0f}, scripts {busy:.1f} ms each")
    assert moving > 0.9 * still


def test_zoom_is_shared_and_keeps_events_sharp(out: Path, browser: chromium.Browser) -> None:
    browser.open(out / CASE)
    draw_all(browser)
    event = truth_of(load("bouncing_ball", "linear")).trajectory.events[0].t
    around = f"[{event - 1e-2}, {event + 1e-2}]"
    browser.js(f"Plotly.relayout(document.querySelector('.plot'), {{ 'xaxis.range': {around} }}).then(() => 0)")
    seen = "[...document.querySelectorAll('.plot[data-time]')].map((box) => box._fullLayout.xaxis.range[0])"
    browser.wait(f"{seen}.every((x) => Math.abs(x - {event - 1e-2}) < 1e-9)")
    line = "document.querySelector('.plot')._fullData[0].x"
    assert browser.js(f"[...{line}].filter((x) => Math.abs(x - {event}) < 1e-2).length") >= 6


def test_engines_are_hidden_everywhere(out: Path, browser: chromium.Browser) -> None:
    browser.open(out / CASE)
    draw_all(browser)
    browser.js("document.querySelector('[data-show=\"fake:p0\"]').click()")
    browser.wait(
        "document.querySelector('.plot').data.filter((line) => line.meta === 'fake:p0').every((l) => !l.visible)"
    )
    assert browser.js(
        "[...document.querySelectorAll('.verdicts tr[data-engine=\"fake:p0\"]')].every((row) => row.hidden)"
    )


def test_a_cell_leads_to_the_verdicts_of_its_engine(out: Path, browser: chromium.Browser) -> None:
    browser.open(out / INDEX)
    browser.follow("document.querySelectorAll('.cell a')[1].click()", "location.pathname.endsWith('linear.html')")
    browser.wait("document.querySelector('[data-filter=engine]').value === 'fake:p1'")
    rows = "[...document.querySelectorAll('.verdicts tbody tr')].filter((row) => !row.hidden)"
    assert browser.js(f"{rows}.length > 0 && {rows}.every((row) => row.dataset.engine === 'fake:p1')")


def test_a_table_is_saved_with_all_digits(out: Path, browser: chromium.Browser) -> None:
    browser.open(out / CASE)
    browser.js(
        "URL.createObjectURL = (blob) => { blob.text().then((text) => { window.saved = text; }); return 'blob:x'; };"
        "HTMLAnchorElement.prototype.click = function () {};"
        "document.querySelector('.verdicts').closest('.scroll').nextElementSibling.click()"
    )
    browser.wait("window.saved")
    lines = browser.js("window.saved").splitlines()
    assert lines[0].startswith("Verdict,Engine,Metric,Value")
    assert len(lines) == 1 + browser.js("document.querySelectorAll('.verdicts tbody tr').length")
    assert any(len(line.split(",")[3]) > 12 for line in lines)


def test_columns_that_do_not_fit_are_folded_and_stay_in_what_is_saved(out: Path, browser: chromium.Browser) -> None:
    browser.open(out / CASE)
    table = "[...document.querySelectorAll('table[data-csv$=Runs]')][0]"
    heads = f"[...{table}.tHead.rows[0].cells]"
    shown, more = (
        f"{heads}.filter((head) => head.offsetWidth).length",
        f"{table}.closest('.scroll').nextElementSibling.nextElementSibling",
    )
    every = browser.js(f"{heads}.length")
    assert browser.js(shown) == every
    assert browser.js(f"{more}.hidden")
    browser.open(out / CASE, width=250)
    browser.wait(f"{shown} < {every}")
    left = browser.js(shown)
    assert left > 1
    assert browser.js(f"{more}.textContent") == f"{every - left} more column{'s' * (every - left > 1)}"
    browser.js(
        "URL.createObjectURL = (blob) => { blob.text().then((text) => { window.saved = text; }); return 'blob:x'; };"
        f"HTMLAnchorElement.prototype.click = function () {{}}; {table}.closest('.scroll').nextElementSibling.click()"
    )
    browser.wait("window.saved")
    assert len(browser.js("window.saved").splitlines()[0].split(",")) == every
    browser.js(f"{more}.click()")
    assert browser.js(shown) == every
    assert browser.js(f"{more}.textContent") == "Fewer columns"
    browser.js(f"{more}.click()")
    assert browser.js(shown) == left


def test_the_switch_turns_the_theme(out: Path, browser: chromium.Browser) -> None:
    browser.open(out / CASE, theme="light")
    paper = "getComputedStyle(document.body).backgroundColor"
    before = browser.js(paper)
    browser.js("theme.value = 'dark'; theme.dispatchEvent(new Event('change'))")
    assert browser.js(paper) != before
    browser.js("theme.value = ''; theme.dispatchEvent(new Event('change'))")
    assert browser.js(paper) == before


def test_one_file_shows_one_page_at_a_time(out: Path, browser: chromium.Browser) -> None:
    site.write(out, single_file=True)
    try:
        browser.open(out / INDEX)
        shown = "[...document.querySelectorAll('[data-page]')].filter((p) => !p.hidden).map((p) => p.id).join()"
        browser.wait(f"{shown} === 'index'")
        browser.js("document.querySelector('.matrix tbody th a').click()")
        browser.wait(f"{shown} === 'case-bouncing_ball.linear'")
        draw_all(browser)
        assert browser.complaints() == []
    finally:
        site.write(out)


AXE = find_spec("axe_playwright_python")


@pytest.mark.parametrize("theme", ["light", pytest.param("dark", marks=pytest.mark.slow)])
def test_every_page_is_quiet_fits_and_has_no_violation(whole: Path, browser: chromium.Browser, theme: str) -> None:
    names = sorted(path.name for path in whole.glob("*.html"))
    assert {INDEX, CASE, *(f"{name}.html" for name in sections.names() if name not in MEASURED)} <= set(names)
    widths = (1400, 400) if theme == "light" else (1400,)  # a theme moves nothing
    told = {(name, width): look(browser, whole / name, width, theme) for name in names for width in widths}
    assert {where: text for where, text in told.items() if text} == {}


CROSSED = """[...document.querySelectorAll('.plot')].flatMap((plot) => {
    const boxes = (kind) => [...plot.querySelectorAll(kind)].map((each) => each.getBoundingClientRect());
    const meet = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
    const titles = boxes('[class*="g-y"] text');
    if (titles.some((one, i) => titles.slice(0, i).some((two) => meet(one, two)))) return [plot.id];
    const heads = boxes('.annotation text');
    if (heads.some((one, i) => heads.slice(0, i).some((two) => meet(one, two)))) return [plot.id];
    const legends = boxes('.legend .bg'), under = [...boxes('[class*="g-x"] text'), ...boxes('.xtick text')];
    if (legends.some((legend) => legend.width && under.some((text) => meet(legend, text)))) return [plot.id];
    const over = (axis) => boxes(`[class*="g-${axis}"] text`).some(
        (title) => boxes(`.${axis}tick text`).some((tick) => meet(title, tick)));
    return ['x', 'y'].some(over) ? [plot.id] : [];
})"""
"""Plots where a title lies over another one or over the labels of ticks, or a legend over either."""


HIDDEN = """[...document.querySelectorAll('table')].filter((table) => table.offsetWidth).flatMap((table) =>
    [...table.querySelectorAll('tr')].filter((row) => row.offsetHeight
        && [...row.cells].some((cell) => cell.textContent.trim() && !cell.offsetWidth && !cell.matches('.folded')))
        .map(() => table.className))"""
"""Tables with a row that is seen and a cell in it that is not."""

SIDEWAYS = """[...document.querySelectorAll('.scroll')].filter((box) => box.scrollWidth > box.clientWidth + 1
    && box.clientWidth && box.querySelector('table:is(.matrix, .verdicts, details.table table)')
    ).map((box) => box.getAttribute('aria-label'))"""
"""Tables that are wider than their place."""


def look(browser: chromium.Browser, page: Path, width: int, theme: str) -> list[str]:
    """What a page does wrong; axe is asked at one width, where it is installed: it sees the same at both."""
    browser.open(page, width, theme)
    draw_all(browser)
    found = browser.complaints()
    if not browser.js("document.documentElement.scrollWidth <= innerWidth"):
        found.append("wider than the window")
    found += [f"{name}: titles over ticks" for name in browser.js(CROSSED)]
    browser.js("document.querySelectorAll('details.table').forEach((each) => { each.open = true; })")
    browser.wait(f"!{SIDEWAYS}.length", 5.0)
    found += [f"{name}: a cell without room" for name in browser.js(HIDDEN) if width > 600]
    if AXE is None or AXE.origin is None or width != 1400:
        return found
    browser.js(f"{Path(AXE.origin).with_name('axe.min.js').read_text(encoding='utf-8')}; 0")
    nodes = "v.nodes.map((n) => n.html).join(' | ')"
    violations = browser.js(f"axe.run(document).then((r) => r.violations.map((v) => v.id + ': ' + {nodes}))")
    return found + violations


def test_plots_are_drawn_soon(whole: Path, browser: chromium.Browser) -> None:
    browser.open(whole / CASE)
    took = browser.js(
        "(async () => { const start = performance.now(); document.querySelector('.plot').scrollIntoView();"
        " while (!('drawn' in document.querySelector('.plot').dataset)) await new Promise(requestAnimationFrame);"
        " return performance.now() - start; })()"
    )
    idle = browser.js("(() => { const start = performance.now(); let x = 0; for (let i = 0; i < 3e7; i++) x += i % 7;"
                      " return performance.now() - start + 0 * x; })()")  # fmt: skip
    assert took < 60 * idle + 500


def test_paper_is_light_and_no_plot_is_cut(whole: Path, browser: chromium.Browser) -> None:
    browser.open(whole / CASE, theme="dark")
    browser.js("dispatchEvent(new Event('beforeprint'))")
    browser.wait("[...document.querySelectorAll('.plot')].every((box) => 'drawn' in box.dataset)")
    widths = browser.js("[...document.querySelectorAll('.plot .main-svg')].map((svg) => svg.width.baseVal.value)")
    assert 0 < max(widths) <= 700
    assert browser.js("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    assert browser.js("[...document.querySelectorAll('details.table')].every((each) => each.open)")
    browser.js("dispatchEvent(new Event('afterprint'))")
    assert browser.js("getComputedStyle(document.body).backgroundColor") != "rgb(255, 255, 255)"


def test_a_page_runs_no_script_but_its_own(out: Path, browser: chromium.Browser, tmp_path: Path) -> None:
    """What is put into a page is not run, and nobody is asked for anything; its own plots are drawn."""
    shutil.copytree(out, tmp_path / "out")
    site.write(tmp_path / "out", single_file=True)
    put = "(() => { const made = document.createElement('script'); made.textContent = 'window.put = 1';"
    for page in (out / CASE, tmp_path / "out" / INDEX):
        browser.open(page)
        assert browser.complaints() == []
        assert browser.js(put + " document.body.append(made); return window.put || 0; })()") == 0
        assert browser.js("fetch('https://example.org').then(() => 'went').catch(() => 'refused')") == "refused"


def test_engines_are_laid_over_each_other_and_side_by_side_in_space(solids: Path, browser: chromium.Browser) -> None:
    """A hidden engine is not drawn in either view; no button leads anywhere."""
    browser.open(solids)
    browser.js("document.querySelector('.player').scrollIntoView()")
    browser.wait("document.querySelector('[data-speed]').options.length > 0")

    def seen(action: str) -> bytes:
        browser.js(action)
        browser.js(NEXT_FRAME)
        return browser.picture(".player canvas")

    field = "document.querySelector('[data-view]')"
    view = f"{field}.value = '%s'; {field}.dispatchEvent(new Event('change'))"
    over, beside = seen(view % "ghosts"), seen(view % "beside")
    assert over != beside
    hidden = "document.querySelector('[data-show=\"reference:compiled\"]').click()"
    alone = seen(hidden)
    assert alone != beside
    assert seen(hidden) == beside
    draw_all(browser)
    assert browser.js('document.querySelectorAll(\'[data-attr="sendChartToCloud"], [data-title*="loud"]\').length') == 0
    assert browser.complaints() == []


def test_what_is_folded_is_drawn_when_it_is_asked_for(solids: Path, browser: chromium.Browser) -> None:
    """It takes part in the shared clock and in print from then on."""
    browser.open(solids)
    fold = "document.querySelector('.fold')"
    browser.js(f"{fold}.scrollIntoView()")
    browser.wait(DRAWN)
    assert browser.js("[...document.querySelectorAll('.fold .plot')].some((box) => 'drawn' in box.dataset)") is False
    browser.js(f"{fold}.querySelector('summary').click()")
    browser.wait(f"'drawn' in {fold}.querySelector('.plot').dataset")
    browser.js(f"{fold}.querySelector('.plot').scrollIntoView()")
    browser.js(NEXT_FRAME)
    browser.js(
        "(() => { const clock = document.querySelector('[data-clock]'); clock.value = 500;"
        " clock.dispatchEvent(new Event('input')); })()"
    )
    browser.wait(f"getComputedStyle({fold}.querySelector('.cursor')).visibility === 'visible'")
    browser.js("dispatchEvent(new Event('beforeprint'))")
    assert browser.js("[...document.querySelectorAll('.fold')].every((each) => each.open)")
    browser.wait("[...document.querySelectorAll('.plot:not([hidden] *)')].every((box) => 'drawn' in box.dataset)")
    browser.js("dispatchEvent(new Event('afterprint'))")
    assert browser.js("[...document.querySelectorAll('.fold')].filter((each) => each.open).length") == 1
    assert browser.complaints() == []


def test_long_names_lie_over_nothing(tmp_path: Path, browser: chromium.Browser) -> None:
    solid = {"mass": 1.0, "com": (0.0, 0.0, -0.3), "inertia": (0.1, 0.1, 0.01, 0.0, 0.0, 0.0)}
    names = [f"{side}_spring_link_joint_of_the_gripper" for side in ("left", "right", "middle")]
    bodies = tuple(Body(name=name, **solid) for name in names)
    joints = tuple(Joint(name=n, body=n, type="hinge", axis=(0.0, 1.0, 0.0), range=(-0.2, 3.0)) for n in names)
    case = from_scene(Scene(bodies=bodies, joints=joints), q0=[0.5, 0.6, 0.7], t_end=0.5)
    page = page_of(case, tmp_path / "out", load_engine("reference").prepare(case, "compiled"))
    assert {width: found for width in (1400, 400) if (found := look(browser, page, width, "light"))} == {}


def test_long_numbers_lie_over_nothing(tmp_path: Path, browser: chromium.Browser) -> None:
    """An energy that hardly changes has many digits beside its axis."""
    run = truth_of(load("bouncing_ball", "linear")).trajectory
    energy = np.c_[0.0 * run.t, -5.0238e-4 - 3e-8 * run.t]
    figure = figures.energy([Trace(about={"engine": "truth", "profile": ""}, run=replace(run, energy=energy))])
    section = Section(name="s", title="S", plots=(Plot(name="p", figure=figure),))
    for name, content in (
        {"p.html": html.render([Page(name="p", title="P", sections=[section])], (), "")} | html.assets()
    ).items():
        (tmp_path / name).write_bytes(content.encode() if isinstance(content, str) else content)
    assert {
        width: found for width in (1400, 400) if (found := look(browser, tmp_path / "p.html", width, "light"))
    } == {}


def test_one_contact_is_chosen_of_several_in_every_section(solids: Path, browser: chromium.Browser) -> None:
    """Its figures are drawn when they are first seen, and again in their width after paper was."""
    browser.open(solids)
    boxes = "[...document.querySelectorAll('[data-of]:not([hidden]) .plot')]"
    assert browser.js("document.querySelectorAll('[data-choice]').length") >= 1
    options = browser.js("[...document.querySelector('[data-choice]').options].map((one) => one.value)")
    assert len(options) > 1
    assert browser.js(f"{boxes}.every((box) => box.closest('[data-of]').dataset.of === {json.dumps(options[0])})")
    browser.js(
        f"(() => {{ const select = document.querySelector('[data-choice]'); select.value = {json.dumps(options[1])};"
        " select.dispatchEvent(new Event('change')); })()"
    )
    browser.js(f"{boxes}[0].scrollIntoView()")
    browser.wait(f"{boxes}.some((box) => 'drawn' in box.dataset)")
    found = browser.js(f"{boxes}.map((box) => box.closest('[data-of]').dataset.of)")
    assert set(found) == {options[1]}
    browser.js("dispatchEvent(new Event('beforeprint')); dispatchEvent(new Event('afterprint'))")
    browser.js(
        f"(() => {{ const select = document.querySelector('[data-choice]'); select.value = {json.dumps(options[0])};"
        " select.dispatchEvent(new Event('change')); })()"
    )
    browser.js(f"{boxes}[0].scrollIntoView()")
    browser.wait(f"{boxes}[0].querySelector('.main-svg')?.clientWidth === {boxes}[0].clientWidth")
    assert browser.complaints() == []


def test_one_goes_from_case_to_case_and_back_to_the_sections(tmp_path: Path, browser: chromium.Browser) -> None:
    results = []
    for variant in ("linear", "resting", "elastic"):
        truth = truth_of(case := load("bouncing_ball", variant, t_end=0.5))
        results.append(
            CaseResult(case=case, truth=truth, entries=(Entry(engine="e", profile="p", run=truth.trajectory),))
        )
    with folder(tmp_path / "out") as made:
        study.write(
            made, results, study.judge(results, {one.case.label: "" for one in results}), {"command": "", "time": ""}
        )
        site.write(made)
    browser.open(tmp_path / "out" / CASE)
    for follow, expected in (('a[title="Next case"]', "resting"), ('a[title="Next case"]', "elastic")):
        assert browser.js(f"document.querySelectorAll('.beside-page {follow}').length") == 1
        browser.js(f"document.querySelector('.beside-page {follow}').click()")
        browser.wait(
            f"document.readyState === 'complete' && document.querySelector('h1').textContent.includes('{expected}')"
        )
    assert browser.js("document.querySelectorAll('.beside-page a').length") == 1
    browser.js("scrollTo(0, document.documentElement.scrollHeight)")
    browser.js("document.querySelector('.engines a').click()")
    top = "document.querySelector('.inside').getBoundingClientRect().top"
    browser.wait(f"{top} >= 0 && {top} < 0.5 * innerHeight")
    assert browser.complaints() == []


def test_timings_and_names_of_rungs_are_read_on_a_narrow_screen(whole: Path, browser: chromium.Browser) -> None:
    """Setting, error and time stand beside each other; what goes on to the right can be scrolled to."""
    (page,) = [path for path in whole.glob("*.html") if "Timings" in path.read_text()][:1]
    browser.open(page, width=400)
    draw_all(browser)
    seen = browser.js(
        "(() => { const table = [...document.querySelectorAll('details.table')].find((one) =>"
        " one.querySelector('summary').textContent.startsWith('Timings'));"
        " const end = table.querySelector('.scroll').getBoundingClientRect().right;"
        " return [...table.querySelectorAll('th')].filter((head) => head.getBoundingClientRect().right <= end)"
        ".map((head) => head.textContent); })()"
    )
    assert {"Setting", "Error", "Median [ms]"} <= set(seen)
    rungs = browser.js(
        "[...document.querySelectorAll('.plot .textpoint text')].map((text) =>"
        " [text.textContent, parseFloat(getComputedStyle(text).fontSize), text.getBoundingClientRect().toJSON()])"
    )
    assert rungs
    assert min(size for _, size, _ in rungs) >= 11.0
