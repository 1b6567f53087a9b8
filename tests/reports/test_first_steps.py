"""First steps of engines are the law's, and a part that is off by a per cent is told, whatever is known of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import Case, Trajectory
from crossbody.cases import closed_forms as cf
from crossbody.engines import Engine, Run
from crossbody.engines._acting import Acting
from crossbody.engines._scene import Forces
from crossbody.engines.pinocchio._admm import TimeStepper
from crossbody.reports.judging import first_steps as first_steps_of
from crossbody.reports.judging.audit import AuditRow, audit
from crossbody.reports.judging.first_steps import _of_law, first_steps

FREE, BLOW, MEETS, RUBS = ("acceleration", "positions"), ("restitution",), ("touches", "forces"), ("friction",)
SEEN = {
    ("bouncing_ball:linear", "mujoco:default"): FREE + MEETS,
    ("bouncing_ball:resting", "pinocchio:impulse"): BLOW,
    ("bouncing_ball:linear", "pinocchio:admm"): FREE + BLOW + MEETS,
    ("bouncing_ball:linear", "dart:matched"): FREE + BLOW + MEETS,
    ("bouncing_ball:elastic", "pymunk:default"): FREE + BLOW + MEETS,
    ("bouncing_ball:listing", "exudyn:default"): FREE,
    ("bouncing_ball:bilateral", "pinocchio:admm"): ("held rows",),
    ("newtons_cradle:pendulums", "pinocchio:admm"): FREE + BLOW + MEETS,
    ("newtons_cradle:unequal", "pinocchio:impulse_simultaneous"): BLOW,
    ("dry_oscillator:swings", "mujoco:default"): FREE,
    ("held_weight:hangs", "mujoco:default"): FREE + MEETS + RUBS,
    ("rolling_sphere:side_spin", "dart:default"): FREE + BLOW + MEETS + RUBS,
    ("stacked_blocks:top_slides", "pinocchio:admm"): FREE + BLOW + MEETS + RUBS,
    ("tossed_cube:tumbles", "dart:matched"): FREE + BLOW + MEETS + RUBS,
    ("tossed_cube:loaded", "mujoco:default"): FREE + MEETS + RUBS,
}
"""What is told of whom; of a case with rows that are always on their law alone, of a machine of its own nothing."""


class Changed(Engine):
    """An engine whose runs are changed behind it."""

    def __init__(self, inner: Engine, change: Callable[[Trajectory], Trajectory]) -> None:
        self.inner, self.change = inner, change
        self.name, self.profiles, self.versions, self.steps = inner.name, inner.profiles, inner.versions, inner.steps
        self.held = inner.held

    def prepare(self, case: Case, profile: str = "matched", **settings: Any) -> Run:
        return ChangedRun(self.inner.prepare(case, profile, **settings), self.change)


class ChangedRun(Run):
    def __init__(self, inner: Run, change: Callable[[Trajectory], Trajectory]) -> None:
        self.inner, self.change = inner, change
        self.engine, self.profile, self.settings = inner.engine, inner.profile, inner.settings

    def run(self) -> Trajectory:
        return self.change(self.inner.run())

    def audit(self) -> Mapping[str, Any]:
        return self.inner.audit()


def told(
    label: str, who: str, change: Callable[[Trajectory], Trajectory] = lambda run: run, **given: float
) -> dict[str, AuditRow]:
    case, (name, profile) = cases.load(*label.split(":"), **given), who.split(":")
    pytest.importorskip({"dart": "dartpy"}.get(name, name))
    engine = engines.load(name)
    prepared = engine.prepare(case, profile)
    theirs, shown = engines.load("reference").prepare(case, "compiled").audit(), prepared.audit()
    rows = audit(shown, theirs, case, {**engine.hidden_in(profile), **shown.get("hidden", {})})
    found = first_steps(case, (Changed(engine, change), profile), prepared.settings, {}, rows, theirs)
    return {row.quantity: row for row in found}


def faster(run: Trajectory) -> Trajectory:
    return replace(run, v=run.v[0] + 1.01 * (run.v - run.v[0]))


def farther(run: Trajectory) -> Trajectory:
    """Positions further by half of what velocities have changed so far in each step, as by those at its end."""
    return replace(run, q=run.q + 0.5 * np.diff(run.t, prepend=0.0)[:, None] * (run.v - run.v[0]))


@pytest.mark.parametrize(("label", "who"), SEEN)
def test_first_steps_of_engines_are_the_laws(label: str, who: str) -> None:
    found = told(label, who)
    assert tuple(found) == SEEN[label, who]
    assert all(row.ok for row in found.values())


@pytest.mark.parametrize(
    ("label", "who"), [("sliding_block:stops", "pinocchio:admm"), ("bouncing_ball:linear", "mujoco:default")]
)
def test_a_change_of_velocity_a_per_cent_too_large_is_told(label: str, who: str) -> None:
    found = told(label, who, faster)
    assert not found["acceleration"].ok
    assert found["acceleration"].difference == pytest.approx(0.01, rel=0.1)
    assert "restitution" not in found or not found["restitution"].ok


def lighter(run: Trajectory) -> Trajectory:
    return replace(run, lam=0.99 * run.lam)


@pytest.mark.parametrize("who", ["pinocchio:admm", "mujoco:default", "dart:matched"])
def test_a_force_a_per_cent_too_small_is_told(who: str) -> None:
    found = told("sliding_block:stops", who, lighter)
    assert [name for name, row in found.items() if not row.ok] == ["forces"]
    assert found["forces"].difference == pytest.approx(0.01, rel=1e-3)


def test_an_input_that_comes_a_step_late_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    at = Acting.at

    def late(acting: Acting, t: float, q: Any, v: Any) -> Any:
        return at(acting, t - 0.5 * acting.case.t_end / first_steps_of.STEPS, q, v)

    assert told("stacked_blocks:apart", "pinocchio:admm")["acceleration"].ok
    monkeypatch.setattr(Acting, "at", late)
    assert not told("stacked_blocks:apart", "pinocchio:admm")["acceleration"].ok


def early(run: Trajectory) -> Trajectory:
    """Velocities a step before they change."""
    return replace(run, v=np.concatenate([run.v[:1], run.v[2:], run.v[-1:]]))


def test_a_pair_that_meets_a_step_too_early_is_told() -> None:
    found = told("sliding_block:stops", "dart:matched", early)
    assert found["restitution"].ok
    assert not found["touches"].ok


def test_another_rule_for_positions_is_told() -> None:
    found = told("bouncing_ball:linear", "pinocchio:admm", farther)
    assert found["acceleration"].ok
    assert found["positions"].difference == pytest.approx(0.5, rel=0.01)
    assert not found["positions"].ok


@pytest.mark.parametrize("who", ["pinocchio:admm", "mujoco:default"])
def test_another_friction_is_told(who: str) -> None:
    case, (name, profile) = cases.load("sliding_block", "stops"), who.split(":")
    other = cases.load("sliding_block", "stops", mu=0.49)
    engine, theirs = engines.load(name), engines.load("reference").prepare(case, "compiled").audit()

    class Other(Changed):
        def prepare(self, case: Case, profile: str = "matched", **settings: Any) -> Run:
            return engine.prepare(replace(case, scene=other.scene), profile, **settings)

    used = engine.prepare(case, profile).settings
    rows = first_steps(case, (Other(engine, lambda run: run), profile), used, {}, (), theirs)
    assert [row.quantity for row in rows if not row.ok] == ["friction"]
    assert {row.quantity: row for row in rows}["friction"].difference == pytest.approx(0.02, rel=1e-3)


def test_a_restitution_that_was_asked_for_is_what_pairs_part_with() -> None:
    case, engine = cases.load("bouncing_ball", "linear"), engines.load("pinocchio")
    theirs = engines.load("reference").prepare(case, "compiled").audit()
    for claimed, ok in (0.5, True), (0.505, False):
        used = {**engine.prepare(case, "admm").settings, "restitution": claimed}
        rows = first_steps(case, (engine, "admm"), used, {"restitution": 0.5}, (), theirs)
        assert [row.ok for row in rows if row.quantity == "restitution"] == [ok]


PARTS = ((1.05, 1.0, 1.0), (1.0, 1.05, 1.0), (1.0, 0.0, 1.0))
"""By which parts of a law are multiplied: some per cent, and what leaves one out."""


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("times", PARTS)
def test_another_law_of_rows_that_are_always_on_is_told(
    seed: int, times: tuple[float, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    draw = np.random.default_rng(seed)
    given = {"a0": float(10.0 ** draw.uniform(1.0, 4.0)), "a1": float(10.0 ** draw.uniform(0.0, 2.5))}
    label, who = "bouncing_ball:bilateral", "pinocchio:admm"
    assert told(label, who, **given)["held rows"].ok
    right = TimeStepper._held
    monkeypatch.setattr(
        TimeStepper, "_held", lambda self, h, hd, law, dt: right(self, h, hd, np.multiply(law, times), dt)
    )
    assert not told(label, who, **given)["held rows"].ok


def test_an_engine_of_ones_own_that_promises_no_steps_is_not_asked() -> None:
    case, engine = cases.load("bouncing_ball", "linear"), engines.load("reference")
    used = engine.prepare(case, "compiled").settings
    assert first_steps(case, (engine, "compiled"), used, {}, (), engine.prepare(case, "compiled").audit()) == ()


@pytest.mark.parametrize("a1", [0.0, 20.0, 200.0, 350.0])
def test_the_restitution_of_the_law_is_that_of_its_arcs(a1: float) -> None:
    """What engines take for it, of strong and of weak damping, is told by another formula."""
    assert _of_law(1e4, a1, 0.0, 0.0) == pytest.approx(cf.restitution(cf.damping_ratio(1e4, a1)), rel=1e-9)
    assert _of_law(1.0, 0.0, 1e4, a1) == pytest.approx(_of_law(1e4, a1, 0.0, 0.0))


def test_another_restitution_than_the_laws_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    own = cf.half_angle
    monkeypatch.setattr(cf, "half_angle", lambda zeta: 0.99 * own(zeta))
    assert not told("bouncing_ball:linear", "pinocchio:admm")["restitution"].ok


@pytest.mark.parametrize("who", ["pinocchio:admm", "mujoco:default"])
def test_steep_friction_that_would_lift_or_jam_lets_slip_no_pair(who: str) -> None:
    case, (name, profile) = cases.load("stacked_blocks", "top_drags", high_mu=3.8, gravity=86.0), who.split(":")
    engine, theirs = engines.load(name), engines.load("reference").prepare(case, "compiled").audit()
    rows = first_steps(case, (engine, profile), engine.prepare(case, profile).settings, {}, (), theirs)
    assert rows
    assert all(row.ok for row in rows)


FALLS = """<mujoco><worldbody><geom type="plane" size="2 2 1"/>
<body name="ball" pos="0 0 .5"{spared}><freejoint/><geom type="sphere" size=".1" mass="1"/></body>
</worldbody></mujoco>"""


@pytest.mark.parametrize("who", ["mujoco:as_is", "dart:matched", "pinocchio:admm"])
@pytest.mark.parametrize("spared", [0.0, 0.6])
def test_a_file_falls_as_fast_as_its_law_has_it(who: str, spared: float, tmp_path: Path) -> None:
    """Also with less weight, which every engine is given in its own way."""
    path = tmp_path / "ball.xml"
    path.write_text(FALLS.format(spared=f' gravcomp="{spared}"' if spared else ""))
    right = told(str(path), who, friction=1)["acceleration"]
    assert right.ok
    assert f"{-9.81 * (1.0 - spared):.6g}" in right.mine.split()
    wrong = told(str(path), who, faster, friction=1)
    assert not wrong["acceleration"].ok


BOX = Path(__file__).parents[1] / "support" / "driven_box.xml"


@pytest.mark.parametrize("who", ["dart:matched", "pinocchio:admm"])
def test_activations_that_follow_another_clock_are_told(who: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """One that stands still between changes, and one that is a step late at each of them."""
    right = told(str(BOX), who, friction=1)["activations"]
    assert right.ok
    assert right.difference < 0.01  # of second order in 16 steps
    change, driven = Forces.change, Forces.driven

    def late(forces: Forces, values: Any, t: float) -> None:
        change(forces, values, forces.t)
        forces.t = forces.since = t

    def still(forces: Forces) -> Any:
        forces.t = forces.since
        return driven(forces)

    for name, other in (("change", late), ("driven", still)):
        with monkeypatch.context() as changed:
            changed.setattr(Forces, name, other)
            assert not told(str(BOX), who, friction=1)["activations"].ok


def test_activations_of_a_file_that_the_engine_reads_by_itself_are_not_asked() -> None:
    assert "activations" not in told(str(BOX), "mujoco:as_is", friction=1)
