"""Synthetic logs of the delta rig: assumed sensors on a plant that MuJoCo computed.

They are no measurement.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.signal import lfilter

from crossbody import cases, engines
from crossbody.cases import Case, Inputs, InvalidValue, SceneError, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.entry_points import checked_arguments, checked_fields
from crossbody.hw.formats import Group
from crossbody.hw.reading.checks import Checks
from crossbody.hw.reading.columns import Role, Signal
from crossbody.hw.reading.log import Channel, Log, Provenance
from crossbody.hw.reading.plan import Source
from crossbody.hw.reading.stream import Rows
from crossbody.hw.reading.units import to_si
from crossbody.reference.delta import scene

NAMES = ("torque 1 [N m]", "torque 2 [N m]", "torque 3 [N m]", "force x [N]", "force y [N]", "force z [N]")
ABOUT = "SYNTHETIC, no measurement: delta robot in MuJoCo"
MOTORS = (0, 3, 6)


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


@checked_fields
@dataclass(frozen=True, slots=True, kw_only=True)
class Sensors:
    """What stands between the plant and its log; all of it is assumed.

    Attributes:
        noise: standard deviation of an angle before it is rounded, rad.
        bits: counts of an encoder turn are 2^bits.
        delay: an angle at t is that of t - delay, s.
        touch_rate: ks of a touch sensor y = ks/(s + ks) f, 1/s.
        touch_noise: standard deviation of a force, N.
        touch_step: one count of a force, N.
        dropped: probability that a sample is lost.
        jitter: standard deviation of the recorded times, s.
        drift: how much the clock of the log runs fast, s/s.
    """

    noise: float = 2e-5
    bits: int = 18
    delay: float = 4e-4
    touch_rate: float = 200.0
    touch_noise: float = 0.02
    touch_step: float = 0.01
    dropped: float = 0.0
    jitter: float = 0.0
    drift: float = 0.0

    def __post_init__(self) -> None:
        """Check ranges."""
        for field in fields(self):
            value = getattr(self, field.name)
            low = -1e-2 if field.name == "drift" else 0.0
            high = {"dropped": 0.5, "drift": 1e-2, "bits": 52}.get(field.name, math.inf)
            if not low <= value <= high or not math.isfinite(value):
                raise InvalidValue(f"Sensors: {field.name} is {value!r}; valid: {low:g} to {high:g}, finite.")


@checked_arguments
def delta_log(plant: Plant, sensors: Sensors | None = None, seed: int = 0) -> Log:
    """Measure a plant.

    Args:
        plant: from `delta_plant`.
        sensors: what they do; the defaults if not given.
        seed: of noise, jitter and losses.

    Returns:
        A log whose provenance says that it is synthetic. Coordinates q11, q21, q31 (with the
        delay that a map would state: 0, for it is to be found), inputs torque 1 to 3, references
        x, y, z, sensors force x, y, z.
    """
    chosen = sensors or Sensors()
    random = np.random.default_rng(seed)
    n, period = len(plant.t), float(plant.case.parameters["period"])
    y = _angles(plant, chosen, random)
    touch = _touch(plant.force, chosen, period, random)
    time = plant.t * (1.0 + chosen.drift) + chosen.jitter * random.standard_normal(n)
    kept = random.random(n) >= chosen.dropped
    kept[[0, -1]] = True
    columns = {
        (Role.COORDINATES, "rad"): dict(zip(("q11", "q21", "q31"), y.T, strict=True)),
        (Role.INPUTS, "N m"): {f"torque {i + 1}": plant.u[:, i] for i in range(3)},
        (Role.REFERENCES, "m"): dict(zip("xyz", plant.r.T, strict=True)),
        (Role.SENSORS, "N"): {f"force {axis}": touch[:, i] for i, axis in enumerate("xyz")},
    }
    channels = tuple(
        Channel(role=role, name=name, unit=unit, values=values[kept], column=name)
        for (role, unit), found in columns.items()
        for name, values in found.items()
    )
    about = f"{ABOUT}; {plant.case.label}, {chosen}, seed {seed}"
    return _finish(time[kept], channels, period, about, plant.engine)


def _angles(plant: Plant, sensors: Sensors, random: np.random.Generator) -> Floats:
    """Motor angles a delay ago (cubic between ticks, by angle and rate), with noise, rounded to counts."""
    count = 2.0 * math.pi / 2**sensors.bits
    y = CubicHermiteSpline(plant.t, plant.q[:, MOTORS], plant.v[:, MOTORS])
    seen = y(np.maximum(plant.t - sensors.delay, 0.0)) + sensors.noise * random.standard_normal((len(plant.t), 3))
    rounded: Floats = count * np.rint(seen / count)
    return rounded


def _touch(force: Floats, sensors: Sensors, period: float, random: np.random.Generator) -> Floats:
    """First-order lag of a force held between ticks, exact: y_k = c y_k-1 + (1 - c) f_k-1, c = e^(-ks T)."""
    c = math.exp(-sensors.touch_rate * period)
    y = lfilter([0.0, 1.0 - c], [1.0, -c], force, axis=0)
    y = y + sensors.touch_noise * random.standard_normal(y.shape)
    return sensors.touch_step * np.rint(y / sensors.touch_step) if sensors.touch_step else y


def _finish(time: Floats, channels: tuple[Channel, ...], period: float, about: str, engine: str) -> Log:
    """The same checks as for a file, and a provenance that cannot be mistaken for a measurement's."""
    group = Group(name="", rows=len(time), columns=())
    sources = [
        Source(role=c.role, name=c.name, signal=Signal(column=c.name), group=group, conversion=to_si(c.unit))
        for c in channels
    ]
    checks = Checks(sources, period)
    values = tuple(c.values for c in channels)
    checks.see(Rows(rows=np.arange(len(time), dtype=np.int64), time=time, values=values))
    digest = hashlib.sha256(b"".join(np.ascontiguousarray(v).tobytes() for v in (time, *values))).hexdigest()
    source = Provenance(
        file="(synthetic)", sha256=digest, format="synthetic", library=engine, rows=len(time), synthetic=True,
        about=about,
    )  # fmt: skip
    return Log(time=time, channels=channels, sample_time=period, provenance=source, findings=checks.findings())
