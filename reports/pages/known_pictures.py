"""What pictures without a browser must draw of a made-up motion of a ball, asked by the command that draws them."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np

from crossbody.cases import Trajectory
from crossbody.reports.judging.asked import Found
from crossbody.reports.pages import picture
from crossbody.reports.pages.known_figures import drawn
from crossbody.reports.pages.known_pages import asked
from crossbody.reports.pages.made_up_traces import Said
from crossbody.reports.runs.store import Trace


@cache
def wrong() -> tuple[Found, ...]:
    """Return what is drawn, number, least and most, and which number, where another one is drawn."""
    return tuple(asked("picture", _pictures))


def _pictures() -> Iterator[Said]:
    """Yield where a ball is in pictures between its samples, and how long the arrow of its force is, in pixels."""
    height, t = 2.0, np.array([0.0, 1.0, 2.0, 4.0])
    q, lam = np.array([[2.0], [0.5], [0.0], [1.6]]), np.array([[0.0], [3.0], [12.0], [6.0]])
    run = Trajectory(
        t=t, q=q, v=np.array([[-1.0], [-1.0], [0.8], [0.8]]), gap=q, lam=lam, energy=np.ones((4, 2)) * t[:, None],
        mode=np.zeros((4, 1), dtype=np.int8),
    )  # fmt: skip
    about = drawn().about | {
        "mechanism": "ball", "parameters": {"height": height}, "contacts": ("floor",), "engine": "one", "profile": "p",
        "coordinates": [{"name": "height", "unit": "m"}], "turning": (), "scales": [2.0], "gap_scales": [2.0],
    }  # fmt: skip
    film, r = picture.Film(Trace(about=about, run=run, truth=None)), 0.12 * height
    spots = {}
    for when, high in ((0.0, 2.0), (0.5, 1.25), (1.0, 0.5), (3.0, 0.8), (4.0, 1.6)):
        strokes = film.at(when)
        ball = next(one.points for one in strokes if one.fill and one.color != picture.PUSH)
        spots[high] = 0.5 * (ball.min(axis=0) + ball.max(axis=0))
        scale = float(np.ptp(ball[:, 1])) / (2.0 * r)
        yield f"how far a ball at {high:g} m is below its start", (spots[high] - spots[2.0])[1], scale * (2.0 - high)
        pushes = [one.points for one in strokes if one.color == picture.PUSH and not one.fill]
        force = {0.0: 0.0, 0.5: 0.0, 1.0: 3.0, 3.0: 12.0, 4.0: 6.0}[when]
        yield f"arrows at {when:g} s", float(len(pushes)), float(force > 0.0)
        for a, b in pushes:
            yield f"the arrow at {when:g} s", a - b, [0.0, picture.FORCE * picture.HEIGHT * force / 12.0]
