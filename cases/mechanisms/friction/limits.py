"""What cases with friction share: exact motion as the truth, and limits."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from types import MappingProxyType

from crossbody.cases.case import Case, Limit, Parameter, Prediction
from crossbody.cases.mechanisms.friction.motions import Motion

CREEPS = (
    "it creeps at the speed that its parameters predict: its friction is a function of the slip, so there is "
    "no force without slip"
)
NEAR = 0.05  # part of a predicted creep by which the measured one may be off
NOTHING: Mapping[tuple[str, str], Prediction] = MappingProxyType({})
SOFT = Limit(
    metric="*", engine="mujoco", profile="default", covers_none=True, known="MuJoCo's own soft contacts and step"
)  # fmt: skip
"""What takes it outside where nothing rubs: where something does, that of every case with friction stands."""
HELD = "friction sticks: the remaining slip decays as a gap does"


def limits(
    case: Case, title: str, parameters: Mapping[str, Parameter], motion: Motion | None,
    p: Mapping[str, float], creeps: Mapping[tuple[str, str], Prediction] = NOTHING,
) -> Case:  # fmt: skip
    """Return a case with its title, its exact motion and the limits of all cases with friction.

    `creeps` tells engine and profile -> speed at which its own parameters have it creep, by its settings, m/s.
    """
    held = 1e-9 * max(1.0, p.get("speed", 0.0))
    return replace(
        case, title=title, closed_form=motion if motion is not None and motion.presses else None,
        units={name: one.unit for name, one in parameters.items()},
        limits=(
            *case.limits, Limit(metric="creep_speed", value=held, why=HELD), *_predicted(creeps, held),
            *(() if case.rubs else (SOFT,)),
        ),
    )  # fmt: skip


def _predicted(creeps: Mapping[tuple[str, str], Prediction], held: float) -> Iterator[Limit]:
    for (engine, profile), predicts in creeps.items():
        yield Limit(
            metric="creep_speed", value=held, engine=engine, profile=profile, known=CREEPS, predicts=predicts, near=NEAR
        ).under({})
