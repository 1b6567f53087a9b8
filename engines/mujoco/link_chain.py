"""A chain of links in MuJoCo: nested bodies on hinges about y; its brakes are forces of every stage."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from crossbody.cases import Case, Mode
from crossbody.engines._link_chain import LinkChain, link_chain
from crossbody.engines._log import charted
from crossbody.engines.mujoco._scene import Scene

FASTEST = 1e5
"""Rate at which a run has diverged, rad/s."""


def default_step(case: Case, profile: str) -> float:
    """Time step when none is given, s: MuJoCo's own, or 1 ms."""
    return 2e-3 if profile == "default" else 1e-3


def build(case: Case, profile: str, dt: float) -> Scene:
    """Compile the model; `default` differs by MuJoCo's own integrator and step alone.

    Raises:
        ValueError: MuJoCo's own, for a model that it refuses.
    """
    own = link_chain(case)
    model = _compiled(own, profile)
    data = mujoco.MjData(model)
    unknown = np.full(len(case.contacts), np.nan)
    held = (int(Mode.BILATERAL),) * len(case.contacts)
    scene = Scene(
        model=model, data=data, nc=len(case.contacts), start=_start(own, model, data), modes=lambda: held,
        lam=lambda: unknown, safe=_guard(data), observe=charted(own.absolute, own.observe),
        chart=own.absolute, hook=_hook(own, data), instants=own.times.tolist(), change=own.change,
    )  # fmt: skip
    q0, v0 = own.absolute(own.r0[None], own.rd0[None])
    scene.audit = {
        "masses": model.body_mass[1:].copy(), "gravity": float(np.linalg.norm(model.opt.gravity)), "constants": {},
        "q0": q0[0], "v0": v0[0],
    }  # fmt: skip
    return scene


def _compiled(own: LinkChain, profile: str) -> Any:
    """Every body hangs along -z from its hinge."""
    spec = mujoco.MjSpec()
    spec.option.gravity = (0.0, 0.0, -own.gravity)
    if profile == "matched":
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    parent, reach = spec.worldbody, 0.0
    for i, link in enumerate(own.links):
        parent = parent.add_body(name=f"link {i}", pos=(0.0, 0.0, -reach))
        parent.add_joint(name=f"joint {i}", type=mujoco.mjtJoint.mjJNT_HINGE, axis=(0.0, 1.0, 0.0))
        parent.explicitinertial = True
        parent.mass, parent.ipos, parent.inertia = link.m, (0.0, 0.0, -link.a), (link.inertia,) * 3
        reach = link.length
    return spec.compile()


def _start(own: LinkChain, model: Any, data: Any) -> Callable[[], None]:
    def start() -> None:
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = own.r0, own.rd0
        own.reset()

    return start


def _guard(data: Any) -> Callable[[], bool]:
    rates = data.qvel
    return lambda: rates.min() > -FASTEST and rates.max() < FASTEST


def _hook(own: LinkChain, data: Any) -> Callable[[Any, Any], None]:
    rates, out = data.qvel, data.qfrc_applied

    def hook(_model: Any, _data: Any) -> None:
        out[:] = own.torque(rates)

    return hook
