"""Numbers that must come out of the ball maze, from closed forms, and how far engines may be off, and why."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping

from crossbody.cases.case import Claim, Limit, Tier, Value
from crossbody.cases.mechanisms.maze import closed_forms as cf
from crossbody.cases.mechanisms.maze.geometry import Maze, tilted_gravity


def claims(variant: str, p: Mapping[str, Value], maze: Maze) -> tuple[Claim, ...]:
    """What holds for the parameters of a variant."""
    made = {"inside": _swing, "free": _swing, "outside": _leave, "solve": _solved}
    return tuple(made[variant](p, maze)) if variant in made else ()


def fallen(p: Mapping[str, Value], maze: Maze) -> float:
    """Height through which the ball has moved on its face at most, over its circle's radius, from small motions.

    On top of a face its angle grows as cosh, inside it swings as cos; infinite where a controller
    moves the maze.
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
    """Whether the closed forms hold: no drive, no brake, a start on that side."""
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
    """Every ring is passed once; the ball falls from its start on top to the bottom of ring 0."""
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


OBVIOUS = (
    "The obvious model builds rings of segments and has MuJoCo's own contact constants and "
    "friction, not the case's law: it rolls over facets, sinks in and slips."
)
_TOLERANCE = "a thousand times the default tolerance of 1e-9"
_LOG = "read between the samples of a run"
_SMALL = "a tolerance of 1e-9 in the height, over that through which the ball moves, a part of its circle's radius"
_TOLERATED, _DEFAULT = 1e-9, 1e-6
"""Default tolerance, and the limit that every case has on energies over the largest kinetic one."""
_ENERGIES = ("energy_drift", "energy_integrator", "contact_work")
_CLAIMED: Mapping[str, tuple[float, str]] = {
    "swing_period": (1e-6, _LOG),
    "unstable_pole": (1e-6, _TOLERANCE),
    "leave_angle": (1e-5, _LOG),
    "ring_changes": (0.0, "a count"),
    "contact_loss": (7e-6, "1 % of 0.70 mJ: what the input works is not in the claim"),
}
"""Judged where the case claims a number."""
_ALWAYS: Mapping[str, tuple[float, str]] = {"ring_change_times": (1e-6, _TOLERANCE)}
_MULTISTEP = (
    "backward differentiation errs by the tolerance of 1e-9 in every step, at worst always to "
    "one side, and takes up to 20,000 of them in stiff contact"
)


def limits(claims: Iterable[Claim], fallen: float) -> tuple[Limit, ...]:
    """The limits of one variant beside those that every case has.

    Args:
        claims: what it claims.
        fallen: height through which the ball moves on its face, over the radius of its circle;
            infinite where more than gravity drives it.
    """
    bounds = {**_ALWAYS, **{claim.metric: _CLAIMED[claim.metric] for claim in claims}}
    if _TOLERATED / fallen > _DEFAULT:
        bounds |= dict.fromkeys(_ENERGIES, (_TOLERATED / fallen, _SMALL))
    return (
        *(Limit(metric=metric, value=value, why=why) for metric, (value, why) in bounds.items()),
        *_of_engines(),
    )


def _of_engines() -> Iterator[Limit]:
    for metric in ("position", "energy_drift"):
        yield Limit(metric=metric, value=2e-5, engine="reference", profile="cvode", why=_MULTISTEP)
    for metric in ("*", "audit"):
        yield Limit(metric=metric, engine="mujoco", profile="default", known=OBVIOUS)
