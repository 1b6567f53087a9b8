"""Questions with known answers that every run asks: nothing is told of what is right, and what is wrong is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import Trajectory, rotations
from crossbody.reports.judging import (
    judge_controls,
    known,
    known_arithmetic,
    known_growth,
    known_parts,
    known_samples,
    known_sides,
    known_steps,
    known_tables,
    known_touches,
    parts,
    truth,
)
from crossbody.reports.judging.clocks import Clock, mistimed
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.measuring import alignment
from crossbody.reports.measuring.laid import Laid
from crossbody.reports.measuring.truth import shortened
from crossbody.reports.metrics import event_gap
from crossbody.reports.pages import (
    errors,
    figures,
    friction,
    grid,
    index_page,
    known_figures,
    known_pages,
    playback,
    precision,
    sheet,
    summary,
)
from crossbody.reports.pages.made_up_traces import Drawn

BOX = Path(__file__).parents[1] / "support" / "driven_box.xml"
KNOWN = (*known.kinds(), *known.kinds(known.OF_FILES))


@pytest.mark.parametrize(
    "module", [*KNOWN, *known.kinds(known.OF_SCENES)], ids=lambda module: module.__name__.rpartition(".")[2]
)
def test_what_is_right_is_not_told(module: Any) -> None:
    assert module.wrong() == ()


@pytest.mark.parametrize("module", KNOWN, ids=lambda module: module.__name__.rpartition(".")[2])
def test_what_is_wrong_is_a_row_of_every_run(module: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "wrong", lambda: (("position", 1.0, (2.0, 2.0), "a motion"),))
    of_file = module in known.kinds(known.OF_FILES)  # asked where a file is run
    case = cases.load(str(BOX), "two", t_end=0.02) if of_file else cases.load("bouncing_ball", "elastic")
    rows = judge_controls.blind(case, shortened(truth_of(case)), "")
    assert [(row.metric, row.verdict) for row in rows] == [("position (control)", "outside")]


PARTS: dict[str, Callable[[Any], Any]] = {
    "extrapolated": lambda own: lambda errors, ratio: own(errors, ratio + 1.0),
    "observed": lambda own: lambda errors, sizes: (2.0 * own(errors, sizes)[0], own(errors, sizes)[1]),
    "remaining": lambda own: lambda errors: 2.0 * own(errors),
    "_most": lambda own: lambda error: float(np.mean(np.abs(error))),
    "scale_of": lambda own: lambda *given: 2.0 * own(*given),
}


@pytest.mark.parametrize("name", PARTS)
def test_parts_that_are_others_are_told(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    change = PARTS[name]
    monkeypatch.setattr(parts, name, change(getattr(parts, name)))
    if name == "remaining":
        monkeypatch.setattr(known_parts, name, parts.remaining)
    known_parts.wrong.cache_clear()
    try:
        assert bool(known_parts.wrong()) == (name != "_most")  # by which is said to what parts are known alone
    finally:
        known_parts.wrong.cache_clear()


def test_an_instant_that_stands_twice_is_read_before_what_happens(monkeypatch: pytest.MonkeyPatch) -> None:
    """Behind it every row is where it must be: a multiplier of .3 N that a release cuts off was none."""
    own = np.searchsorted

    def behind(*given: Any, side: str = "left", **more: Any) -> Any:
        return own(*given, side="right", **more) - 1 + (own(*given, side="right") == own(*given, side="left"))

    monkeypatch.setattr(event_gap, "np", SimpleNamespace(**{**vars(np), "searchsorted": behind}))
    known_sides.wrong.cache_clear()
    try:
        assert {name for name, *_ in known_sides.wrong()} == {"event_gap"}
    finally:
        known_sides.wrong.cache_clear()


def test_a_truth_that_is_asked_on_one_side_of_a_jump_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(alignment, "_sides", lambda truth, run, t: (t, np.arange(len(t))))
    known_sides.wrong.cache_clear()
    try:
        assert {name for name, *_ in known_sides.wrong()} == {"lam_impulse"}
    finally:
        known_sides.wrong.cache_clear()


@pytest.mark.parametrize(("laid", "said"), [(True, "slides"), (False, "bounces")])
def test_a_clock_that_is_laid_on_every_touch_or_on_none_is_told(
    laid: bool, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def always(truth: Any, run: Any, case: Any, here: Any, there: Any) -> Laid:
        return Laid(at=there, on=np.append(True, np.full(len(there) - 1, laid)))

    monkeypatch.setattr(alignment, "nearest", always)
    known_touches.wrong.cache_clear()
    try:
        told = {(name, what) for name, _, _, what in known_touches.wrong()}
    finally:
        known_touches.wrong.cache_clear()
    assert ("position", f"a body that {said} and touches late") in told
    assert all(said in what for _, what in told)


@pytest.mark.parametrize("times", [2.0, 0.1])
def test_growth_that_depends_on_the_unit_of_time_is_told(times: float, monkeypatch: pytest.MonkeyPatch) -> None:
    for end in (times, None):
        known_growth.wrong.cache_clear()
        monkeypatch.setattr(
            known_growth, "grown",
            lambda t, apart, off, end=end: truth.grown(t, apart, off) * (t[-1] if end is None else end),
        )  # fmt: skip
        assert known_growth.wrong()
    known_growth.wrong.cache_clear()


@pytest.mark.parametrize(("module", "of", "name", "said"), [
    (known_arithmetic, rotations, "turned", {"signed", "differences", "ways", "drifts"}),
    (known_arithmetic, rotations, "matrices", {"matrices"}),
    (known_arithmetic, known_arithmetic, "spline", {"spline"}),
    (known_samples, known_samples, "multipliers", {"multipliers"}),
])  # fmt: skip
def test_arithmetic_that_is_off_by_a_millionth_is_told(
    module: Any, of: Any, name: str, said: set[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    own = getattr(of, name)

    def off(*given: Any) -> Any:
        found = own(*given)
        return found if found is None else found * (1.0 + 1e-6)

    monkeypatch.setattr(of, name, off)
    module.wrong.cache_clear()
    try:
        assert {found for found, *_ in module.wrong()} == said
    finally:
        module.wrong.cache_clear()


def test_steps_that_err_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    own = known_steps.stepped

    def off(*given: Any) -> Trajectory:
        run = own(*given)
        return replace(run, q=run.q * (1.0 + 1e-3), steps=3 * run.steps if given[3] < 1e-7 else run.steps)

    monkeypatch.setattr(known_steps, "stepped", off)
    told = {name for name, *_ in known_steps._cubic()}
    assert told == {
        f"reference {name}{what}" for name in ("explicit", "implicit") for what in ("", " (steps)", " (work)")
    }


def test_tables_whose_coefficients_are_others_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    for k, (name, A, b, c, order) in enumerate(known_tables.METHODS):
        for i, j in zip(*np.nonzero(A), strict=True):
            other = A.copy()
            other[i, j] *= 1.0 + 1e-10
            changed = (*known_tables.METHODS[:k], (name, other, b, c, order), *known_tables.METHODS[k + 1 :])
            monkeypatch.setattr(known_tables, "METHODS", changed)
            assert any(abs(off) > known_tables.ROUNDED for _, off, _ in known_tables._orders())


@pytest.fixture
def drawn_anew() -> Iterator[None]:
    """What pages draw is asked for, and made up, again."""
    caches = (known_pages.wrong, known_figures.drawn)
    for one in (*caches, *caches):
        one.cache_clear()
    yield
    for one in caches:
        one.cache_clear()


@pytest.mark.parametrize("seed", range(20, 30))
@pytest.mark.usefixtures("drawn_anew")
def test_pages_draw_any_motion_as_it_is(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(known_figures, "Drawn", partial(Drawn, seed))
    assert known_pages.wrong() == ()


PAGES: dict[str, tuple[Any, str, Callable[[Any], Any], str]] = {
    "a largest value": (playback, "_largest", lambda _: lambda lam: float(lam.max()), "playback"),
    "errors with their sign": (figures, "apart", lambda _: lambda a, b, _: a - b, "force figure"),
    "errors of the next coordinate": (
        errors, "differences", lambda own: lambda *given: np.roll(own(*given), 1, axis=1), "motion figure",
    ),
    "rotations by their entries": (errors, "differences", lambda _: lambda a, b, _: np.abs(a - b), "rotations"),
    "lines over long steps": (sheet, "LONG", lambda _: 2.0, "long steps"),
    "blows left out": (figures, "with_collisions", lambda own: lambda run, _: own(run, ()), "force figure"),
    "half an energy": (figures, "energy_of", lambda own: lambda run: 0.5 * own(run), "energy figure"),
    "depth above": (figures, "_depth", lambda _: lambda gap, _: gap, "penetration figure"),
    "one sample less": (sheet, "keep", lambda own: lambda *given: own(*given)[:-1], "step figure"),
    "modes at their ends": (
        sheet, "_spans", lambda own: lambda *given: ((b, b, mode) for _, b, mode in own(*given)), "mode figure",
    ),
    "slip the other way": (friction, "slip", lambda own: lambda *given: -own(*given), "friction figures"),
    "heat by size": (grid, "share", lambda _: lambda row: abs(row["value"]) / row["limit"], "heat"),
    "run times in s": (
        precision, "scatter", lambda own: lambda points, *more: own([(w, x, 1e-3 * t) for w, x, t in points], *more),
        "error against run time",
    ),
    "means": (summary, "median", lambda _: np.mean, "table of engines"),
    "by its own size": (index_page, "_share", lambda _: lambda row: row["value"], "what changed"),
}  # fmt: skip


@pytest.mark.parametrize("what", PAGES)
@pytest.mark.usefixtures("drawn_anew")
def test_what_pages_draw_otherwise_is_told(what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    module, name, change, figure = PAGES[what]
    monkeypatch.setattr(module, name, change(getattr(module, name)))
    assert figure in {told for told, *_ in known_pages.wrong()}


def test_times_that_are_no_run_s_are_told() -> None:
    run = engines.load("reference").prepare(cases.load("bouncing_ball", "elastic"), "compiled").run()
    run = replace(run, wall_s=1.0, steps=1000)
    right = Clock(run=run, around_s=2.0, compiled_s=0.0)
    assert list(mistimed(right, run, 3.0)) == []
    for clock, shown, took in (
        (right, replace(run, wall_s=1.1), 3.0), (right, replace(run, steps=1), 3.0), (right, run, 1.9),
        (replace(right, around_s=0.9), run, 3.0), (replace(right, run=replace(run, wall_s=1e-5)), run, 3.0),
        (replace(right, run=replace(run, control_s=1.1)), run, 3.0),
        (Clock(run=replace(run, wall_s=1e-6), around_s=1e-6, compiled_s=0.0), replace(run, wall_s=1e-6), 3.0),
    ):  # fmt: skip
        assert list(mistimed(clock, shown, took))
    unknown = replace(run, wall_s=0.0)  # one's own engine need not know it
    assert list(mistimed(replace(right, run=unknown), unknown, 3.0)) == []
