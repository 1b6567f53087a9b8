"""A ball above a floor in MuJoCo: a sphere on a slide joint, whose position is the height of its lowest point."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from crossbody.cases import Case, Mode
from crossbody.cases.arrays import Floats
from crossbody.engines import _ball_scale, _scale
from crossbody.engines._log import Modes
from crossbody.engines.mujoco._audit import audit
from crossbody.engines.mujoco._direct import direct_solref, without_regularisation
from crossbody.engines.mujoco._globals import Hook
from crossbody.engines.mujoco._scene import Scene

OPEN, CLOSED = (int(Mode.FREE),), (int(Mode.CONTACT),)
PULLED, HELD = (int(Mode.BALLISTIC),), (int(Mode.BILATERAL),)
FAR = 1e10
"""Margin that no gap falls below: the pair is never a contact, m."""


def default_step(case: Case, profile: str) -> float:
    """Time step when none is given, s: MuJoCo's own, or one that resolves the law at its deepest point."""
    return 2e-3 if profile == "default" else min(1e-3, _scale.resolving_step(case.law, _ball_scale.deepest(case)))


def build(case: Case, profile: str, dt: float) -> Scene:
    """Compile the model of one profile.

    Raises:
        ValueError: MuJoCo's own, for a model that it refuses.
    """
    model = _model(case, profile)
    data = mujoco.MjData(model)
    scene = Scene(
        model=model,
        data=data,
        nc=1,
        start=_start(case, model, data),
        modes=lambda: HELD,
        lam=_multiplier(data),
        safe=_guard(case, data),
        observe=_observer(model),
    )
    if case.law.unilateral[0]:
        scene.modes = _modes(data)
    if profile == "matched":
        _match(scene, case, dt)
    scene.audit = audit(case, scene, matched=profile == "matched")
    return scene


def _model(case: Case, profile: str) -> Any:
    spec = mujoco.MjSpec.from_file(str(Path(__file__).with_name(f"ball_{profile}.xml")))
    spec.option.gravity = (0.0, 0.0, -case.number("gravity"))
    spec.geom("ball").mass = case.number("mass")
    spec.equality("hold").active = not case.law.unilateral[0]
    if profile == "default":
        for geom in spec.geoms:
            geom.contype = geom.conaffinity = int(case.law.unilateral[0])
        return spec.compile()
    row = spec.pairs[0] if case.law.unilateral[0] else spec.equality("hold")
    row.solref = direct_solref(case.law, 0)
    model = spec.compile()
    without_regularisation(model)
    if not case.law.unilateral[0]:
        model.pair_margin[0] = -FAR
    return model


def _start(case: Case, model: Any, data: Any) -> Callable[[], None]:
    def start() -> None:
        mujoco.mj_resetData(model, data)
        data.qpos[:] = case.q0
        data.qvel[:] = case.v0

    return start


def _multiplier(data: Any) -> Callable[[], float]:
    """H = 1, so lam is the generalised constraint force: the sum of the rows of efc_force, without their copy."""
    force: Callable[[int], float] = data.qfrc_constraint.item
    return lambda: force(0)


def _modes(data: Any) -> Callable[[], Modes]:
    """Free above the floor; below it in contact while it pushes (MuJoCo keeps no memory)."""
    height, force = data.qpos.item, data.qfrc_constraint.item

    def modes() -> Modes:
        if height(0) > 0.0:
            return OPEN
        return CLOSED if force(0) > 0.0 else PULLED

    return modes


def _guard(case: Case, data: Any) -> Callable[[], bool]:
    """Finite, not deeper than free fall, and not 100 times faster than all energy at hand explains."""
    height, speed = data.qpos.item, data.qvel.item
    fall = _ball_scale.fall_depth(case) * (1 + 1e-9)
    floor = float(case.q0[0]) - fall if case.law.unilateral[0] else -math.inf
    rise = 2 * _ball_scale.energy_per_mass(case) + (case.number("gravity") * case.t_end) ** 2
    fastest = 100.0 * math.sqrt(rise)
    return lambda: floor <= height(0) < math.inf and -fastest <= speed(0) <= fastest


def _observer(model: Any) -> Callable[[Floats, Floats], tuple[Floats, Floats]]:
    mass, gravity = float(model.body_mass[1]), -float(model.opt.gravity[2])

    def observe(q: Floats, v: Floats) -> tuple[Floats, Floats]:
        return q, np.column_stack((0.5 * mass * v[:, 0] ** 2, mass * gravity * q[:, 0]))

    return observe


def _match(scene: Scene, case: Case, dt: float) -> None:
    """The rest of the law: cubic term, and rows that live exactly as long as the event machine says."""
    model, data = scene.model, scene.data
    a0, a2 = float(case.law.a0[0]), float(case.law.a2[0])
    if not case.law.unilateral[0]:
        scene.hook = _cubic(data, a2, 0.0) if a2 else None
        return
    # A row must outlive the floor by a step, or the stages of the step that leaves it see different equations.
    # The engine counts positions from the margin: the hook takes a0 margin out again.
    reach = 4 * dt * math.sqrt(2 * _ball_scale.energy_per_mass(case) + (case.number("gravity") * dt) ** 2)
    scene.hook = _cubic(data, a2, a0 * reach)

    def arm(modes: Modes) -> None:
        model.pair_margin[0] = -FAR if modes[0] == Mode.FREE else reach

    def margins() -> list[tuple[float, float]]:
        lam = scene.lam()
        if lam <= 0.0 and data.nefc:
            lam = (data.efc_aref.item(0) - data.qacc.item(0)) * model.body_mass.item(1)
        return [(data.qpos.item(0), lam)]

    scene.arm, scene.margins = arm, margins


def _cubic(data: Any, a2: float, shift: float) -> Hook:
    """Add -a2 h^3 - shift to the row's reference acceleration (which holds -a1 h' - a0 (h - margin) already)."""
    height = data.qpos.item

    def hook(_model: Any, d: Any) -> None:
        if d.nefc:
            h = height(0)
            d.efc_aref[0] -= a2 * h * h * h + shift

    return hook
