"""Playback: steps from event to event of all engines, differences at the picture's scale, arrows within it."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import chromium
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from study_pages import page_of

from crossbody.cases import Event, Mode, load
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.pages import playback

needs_chromium = pytest.mark.skipif(
    chromium.binary() is None, reason="Chromium is not installed (Debian: apt-get install chromium)."
)
NEXT_FRAME = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
CHATTER = 2000


def chattering(seed: int, count: int, end: float) -> tuple[Event, ...]:
    """Events of one contact that opens and closes so often, at random."""
    times = np.sort(np.random.default_rng(seed).uniform(0.0, end, count))
    ways = ((Mode.FREE, Mode.CONTACT), (Mode.CONTACT, Mode.FREE))
    return tuple(Event(t=float(t), contact=0, before=ways[i % 2][0], after=ways[i % 2][1]) for i, t in enumerate(times))


@pytest.mark.parametrize("seed", range(20))
def test_no_event_is_far_from_one_that_a_button_leads_to(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count, end = int(10 ** rng.uniform(0.0, 3.5)), float(rng.uniform(0.1, 9.0))
    events = chattering(seed, count, end)
    trace = SimpleNamespace(run=SimpleNamespace(events=tuple(rng.permutation(np.array(events, dtype=object)))),
                            about={"contacts": ("floor",)})  # fmt: skip
    instants, told = playback.happens(trace)
    assert len(instants) == len(told) <= playback.BLOWS
    assert instants == sorted(set(instants))
    assert set(instants) <= {event.t for event in events}
    most = 0.0 if count <= playback.BLOWS else end / (playback.BLOWS - 1)
    late = [event.t - max(t for t in instants if t <= event.t) for event in events]
    assert max(late) <= most
    assert all(text.startswith("floor") for text in told)
    if count <= playback.BLOWS:
        assert told == ["floor touches" if i % 2 == 0 else "floor opens" for i in range(count)]


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of a ball and three engines: one touches 2000 times, one is off, one presses wherever the ball is."""
    case = load("bouncing_ball", "linear")
    run = truth_of(case).trajectory
    off = replace(run, q=run.q + 0.05 * np.sin(3.0 * run.t)[:, None], events=run.events[:1])
    pressed = replace(run, lam=np.full_like(run.lam, np.nanmax(run.lam)))
    given = [
        SimpleNamespace(engine="fake", profile=name, run=lambda one=one: one)
        for name, one in (
            ("presses", pressed),
            ("chatters", replace(run, events=chattering(0, CHATTER, float(run.t[-1])))),
            ("off", off),
        )
    ]
    return page_of(case, tmp_path_factory.mktemp("playback") / "out", *given)


@pytest.mark.parametrize(
    ("name", "before", "after", "said"),
    [
        ("floor:ball", Mode.FREE, Mode.SLIP, "floor:ball touches and slips"),
        ("floor:ball", Mode.FREE, Mode.STICK, "floor:ball touches and sticks"),
        ("balls 0 and 1", Mode.FREE, Mode.SLIP, "balls 0 and 1 touch and slip"),
        ("balls 0 and 1", Mode.CONTACT, Mode.BALLISTIC, "balls 0 and 1 let go below the surface"),
        ("balls 0 and 1", Mode.FREE, Mode.CONTACT, "balls 0 and 1 touch"),
        ("balls 0 and 1", Mode.BALLISTIC, Mode.CONTACT, "balls 0 and 1 press"),
        ("balls 0 and 1", Mode.BALLISTIC, Mode.COLLISION, "balls 0 and 1 collide"),
        ("floor:ball", Mode.STICK, Mode.SLIP, "floor:ball slips"),
    ],
)
def test_what_happens_is_said_whole_and_of_two_in_the_plural(name: str, before: Mode, after: Mode, said: str) -> None:
    events = (Event(t=1.0, contact=0, before=before, after=after),)
    trace = SimpleNamespace(run=SimpleNamespace(events=events), about={"contacts": (name,)})
    assert playback.happens(trace) == ([1.0], [said])


STEPS = """(async (way) => {
    const find = (name) => document.querySelector(`[data-${name}]`);
    const found = [];
    while (!find(way).disabled && found.length < 3000) {
        find(way).click();
        await NEXT;
        found.push([Number(find("readout").textContent.split(" ")[2]), find("event").textContent]);
    }
    return found;
})""".replace("NEXT", NEXT_FRAME)


def opened(browser: chromium.Browser, page: Path) -> None:
    browser.open(page)
    browser.wait("document.querySelector('[data-speed]').options.length > 0")
    browser.js(NEXT_FRAME)


@pytest.mark.browser
@needs_chromium
def test_buttons_go_through_what_happens_in_every_engine_that_is_shown_and_end(
    page: Path, browser: chromium.Browser
) -> None:
    opened(browser, page)
    assert browser.js("document.querySelector('[data-before]').disabled"), "nothing is before the start"
    truth = sorted({event.t for event in truth_of(load("bouncing_ball", "linear")).trajectory.events})
    steps = browser.js(f"{STEPS}('after')")
    assert len(truth) + 50 < len(steps) <= len(truth) + playback.BLOWS
    times = [t for t, _ in steps]
    assert all(a <= b for a, b in pairwise(times))
    assert all(min(abs(t - one) for one in times) < 2e-4 for t in truth), "an event of the truth is never passed over"
    assert all("floor" in text or "ball" in text for _, text in steps)
    assert any("fake:chatters" in text for _, text in steps)
    assert sum("truth" in text for _, text in steps) == len(truth)
    back = browser.js(f"{STEPS}('before')")
    assert [t for t, _ in back] == times[-2::-1]
    browser.js("document.querySelector('[data-show=\"fake:chatters\"]').click()")
    browser.js(NEXT_FRAME)
    own = browser.js(f"{STEPS}('after')")
    assert [t for t, _ in own] == pytest.approx([t for t in truth if t > times[0]], abs=2e-4)
    browser.js("document.querySelector('[data-show-all]').click()")
    browser.js(f"document.querySelector('[data-alone]').click(); {PICKED}('clock', 0)")
    alone = browser.js(f"{STEPS}('after')")
    assert [t for t, _ in alone] == pytest.approx(truth, abs=2e-4), "of the truth alone, whatever is shown"
    assert all("fake" not in text for _, text in alone)
    assert browser.complaints() == []


@pytest.mark.browser
@needs_chromium
@pytest.mark.parametrize("seed", range(3))
def test_a_turn_is_exaggerated_about_its_own_axis(seed: int, page: Path, browser: chromium.Browser) -> None:
    rng = np.random.default_rng(seed)
    opened(browser, page)
    start, turn = Rotation.random(rng=rng), rng.normal(size=3) * 0.02
    axes = [(one * start).as_matrix().T.tolist() for one in (Rotation.identity(), Rotation.from_rotvec(turn))]
    for factor in (1, 10, 100):
        angle = min(factor * float(np.linalg.norm(turn)), np.pi)
        found = np.array(browser.js(f"crossbody.solids.exaggerated({axes[0]}, {axes[1]}, {factor})"))
        wanted = Rotation.from_rotvec(angle * turn / np.linalg.norm(turn)) * start
        assert np.abs(found.T - wanted.as_matrix()).max() < 1e-9
    still = np.array(browser.js(f"crossbody.solids.exaggerated({axes[0]}, {axes[0]}, 10)"))
    assert np.abs(still - axes[0]).max() < 1e-9


@pytest.mark.browser
@needs_chromium
def test_what_an_engine_does_stands_beside_the_same_of_the_truth(page: Path, browser: chromium.Browser) -> None:
    opened(browser, page)
    browser.js("document.querySelector('[data-show=\"fake:chatters\"]').click()")
    browser.js(NEXT_FRAME)
    told = [text for _, text in browser.js(f"{STEPS}('after')") if "truth" in text and "fake:presses" in text]
    assert told
    assert all("; " not in text for text in told), "each does what the truth does, at its instant"


@pytest.mark.browser
@needs_chromium
def test_real_time_is_one_of_the_speeds_and_all_are_named(page: Path, browser: chromium.Browser) -> None:
    opened(browser, page)
    told = browser.js("[...document.querySelector('[data-speed]').options].map((one) => [one.text, Number(one.value)])")
    assert ["real time", 1] in told
    paces = [pace for _, pace in told]
    assert paces == sorted(set(paces))
    for text, pace in told:
        if pace != 1:
            times, _, way = text.split(" ", 2)
            assert float(times) == pytest.approx(max(pace, 1.0 / pace), rel=1e-2)
            assert way == ("slower" if pace < 1.0 else "faster")


PICKED = """(async (name, value) => {
    const field = document.querySelector(`[data-${name}]`);
    field.value = value;
    field.dispatchEvent(new Event(field.type === "range" ? "input" : "change"));
    await NEXT;
})""".replace("NEXT", NEXT_FRAME)


@pytest.mark.browser
@needs_chromium
def test_larger_differences_leave_the_picture_as_it_is_and_can_be_of_one_engine(
    page: Path, browser: chromium.Browser
) -> None:
    opened(browser, page)
    browser.js(f"{PICKED}('clock', 500)")
    browser.js("document.querySelector('[data-forces]').click()")
    browser.js("document.querySelectorAll('[data-show^=fake]').forEach((each) => each.click())")
    browser.js(NEXT_FRAME)
    true = browser.picture(".player canvas")
    assert browser.js("document.querySelector('[data-whose]').disabled")
    browser.js(f"{PICKED}('differences', 100)")
    assert not browser.js("document.querySelector('[data-whose]').disabled")
    assert browser.picture(".player canvas") == true, "the truth is drawn as it was, at the scale that it had"
    browser.js("document.querySelector('[data-show-all]').click()")
    browser.js(f"{PICKED}('differences', 1)")
    to_scale = browser.picture(".player canvas")
    browser.js(f"{PICKED}('differences', 10)")
    both = browser.picture(".player canvas")
    browser.js(f"{PICKED}('whose', 'fake:chatters')")
    one = browser.picture(".player canvas")
    browser.js(f"{PICKED}('whose', 'fake:off')")
    other = browser.picture(".player canvas")
    assert one == to_scale, "it moves as the truth does: there is no difference to be made larger"
    assert other == both != to_scale
    browser.js(f"{PICKED}('differences', 1)")
    assert browser.picture(".player canvas") == to_scale
    assert browser.complaints() == []


SHAFTS = """(() => {
    const g = CanvasRenderingContext2D.prototype, seen = window.shafts = [];
    const [begin, move, line, stroke] = [g.beginPath, g.moveTo, g.lineTo, g.stroke];
    let path = [];
    g.beginPath = function () { path = []; begin.call(this); };
    g.moveTo = function (x, y) { path.push([x, y]); move.call(this, x, y); };
    g.lineTo = function (x, y) { path.push([x, y]); line.call(this, x, y); };
    g.stroke = function () {
        if (path.length === 2 || path.length === 7) seen.push(...path);
        stroke.apply(this, arguments);
    };
})()"""
"""Keep the points of every shaft, outline of an impulse, bar and floor."""


@pytest.mark.browser
@needs_chromium
@pytest.mark.parametrize("view", ["ghosts", "beside"])
def test_arrows_stay_in_the_picture_however_long_they_are(view: str, page: Path, browser: chromium.Browser) -> None:
    opened(browser, page)
    run = truth_of(load("bouncing_ball", "linear")).trajectory
    browser.js(SHAFTS)
    browser.js(f"{PICKED}('view', '{view}')")
    browser.js(f"{PICKED}('longer', 100)")
    width, height = browser.js(
        "[document.querySelector('canvas').clientWidth, document.querySelector('canvas').clientHeight]"
    )
    for t in (run.t[np.argmax(run.lam[:, 0])], 0.0):  # deep in the floor, and high above it
        browser.js("window.shafts.length = 0")
        browser.js(f"{PICKED}('clock', {1000.0 * float(t) / float(run.t[-1])})")
        ends = np.array(browser.js("window.shafts"))
        assert len(ends) > 6
        assert np.all((ends >= 0.0) & (ends <= (width, height)))
        assert np.ptp(ends[:, 1]) > 0.1 * height, "an arrow is seen"
