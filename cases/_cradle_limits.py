"""How far each engine may be from the truth of Newton's cradle at its default settings, and why."""

from __future__ import annotations

from crossbody.cases._case import Limit


def limits(variant: str, rule: str) -> tuple[Limit, ...]:
    """The limits of one variant under one rule."""
    return ()
