"""Newton's cradle in MuJoCo: a sphere on a joint of its own each (spec 4.1, 4.2)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from crossbody.cases import Case, Law
from crossbody.cases.arrays import Floats
from crossbody.engines._cradle import Chain, one_set
from crossbody.engines.mujoco._audit import audit
from crossbody.engines.mujoco._direct import without_regularisation
from crossbody.engines.mujoco._pairs import Pairs, add_pairs
from crossbody.engines.mujoco._scene import Scene

USUAL = 1e4
"""Stiffness over mass of the obvious model, 1/s^2: about the largest that MuJoCo's own step of 2 ms resolves."""
FASTEST = 100.0
"""Times the speed that a scene can have: a run has diverged."""
SMALL = 1e-9
"""Part of a collision's depth that rounding may make of a gap; ten times of it of its multiplier."""
ITERATIONS = 20
"""Of Newton; it needs 3 for 9 rows that all push, to 2e-10 of lam."""


def default_step(chain: Chain, case: Case, profile: str) -> float:
    """MuJoCo's own step, or twenty in a contact, s."""
    return 2e-3 if profile == "default" else min(1e-3, chain.step(case.law))


def build(case: Case, chain: Chain, spec: Any, profile: str, dt: float) -> Scene:
    """Compile the model of one profile from bodies named `ball i`, each with a joint and a geom of that name."""
    model = _compiled(case, chain, spec, profile)
    data = mujoco.MjData(model)
    q, v = data.qpos, data.qvel
    law = one_set(case.law)
    pairs = Pairs(
        model, data, _neighbours(chain), law, _small(chain, law), gaps=lambda: chain.heights(q),
        drift=lambda: chain.drift(q, v),
    )  # fmt: skip
    scene = Scene(
        model=model, data=data, nc=chain.n - 1, start=_start(case, model, data), modes=pairs.modes, lam=pairs.lam,
        safe=_guard(chain, case.law, data), observe=chain.observe,
    )  # fmt: skip
    matched = profile == "matched"
    if matched:
        scene.hook, scene.margins = pairs.hook, pairs.margins
        scene.arm = pairs.arm(reach=8 * dt * chain.speed)
    scene.audit = {**audit(case, scene, matched=matched)}
    return scene


def _compiled(case: Case, chain: Chain, spec: Any, profile: str) -> Any:
    spec.option.gravity = (0.0, 0.0, -chain.gravity)
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    if profile == "default":
        zeta = case.number("zeta")
        for i in range(chain.n):
            spec.geom(f"ball {i}").solref[:2] = -USUAL, -2.0 * zeta * USUAL**0.5
        return spec.compile()
    return _matched(spec, _neighbours(chain), one_set(case.law))


def _neighbours(chain: Chain) -> list[tuple[str, str]]:
    return [(f"ball {i}", f"ball {i + 1}") for i in range(chain.n - 1)]


def _small(chain: Chain, law: Law) -> tuple[float, float]:
    """Gap, m, and multiplier, N, that count as zero, beside those of two balls that collide."""
    lam = float(chain.masses.max()) * chain.speed**2 / chain.depth(law)
    return SMALL * chain.depth(law), 10.0 * SMALL * lam


def _matched(spec: Any, geoms: list[tuple[str, str]], law: Law) -> Any:
    """One pair a row with its own law, without the regularisation; nothing else collides."""
    option = spec.option
    option.integrator, option.solver = mujoco.mjtIntegrator.mjINT_RK4, mujoco.mjtSolver.mjSOL_NEWTON
    option.jacobian, option.iterations, option.tolerance = mujoco.mjtJacobian.mjJAC_DENSE, ITERATIONS, 0.0
    option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ISLAND)
    add_pairs(spec, geoms, law)
    model = spec.compile()
    without_regularisation(model)
    return model


def _start(case: Case, model: Any, data: Any) -> Callable[[], None]:
    def start() -> None:
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = case.q0, case.v0

    return start


def _guard(chain: Chain, law: Law, data: Any) -> Callable[[], bool]:
    """Finite, and not 100 times faster than the energy at hand explains."""
    rates: Floats = data.qvel
    fastest = FASTEST * chain.sizes(law)[1]
    return lambda: bool(np.abs(rates).max() < fastest)
