"""What holds of every motion with friction, whatever the scene; and every set of modes against all that could be."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np
import pytest
from friction_obeyed import obeys
from friction_oracle import consistent, tossed_rod
from friction_scenes import (
    EDGED,
    G,
    box_on_floor,
    linear,
    piled,
    point,
    random_problem,
    rod_on_floor,
    run,
    tossed,
)

from crossbody import cases, engines
from crossbody.cases import InvalidValue, Mode, Outcome, SceneError
from crossbody.cases.scene import RowLaw
from crossbody.cases.scene_contacts import PLACES
from crossbody.reference import System, simulate

FURTHER = (1090, 1481, 2129, 2629)
QUICK = (*range(60), 70, 147, 158, 210, 240, 264, 304, 325, 417, 499, 536, 572, *FURTHER)  # each broke some rule


@pytest.mark.parametrize("seed", range(40))
def test_cones_power_and_energy_of_tossed_bodies(seed: int) -> None:
    scene, q0, v0, mu = tossed(seed)
    run_ = run(scene, q0, v0, 0.5, rtol=1e-8)
    assert run_.outcome is Outcome.FINISHED, run_.message
    assert obeys(scene, run_, mu, 1e-8) > 0 or mu == 0.0 or not run_.events or run_.outcome is Outcome.PAINLEVE


@pytest.mark.parametrize(
    "seed",
    [pytest.param(seed, marks=[] if seed in QUICK else pytest.mark.slow) for seed in (*range(600), *FURTHER)],
)
def test_cones_power_and_energy_of_bodies_with_edges(seed: int) -> None:
    scene, q0, v0, mu = tossed(seed, EDGED, 1)
    run_ = run(scene, q0, v0, 0.8, rtol=1e-6, max_steps=150_000)
    assert run_.outcome in (Outcome.FINISHED, Outcome.PAINLEVE), run_.message
    assert obeys(scene, run_, mu, 1e-6) > 0 or mu == 0.0 or not run_.events or run_.outcome is Outcome.PAINLEVE


@pytest.mark.parametrize("size", [(0.1, 0.15, 0.0), (0.15, 0.02, 0.0)], ids=["can", "coin"])
@pytest.mark.parametrize("seed", [*range(4), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(4, 60))])
def test_cones_power_and_energy_of_tossed_cans(seed: int, size: tuple[float, ...]) -> None:
    """They land on a rim, roll round on it, rock from side to side, stand or roll on their side."""
    scene, q0, v0, mu = tossed(seed, {"cylinder": size}, 1)
    run_ = run(scene, q0, v0, 2.0, rtol=1e-6, max_steps=150_000)
    assert run_.outcome is Outcome.FINISHED, run_.message
    assert obeys(scene, run_, mu, 1e-6) > 0 or mu == 0.0 or not run_.events or run_.outcome is Outcome.PAINLEVE


@pytest.mark.parametrize("kinds", [types for types in PLACES if "plane" not in types], ids=":".join)
@pytest.mark.parametrize("seed", [*range(2), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(2, 30))])
def test_cones_power_and_energy_of_piled_solids(seed: int, kinds: tuple[str, str]) -> None:
    scene, q0, v0, mu = piled(seed, kinds)
    run_ = run(scene, q0, v0, 0.8, rtol=1e-6, max_steps=150_000)
    assert run_.outcome in (Outcome.FINISHED, Outcome.PAINLEVE), run_.message
    assert obeys(scene, run_, mu, 1e-6) > 0 or mu == 0.0 or not run_.events or run_.outcome is Outcome.PAINLEVE


@pytest.mark.parametrize("seed", [0, 1, 2, 3, 4, 5, 6, 8])
def test_a_second_machine_moves_a_tossed_rod_alike(seed: int) -> None:
    (mu, half, radius, a1), q0, v0, t_end, (q, v, log) = tossed_rod(seed)
    scene = rod_on_floor(mu, length=half, radius=radius, law=RowLaw(a0=1e4, a1=a1))
    found = run(scene, q0, v0, t_end, rtol=1e-10)
    assert np.abs(found.q[-1] - q).max() < 1e-9
    assert np.abs(found.v[-1] - v).max() < 1e-7
    times = np.array([e.t for e in found.events])
    assert all(np.abs(times - t).min() < 1e-9 for t, _ in log[1:])


@pytest.mark.parametrize("seed", range(20))
def test_modes_are_a_set_that_agrees_with_its_forces(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(10):
        H, force, mu, k = random_problem(rng, most=4, rough=1.5)
        n = len(force)
        sets = consistent(H, force, mu, k)
        run_ = simulate(linear(H, force, mu, k), np.zeros(n), np.zeros(n), 1e-6, rtol=1e-6, max_steps=3)
        if run_.outcome is Outcome.PAINLEVE:
            assert not sets
            continue
        assert sets
        assert run_.outcome is not Outcome.NO_CONSISTENT_MODES, run_.message
        assert min(np.abs(run_.v[-1] / run_.t[-1] - a).max() for a in sets) < 1e-3
        assert k > 3 or ("not_unique" in run_.counts) == (len(sets) > 1)


@pytest.mark.parametrize("seed", range(10))
def test_contacts_that_slide_are_told_where_more_than_one_set_of_them_presses(seed: int) -> None:
    """Of linear complementarity problems that are no P-matrix: all subsets of rows, solved one by one."""
    rng, told = np.random.default_rng(100 + seed), 0
    for _ in range(60):
        H, force, mu, k = random_problem(rng, most=4, rough=3.0)
        if len(force) < 2 * k:
            continue
        slip = rng.choice([-1.0, 1.0], size=k)
        H[k:] -= slip[:, None] * rng.uniform(0.0, 2.0) / mu * np.roll(H[:k], 1, axis=0)  # one presses by the next
        v0 = np.linalg.lstsq(H, np.concatenate([np.full(k, -1e-3), slip]), rcond=None)[0]
        C, wanted = H[:k] - mu * slip[:, None] * H[k:], 1e-3 * 200.0 - H[:k] @ force
        margins = []
        for on in (np.flatnonzero(one) for one in product((False, True), repeat=k)):
            x = np.linalg.solve(H[on] @ C[on].T, wanted[on]) if len(on) else np.zeros(0)
            jams = np.linalg.det(H[on] @ C[on].T) < 0.0 if len(on) else False
            margins.append(-np.inf if jams else min([*x, *np.delete(H[:k] @ C[on].T @ x - wanted, on)]))
        if np.abs(margins).min() < 1e-3:  # the law is all but undecided
            continue
        run_ = simulate(linear(H, force, mu, k), np.zeros(len(force)), v0, 1e-9, rtol=1e-6, max_steps=3)
        if run_.outcome in (Outcome.PAINLEVE, Outcome.NO_CONSISTENT_MODES):
            continue
        several = np.sum(np.array(margins) > 0.0) > 1
        assert ("not_unique" in run_.counts) == several
        assert (run_.unique_until == 0.0) == several
        told += several
    assert told


def test_turning_the_frame_of_a_plane_changes_nothing() -> None:
    q0, v0 = [0, 0, 0.1, 1, 0, 0, 0], [1.0, 0.4, 0, 0, 0, 0]
    ends = [run(box_on_floor(0.3, turn=turn, tilt=0.2), q0, v0, 0.4) for turn in (0.0, 1.1)]
    assert np.abs(ends[0].q[-1] - ends[1].q[-1]).max() < 1e-12


def test_a_spinning_box_that_slides_is_told_to_be_indeterminate() -> None:
    run_ = run(box_on_floor(0.3), [0, 0, 0.1, 1, 0, 0, 0], [1.0, 0.3, 0, 0, 0, 2.0], 0.2, rtol=1e-9)
    assert run_.counts["indeterminate"]
    assert run_.message.startswith("indeterminate")
    assert 0.0 <= run_.determined_until < 0.2
    assert run(box_on_floor(0.3), [0, 0, 0.1, 1, 0, 0, 0], [1.0, 0.3, 0, 0, 0, 0], 0.2).determined_until == np.inf


def test_a_file_slides_as_its_scene_does(tmp_path: Path) -> None:
    text = """<mujoco><option gravity="0 0 -9.81"/><worldbody>
      <geom name="floor" type="plane" size="1 1 1" friction="0.3"/>
      <body name="box" pos="0 0 .1"><freejoint/><geom type="box" size=".2 .15 .1" mass="1" friction="0.2"/></body>
    </worldbody><keyframe><key name="k" qpos="0 0 .1 1 0 0 0" qvel="1 0 0 0 0 0"/></keyframe></mujoco>"""
    path = tmp_path / "box.xml"
    path.write_text(text)
    case = cases.from_file(str(path), friction=1, t_end=0.5)
    run_ = engines.load("reference").prepare(case, "compiled", rtol=1e-11).run()
    assert run_.outcome is Outcome.FINISHED, run_.message
    stops = {e.t for e in run_.events if e.after is Mode.STICK and e.t > 0.0}
    assert len(stops) == 1
    assert abs(stops.pop() - 1.0 / (0.3 * G)) < 1e-11
    reason = engines.load("mujoco").why_not(case, "matched")
    assert reason
    assert "friction" in reason
    assert not any("t1" in name for name in cases.from_file(str(path), t_end=0.5).contacts)


def wall(mu: object, **given: object) -> System:
    base = point(0.5, 0.1)
    fields = {name: getattr(base, name) for name in ("n", "dynamics", "gaps", "rows", "a0", "a1", "follows")}
    return System(**(fields | {"parameters": base.p, "mu": mu} | given))


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"mu": [np.inf, -0.1]}, "at least 0"),
        ({"mu": [np.inf, np.nan]}, "at least 0"),
        ({"mu": [np.inf, 0.5], "unilateral": [False, True]}, "able to open"),
        ({"mu": [np.inf, np.inf], "drift": [0.0, 1.0]}, "drift"),
    ],
)
def test_systems_with_wrong_friction_are_refused(given: dict[str, object], told: str) -> None:
    with pytest.raises(SceneError, match=told):
        wall(**given)


@pytest.mark.parametrize(
    ("options", "error", "told"),
    [
        ({"fsm": "edge"}, InvalidValue, "friction"),
        ({"solver": "ida"}, InvalidValue, "friction"),
    ],
)
def test_machines_without_friction_are_refused(options: dict, error: type, told: str) -> None:
    with pytest.raises(error, match=told):
        simulate(point(0.5, 0.1), [0, 0], [0, 0], 0.1, **options)


def test_frozen_collisions_with_friction_are_refused() -> None:
    with pytest.raises(SceneError, match="friction"):
        simulate(wall([np.inf, 0.5], b0=[1e6, 0.0]), [0, 0], [0, 0], 0.1)
