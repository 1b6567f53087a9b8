"""A row of balls, some of which strike the others: k in, k out, if collisions follow one another.

Sliders are the collision problem alone; pendulums add strings and gravity. Which collision rule is used
decides what comes out of balls that touch: `collisions`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from crossbody.cases import closed_forms as cf
from crossbody.cases.case import Case, Claim, Coordinate, Parameter, Tier, Value
from crossbody.cases.mechanisms.cradle.claims import METRICS, SLIDING, limits
from crossbody.cases.mechanisms.cradle.motion import Motion
from crossbody.cases.mechanisms.cradle.scene import FROZEN, Row, law, row, scene, turning
from crossbody.cases.parameters import NumberOrWord, Numbers
from crossbody.cases.scene_contacts import law_of

AUTO = "auto"

PARAMETERS = {
    "n": Parameter(default=5, doc="number of balls", low=2, high=1000),
    "lifted": Parameter(default=1, doc="number of leftmost balls that strike the others", low=1),
    "gap": Parameter(default=0.0, unit="m", doc="between neighbours at rest; 0 for touching"),
    "radius": Parameter(default=0.025, unit="m", doc="radius of a ball", low=0.0, open_low=True),
    "masses": Numbers(default="0.1", unit="kg", doc="of one ball, or of all: 4,2,1", low=0.0, open_low=True),
    "length": Parameter(default=0.25, unit="m", doc=("length of the string, from pivot to centre of "
        "the ball"), low=0.0, open_low=True),
    "gravity": Parameter(default=9.81, unit="m/s^2", doc="on the pendulums", low=0.0, open_low=True),
    "angle": Parameter(
        default=-0.5, unit="rad", doc="of the lifted strings, counter-clockwise", low=-math.pi, high=0.0
    ),
    "speed": Parameter(default=1.0, unit="m/s", doc="of the sliders that strike", low=0.0, open_low=True),
    "a0": Parameter(default=1e6, unit="1/s^2", doc="stiffness of a collision over the mass", low=0.0, open_low=True),
    "zeta": Parameter(default=0.0, doc="damping ratio of a collision; 0 is elastic", low=0.0),
    "collisions": Parameter(
        default="sequential", doc="rule for several contacts", choices=("sequential", "simultaneous", "resolved")
    ),
    "t_end": NumberOrWord(
        default=AUTO, unit="s", doc="horizon; auto: until every gap opens (sliders), 5 s (pendulums)",
        low=0.0, open_low=True, choices=(AUTO,),
    ),
}  # fmt: skip

VARIANTS: dict[str, dict[str, Value]] = {
    "sliders": {},
    "pendulums": {},
    "unequal": {"masses": "0.4,0.3,0.2,0.1,0.05", "gap": 0.01, "collisions": "resolved"},
}

_TITLES = {
    "sliders": "balls on a line without gravity: the collision problem alone",
    "pendulums": "pendulums side by side, the leftmost released",
    "unequal": "balls on a line, each lighter than the one before, so far apart that pairs collide one after another",
}
_MECHANISMS = {"unequal": "sliders"}  # of the variants that are not named after theirs
_UNITS = {"sliders": "m", "pendulums": "rad"}
PENDULUMS_S = 5.0


def horizon(balls: Row, motion: Motion) -> float:
    """Long enough for sliders that collide in no time and for those whose collisions are integrated, s.

    Every contact may take its contact time and its ballistic time, one after another through the whole row;
    and balls that meet overlapping collisions leave with other speeds, so that what follows comes later.
    """
    a1 = 2.0 * balls.zeta * math.sqrt(balls.a0)
    contact = cf.contact_time(balls.a0, a1) + cf.ballistic_time(balls.a0, a1)
    return 2.0 * motion.last + 4.0 * balls.n * contact + balls.gap / balls.speed


def _claims(balls: Row, rule: str) -> tuple[Claim, ...]:
    """What the presentation of the law says of the cradle: as many out as in."""
    if rule != "sequential" or balls.e != 1.0 or np.ptp(balls.masses) > 0.0:
        return ()
    return (
        Claim(
            metric="balls_out",
            expected=float(balls.lifted),
            tier=Tier.A,
            source=f"{balls.lifted} in, {balls.lifted} out",
        ),
    )


def build(variant: str, parameters: Mapping[str, Value]) -> Case:
    """The scene with its truth; sliders under a frozen rule move in straight lines between impacts."""
    mechanism = _MECHANISMS.get(variant, variant)
    balls, rule = row(parameters, mechanism), str(parameters["collisions"])
    sliders = mechanism == "sliders"
    motion = Motion(balls, rule if rule in FROZEN else FROZEN[0])
    t_end = parameters["t_end"]
    if t_end == AUTO:
        t_end = horizon(balls, motion) if sliders else PENDULUMS_S
    angle = 0.0 if sliders else float(parameters["angle"])
    q0 = np.where(np.arange(balls.n) < balls.lifted, angle, 0.0)
    v0 = balls.v0 if sliders else np.zeros(balls.n)
    made = scene(parameters, mechanism, law(balls, rule))
    claims = _claims(balls, rule)
    return Case(
        name="newtons_cradle",
        variant=variant,
        title=_TITLES[variant],
        mechanism=mechanism,
        parameters={**parameters, "t_end": t_end},
        coordinates=tuple(Coordinate(name=f"ball {i}", unit=_UNITS[mechanism]) for i in range(balls.n)),
        contacts=tuple(tendon.name for tendon in made.tendons),
        q0=q0,
        v0=v0,
        t_end=float(t_end),
        law=law_of(made),
        real_time=law_of(scene(parameters, mechanism, law(balls, "resolved"))),
        scene=made,
        collisions=rule,
        closed_form=motion if sliders and rule in FROZEN else None,
        claims=claims,
        metrics={**METRICS, **(SLIDING if sliders else {})},
        limits=limits(mechanism, rule, balls.gap, claims, 0.0 if sliders else turning(parameters)),
        units={k: parameter.unit for k, parameter in PARAMETERS.items()},
    )
