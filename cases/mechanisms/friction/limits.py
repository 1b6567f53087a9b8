"""What cases with friction share: their exact motion as the truth, limits, and how far MuJoCo creeps by itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from crossbody.cases.case import Case, Limit, Parameter
from crossbody.cases.mechanisms.friction.motions import Motion

OWN = (
    "MuJoCo's own pyramids, soft contacts and step: friction creeps where it holds, pushes off the slip where it "
    "slides, and lifts what slides fast"
)
CREEPS = "it creeps as MuJoCo's own parameters say: its rows are springs and dampers, and a force needs a rate"
NEAR = 0.05
"""Part of a predicted creep by which the measured one may be off."""
HELD = "friction holds: what is left of a slip decays as a gap does"


def limits(
    case: Case, title: str, parameters: Mapping[str, Parameter], motion: Motion | None,
    p: Mapping[str, float], creeps: float = 0.0,
) -> Case:  # fmt: skip
    """Return a case with its title, its exact motion and the limits of all cases with friction.

    Args:
        case: the scene.
        title: of the case.
        parameters: of the case, for their units.
        motion: exact, and the truth where it is one.
        p: values of the parameters.
        creeps: speed at which MuJoCo's own parameters have it creep, m/s; 0 where they do not say.
    """
    held = 1e-9 * max(1.0, p.get("speed", 0.0))
    predicted = Limit(
        metric="creep_speed", value=held, engine="mujoco", profile="default", known=CREEPS,
        known_least=creeps * (1.0 - NEAR), known_size=creeps * (1.0 + NEAR),
    )  # fmt: skip
    return replace(
        case, title=title, closed_form=motion if motion is not None and motion.presses else None,
        units={name: one.unit for name, one in parameters.items()},
        limits=(
            *case.limits,
            Limit(metric="creep_speed", value=held, why=HELD),
            *((predicted,) if creeps else ()),
            Limit(metric="*", engine="mujoco", profile="default", covers_none=True, known=OWN),
        ),
    )  # fmt: skip
