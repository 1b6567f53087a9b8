"""How far each engine may be from the truth of the delta robot at its default settings, and why."""

from __future__ import annotations

from crossbody.cases._case import Limit

IMPULSE: tuple[Limit, ...] = ()
FREE: tuple[Limit, ...] = ()
SINGULARITY: tuple[Limit, ...] = ()
TRACKING: tuple[Limit, ...] = ()
