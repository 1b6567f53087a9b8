"""What is drawn of hulls, asked of robot files alone."""

from __future__ import annotations

from crossbody.reports.judging.asked import Found
from crossbody.reports.pages import known_solids
from crossbody.reports.pages.known_pages import asked


def wrong() -> tuple[Found, ...]:
    """Return how far a hull reaches, and where its marks are, where that is another number than it must be."""
    return tuple(asked("hulls in space", known_solids.hulls))
