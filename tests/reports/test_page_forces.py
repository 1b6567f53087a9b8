"""Force over depth and over time: the loop's area is the energy lost, and what is off the plot is named."""

from __future__ import annotations

import base64
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from crossbody.cases import Mode, Trajectory, from_scene, load
from crossbody.cases.arrays import Floats
from crossbody.cases.scene import Body, Joint, Scene
from crossbody.engines import load as load_engine
from crossbody.reports.figures.section import Figure
from crossbody.reports.measuring.impulse import with_collisions
from crossbody.reports.measuring.truth import TRUTH
from crossbody.reports.pages.figures import MOST_SIGNALS, carrying, chattering, force, motion, note, penetration, plots
from crossbody.reports.pages.friction import hysteresis
from crossbody.reports.pages.sheet import Sheet, broken, off_scale
from crossbody.reports.runs import study
from crossbody.reports.runs.choice import Pick
from crossbody.reports.runs.jobs import run_case
from crossbody.reports.runs.store import Trace
from crossbody.reports.runs.store import load as load_trace

LIMITS = {"position": {1e-6: "limit", 1e-3: "limit of fake:p"}}


@pytest.fixture(scope="module")
def run() -> Trajectory:
    """Samples with both sides of every event, as pages have them."""
    case = load("bouncing_ball", "linear")
    (entry,) = run_case(case, [Pick(engine="reference", profile="compiled")], refine=False).entries
    assert entry.run is not None
    return entry.run


def trace(run: Trajectory, engine: str = TRUTH) -> Trace:
    about = {"engine": engine, "profile": "p", "contacts": ["floor"], "coordinates": [{"name": "height", "unit": "m"}]}
    return Trace(about=about, run=run, truth=run)


def numbers(coded: dict[str, str]) -> Floats:
    return np.frombuffer(base64.b64decode(coded["bdata"]), dtype=coded["dtype"]).astype(float)


def test_the_area_of_the_loop_is_the_energy_that_the_contact_lost(run: Trajectory) -> None:
    (section,) = hysteresis([trace(run)])
    (line,) = section.plots[0].figure["data"]
    x, y = numbers(line["x"]), numbers(line["y"])
    area = np.trapezoid(y, x)
    assert run.ledger is not None
    lost = -(run.ledger.contact[-1, 0] - run.ledger.contact[0, 0])
    assert lost > 0.1
    assert area == pytest.approx(lost, rel=0.02)


def test_a_loop_keeps_its_bends_however_long_the_body_rests() -> None:
    """Every sample of a contact that carries lies on the line that is drawn, to two per cent of the plot."""
    pytest.importorskip("mujoco")
    rests = load_engine("mujoco").prepare(load("bouncing_ball", "listing"), "matched").run()
    (section,) = hysteresis([trace(rests)])
    (line,) = section.plots[0].figure["data"]
    drawn, given = (
        np.stack(one, axis=1) for one in ((numbers(line["x"]), numbers(line["y"])), (-rests.gap[:, 0], rests.lam[:, 0]))
    )
    size = np.ptp(given[rests.lam[:, 0] > 0.0], axis=0)
    drawn, given = drawn / size, given[rests.lam[:, 0] > 0.0] / size
    start, way = drawn[:-1], np.diff(drawn, axis=0)
    off = given[:, None] - start[None]
    part = np.clip((off * way).sum(axis=2) / np.maximum((way**2).sum(axis=1), 1e-300), 0.0, 1.0)
    apart = np.linalg.norm(off - part[:, :, None] * way[None], axis=2).min(axis=1)
    assert np.nanmax(apart) < 0.02


def test_a_row_that_is_always_on_has_no_loop() -> None:
    case = load("bouncing_ball", "bilateral")
    assert hysteresis([trace(load_engine("reference").prepare(case, "compiled").run())]) == []


def test_a_force_beyond_the_plot_is_named(run: Trajectory) -> None:
    drawn = force([trace(run), trace(replace(run, lam=100.0 * run.lam), "wild")])
    top = float(np.nanmax(run.lam))
    assert drawn["layout"]["title"]["text"].endswith(f"Off scale: wild:p up to {100.0 * top:.3g} N (floor)")
    assert top < drawn["layout"]["yaxis"]["range"][1] < 2.0 * top
    calm = force([trace(run), trace(replace(run, lam=1.2 * run.lam), "calm")])
    assert "Off scale" not in calm["layout"]["title"]["text"]
    assert "range" not in calm["layout"]["yaxis"]


@pytest.mark.parametrize("times", [1.0, 100.0])
@pytest.mark.parametrize("seed", range(5))
def test_a_loop_is_whole(seed: int, times: float) -> None:
    """From the surface without a force to the largest and back, of every contact and however strong it is."""
    draw = np.random.default_rng(seed)
    phase = np.linspace(0.0, 6.0 * np.pi, 400) + draw.uniform(0.3, 2.0)
    depth, damped = np.sin(phase), np.sin(phase) + 0.3 * np.cos(phase)
    lam = np.where(depth > 0.0, times * np.maximum(damped, 0.0), 0.0)
    made = Trajectory(
        t=phase, q=-depth[:, None], v=0.0 * depth[:, None], gap=-depth[:, None], lam=lam[:, None],
        energy=np.ones((400, 2)), mode=np.where(lam > 0.0, 1, 0)[:, None].astype(np.int8),
    )  # fmt: skip
    weak = replace(made, lam=made.lam / times)
    (section,) = hysteresis([trace(weak), trace(made, "strong")])
    figure = section.plots[0].figure
    assert "range" not in figure["layout"]["xaxis"]
    assert ("range" in figure["layout"]["yaxis"]) == (times > 1.0)
    if times > 1.0:
        assert figure["layout"]["title"]["text"].endswith(f"Off scale: strong:p up to {lam.max():.3g} N (floor)")
        assert figure["layout"]["yaxis"]["range"][1] == pytest.approx(1.5 * weak.lam.max())
    x, y = (numbers(figure["data"][1][axis]) for axis in "xy")
    assert y.max() == pytest.approx(lam.max())
    assert np.isfinite(x).all(), "nothing is broken where both depth and force are known"
    for i in np.flatnonzero((y[1:] > 0.0) != (y[:-1] > 0.0)):
        touch = i if y[i] == 0.0 else i + 1
        assert x[touch] == 0.0


@pytest.mark.parametrize("times", [3.0, 100.0])
def test_a_depth_far_beyond_the_truths_is_named_and_no_loop_is_a_line(run: Trajectory, times: float) -> None:
    (section,) = hysteresis(
        [trace(run), trace(replace(run, gap=times * run.gap), "soft")],
        limits={"penetration_error": {0.1: "limit"}, "penetration": {2e-3: "limit"}},
    )
    layout = section.plots[0].figure["layout"]
    depth = -float(run.gap.min())
    assert ("range" in layout["xaxis"]) == (times > 4.0)
    assert (f"Off scale: soft:p up to {times * depth:.3g} m (floor)" in layout["title"]["text"]) == (times > 4.0)
    assert f"Limits of the depth: ±{0.1 * depth:.2g} m (limit)" in layout["title"]["text"]
    assert [line["x0"] for line in layout["shapes"]] == [2e-3]


def test_what_lies_on_a_rigid_floor_is_a_dot(run: Trajectory) -> None:
    lies = replace(run, gap=np.zeros_like(run.gap), lam=np.full_like(run.lam, 9.81))
    (section,) = hysteresis([trace(lies), trace(run, "soft")])
    modes = {line["name"]: line["mode"] for line in section.plots[0].figure["data"]}
    assert modes == {f"{TRUTH}": "lines+markers", "soft:p": "lines"}


def test_limits_that_are_narrower_than_a_line_are_said(run: Trajectory) -> None:
    for limit, said in ((1e-9, True), (0.5, False)):
        traces = [replace(one, about=one.about | {"scales": [2.0]}) for one in (trace(run), trace(run, "fake"))]
        figure = motion(traces, limits={"position": {limit: "limit"}})
        text = f"Limits narrower than a line: height ±{2.0 * limit:.2g} m (limit)"
        assert (text in figure["layout"]["title"]["text"]) == said


@pytest.mark.parametrize("times", [1.6, 3.9])
def test_a_force_of_a_few_times_the_truths_is_drawn_whole(run: Trajectory, times: float) -> None:
    drawn = force([trace(run), trace(replace(run, lam=times * run.lam), "strong")])
    assert "Off scale" not in drawn["layout"]["title"]["text"]
    assert "range" not in drawn["layout"]["yaxis"]


def test_rows_of_friction_are_not_said_to_be_above_a_surface(run: Trajectory) -> None:
    """They have none: a contact that is below it has tangential rows whose gap is 0."""
    names = ["floor", "floor t1", "floor t2", "wall"]
    wide = {name: np.repeat(getattr(run, name), 4, axis=1) for name in ("lam", "mode")}
    gap = np.column_stack([run.gap[:, 0], 0.0 * run.gap[:, 0], 0.0 * run.gap[:, 0], np.abs(run.gap[:, 0]) + 1.0])
    found = trace(replace(run, gap=gap, ledger=None, **wide))
    told = note("penetration", [replace(found, about=found.about | {"contacts": names}, truth=None)])
    assert told.endswith("Never below the surface: wall.")


def test_rows_that_carry_nothing_are_named_and_not_drawn(run: Trajectory) -> None:
    def wide(lam: Floats) -> Trace:
        doubled = {name: np.repeat(getattr(run, name), 2, axis=1) for name in ("gap", "mode")}
        found = trace(replace(run, lam=np.c_[lam, 0.0 * lam], ledger=None, **doubled))
        return replace(found, about=found.about | {"contacts": ["floor", "wall"]}, truth=None)

    bears, idles = wide(run.lam), wide(0.0 * run.lam)
    titles = [axis["title"]["text"] for key, axis in force([bears])["layout"].items() if key.startswith("yaxis")]
    assert [text.partition("<br>")[0] for text in titles] == ["force floor", "impulse"]
    assert note("force", [bears]).endswith("Without force in every run: wall.")
    assert (bool(plots("force", [bears])), bool(plots("force", [idles]))) == (True, False)


@pytest.mark.parametrize("seed", range(6))
def test_forces_of_rounding_are_none_whatever_the_unit_of_mass(run: Trajectory, seed: int) -> None:
    """Of rows beside one that bears, and of one that bears nothing itself but rounding."""
    draw = np.random.default_rng(seed)
    units = 10.0 ** draw.uniform(-6.0, 6.0)
    noise = draw.normal(size=run.lam.shape) * units * float(np.nanmax(run.lam)) * np.finfo(float).eps
    doubled = {name: np.repeat(getattr(run, name), 2, axis=1) for name in ("gap", "mode")}
    for bears in (1.0, 0.0):
        lam = np.c_[bears * units * run.lam + noise, noise]
        found = trace(replace(run, lam=lam, energy=units * run.energy, ledger=None, **doubled))
        found = replace(found, about=found.about | {"contacts": ["floor", "wall"]}, truth=None)
        assert carrying([found]) == ([0] if bears else [])


def test_of_an_engine_that_is_off_scale_everywhere_the_farthest_is_named() -> None:
    far = {"a:p": [(3.0, "N", "x"), (500.0, "N", "y"), (70.0, "N", "z")], "b:p": [(12345.0, "N m", "x")]}
    assert off_scale(far) == "a:p up to 500 N (y and 2 more); b:p up to 1.23e+04 N m (x)"


def test_of_many_rows_that_carry_nothing_a_few_are_named(run: Trajectory) -> None:
    """A robot has hundreds; their names would fill the page."""
    names = ["floor", *(f"pair {k}" for k in range(600))]
    rows = {name: np.repeat(getattr(run, name), 601, axis=1) for name in ("gap", "mode")}
    found = trace(replace(run, lam=np.c_[run.lam, np.zeros((len(run.t), 600))], ledger=None, **rows))
    told = note("force", [replace(found, about=found.about | {"contacts": names})])
    assert told.endswith("Without force in every run: pair 0, pair 1, pair 2, pair 3, pair 4, pair 5 and 594 more.")


def test_a_bound_of_an_angle_pushes_with_a_torque(tmp_path: Path) -> None:
    rod = Body(name="rod", mass=1.0, com=(0.0, 0.0, 0.5), inertia=(0.1, 0.1, 0.01, 0.0, 0.0, 0.0))
    hinge = Joint(name="hinge", body="rod", type="hinge", axis=(0.0, 1.0, 0.0), range=(-2.0, 0.3))
    case = from_scene(Scene(bodies=(rod,), joints=(hinge,)), q0=[0.2], t_end=1.0)
    result = run_case(case, [Pick(engine="reference", profile="compiled")], refine=False)
    study.write(tmp_path, [result], study.judge([result], {case.label: ""}), {"command": "", "time": ""})
    traces = [load_trace(path) for path in sorted((tmp_path / "traces").rglob("*.parquet"))]
    assert "torque hinge high<br>[N m]" in axis_titles(force(traces))
    assert "impulse<br>[N m s]" in axis_titles(force(traces))
    assert "depth hinge high<br>[rad]" in axis_titles(penetration(traces))
    (section,) = hysteresis(traces)
    assert axis_titles(section.plots[0].figure) == ["torque [N m]"]


def test_a_contact_above_its_surface_has_no_depth_and_its_line_goes_on(run: Trajectory) -> None:
    """It ended in the air, as if the run had."""
    (line,) = penetration([trace(run)])["data"]
    depth = numbers(line["y"])
    assert depth.max() > 0.0
    assert depth.min() == 0.0
    assert numbers(line["x"])[-1] == pytest.approx(run.t[-1])


def axis_titles(drawn: Figure) -> list[str]:
    return [axis["title"]["text"] for key, axis in drawn["layout"].items() if key.startswith("yaxis")]


def test_a_coordinate_that_only_rounding_moves_is_drawn_at_rest(run: Trajectory) -> None:
    def drawn(size: float) -> dict[str, object]:
        still = replace(run, q=size * np.sin(run.t)[:, None])
        found = trace(still)
        return motion([replace(found, about=found.about | {"scales": [1.0]})], limits=LIMITS)["layout"]["yaxis"]

    assert drawn(1e-15)["range"] == pytest.approx([-1e-6, 1e-6], rel=1e-3)
    assert "range" not in drawn(1e-2)


def test_the_floor_of_differences_is_that_of_the_largest_motion_of_any_run(run: Trajectory) -> None:
    """A coordinate that the truth leaves at 1e-16 would have 16 decades more."""
    still = trace(replace(run, q=1e-16 * run.q))
    moved = replace(trace(run, "fake"), truth=still.run)
    drawn = motion([still, moved])
    least = min(float(np.nanmin(numbers(line["y"]))) for line in drawn["data"] if line.get("yaxis") == "y2")
    assert 1e-17 <= least <= 1e-15


def test_tangential_rows_of_named_contacts_are_not_named(run: Trajectory) -> None:
    rows = {name: np.repeat(getattr(run, name), 7, axis=1) for name in ("gap", "mode")}
    lam = np.c_[run.lam, np.zeros((len(run.t), 6))]
    found = trace(replace(run, lam=lam, ledger=None, **rows))
    names = ["floor", "a", "b", "a t1", "a t2", "b t1", "floor t1"]
    found = replace(found, about=found.about | {"contacts": names}, truth=None)
    assert note("force", [found]).endswith("Without force in every run: a, b, floor t1.")
    assert note("modes", [found]).startswith("The same as floor: a, b.")


def test_an_engine_without_an_account_is_named(run: Trajectory) -> None:
    told = note("energy", [trace(run), trace(replace(run, ledger=None), "fake")])
    assert told.endswith("without an account of work: fake:p.")
    assert note("energy", [trace(run)]) == ""


def many(run: Trajectory, seed: int) -> list[Trace]:
    """The truth and two engines on a mechanism of many coordinates and contacts, each off by its own size."""
    draw = np.random.default_rng(seed)
    n = int(draw.integers(2, 20))
    sizes, loads = 10.0 ** draw.uniform(-9.0, 0.0, n), 10.0 ** draw.uniform(-3.0, 3.0, n)
    wide = {name: np.repeat(getattr(run, name), n, axis=1) for name in ("v", "gap", "mode")}
    exact = replace(run, q=np.repeat(run.q, n, axis=1), lam=run.lam * loads, ledger=None, events=(), **wide)
    about = {
        "engine": TRUTH, "profile": "", "contacts": [f"c{k}" for k in range(n)], "scales": [1.0] * n,
        "coordinates": [{"name": f"x{k}", "unit": "m"} for k in range(n)],
    }  # fmt: skip
    off = [replace(exact, q=exact.q + share * sizes) for share in (0.1, 1.0)]
    runs = [
        Trace(about=about | {"engine": "fake", "profile": f"p{i}"}, run=one, truth=exact) for i, one in enumerate(off)
    ]
    return [Trace(about=about, run=exact), *runs]


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize(("name", "axis"), [("motion", "x"), ("force", "force c")])
def test_what_matters_most_is_seen_first_and_nothing_that_is_drawn_is_lost(
    run: Trajectory, name: str, axis: str, seed: int
) -> None:
    traces = many(run, seed)
    shown = [
        [
            int(text.removeprefix(axis).partition("<br>")[0])
            for text in axis_titles(part.figure)
            if text.startswith(axis)
        ]
        for part in plots(name, traces, 200)
    ]
    off = np.abs(traces[-1].run.q - traces[0].run.q).max(axis=0) if name == "motion" else traces[0].run.lam.max(axis=0)
    order = np.argsort(-off)[:MOST_SIGNALS].tolist()
    assert sorted(k for part in shown for k in part) == sorted(order)
    assert set(shown[0]) == set(order[: len(shown[0])])
    assert all(part == sorted(part) for part in shown)
    assert len(shown[0]) <= 4
    assert len(shown) == (1 if len(order) <= 4 else 2)
    folded = [part.folded for part in plots(name, traces, 200)]
    assert folded[0] == ""
    assert all(text.startswith(f"{len(part)} more ") for text, part in zip(folded[1:], shown[1:], strict=True))


@pytest.mark.parametrize("seed", range(4))
def test_the_error_of_an_impulse_is_what_lies_between_the_lines(run: Trajectory, seed: int) -> None:
    """A run whose collisions take no time has too few samples for the force of a truth whose collisions take some."""
    draw = np.random.default_rng(seed)
    touch = next(event for event in run.events if event.after == Mode.CONTACT)
    kept = np.unique(np.r_[0, draw.choice(len(run.t), 20), len(run.t) - 1])
    sparse = Trajectory(
        **{name: getattr(run, name)[kept] for name in ("t", "q", "v", "gap", "energy", "mode")},
        lam=np.zeros((len(kept), 1)), events=(replace(touch, impulse=float(draw.uniform(0.5, 3.0))),),
    )  # fmt: skip
    beside = replace(sparse, lam=run.lam[kept], events=())
    lead = trace(run)
    rigid = Trace(about=lead.about | {"engine": "rigid"}, run=sparse, truth=beside)
    figure = force([lead, rigid])
    error = next(line for line in figure["data"] if line["meta"] == "rigid:p" and line["yaxis"] == "y3")
    ends = [with_collisions(one, one.events)[-1, 0] for one in (run, sparse)]
    assert numbers(error["y"])[-1] == pytest.approx(abs(ends[1] - ends[0]), rel=1e-4)


def test_where_no_force_of_the_truth_is_known_no_error_of_an_impulse_is_drawn(run: Trajectory) -> None:
    blind = replace(run, lam=np.full_like(run.lam, np.nan), events=())
    lead = replace(trace(blind), truth=None)
    drawn = force([lead, Trace(about=lead.about | {"engine": "seeing"}, run=run, truth=blind)])
    assert [text.partition("<br>")[0] for text in axis_titles(drawn)] == ["force floor", "impulse"]


@pytest.mark.parametrize("seed", range(4))
def test_a_force_of_rounding_in_the_truth_sets_neither_scale_nor_limit(run: Trajectory, seed: int) -> None:
    """Couplings of a robot that falls freely carry 1e-16 N m: what others carry is not off a scale of that."""
    size = float(10.0 ** np.random.default_rng(seed).uniform(-20.0, -12.0))
    idles = replace(run, lam=size * run.lam, ledger=None, events=())
    lead, bears = trace(idles), trace(replace(run, lam=1e-3 * run.lam, ledger=None, events=()), "bears")
    drawn = force([lead, replace(bears, truth=idles)], limits={"lam_impulse_path": {1e-6: "limit"}})
    assert "Off scale" not in drawn["layout"]["title"]["text"]
    assert "range" not in drawn["layout"]["yaxis"]
    (limit,) = drawn["layout"]["shapes"]
    weight = 9.81 * 1.0  # of the ball, which a thousandth counts as none
    assert limit["y0"] > 1e-6 * 1e-4 * weight * float(run.t[-1])


@pytest.mark.parametrize("seed", range(30))
def test_a_line_on_a_logarithmic_axis_crosses_no_decades_from_the_floor_and_loses_no_sample(seed: int) -> None:
    draw = np.random.default_rng(seed)
    floor, t = 1e-16, np.arange(200.0)
    level = np.repeat(draw.choice([1e-18, 3e-16, 1e-9, 1e-3], 20), draw.multinomial(180, np.full(20, 0.05)) + 1)
    y = np.maximum(level * draw.uniform(0.5, 2.0, 200), floor)
    y[0] = floor
    low = y <= floor

    def leaps(i: int) -> bool:
        """Whether between this sample and the next a line would join what is cut off and what is seen."""
        before = low[i - 1] == low[i] if i else low[0]
        after = low[i + 2] == low[i + 1] if i + 2 < len(y) else low[-1]
        return bool(low[i] != low[i + 1] and max(y[i], y[i + 1]) > 100.0 * floor and before and after)

    bx, by = broken(t, y, floor)
    seen = np.isfinite(by)
    assert (bx[seen] == t).all()
    assert (by[seen] == y).all()
    gaps = np.flatnonzero(~seen) - np.arange((~seen).sum()) - 1
    assert gaps.tolist() == [i for i in range(len(y) - 1) if leaps(i)]
    assert len(gaps) > 0


@pytest.mark.parametrize("seed", range(10))
def test_coordinates_at_rest_are_named_and_not_drawn(run: Trajectory, seed: int) -> None:
    """An axis of rounding noise says nothing; but one that any engine moves is drawn."""
    draw = np.random.default_rng(seed)
    limit, rests = 1e-6, draw.random(3) < 0.5
    names = [f"rests {k}" if rest else f"moves {k}" for k, rest in enumerate(rests)]
    q = np.concatenate([run.q, *(0.9 * limit * draw.random((len(run.t), 1)) for _ in names)], axis=1)
    moved = q + np.where(np.r_[False, rests], 0.0, 3.0 * limit) * np.sin(run.t)[:, None]
    about = {"coordinates": [{"name": name, "unit": "m"} for name in ("height", *names)], "scales": [1.0] * 4}
    traces = [trace(replace(run, q=q)), trace(replace(run, q=np.where(np.r_[True, rests], q, moved)), "fake")]
    traces = [replace(one, about=one.about | about, truth=traces[0].run) for one in traces]
    titles = "".join(title for one in plots("motion", traces, limits={"position": {limit: "limit"}})
                     for title in axis_titles(one.figure))  # fmt: skip
    assert [name in titles for name in ("height", *names)] == [True, *~rests]
    told = note("motion", traces, {"position": {limit: "limit"}})
    named = ", ".join(name for name, rest in zip(names, rests, strict=True) if rest)
    assert told.endswith(f"At rest in every run, to within the limit: {named}." if named else "ends is drawn.")
    alone = [replace(one, run=replace(one.run, q=0.0 * q), truth=None) for one in traces]
    assert plots("motion", alone, limits={"position": {limit: "limit"}}), "what rests as a whole is the motion"


def comb(run: Trajectory, seed: int, periods: int) -> Trajectory:
    """The run with a force that opens and closes so often, of sizes at random."""
    rng, t = np.random.default_rng(seed), np.linspace(0.0, run.t[-1], 40 * periods + 1)
    sizes = np.append(rng.uniform(0.2, 1.4, periods), 0.0) * np.nanmax(run.lam)
    at = np.arange(len(t)) // 40
    lam = np.where(np.arange(len(t)) % 40 < rng.integers(2, 30), sizes[at], 0.0)[:, None]
    shaped = {name: np.zeros((len(t), getattr(run, name).shape[1])) for name in ("q", "v", "energy")}
    mode = np.where(lam > 0.0, Mode.CONTACT, Mode.FREE).astype(np.int8)
    return replace(run, t=t, lam=lam, gap=-1e-4 * lam, mode=mode, events=(), ledger=None, **shaped)


@pytest.mark.parametrize("seed", range(8))
def test_a_force_that_is_a_comb_is_drawn_from_least_to_largest_below_the_truth_and_by_its_mean(
    run: Trajectory, seed: int
) -> None:
    """The mean has the impulse, whose rate a reader compares with the truth's force."""
    often = comb(run, seed, 300)
    traces = [trace(run), trace(often, "fake")]
    figure = force(traces)
    lines = [line for line in figure["data"] if line["yaxis"] == "y"]
    assert [line["meta"] for line in lines] == ["fake:p", TRUTH, "fake:p"], "nothing lies over the truth but a line"
    band, _, mean = lines
    assert band["fill"] == "toself"
    x, y = numbers(band["x"]), numbers(band["y"])
    half, lam = len(x) // 2, often.lam[:, 0]
    for start, end, high, low in zip(x[:half:2], x[1:half:2], y[:half:2], y[half:][::-1][::2], strict=True):
        part = lam[(often.t >= start) & (often.t <= end)]
        assert low - 1e-6 <= part.min() <= part.max() <= high + 1e-6 * lam.max()
    assert y.max() == pytest.approx(lam.max(), rel=1e-6)
    x, y = numbers(mean["x"]), numbers(mean["y"])
    assert np.sum(y[:-1] * np.diff(x)) == pytest.approx(np.trapezoid(lam, often.t), rel=1e-4)
    assert "least to largest of fake:p" in figure["layout"]["title"]["text"]
    (section,) = hysteresis(traces)
    first, second = section.plots[0].figure["data"]
    assert (first["meta"], first["mode"], second["meta"], second["mode"]) == ("fake:p", "markers", TRUTH, "lines")
    assert len(numbers(first["x"])) <= 400
    assert set(numbers(first["y"])) <= set(lam.astype(np.float32).astype(float))


@pytest.mark.parametrize("periods", [1, 5, 20])
def test_a_force_of_a_few_periods_is_drawn_as_it_is(run: Trajectory, periods: int) -> None:
    some = comb(run, 0, periods)
    assert not chattering([trace(run), trace(some, "fake")], 0)
    assert chattering([trace(comb(run, 1, 300)), trace(comb(run, 2, 300), "fake")], 0) == {}, "as the truth's"


def test_of_several_limits_narrower_than_a_line_one_number_is_said_of_each_quantity(run: Trajectory) -> None:
    sheet = Sheet(["depth a\n[m]", "depth b\n[m]"], "Depths", 100)
    for row in (0, 1):
        sheet.line(trace(run), row, run.q[:, 0])
        for half, name in ((1e-6, "limit"), (6.7e-8, "limit"), (1e-8, "limit of fake:p"), (1e-7, "limit")):
            sheet.band(row, half, name)
    assert "Limits narrower than a line: depth a, depth b ±6.7e-08 m (limit)" in sheet.done()["layout"]["title"]["text"]
    assert "fake" not in sheet.done()["layout"]["title"]["text"]
