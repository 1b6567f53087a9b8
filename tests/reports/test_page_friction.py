"""Friction on a page: its slip is that of the equations of motion, and its force stands against the cone."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from unpacked import numbers

from crossbody.cases import Mode, Trajectory, load
from crossbody.cases.scene_contacts import contacts
from crossbody.engines import load as load_engine
from crossbody.reports.measuring.friction import rubbing
from crossbody.reports.pages.friction import _line, friction, hysteresis
from crossbody.reports.runs import study
from crossbody.reports.runs.store import Trace
from crossbody.reports.scenes.scene import slip

CASES = (("sliding_block", "askew"), ("sliding_block", "flat"), ("rolling_sphere", ""), ("rocking_block", ""))


@pytest.fixture(scope="module", params=CASES, ids=lambda one: one[0])
def trace(request: pytest.FixtureRequest) -> Trace:
    name, variant = request.param
    case = load(name, variant) if variant else load(name)
    run = load_engine("reference").prepare(case, "compiled").run()
    return Trace(about=study._about(case, "reference", "compiled") | {"profile": "compiled"}, run=run)


def test_slip_is_that_of_the_equations(trace: Trace) -> None:
    case = load(trace.about["case"], trace.about["variant"])
    found = rubbing(trace.run, case)
    assert found is not None
    assert case.scene is not None
    places = [(one, k) for one in contacts(case.scene) if one.friction > 0.0 for k in range(one.places)]
    for m, (contact, place) in enumerate(places):
        drawn = slip(case.scene, contact, place, trace.run.q, trace.run.v)
        assert np.abs(drawn - found.slip[:, m]).max() <= 1e-8 * max(1.0, np.abs(found.slip).max())


def test_slip_on_a_belt_is_the_block_less_the_belt() -> None:
    """By hand, in the laboratory: x'' = mu g - w^2 x from rest to x' = V; stick; then x' = V cos w (t - t_2)."""
    case = load("block_on_belt")
    p = {name: float(value) for name, value in case.parameters.items()}
    run = load_engine("reference").prepare(case, "compiled", samples=np.linspace(0.0, case.t_end, 400)).run()
    (section,) = friction([Trace(about=study._about(case, "reference", "compiled"), run=run)])
    (line,) = section.plots[2].figure["data"]
    drawn = {float(t): (x, y) for t, x, y in zip(run.t, numbers(line["x"]), numbers(line["y"]), strict=True)}
    V, g, w = p["speed"], p["gravity"], np.sqrt(p["stiffness"])  # of a kilogram
    sticks = np.arcsin(V * w / (p["mu"] * g)) / w
    slides = sticks + (p["mu"] * g / w**2 * np.cos(w * sticks)) / V
    for t, (along, across) in drawn.items():
        rate = p["mu"] * g / w * np.sin(w * t) if t < sticks else V if t < slides else V * np.cos(w * (t - slides))
        assert abs(along - (rate - V)) < 1e-6
        assert abs(across) < 1e-12


def test_what_slides_is_on_the_edge_and_against_its_slip(trace: Trace) -> None:
    (section,) = friction([trace])
    cone, plane, slips = (plot.figure for plot in section.plots[:3])
    edge = cone["layout"]["shapes"][0]
    mu = edge["y1"] / edge["x1"]
    (line,) = cone["data"]
    normal, size = numbers(line["x"]), numbers(line["y"])
    pressed = np.isfinite(size)
    assert pressed.sum() > 10
    assert (size[pressed] <= mu * normal[pressed] * (1 + 1e-6) + 1e-9).all()
    (disc,), (way,) = plane["data"], slips["data"]
    force = np.array([numbers(disc[axis]) for axis in "xy"])
    speed = np.array([numbers(way[axis]) for axis in "xy"])
    fast = np.linalg.norm(speed, axis=0) > 1e-3 * np.nanmax(np.linalg.norm(speed, axis=0))
    if (trace.run.mode == Mode.SLIP).any() and fast.sum() > 3:
        against = np.sum(force * speed, axis=0)[fast] / np.linalg.norm(speed, axis=0)[fast]
        assert np.median(against) == pytest.approx(-1.0, abs=1e-3)


def test_one_contact_of_several_is_chosen_the_most_loaded_first() -> None:
    """Each has its own figures, of the same kinds; together they have at most twice the points of one."""
    case = load("sliding_block", "flat")
    run = load_engine("reference").prepare(case, "compiled").run()
    run = replace(run, lam=run.lam * np.linspace(1.0, 2.0, run.lam.shape[1]))
    (section,) = friction([Trace(about=study._about(case, "reference", "compiled"), run=run)])
    kinds = [[plot.name.split("-")[2] for plot in plots] for plots in section.choices.values()]
    assert len(section.choices) == 4
    assert kinds == [["cone", "plane", "slip"]] * 4
    assert len({plot.name for plot in section.plots}) == len(section.plots)
    loads = [float(np.nanmax(numbers(plots[0].figure["data"][0]["x"]))) for plots in section.choices.values()]
    assert loads == sorted(loads, reverse=True)
    for name, plots in section.choices.items():
        assert name in case.contacts
        assert all(name in plot.figure["layout"]["title"]["text"] for plot in plots)


def test_a_force_stands_over_depth_for_every_contact_and_no_row_of_friction(trace: Trace) -> None:
    """A row along a surface has no depth."""
    case = load(trace.about["case"], trace.about["variant"])
    assert case.scene is not None
    normals = {name for one in contacts(case.scene) for name in one.normals}
    chosen = [name for section in hysteresis([trace]) for name in section.choices]
    moves = np.abs(trace.run.gap).max(axis=0) > 0.0  # a block that only slides has no depth either
    pressed = {name for name in normals if moves[(k := case.contacts.index(name))] and trace.run.lam[:, k].any()}
    assert set(chosen) == pressed


def test_without_friction_there_is_no_such_section() -> None:
    case = load("bouncing_ball", "linear")
    run = load_engine("reference").prepare(case, "compiled").run()
    assert friction([Trace(about=study._about(case, "reference", "compiled"), run=run)]) == []


def at_instants(trace: Trace, t: np.ndarray) -> Trace:
    """A trace with samples at these instants, of which nothing is asked but when they are."""
    n, none = len(t), np.zeros((len(t), 0))
    run = Trajectory(t=t, q=none, v=none, gap=none, lam=none, energy=np.zeros((n, 2)), mode=none.astype(np.int8))
    return replace(trace, run=run)


@pytest.mark.parametrize("seed", range(3))
def test_a_line_of_friction_ends_wherever_its_contact_opens(trace: Trace, seed: int) -> None:
    """Between two samples that are drawn it was pressed throughout."""
    rng = np.random.default_rng(seed)
    n = 4000
    pressed = np.repeat(rng.uniform(size=n // 4) > 0.1, 4)
    x = np.where(pressed, np.arange(n, dtype=float), np.nan)
    for a, b in pairwise(numbers(_line(at_instants(trace, np.linspace(0.0, 1.0, n)), (x, x), 100)["x"])):
        if np.isfinite(a) and np.isfinite(b):
            assert pressed[int(a) : int(b) + 1].all()


def test_a_line_is_round_where_few_of_many_samples_turn_and_broken_at_a_jump(trace: Trace) -> None:
    """A force that turns around the cone within a hundredth of its samples, and jumps to the other side at an event."""
    n = 4000
    turned = np.pi * np.clip((np.arange(n) - 2000) / 40.0, 0.0, 1.0)
    t = np.linspace(0.0, 1.0, n)
    t[3001] = t[3000]
    x, y = np.where(np.arange(n) > 3000, -1.0, 1.0) * (np.cos(turned), np.sin(turned))
    line = _line(at_instants(trace, t), (x, y), 200)
    drawn = np.column_stack([numbers(line[axis]) for axis in "xy"])
    chords = np.linalg.norm(np.diff(drawn, axis=0), axis=1)
    assert np.nanmax(chords) < 0.3
    assert np.isnan(drawn).any(axis=1).sum() == 1


def test_forces_beyond_single_precision_are_gaps_and_no_warning(trace: Trace) -> None:
    lam, gap = np.array(trace.run.lam), np.array(trace.run.gap)
    lam[-3:] *= 1e245
    gap[-3:] = 1e200
    far = replace(trace, run=replace(trace.run, lam=lam, gap=gap))
    with np.errstate(over="raise"):
        sections = [*hysteresis([trace, far]), *friction([trace, far])]
    assert sections
