"""How engines with laws of their own for friction are known to be off."""

from __future__ import annotations

from crossbody.cases.case import Limit

OWN = (
    "MuJoCo's own pyramids, soft contacts and step: friction creeps where it holds, pushes off the slip where it "
    "slides, and lifts what slides fast"
)
RIGID = (
    "rigid contacts on a grid of steps: friction begins and ends with a step, and so does what it makes of a velocity"
)
BOUNDED = f"{RIGID}; its friction is bounded along two axes, not in a cone"
KNOWN = {
    ("mujoco", "default"): OWN,
    ("pinocchio", "admm"): RIGID,
    ("drake", "matched"): "stiff contacts on a grid of steps, and friction as a steep function of the slip",
    ("drake", "default"): (
        "soft contacts, one a pair of solids, where they are deepest; friction as a function of the slip, and the "
        "normal force of the step before"
    ),
    ("dart", "matched"): BOUNDED,
    ("dart", "default"): f"{BOUNDED}, and what rests is put to sleep",
}
LIMITS = tuple(
    Limit(metric="*", engine=engine, profile=profile, covers_none=True, known=known)
    for (engine, profile), known in KNOWN.items()
)
"""What takes engines and profiles outside where contacts or joints of a scene have friction."""
