"""How far each engine may be from the truth of the bouncing ball, and why."""

from __future__ import annotations

from crossbody.cases._case import Limit

LIMITS: tuple[Limit, ...] = ()
