"""The delta robot in MuJoCo: a tree of hinges with two loops, driven on the absolute angles (spec 3.8, 4.2).

Friction, servos and motors are forces of every stage, set in the callback that Runge-Kutta visits; the force on the
flange pulls a third at each tip.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from crossbody.cases import Case, Mode
from crossbody.cases.arrays import Floats
from crossbody.cases.files.warned import captured
from crossbody.engines._delta import chart
from crossbody.engines._delta.forces import forces
from crossbody.engines._delta.scene import Delta, delta, in_absolute, steady
from crossbody.engines.linear import Spot
from crossbody.engines.mujoco._delta_model import compiled
from crossbody.engines.mujoco._direct import law_of
from crossbody.engines.mujoco._globals import Hook, hooked
from crossbody.engines.mujoco._linear import Stand
from crossbody.engines.mujoco._observe import mass_matrix, of_equalities
from crossbody.engines.mujoco._scene import Scene

HELD = (int(Mode.BILATERAL),) * 6
FASTEST = 1e6
"""Rate at which a run has diverged, rad/s."""


def default_step(case: Case, profile: str) -> float:
    """Time step when none is given, s: MuJoCo's own; 1 ms, or one sample of the controller if that is shorter."""
    period = float(case.parameters.get("period", 1e-3))
    return 2e-3 if profile == "default" else min(1e-3, period)


def build(case: Case, profile: str, dt: float) -> Scene:
    """Compile the model of one profile.

    Raises:
        ValueError: MuJoCo's own, for a model that it refuses.
        SceneError: for a start that does not close the loops.
    """
    own = delta(case)
    model = compiled(own.robot, case.law if profile == "matched" else None)
    data = mujoco.MjData(model)
    scene = Scene(
        model=model,
        data=data,
        nc=6,
        start=_start(own, model, data),
        modes=lambda: HELD,
        lam=lambda: np.array(data.efc_force),  # a view into the arena: copied
        safe=_guard(data),
        observe=of_equalities(model),
        chart=own.absolute,
        instants=own.drive.times,
        change=_change(own, model, data),
        hook=_hook(own, data),
    )
    scene.audit = _audit(case, scene, matched=profile == "matched")
    return scene


def stand(case: Case, spot: Spot) -> Stand:
    """The matched model at an equilibrium under constant inputs, without its controller."""
    own, (r, rd) = steady(case, spot), chart.to_tree(spot.q, spot.v)
    model = compiled(own.robot, case.law)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.time = r, rd, spot.t
    data.xfrc_applied[[model.body(f"tip{i}").id for i in (1, 2, 3)], :3] = spot.u[3:] / 3
    return Stand(model=model, data=data, chart=chart.linear(r), hook=_hook(own, data))


def _start(own: Delta, model: Any, data: Any) -> Callable[[], None]:
    def start() -> None:
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = own.r0, own.rd0
        own.drive.reset()

    return start


def _guard(data: Any) -> Callable[[], bool]:
    rates = data.qvel
    return lambda: rates.min() > -FASTEST and rates.max() < FASTEST


def _hook(own: Delta, data: Any) -> Hook:
    """Set the forces of this stage; the force on the flange is not among them."""
    r, rd, out, u, table, motors = data.qpos, data.qvel, data.qfrc_applied, np.zeros(6), own.table, own.drive.u

    def hook(_model: Any, d: Any) -> None:
        u[:3] = motors[:3]
        forces(d.time, r, rd, u, table, out)

    return hook


def _change(own: Delta, model: Any, data: Any) -> Callable[[float], None]:
    tips = [model.body(f"tip{i}").id for i in (1, 2, 3)]

    def change(t: float) -> None:
        own.drive.change(t, chart.from_tree(data.qpos, data.qvel)[0])
        data.xfrc_applied[tips, :3] = own.drive.u[3:] / 3

    return change


def _audit(case: Case, scene: Scene, matched: bool) -> dict[str, Any]:
    """Read back from the model; lam and bias without inputs, with friction and servos as they are at t = 0."""
    model, data = scene.model, scene.data

    def look(r: Floats, rd: Floats) -> None:
        scene.start()
        data.qpos[:], data.qvel[:] = r, rd
        with captured(), hooked(scene.hook):
            mujoco.mj_forward(model, data)

    def terms(r: Floats, rd: Floats) -> tuple[Floats, Floats, Floats]:
        look(r, rd)
        M = mass_matrix(model, data)
        return M, data.qfrc_bias - data.qfrc_passive - data.qfrc_applied, np.array(data.efc_J).reshape(6, 9)

    def lam(q: Floats, v: Floats) -> Floats:
        look(*chart.to_tree(q, v))
        return np.array(data.efc_force)

    constants: dict[str, Any] = {"solref": model.eq_solref[0].copy()}
    if matched:
        a0, a1 = np.repeat([law_of(row) for row in model.eq_solref], 3, axis=0).T
        constants = {"a0": a0, "a1": a1, "a2": np.zeros(6)}
    start = chart.from_tree(*chart.to_tree(np.array(case.q0), np.array(case.v0)))
    return {
        "masses": model.body_mass[2:].copy(),
        "gravity": float(np.linalg.norm(model.opt.gravity)),
        "constants": constants,
        "q0": start[0],
        "v0": start[1],
        "lam": lam,
        **in_absolute(terms),
    }
