"""How soon the main page is there, and how fast 30 bodies move: run by hand with `-m bench -s`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import chromium
import numpy as np
import pytest
from study_pages import page_of

from crossbody.cases import from_scene
from crossbody.cases.scene import Body, Joint, Pair, RowLaw, Scene, Shape
from crossbody.engines import load as load_engine
from crossbody.reports.cli import main

pytestmark = [
    pytest.mark.bench,
    pytest.mark.skipif(chromium.binary() is None, reason="Chromium is not installed."),
]
COUNT, SECONDS, TRIALS = 30, 3.0, 5
FRAME = 1000.0 / 60.0  # time that one of 60 frames a second may take, ms
SHARE = 1.0 / 3.0  # of a frame that the page may work: the rest is the browser's and other programs'
SCRIPT = 8.0  # ms of a frame that may be script: drawing balls without a graphics card takes as long
LOADED = 1500.0
"""Time in which the main page is to be there with its first plot, ms; others may share the machine."""
SETTLED = """[...document.querySelectorAll('.plot:not([data-drawn])')]
    .every((box) => !box.offsetParent || box.getBoundingClientRect().top > innerHeight + 500)"""
"""Whether plots near the screen are drawn: none is drawn while the bodies move."""


@pytest.fixture
def browser(tmp_path: Path) -> Iterator[chromium.Browser]:
    opened = chromium.Browser(tmp_path / "profile")
    yield opened
    opened.close()


def busy(browser: chromium.Browser, name: str = "TaskDuration") -> float:
    """Time that the page's thread has worked, ms: what else the machine does is not in it."""
    told = browser.call("Performance.getMetrics")["metrics"]
    return 1000.0 * next(one["value"] for one in told if one["name"] == name)


def test_the_main_page_is_there_within_its_time(tmp_path: Path, browser: chromium.Browser) -> None:
    with pytest.raises(SystemExit):
        main(["run", "--out", str(tmp_path / "out"), "--quiet"])
    took = []
    for _ in range(TRIALS):
        browser.open(tmp_path / "out" / "index.html")
        took.append(browser.js(
            "new Promise((done) => { const look = () => document.querySelector('.plot[data-drawn]')"
            " ? done(performance.now()) : requestAnimationFrame(look); look(); })"
        ))  # fmt: skip
    print(f"main page: {min(took):.0f} ms from the click until its first plot is drawn, at most {max(took):.0f}")
    assert min(took) < LOADED


def swinging() -> tuple[Scene, list[float]]:
    """Return pendulums side by side, and their angles."""
    solid, names = {"mass": 1.0, "com": (0.0, 0.0, -0.3), "inertia": (0.1, 0.1, 0.01, 0.0, 0.0, 0.0)}, range(COUNT)
    bodies = tuple(Body(name=f"b{k}", position=(0.0, 0.2 * k, 0.0), **solid) for k in names)
    joints = tuple(Joint(name=f"j{k}", body=f"b{k}", type="hinge", axis=(0.0, 1.0, 0.0)) for k in names)
    shapes = tuple(Shape(name=f"s{k}", body=f"b{k}", type="capsule", size=(0.03, 0.2, 0.0)) for k in names)
    return Scene(bodies=bodies, joints=joints, shapes=shapes), np.linspace(0.1, 1.0, COUNT).tolist()


def dropped() -> tuple[Scene, list[float]]:
    """Return balls above a floor, one row each, most of which press at any time, and their heights."""
    solid, names = {"mass": 1.0, "inertia": (0.1, 0.1, 0.1, 0.0, 0.0, 0.0)}, range(COUNT)
    soft = RowLaw(a0=400.0, a1=1.0)
    bodies = tuple(Body(name=f"b{k}", position=(0.25 * (k % 6), 0.25 * (k // 6), 0.1), **solid) for k in names)
    joints = tuple(Joint(name=f"j{k}", body=f"b{k}", type="slide", axis=(0.0, 0.0, 1.0)) for k in names)
    balls = tuple(Shape(name=f"s{k}", body=f"b{k}", type="sphere", size=(0.1, 0.0, 0.0)) for k in names)
    floor = Shape(name="floor", type="plane", size=(3.0, 3.0, 0.1))
    pairs = tuple(Pair(name=f"p{k}", first="floor", second=f"s{k}", law=soft) for k in names)
    scene = Scene(bodies=bodies, joints=joints, shapes=(floor, *balls), pairs=pairs)
    return scene, np.linspace(-0.02, 0.05, COUNT).tolist()


@pytest.mark.parametrize(("made", "share"), [(swinging, SHARE), (dropped, 1.0)])
def test_thirty_bodies_move_at_sixty_frames_a_second(
    made: Callable[[], tuple[Scene, list[float]]], share: float, tmp_path: Path, browser: chromium.Browser
) -> None:
    scene, start = made()
    case = from_scene(scene, q0=start, t_end=2.0)
    page = page_of(case, tmp_path / "out", load_engine("reference").prepare(case, "compiled"))
    browser.open(page)
    browser.js("document.querySelector('.player').scrollIntoView()")
    browser.wait("document.querySelector('[data-speed]').options.length > 0")
    browser.wait(SETTLED)
    browser.call("Performance.enable", timeDomain="threadTicks")
    browser.js("document.querySelector('[data-play]').click()")
    before, script = busy(browser), busy(browser, "ScriptDuration")
    frames = browser.js(
        f"new Promise((done) => {{ const end = performance.now() + {1000.0 * SECONDS}; let count = 0;"
        " const one = () => { count += 1; performance.now() < end ? requestAnimationFrame(one) : done(count); };"
        " requestAnimationFrame(one); })"
    )
    work, script = (busy(browser) - before) / frames, (busy(browser, "ScriptDuration") - script) / frames
    told = f"{work:.1f} of {FRAME:.1f} ms of work each, {script:.1f} of them script"
    print(f"{COUNT} bodies {made.__name__}: {frames / SECONDS:.0f} frames a second, {told}")
    assert browser.complaints() == []
    assert script < SCRIPT
    assert work < share * FRAME
