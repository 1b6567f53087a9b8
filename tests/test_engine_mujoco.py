"""MuJoCo: which law it follows, in which order, and that it leaves nothing behind."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from crossbody import cases, engines
from crossbody.cases import Case, Mode

mujoco = pytest.importorskip("mujoco")
FREE, CONTACT, BALLISTIC = Mode.FREE, Mode.CONTACT, Mode.BALLISTIC


def ball(variant: str, **parameters: Any) -> Case:
    return cases.load("bouncing_ball", variant=variant, **parameters)


def law(case: Case, h: float, v: float) -> float:
    a0, a1, a2 = (float(a[0]) for a in (case.law.a0, case.law.a1, case.law.a2))
    return -a1 * v - a0 * h - a2 * h**3


def memoryless(case: Case) -> Callable[[np.ndarray[Any, Any]], np.ndarray[Any, Any]]:
    """h'' = -g above the floor and max(-g, law) at and below it, arc by arc with every switch located by SciPy."""
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
        watched = {FREE: (gap,), CONTACT: (gap, push), BALLISTIC: (gap, push)}[mode]
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
        crossed_floor = bool(arc.t_events[0].size)
        if crossed_floor and mode != FREE:
            mode = FREE
        else:
            mode = CONTACT if not pushes and (mode != FREE or push(t, y) > 0) else BALLISTIC

    def at(times: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        out = np.empty(len(times))
        for start, stop, sol in arcs:
            inside = (times >= start) & (times <= stop)
            out[inside] = sol(times[inside])[0]
        return out

    return at


LADDER = (4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4)


def errors(case: Case, steps: tuple[float, ...], profile: str = "matched") -> list[float]:
    truth, engine = memoryless(case), engines.load("mujoco")
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


if __name__ == "__main__":
    for v, p in SMOOTH:
        print(v, p, errors(ball(v, **p), LADDER))
