"""Optional engines on bodies on a line, against truths that are written out here; one that is absent is a skip."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import CaseUnsupported, EngineUnavailable, Mode, Outcome
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, Loop, Scene, Tendon
from crossbody.engines._line import line
from crossbody.engines._peer import ended, sampled
from crossbody.engines.equations import system_of
from crossbody.reports import metrics
from crossbody.reports.judging.audit import audit
from crossbody.reports.judging.comparison import judged
from crossbody.reports.judging.truth import law_of
from crossbody.reports.judging.verdict import Word
from crossbody.reports.runs import choice, jobs

PACKAGES = {"exudyn": "exudyn", "drake": "pydrake", "dart": "dartpy", "pymunk": "pymunk"}
LAW = ("exudyn", "drake")
STEPPED = ("dart", "pymunk")
SOFTENED = {"dart": 3e-5, "pymunk": 1e-9}
"""DART adds 1e-5 to the diagonal of its complementarity problem."""
G, A0, T_END = 9.81, 1e5, 2.0


def peer(name: str) -> Any:
    try:
        return engines.load(name)
    except EngineUnavailable as error:
        pytest.skip(str(error))


def drop(**given: float) -> cases.Case:
    return cases.load("bouncing_ball", "elastic", **{"a0": A0, "a1": 0.0, "a2": 0.0, "t_end": T_END} | given)


def height(t: float) -> float:
    """Without memory: parabolas between half sines of length pi/w, h = -v/w sin(w s)."""
    v, w = np.sqrt(2.0 * G), np.sqrt(A0)
    contact, flight = np.pi / w, 2.0 * v / G
    s = (t - v / G) % (contact + flight)
    s, inside = (s - contact, False) if s > contact else (s, True)
    return float(-v / w * np.sin(w * s) if inside else v * s - 0.5 * G * s * s)


@pytest.mark.parametrize("name", LAW)
def test_adaptive_engines_follow_the_memoryless_law(name: str) -> None:
    engine = peer(name)
    errors = [abs(engine.prepare(drop(), rtol=rtol).run().q[-1, 0] - height(T_END)) for rtol in (1e-5, 1e-12)]
    assert errors[1] < 1e-8
    assert errors[1] < 1e-3 * errors[0]


@pytest.mark.parametrize("name", LAW)
def test_every_metric_is_small_against_the_law_that_is_followed(name: str) -> None:
    run = peer(name).prepare(drop(), rtol=1e-12)
    own = law_of(run.follows)
    assert own is not None
    found = run.run()
    for metric, limit in (("position", 1e-8), ("event_times", 1e-8), ("energy_drift", 1e-7), ("lam_impulse", 1e-8)):
        value = metrics.load(metric).measure(own, found, drop())
        assert value is not None
        assert value < limit, metric
    assert metrics.load("touch_count").measure(own, found, drop()) == 0.0


@pytest.mark.parametrize("name", LAW)
@pytest.mark.parametrize("variant", ["listing", "bilateral"])
def test_the_cases_law_reached_the_engine(name: str, variant: str) -> None:
    case = cases.load("bouncing_ball", variant)
    mine = peer(name).prepare(case).audit()
    theirs = engines.load("reference").prepare(case, "compiled").audit()
    rows = {row.quantity: row for row in audit(mine, theirs, case, peer(name).hidden_in("matched"))}
    assert all(row.ok for row in rows.values())
    assert rows["constants"].difference == 0.0
    if name == "exudyn":
        assert rows["lam"].difference < 1e-12


@pytest.mark.parametrize("name", LAW)
def test_one_pair_of_sliders_swaps_its_speeds_after_half_a_period(name: str) -> None:
    case = cases.load("newtons_cradle", "sliders", n=2, collisions="resolved", masses="4,2")
    run = peer(name).prepare(case, rtol=1e-12).run()
    np.testing.assert_allclose(run.v[-1], [1.0 / 3.0, 4.0 / 3.0], atol=1e-7)
    release = next(e.t for e in run.events if e.before == Mode.CONTACT)
    assert release == pytest.approx(np.pi / np.sqrt(case.law.a0[0]), abs=1e-9)


@pytest.mark.parametrize("name", [*LAW, *STEPPED])
def test_momentum_of_a_cradle_is_kept(name: str) -> None:
    case = cases.load("newtons_cradle", "sliders", n=3, masses="1,2,4")
    engine = peer(name)
    for profile in (one for one in engine.profiles if engine.why_not(case, one) is None):
        run = engine.prepare(case, profile).run()
        assert run.outcome.ok, run.message
        np.testing.assert_allclose(run.v @ [1.0, 2.0, 4.0], 1.0, rtol=1e-9)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("name", LAW)
def test_balls_that_touch_close_once_each(name: str, seed: int) -> None:
    """A chain of springs is pressed from end to end and opens again: rounding of places is no gap and no touch."""
    rng = np.random.default_rng(seed)
    sizes = {"n": int(rng.integers(3, 8)), "radius": float(10 ** rng.uniform(-2.0, 0.0))} if seed else {}
    case = cases.load("newtons_cradle", "sliders", **sizes)
    for profile in ("continuous", "default", "matched"):
        if profile in peer(name).profiles and (name, profile) != ("drake", "default"):
            run = peer(name).prepare(case, profile).run()
            closed = [e.contact for e in run.events if e.before == Mode.FREE]
            assert sorted(closed) == list(range(len(case.q0) - 1))


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("name", STEPPED)
def test_restitution_of_an_impact(name: str, e: float) -> None:
    case = cases.load("bouncing_ball", "linear", gravity=0.0, speed=1.0, height=0.1, t_end=0.3)
    run = peer(name).prepare(case, restitution=e).run()
    assert run.v[-1, 0] == pytest.approx(e, abs=SOFTENED[name])
    impulse = float(np.sum(run.lam[1:, 0] * np.diff(run.t)))
    assert impulse == pytest.approx(1.0 + e, rel=SOFTENED[name])


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("name", STEPPED)
def test_forces_bear_the_weight_and_change_the_momentum(name: str, seed: int) -> None:
    """INT lam dt = m (v(T) - v(0) + g T), in the air, in impacts and at rest on the floor."""
    rng = np.random.default_rng(seed)
    m, g, t_end = rng.uniform(0.1, 5.0), rng.uniform(1.0, 20.0), rng.uniform(1.0, 2.0)
    case = cases.load("bouncing_ball", "linear", mass=m, gravity=g, height=rng.uniform(0.02, 0.3), t_end=t_end)
    run = peer(name).prepare(case, restitution=rng.uniform(0.0, 0.5)).run()
    given = float(np.sum(run.lam[1:, 0] * np.diff(run.t)))
    assert given == pytest.approx(m * float(run.v[-1, 0] - run.v[0, 0] + g * t_end), rel=1e-6)


@pytest.mark.parametrize(("case", "variant"), [("bouncing_ball", "linear"), ("newtons_cradle", "sliders")])
@pytest.mark.parametrize("name", PACKAGES)
def test_no_engine_is_outside_in_a_shipped_case(name: str, case: str, variant: str) -> None:
    """Its own contact is a known property: what follows from it is judged by its size, and not left out."""
    peer(name)
    (loaded,) = choice.load_cases([case], variant, {})
    result = jobs.run_case(loaded, choice.picks([name]), refine=False)
    rows = judged(loaded, result.entries, result.truth, "")
    assert [(row.profile, row.metric, row.why) for row in rows if row.verdict == Word.OUTSIDE] == []
    assert {entry.profile for entry in result.entries if not entry.skipped} == {
        r.profile for r in rows if r.metric == "position"
    }


def test_a_discrete_plant_loses_energy_that_a_continuous_one_keeps() -> None:
    """What is asked for is not what is had: at its own step of 1 ms the discrete plant takes most of a bounce."""
    engine = peer("drake")
    kept = {}
    for profile in ("continuous", "default"):
        run = engine.prepare(drop(), profile).run()
        kept[profile] = run.total_energy[-1] / run.total_energy[0]
    assert kept["continuous"] == pytest.approx(1.0, abs=1e-3)
    assert kept["default"] < 0.5


@pytest.mark.parametrize("name", [*LAW, *STEPPED])
def test_what_they_cannot_do_they_say(name: str) -> None:
    engine = peer(name)
    for case in (cases.load("delta_impulse"), cases.load("newtons_cradle", "pendulums")):
        reason = engine.why_not(case, "matched")
        assert reason
        assert case.mechanism in reason
        with pytest.raises(CaseUnsupported):
            engine.prepare(case)


@pytest.mark.parametrize("name", PACKAGES)
def test_an_absent_engine_names_the_extra_that_brings_it(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in [m for m in sys.modules if m.startswith(f"crossbody.engines.{name}")]:
        monkeypatch.delitem(sys.modules, module)
    for module in [m for m in sys.modules if m.partition(".")[0] == PACKAGES[name]]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setattr(sys, "meta_path", [_Absent(PACKAGES[name]), *sys.meta_path])
    with pytest.raises(EngineUnavailable, match=rf"crossbody\[{name}\]"):
        engines.load(name)


class _Absent:
    """An import hook that finds nothing of one package."""

    def __init__(self, package: str) -> None:
        self.package = package

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        if name.partition(".")[0] == self.package:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


@pytest.mark.parametrize("seed", range(8))
def test_rows_of_a_line_are_those_of_its_scene(seed: int) -> None:
    """Held coordinates, bounds on both sides and of a difference, with references and values that are drawn."""
    rng, along = np.random.default_rng(seed), (0.0, 0.0, 1.0)
    low, high, held, *references = rng.uniform(0.1, 1.0, 6).tolist()
    names = ("a", "b", "c")
    joints = [
        Joint(name=n, body=n, type="slide", axis=along, reference=x, range=(-low, high if n == "b" else np.inf))
        for n, x in zip(names, references, strict=True)
    ]
    scene = Scene(
        bodies=tuple(Body(name=n, mass=1.0, position=tuple(rng.normal(size=3).tolist())) for n in names),
        joints=tuple(joints),
        loops=(Loop(name="held", type="joint", first="a", polynomial=(held, 0.0, 0.0, 0.0, 0.0)),),
        tendons=(Tendon(name="t", joints=("b", "c"), coefficients=(1.0, -1.0), range=(-low, np.inf)),),
    )
    case = cases.from_scene(scene, q0=[references[0] + held, 0.0, 0.0], t_end=1.0)
    q = rng.normal(size=3)
    assert line(case).gaps(q) == pytest.approx(system_of(case).gap(q)[0], abs=1e-14)


def test_touches_between_steps_are_put_in_where_free_flight_has_them() -> None:
    case = drop(t_end=0.5)
    scene = line(case)
    at = np.sqrt(2.0 / G)
    t = np.array([0.0, 0.45, 0.455])
    w, v = np.sqrt(A0), np.sqrt(2.0 * G)
    q = np.array([[1.0], [1.0 - 0.5 * G * 0.45**2], [-v / w * np.sin(w * (0.455 - at))]])
    rates = np.array([[0.0], [-G * 0.45], [-v * np.cos(w * (0.455 - at))]])
    run = sampled(scene, t, q, rates, scene.memoryless(q, rates), wall_s=0.0, steps=2)
    assert len(run.t) == 4
    assert run.t[2] == pytest.approx(at, abs=1e-15)
    assert run.v[2, 0] == pytest.approx(-v, rel=1e-14)
    assert [(e.t, e.after) for e in run.events] == [(run.t[2], Mode.CONTACT)]


@pytest.mark.parametrize("seed", range(6))
def test_touches_and_releases_between_steps_are_told_where_they_are(seed: int) -> None:
    """Whichever sign rounding gives the gap at the instant that was put in."""
    rng, scene = np.random.default_rng(seed), line(drop(t_end=0.9))
    touch, contact = np.sqrt(2.0 / G), np.pi / np.sqrt(A0)
    inside = touch + contact * np.sort(rng.uniform(0.05, 0.95, 6))
    t = np.concatenate(([0.0], np.sort(rng.uniform(0.0, touch, 8)), inside, np.sort(rng.uniform(0.5, 0.9, 5))))
    q = np.array([[height(x)] for x in t])
    s = t - touch
    v = np.where(
        s < 0.0, -G * t, np.where(s < contact, -touch * G * np.cos(np.sqrt(A0) * s), G * (touch - s + contact))
    )
    run = sampled(scene, t, q, v[:, None], scene.memoryless(q, v[:, None]), wall_s=0.0, steps=len(t) - 1)
    assert [e.after for e in run.events] == [Mode.CONTACT, Mode.FREE]
    assert [e.t for e in run.events] == pytest.approx([touch, touch + contact], abs=1e-14)
    assert max(np.abs(run.gap[run.t == e.t]).max() for e in run.events) < 1e-14


def test_a_state_that_leaves_the_scene_has_diverged() -> None:
    scene, q = line(drop()), np.array([0.0])
    assert ended(scene, q, np.array([-4.0])) is Outcome.FINISHED
    assert ended(scene, q, np.array([1e9])) is Outcome.DIVERGED
    assert ended(scene, q, np.array([np.nan])) is Outcome.NOT_FINITE


@pytest.mark.parametrize("variant", ["sliders", "unequal"])
def test_obvious_springs_of_exudyn_push_below_the_surface_alone(variant: str) -> None:
    """Stops of its connectors are at differences of coordinates: the gaps at the start are no part of them."""
    run = peer("exudyn").prepare(cases.load("newtons_cradle", variant), "default").run()
    assert run.lam.max() > 1.0
    assert np.abs(run.lam[run.gap > 1e-9]).max(initial=0.0) <= 1e-9 * run.lam.max()


@pytest.mark.parametrize("mass", [0.5, 3.0])
def test_obvious_springs_of_exudyn_are_the_law_s_by_the_mass_that_they_move(mass: float) -> None:
    """Read back from the connectors, as a factor that is missing would show."""
    case = cases.load("bouncing_ball", "linear", mass=mass)
    found = peer("exudyn").prepare(case, "default").audit()["constants"]
    assert found["a0"] == pytest.approx(case.law.a0, rel=1e-12)
    assert found["a1"] == pytest.approx(case.law.a1, rel=1e-12)


@pytest.mark.timeout(60)
@pytest.mark.parametrize("zeta", [0.135, 0.3, 0.9975])
def test_exudyn_ends_at_its_tightest_tolerance(zeta: float) -> None:
    """At the release of a damped contact its force has a kink, where a step must be allowed to be as short as it is."""
    for rtol in (1e-12, 2.7e-12):
        run = peer("exudyn").prepare(cases.load("newtons_cradle", "unequal", zeta=zeta), rtol=rtol).run()
        assert run.outcome is Outcome.FINISHED


@pytest.mark.parametrize("name", STEPPED)
def test_a_bound_at_which_no_shapes_touch_is_refused(name: str) -> None:
    """Where what touches are shapes a body would go through it."""
    body = Body(name="cart", mass=1.3, inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0))
    rail = Joint(name="rail", body="cart", type="slide", axis=(1.0, 0.0, 0.0), range=(0.35, np.inf))
    case = case_of(Scene(bodies=(body,), joints=(rail,), gravity=(0.0, 0.0, 0.0)), q0=[0.6], v0=[-1.3], t_end=0.5)
    assert (
        peer(name).why_not(case, "matched") == "A contact is between two shapes, but none touch at the bound of 'rail'."
    )
    assert peer(name).why_not(cases.load("newtons_cradle", "sliders"), "matched") is None
