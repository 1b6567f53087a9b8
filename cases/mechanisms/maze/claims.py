"""Numbers that must come out of the ball maze, from its closed forms."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from crossbody.cases.case import Claim, Tier, Value
from crossbody.cases.mechanisms.maze import closed_forms as cf
from crossbody.cases.mechanisms.maze.geometry import Maze, tilted_gravity


def claims(variant: str, p: Mapping[str, Value], maze: Maze) -> tuple[Claim, ...]:
    """What holds for the parameters of a variant."""
    made = {"inside": _swing, "free": _swing, "outside": _leave, "solve": _solved}
    return tuple(made[variant](p, maze)) if variant in made else ()


def fallen(p: Mapping[str, Value], maze: Maze) -> float:
    """Height through which the ball has moved on its face at most, over its circle's radius, from small motions.

    On top of a face its angle grows as cosh, inside it swings as cos; infinite where a controller moves the maze.
    """
    angle, outer = abs(float(p["angle"])), p["side"] == "outer"
    if p["controller"] != "off" or not angle:
        return math.inf
    ring = maze.rings[int(p["ring"])]
    R, rho = (ring.outer, ring.outer + maze.ball) if outer else (ring.inner, ring.inner - maze.ball)
    turned = cf.pole(tilted_gravity(p), rho, _effective_mass(p, R)) * float(p["t_end"])
    grown = math.cosh(min(turned, 100.0)) if outer else math.cos(min(turned, 0.5 * math.pi))
    return abs(math.cos(min(angle * grown, math.pi)) - math.cos(angle))


def _effective_mass(p: Mapping[str, Value], R: float) -> float:
    return cf.effective_mass(float(p["ball_mass"]), R, float(p["maze_inertia"]), bool(p["rolling"]))


def _plain(p: Mapping[str, Value], side: str) -> bool:
    """Whether the closed forms hold: nothing drives the maze, nothing brakes the ball, it starts on that side."""
    return p["controller"] == "off" and not p["rolling_damping"] and p["side"] == side and p["angle"] != 0.0


def _clear(p: Mapping[str, Value], maze: Maze, middle: float, half: float) -> bool:
    """Whether the face is solid on an arc, and a tenth of it around: a free maze turns a little."""
    ring = maze.rings[int(p["ring"])]
    centres = (ring.centre(gap) + float(p["theta"]) for gap in range(ring.gaps))
    return all(abs(math.remainder(middle - c, 2.0 * math.pi)) > ring.reach + 1.1 * half for c in centres)


def _swing(p: Mapping[str, Value], maze: Maze) -> Iterator[Claim]:
    """The period inside a ring, if the swing meets no gap and is seen often enough."""
    R = maze.rings[int(p["ring"])].inner
    amplitude = abs(float(p["angle"]))
    period = cf.period(tilted_gravity(p), R - maze.ball, _effective_mass(p, R), amplitude)
    seen = amplitude < 0.5 * math.pi and 4.0 * period < float(p["t_end"])
    if seen and _plain(p, "inner") and _clear(p, maze, -0.5 * math.pi, amplitude):
        yield Claim(metric="swing_period", expected=period, tier=Tier.A, source="pendulum of length 7/5 (R - r)")


def _leave(p: Mapping[str, Value], maze: Maze) -> Iterator[Claim]:
    """Pole on the top, and where the ball leaves the face."""
    R, angle = maze.rings[int(p["ring"])].outer, float(p["angle"])
    mu = _effective_mass(p, R)
    pole = cf.pole(tilted_gravity(p), R + maze.ball, mu)
    cosine = cf.leave_cosine(angle, mu)
    leaves = math.copysign(math.acos(cosine), angle)
    early = math.cosh(pole * float(p["t_end"])) > 1.1 * leaves / angle if angle else False
    if early and _plain(p, "outer") and _clear(p, maze, 0.5 * (math.pi - leaves), 0.5 * abs(leaves)):
        yield Claim(metric="unstable_pole", expected=pole, tier=Tier.A, source="sqrt(5 g/(7 rho)) in a locked maze")
        yield Claim(metric="leave_angle", expected=cosine, tier=Tier.A, source="10/17 rolling, 2/3 frictionless")


def _solved(p: Mapping[str, Value], maze: Maze) -> Iterator[Claim]:
    """Every ring is passed once; the ball loses the height between its start on the top and the bottom of ring 0."""
    top, bottom = maze.rings[int(p["ring"])].outer + maze.ball, maze.rings[0].inner - maze.ball
    lost = float(p["ball_mass"]) * tilted_gravity(p) * (top * math.cos(float(p["angle"])) + bottom)
    if p["controller"] == "off" or float(p["t_end"]) < ARRIVED:
        return
    yield Claim(
        metric="ring_changes", expected=float(p["ring"]) + 1.0, tier=Tier.B, source="one change a ring, to the centre"
    )  # fmt: skip
    if not p["rolling_damping"]:
        yield Claim(
            metric="contact_loss", expected=lost, tier=Tier.A, source="weight times height; input works 1e-7 J"
        )  # fmt: skip


ARRIVED = 60.0  # from when on the default run is at rest in the centre, s
