"""MuJoCo: which law it follows, in which order, and that it leaves nothing behind."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from crossbody import cases, engines
from crossbody.cases import Case, CaseUnsupported, Mode, Outcome
from crossbody.engines.mujoco._scene import hooked

mujoco = pytest.importorskip("mujoco")
FREE, CONTACT, BALLISTIC = Mode.FREE, Mode.CONTACT, Mode.BALLISTIC


def ball(variant: str = "listing", **parameters: Any) -> Case:
    return cases.load("bouncing_ball", variant=variant, **parameters)


def law(case: Case, h: float, v: float) -> float:
    a0, a1, a2 = (float(a[0]) for a in (case.law.a0, case.law.a1, case.law.a2))
    return -a1 * v - a0 * h - a2 * h**3


def level(case: Case) -> Callable[[np.ndarray[Any, Any]], np.ndarray[Any, Any]]:
    """h'' = -g, or the law from a touch until nothing pushes, arc by arc with every switch located by SciPy."""
    g = case.number("gravity")
    t, y, mode, arcs = 0.0, np.array([case.q0[0], case.v0[0]]), FREE, []

    def gap(_t: float, y: np.ndarray[Any, Any]) -> float:
        return float(y[0])

    def push(_t: float, y: np.ndarray[Any, Any]) -> float:
        return g + law(case, float(y[0]), float(y[1]))

    for function in (gap, push):
        function.terminal = True  # type: ignore[attr-defined]
    while t < case.t_end:
        pushes = mode == CONTACT
        watched = {FREE: (gap,), CONTACT: (push,), BALLISTIC: (gap,)}[mode]
        gap.direction = -1 if mode == FREE else 1  # type: ignore[attr-defined]
        push.direction = -1 if pushes else 1  # type: ignore[attr-defined]
        arc = solve_ivp(
            lambda _t, y, on=pushes: (y[1], law(case, y[0], y[1]) if on else -g),
            (t, case.t_end), y, method="DOP853", rtol=1e-13, atol=1e-15, events=watched, dense_output=True,
        )  # fmt: skip
        arcs.append((t, arc.t[-1], arc.sol))
        t, y = arc.t[-1], arc.y[:, -1]
        if arc.status == 0:
            break
        released = FREE if y[0] > 0.0 else BALLISTIC
        mode = {FREE: CONTACT, CONTACT: released, BALLISTIC: FREE}[mode]

    def at(times: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        out = np.empty(len(times))
        for start, stop, sol in arcs:
            inside = (times >= start) & (times <= stop)
            out[inside] = sol(times[inside])[0]
        return out

    return at


LADDER = (4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4)


def errors(case: Case, steps: tuple[float, ...], profile: str = "matched") -> list[float]:
    truth, engine = level(case), engines.load("mujoco")
    runs = [engine.prepare(case, profile, dt=dt).run() for dt in steps]
    assert all(r.outcome.ok for r in runs)
    return [float(np.abs(r.q[:, 0] - truth(r.t)).max()) for r in runs]


SMOOTH = (
    ("linear", {"a0": 400.0, "a1": 4.0, "t_end": 1.2}),  # leaves by lam = 0 below the floor, then flies out
    ("linear", {"a0": 400.0, "a1": 0.0, "t_end": 1.2}),  # dropped at the floor with lam = m g
    ("listing", {"a0": 100.0, "a1": 4.0, "a2": 1e4, "t_end": 1.2}),  # cubic part through the hook
)


@pytest.mark.parametrize(("variant", "parameters"), SMOOTH)
def test_located_events_keep_order_four(variant: str, parameters: dict[str, float]) -> None:
    found = errors(ball(variant, **parameters), LADDER)
    order = np.polyfit(np.log(LADDER), np.log(found), 1)[0]
    assert 3.6 < order < 4.6, found
    assert found[-1] < 3e-9


def test_the_obvious_model_follows_another_law_and_sees_events_at_its_steps() -> None:
    case = ball("linear", a0=400.0, a1=4.0, t_end=1.2)
    default = engines.load("mujoco").prepare(case, "default").run()
    truth = level(case)
    assert np.abs(default.q[:, 0] - truth(default.t)).max() > 1e-3  # another law altogether: its own constants
    np.testing.assert_allclose([(e.t + 1e-3) % 2e-3 - 1e-3 for e in default.events], 0.0, atol=1e-9)


@pytest.mark.parametrize("variant", ["listing", "bilateral"])
def test_multiplier_is_the_law_at_random_states(variant: str) -> None:
    draw = np.random.default_rng(11)
    for _ in range(200):
        a0, a2 = 10.0 ** draw.uniform(0, 10), 10.0 ** draw.uniform(0, 8)
        a1, m = 2 * np.sqrt(a0) * draw.uniform(0, 3), 10.0 ** draw.uniform(-3, 3)
        h, v = -(10.0 ** draw.uniform(-6, 0)), draw.normal()
        case = ball(variant, mass=m, a0=a0, a1=a1, a2=a2)
        lam = engines.load("mujoco").prepare(case, "matched").audit()["lam"](np.array([h]), np.array([v]))[0]
        terms = m * np.array([9.81, -a1 * v, -a0 * h, -a2 * h**3])
        want = terms.sum() if variant == "bilateral" else max(terms.sum(), 0.0)
        assert lam == pytest.approx(want, abs=1e-10 * np.abs(terms).sum())


@pytest.mark.parametrize("variant", ["listing", "bilateral"])
@pytest.mark.parametrize("profile", ["default", "matched"])
def test_multiplier_is_the_sum_of_the_rows_of_efc_force(variant: str, profile: str) -> None:
    scene = engines.load("mujoco").prepare(ball(variant, mass=3.0), profile).scene
    scene.start()
    scene.data.qpos[:], scene.data.qvel[:] = -1e-3, -0.5
    if scene.arm is not None:
        scene.arm((CONTACT,))
    with hooked(scene.hook):
        mujoco.mj_forward(scene.model, scene.data)
    rows, lam = scene.data.efc_force, np.ravel(scene.lam())
    assert len(rows) == (4 if (profile, variant) == ("default", "listing") else 1)
    assert lam == pytest.approx(rows.sum(), rel=1e-12)
    assert lam[0] > 0.0


def test_multiplier_belongs_to_the_instant_beside_it() -> None:
    case = ball("linear", a0=400.0, a1=4.0, t_end=1.0)
    found = engines.load("mujoco").prepare(case, "matched").run()
    touching = found.mode[:, 0] == CONTACT
    want = [9.81 + law(case, h, v) for h, v in zip(found.q[touching, 0], found.v[touching, 0], strict=True)]
    assert touching.sum() > 20
    np.testing.assert_allclose(found.lam[touching, 0], want, rtol=1e-9, atol=1e-9)


def test_keeps_the_energy_that_the_law_makes() -> None:
    case = ball("elastic")
    found = engines.load("mujoco").prepare(case, "matched", dt=5e-4).run()
    truth = engines.load("reference").prepare(case, "compiled").run()
    flights = [
        [run.total_energy[np.searchsorted(run.t, e.t, "right")] for e in run.events if e.after == FREE]
        for run in (found, truth)
    ]
    np.testing.assert_allclose(*flights, rtol=1e-6)
    assert flights[0][-1] > 9.9 > found.total_energy[0]  # it pulls nothing on the way out
    at = [np.searchsorted(found.t, e.t) for e in found.events if e.before == FREE]
    assert np.abs(found.gap[at, 0]).max() < 2e-12


def test_divergence_is_an_outcome() -> None:
    found = engines.load("mujoco").prepare(ball("bilateral", a0=1e6, a1=0.0, a2=0.0), "matched", dt=0.05).run()
    assert found.outcome is Outcome.DIVERGED
    assert "t = " in found.message
    assert np.isfinite(found.q).all()


def test_what_is_not_finite_is_an_outcome() -> None:
    prepared = engines.load("mujoco").prepare(ball(), "matched")
    start = prepared.scene.start

    def poisoned() -> None:
        start()
        prepared.scene.data.qfrc_applied[:] = np.nan

    prepared.scene.start = poisoned
    assert prepared.run().outcome is Outcome.NOT_FINITE


def test_globals_are_put_back_whatever_happens() -> None:
    prepared = engines.load("mujoco").prepare(ball(), "matched")

    def broken() -> None:
        raise RuntimeError("on purpose")

    for scene_part in (None, broken):
        if scene_part is not None:
            prepared.scene.start = scene_part
            with pytest.raises(RuntimeError, match="on purpose"):
                prepared.run()
        else:
            prepared.run()
        assert mujoco.get_mjcb_control() is None
        assert mujoco.get_mju_user_warning() is None


def test_warnings_go_into_the_message(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    prepared = engines.load("mujoco").prepare(ball(t_end=0.5), "matched")
    prepared.scene.model.jnt_solref[:] = (-100.0, 1.0)  # mixed signs: MuJoCo replaces them and says so
    found = prepared.run()
    assert "MuJoCo warned" in found.message
    assert list(tmp_path.iterdir()) == []


def test_a_model_that_mujoco_refuses() -> None:
    with pytest.raises(CaseUnsupported, match="MuJoCo refuses the model of bouncing_ball:listing"):
        engines.load("mujoco").prepare(ball(mass=1e-300), "matched")


@pytest.mark.parametrize("profile", ["default", "matched"])
def test_lies_still_where_it_starts_at_rest(profile: str) -> None:
    found = engines.load("mujoco").prepare(ball("linear", height=0.0, t_end=0.1), profile).run()
    assert found.lam[-1, 0] == pytest.approx(9.81, rel=0.05 if profile == "default" else 1e-9)
    assert abs(found.gap[-1, 0]) < 1e-3
