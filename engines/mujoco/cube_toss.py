"""A cube tossed on a table in MuJoCo: a box on a free joint, a plane, one friction coefficient and one solref."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import mujoco
import numpy as np

from crossbody.cases import Case, Mode, Outcome, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.files.warned import captured
from crossbody.engines._cube import Cube, cube, quaternion, rotation_vector
from crossbody.engines._log import Log, charted
from crossbody.engines.contract import Run

FASTEST = 1e4
"""Speed at which a run has diverged, m/s or rad/s."""


def default_step(case: Case, profile: str) -> float:
    """Time step when none is given, s: MuJoCo's own, or 1 ms."""
    return 2e-3 if profile == "default" else 1e-3


def prepare(case: Case, profile: str, used: Mapping[str, Any]) -> CubeRun:
    """Compile the model; `default` has the contact constants of MuJoCo, `matched` those of the case.

    Raises:
        ValueError: MuJoCo's own, for a model that it refuses.
    """
    own, spec = cube(case), mujoco.MjSpec()
    spec.option.gravity = (0.0, 0.0, -own.gravity)
    spec.option.timestep = float(used["dt"])
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC if profile == "matched" else mujoco.mjtCone.mjCONE_PYRAMIDAL
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=(1.0, 1.0, 0.1), friction=(own.friction, 0.0, 0.0))
    body = spec.worldbody.add_body(name="cube")
    body.add_freejoint()
    body.explicitinertial = True
    body.mass, body.inertia = own.mass, (own.inertia,) * 3
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=(own.half,) * 3, friction=(own.friction, 0.0, 0.0))
    if profile == "matched":
        for geom in spec.geoms:
            geom.solref[:] = case.number("timeconst"), case.number("dampratio")
    return CubeRun(case=case, cube=own, model=spec.compile(), profile=profile, settings=dict(used))


@dataclass(slots=True, kw_only=True)
class CubeRun(Run):
    """One prepared run; see `crossbody.engines.Run`."""

    case: Case
    cube: Cube
    model: Any
    profile: str
    settings: Mapping[str, Any]
    engine: str = "mujoco"
    data: Any = field(init=False)

    def __post_init__(self) -> None:
        """State of the model."""
        self.data = mujoco.MjData(self.model)

    def run(self) -> Trajectory:
        """Step from the start; lam is the vertical force of the table, N."""
        log, data = Log(), self.data
        mujoco.mj_resetData(self.model, data)
        q0, dt = self.case.q0, float(self.settings["dt"])
        data.qpos[:3], data.qpos[3:], data.qvel[:] = q0[:3], quaternion(q0[3:]), self.case.v0
        start = perf_counter()
        with captured() as warned:
            outcome = self._steps(log, dt)
        wall = perf_counter() - start
        message = " ".join(f"MuJoCo warned: {w.strip()}" for w in dict.fromkeys(warned))
        return log.trajectory(
            charted(_chart, self.cube.observe), outcome, message, len(log.motion) - 1, wall, chart=_chart
        )

    def _steps(self, log: Log, dt: float) -> Outcome:
        model, data = self.model, self.data
        count = int(np.ceil(self.case.t_end / dt - 1e-9))
        if count > int(self.settings["max_steps"]):
            return Outcome.STEP_LIMIT
        mujoco.mj_forward(model, data)
        mode = self._record(log, (int(Mode.FREE),))
        for _ in range(count):
            mujoco.mj_step(model, data)
            if not (np.abs(data.qvel).max() < FASTEST and np.isfinite(data.qpos).all()):
                return Outcome.DIVERGED
            mode = self._record(log, mode)
        return Outcome.FINISHED

    def _record(self, log: Log, before: tuple[int, ...]) -> tuple[int, ...]:
        data = self.data
        mode = (int(Mode.CONTACT if data.ncon else Mode.FREE),)
        log.switch(data.time, before, mode)
        log.add(data.time, data.qpos.copy(), data.qvel.copy(), float(data.qfrc_constraint[2]), mode)
        return mode

    def audit(self) -> Mapping[str, Any]:
        """The physics read back from the compiled model."""
        model = self.model
        return {
            "masses": model.body_mass[1:].copy(), "gravity": float(np.linalg.norm(model.opt.gravity)),
            "constants": {"solref": model.geom_solref[1].copy()}, "q0": self.case.q0, "v0": self.case.v0,
        }  # fmt: skip


def _chart(q: Floats, v: Floats) -> tuple[Floats, Floats]:
    return np.column_stack((q[:, :3], rotation_vector(q[:, 3:]))), v
