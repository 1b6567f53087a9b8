"""By what errors must be measured of a scene in which fast, slow, resting and far coordinates stand beside each other.

Motions that are made up have no scene, and no run has a wheel beside a finger: were a finger's error taken relative to
the turns of a wheel, or a body's to how far off another one is, no number of theirs would differ.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache

import numpy as np

from crossbody.cases import Case, Trajectory
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, Scene
from crossbody.reports.judging.asked import Asked, Found, unlike_by
from crossbody.reports.measuring.scale import energy, idle, rounded, scale_of, scale_of_rates, still

PART, LASTS = 1e-12, 2.0
"""Part by which a size may differ; of a motion, s."""
FLOATS = {"near": (0.5, -2.0, 1.0), "far": (100.0, 3.0, -40.0)}
"""How far bodies float, m: each is measured by the largest of its own."""
MOVES = {"wheel": -300.0, "finger": 0.2, "idle": 0.0, "rail": 0.05, "stop": 0.0}
"""How far joints move, rad and m."""
SIZES = {"wheel": 300.0, "finger": 1.0, "idle": 1.0, "rail": 0.05, "stop": 0.05}
"""What they are measured by: the largest of their like, but no more than a radian, or their own."""
RATES = {"wheel": 150.0, "finger": 0.5, "idle": 0.5, "rail": 0.025, "stop": 0.025}
"""What their rates are measured by: of those that turn the part of the wheel's that a radian is of its turns."""
SLOWER = {"finger": 0.2, "idle": 0.2, "rail": 0.05, "stop": 0.05}
"""The same of those beside which no wheel turns."""


@cache
def wrong() -> tuple[Found, ...]:
    """Return which coordinate is measured by another size than it must be, m or rad, or their rates."""
    return unlike_by((_beside_a_wheel, _alone, _carried), "size", "coordinates of a scene, which end in", PART, 1e-300)


def _beside_a_wheel() -> Iterator[Asked]:
    case = _case((*FLOATS, *MOVES))
    places = {f"{name} {x}": size for name, at in FLOATS.items() for x, size in zip("xyz", at, strict=True)}
    wanted = {f"{name} {x}": max(map(abs, at)) for name, at in FLOATS.items() for x in "xyz"} | SIZES
    truth = _motion(case, places | MOVES)
    yield from _asked(case, truth, wanted)
    own = {f"{name} {x}": max(map(abs, at)) / LASTS for name, at in FLOATS.items() for x in "xyz"}
    yield from _rates(case, truth, own | {f"{name} r{x}": 1.0 / LASTS for name in FLOATS for x in "xyz"} | RATES)


def _alone() -> Iterator[Asked]:
    case = _case(tuple(SLOWER))
    truth = _motion(case, MOVES)
    yield from _asked(case, truth, SLOWER)
    yield from _rates(case, truth, {name: size / LASTS for name, size in SLOWER.items()})


KINETIC, SWING, FAR, FALLS = 3.0, 40.0, 250.0, 7.0
"""Of a motion: its largest kinetic energy, and by how much its potential differs, J; where it begins, and how far it
goes, m."""
IDLE, ROUNDING = 1e-3, 1e-6
"""Of the force that moves it, and of where it is, of which nothing is told."""


def _carried() -> Iterator[Asked]:
    """Yield what energies, idle rows and gaps of a fall are measured by, and whether it stands still."""
    part, none = np.linspace(0.0, 1.0, 5), np.zeros((5, 0))
    q, energies = (FAR - FALLS * part)[:, None], np.stack([KINETIC * part, 10.0 * SWING - SWING * part], axis=1)
    fall = Trajectory(
        t=LASTS * part, q=q, v=np.full((5, 1), -FALLS / LASTS), gap=none, lam=none, energy=energies,
        mode=none.astype(int),
    )  # fmt: skip
    rest = replace(fall, q=np.full((5, 1), FAR), v=np.zeros((5, 1)))
    yield "size", "the energy of a fall", energy(fall), SWING
    yield "size", "the energy of a fast fall", energy(replace(fall, energy=energies * [100.0, 1.0])), 100.0 * KINETIC
    yield "size", "what is idle in a fall", idle(fall), IDLE * SWING / FALLS
    yield "size", "rounding of gaps in a fall", rounded(q), ROUNDING * FAR
    yield "size", "rounding of gaps near an origin", rounded(q / (2.0 * FAR)), ROUNDING
    for what, run, wanted in (
        ("fall", fall, 0.0),
        ("body at rest", rest, 1.0),
        ("start", replace(rest, v=fall.v), 0.0),
    ):
        yield "still", f"a {what}", float(still(run)), wanted


def _case(names: tuple[str, ...]) -> Case:
    """Return bodies beside each other, each on a joint of its own."""
    kinds = {**dict.fromkeys(FLOATS, "free"), "rail": "slide", "stop": "slide"}
    inertia = (0.1, 0.1, 0.1, 0.0, 0.0, 0.0)
    return case_of(
        Scene(
            bodies=tuple(Body(name=name, mass=1.0, inertia=inertia) for name in names),
            joints=tuple(Joint(name=name, body=name, type=kinds.get(name, "hinge")) for name in names),
        ),
        name="sizes", t_end=LASTS,
    )  # fmt: skip


def _motion(case: Case, moves: Mapping[str, float]) -> Trajectory:
    """Return a motion from 0 to what coordinates move by, all of them steadily."""
    part, names = np.linspace(0.0, 1.0, 5), [one.name for one in case.coordinates]
    q = np.outer(part, [moves.get(name, 0.0) for name in names])
    for at in case.quaternions:
        q[:, at] = 1.0
    v = np.tile([moves.get(one.name, 0.0) / LASTS for one in case.velocities], (len(part), 1))
    none = np.zeros((len(part), 0))
    return Trajectory(
        t=LASTS * part, q=q, v=v, gap=none, lam=none, energy=np.ones((len(part), 2)), mode=none.astype(int)
    )


def _asked(case: Case, truth: Trajectory, wanted: Mapping[str, float]) -> Iterator[Asked]:
    found = dict(zip((one.name for one in case.coordinates), scale_of(truth, case).tolist(), strict=True))
    yield from (("size", f"{name} in a scene", found[name], size) for name, size in wanted.items())


def _rates(case: Case, truth: Trajectory, wanted: Mapping[str, float]) -> Iterator[Asked]:
    found = dict(zip((one.name for one in case.velocities), scale_of_rates(truth, case).tolist(), strict=True))
    yield from (("size", f"the rate of {name} in a scene", found[name], size) for name, size in wanted.items())
