"""The plant of synthetic logs of the delta rig: MuJoCo under the rig's sampled control; no measurement."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from crossbody import cases, engines
from crossbody.cases import Case, Inputs, InvalidValue, SceneError, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.entry_points import checked_arguments, checked_fields
from crossbody.reference.delta import scene

NAMES = ("torque 1 [N m]", "torque 2 [N m]", "torque 3 [N m]", "force x [N]", "force y [N]", "force z [N]")


@checked_fields
@dataclass(frozen=True, slots=True, kw_only=True)
class Push:
    """A constant force on the flange for a while; both ends are moved to the next tick of the controller.

    Attributes:
        start, length: s.
        force: N.
    """

    start: float
    length: float
    force: tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plant:
    """A run of the plant, at the ticks of its controller.

    Attributes:
        case: the scene with its true parameters and the pushes as inputs.
        engine: who ran it, with its version.
        trajectory: the motion as the engine gave it.
        t (n,): ticks, s.
        q, v (n, 9): all joint angles and rates there, rad, rad/s.
        u (n, 3): torques in force from each tick on, N m.
        force (n, 3): force on the flange from each tick on, N.
        r (n, 3): reference of the flange, m.
    """

    case: Case
    engine: str
    trajectory: Trajectory
    t: Floats
    q: Floats
    v: Floats
    u: Floats
    force: Floats
    r: Floats


@checked_arguments
def delta_plant(pushes: Iterable[Push] = (), **parameters: float | int | str | bool) -> Plant:
    """Run the sampled closed loop of `delta_tracking` in MuJoCo.

    Args:
        pushes: forces on the flange, in the order of their times, not overlapping.
        parameters: of the case, for example t_end=60.0, frequency=0.7, variant="pd".

    Raises:
        EngineUnavailable: if MuJoCo is not installed.
        UnknownName, InvalidValue, SceneError: for a scene that cannot be built or that MuJoCo
            does not finish.
    """
    case = cases.load("delta_tracking", **parameters)  # type: ignore[arg-type]
    ticks = scene.sampling_of(case.parameters).ticks(case.t_end)
    ticks = ticks[ticks < case.t_end]
    case = replace(case, inputs=_inputs(ticks, tuple(pushes)))
    engine = engines.load("mujoco")
    motion = engine.prepare(case, "matched").run()
    if not motion.outcome.ok:
        raise SceneError(f"The plant did not finish: {motion.outcome}. {motion.message}")
    at = np.searchsorted(motion.t, ticks - 1e-12)
    q, v = motion.q[at], motion.v[at]
    path = scene.path_of(case.parameters)
    assert path is not None  # the case has a sampled controller
    return Plant(
        case=case, engine=" ".join(("mujoco", *engine.versions.values())), trajectory=motion, t=ticks,
        q=q, v=v, u=_torques(case, ticks, q, v), force=_forces(case, ticks), r=path(ticks)[0],
    )  # fmt: skip


def _inputs(ticks: Floats, pushes: tuple[Push, ...]) -> Inputs | None:
    if not pushes:
        return None
    times, values = [], []
    for push in pushes:
        ends = np.searchsorted(ticks, (push.start - 1e-12, push.start + push.length - 1e-12))
        if not 0 <= ends[0] < ends[1] < len(ticks):
            raise InvalidValue(f"{push} does not lie within 0 and {ticks[-1]:g} s.")
        for end, force in zip(ends, (push.force, (0.0, 0.0, 0.0)), strict=True):
            times.append(float(ticks[end]))
            values.append([0.0, 0.0, 0.0, *force])
    return Inputs(names=NAMES, times=np.array(times), values=np.array(values))


def _torques(case: Case, ticks: Floats, q: Floats, v: Floats) -> Floats:
    """The controller again on what it saw: the torques that it had set."""
    program = scene.program_of(case.parameters)
    assert program is not None  # the case has a sampled controller
    u, memory, found = np.zeros(6), np.zeros(program.memory), np.empty((len(ticks), 3))
    for k, t in enumerate(ticks):
        program.control(float(t), q[k].copy(), v[k].copy(), u, memory, program.parameters)
        found[k] = u[:3]
    return found


def _forces(case: Case, ticks: Floats) -> Floats:
    force = np.zeros((len(ticks), 3))
    if case.inputs is not None:
        for t, value in zip(case.inputs.times, case.inputs.values, strict=True):
            force[ticks >= t - 1e-12] = value[3:]
    return force
