"""Synthetic logs of the delta rig: assumed sensors on a plant that MuJoCo computed. They are no measurement.

The layout is that of the rig: every 0.88 ms three motor angles, the three torques in force from then on, the
reference of the flange, and three touch sensors that feel the force on the flange through a first-order lag.
The plant runs once (seconds); any number of seeds measure it (milliseconds).
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, fields

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.signal import lfilter

from crossbody.cases import InvalidValue
from crossbody.cases.arrays import Floats
from crossbody.cases.entry_points import checked_arguments, checked_fields
from crossbody.hw.formats import Group
from crossbody.hw.reading.checks import Checks
from crossbody.hw.reading.columns import Role, Signal
from crossbody.hw.reading.log import Channel, Log, Provenance
from crossbody.hw.reading.plan import Source
from crossbody.hw.reading.rows import Rows
from crossbody.hw.reading.units import to_si
from crossbody.hw.synthetic.plant import Plant

ABOUT = "SYNTHETIC, no measurement: delta robot in MuJoCo"
MOTORS = (0, 3, 6)


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
        """Check ranges.

        Raises:
            InvalidValue: naming the attribute.
        """
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
