"""What must come out of the ball maze, by closed forms, and how far engines may be off, and why."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.between import period
from crossbody.cases.case import Case, CaseMetric, Claim, Limit, Tier, Value
from crossbody.cases.contacts import at, contacts
from crossbody.cases.mechanisms.maze.geometry import Maze, tilted_gravity
from crossbody.cases.trajectory import Trajectory

FACE_BELOW = 0


def ring_changes(run: Trajectory, case: Case) -> Floats:
    """Return the instants at which the ball passed a ring (m,), s."""
    channel = case.discrete.index("channel")
    return np.array([switch.t for switch in run.switches if switch.variable == channel])


def leaving(run: Trajectory) -> tuple[float, float] | None:
    """Find angle from the top and its rate, rad and rad/s, where the ball leaves the outer face; None if it stays."""
    first = next((c for c in contacts(run) if c.row == FACE_BELOW and np.isfinite(c.release)), None)
    if first is None:
        return None
    x, y, xd, yd = (
        at(run, signal, first.release) for signal in (run.q[:, 1], run.q[:, 2], run.v[:, 1], run.v[:, 2])
    )  # fmt: skip
    return float(np.arctan2(x, y)), (y * xd - x * yd) / (x * x + y * y)


def _leave_angle(run: Trajectory, case: Case) -> float | None:
    left = leaving(run)
    return None if left is None else math.cos(left[0])


def _unstable_pole(run: Trajectory, case: Case) -> float | None:
    """Where the ball leaves the face, by delta'^2 = 2 pole^2 (cos(delta0) - cos(delta)), exact."""
    left = leaving(run)
    if left is None:
        return None
    angle, rate = left
    start = math.atan2(run.q[0, 1], run.q[0, 2])
    return abs(rate) / math.sqrt(2.0 * (math.cos(start) - math.cos(angle)))


METRICS = {
    "leave_angle": CaseMetric(
        doc="cosine of the angle, from the top, at which the ball leaves an outer face", number=_leave_angle
    ),
    "ring_changes": CaseMetric(
        doc="number of times that the ball passes a ring, inward and outward",
        number=lambda run, case: float(len(ring_changes(run, case))),
    ),
    "ring_change_times": CaseMetric(
        doc="error of the instants at which the ball passes a ring", unit="s", instants=ring_changes, always=True
    ),
    "swing_period": CaseMetric(
        doc="period of the ball's swing inside a ring", unit="s", number=lambda run, case: period(run.t, run.q[:, 1])
    ),
    "unstable_pole": CaseMetric(
        doc="rate at which a ball released near the top of an outer face runs away", unit="1/s", number=_unstable_pole
    ),
}


INERTIA = 0.4  # J/(m r^2) of a solid ball


def effective_mass(mass: float, R: float, maze_inertia: float, rolling: bool) -> float:
    """Mu, the mass that moves along the face over the mass of the ball; 7/5 where the maze is locked."""
    if not rolling:
        return 1.0
    k = INERTIA * mass * R * R
    return 1.0 + INERTIA * (1.0 - k / (maze_inertia + k))


def pole(g: float, rho: float, mu: float) -> float:
    """Unstable pole on top of an outer face, 1/s: sqrt(g/(mu rho)), sqrt(5 g/(7 rho)) if locked."""
    return math.sqrt(g / (mu * rho))


def leave_cosine(angle: float, mu: float) -> float:
    """Cosine of the angle from the top where a ball released at rest at `angle` leaves: 2 cos(angle)/(2 + mu).

    10/17 of cos(angle) in a locked maze, 2/3 without friction.
    """
    return 2.0 * math.cos(angle) / (2.0 + mu)


def swing_period(g: float, rho: float, mu: float, amplitude: float) -> float:
    """Period of the swing inside a face, s: 2 pi sqrt(mu rho/g) over the mean agm(1, cos(amplitude/2))."""
    a, b = 1.0, math.cos(0.5 * amplitude)
    while abs(a - b) > 1e-15:
        a, b = 0.5 * (a + b), math.sqrt(a * b)
    return 2.0 * math.pi * math.sqrt(mu * rho / g) / a


def balance_gains(p: float) -> tuple[float, float, float]:
    """(k2, k1, k0) of (s + p)^3."""
    return 3.0 * p, 3.0 * p * p, p**3


def centre_gains(g: float, rho: float, p: float) -> tuple[float, float, float]:
    """(k2, k1, k0) of (s^2 + w0 s + w0^2)(s + p), w0 the frequency of the ball that rolls to the bottom."""
    w0 = pole(g, rho, 1.0 + INERTIA)
    return w0 + p, w0 * w0 + p * w0, p * w0 * w0


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
    turned = pole(tilted_gravity(p), rho, _effective_mass(p, R)) * float(p["t_end"])
    grown = math.cosh(min(turned, 100.0)) if outer else math.cos(min(turned, 0.5 * math.pi))
    return abs(math.cos(min(angle * grown, math.pi)) - math.cos(angle))


def _effective_mass(p: Mapping[str, Value], R: float) -> float:
    return effective_mass(float(p["ball_mass"]), R, float(p["maze_inertia"]), bool(p["rolling"]))


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
    period = swing_period(tilted_gravity(p), R - maze.ball, _effective_mass(p, R), amplitude)
    seen = amplitude < 0.5 * math.pi and 4.0 * period < float(p["t_end"])
    if seen and _plain(p, "inner") and _clear(p, maze, -0.5 * math.pi, amplitude):
        yield Claim(metric="swing_period", expected=period, tier=Tier.A, source="pendulum of length 7/5 (R - r)")


def _leave(p: Mapping[str, Value], maze: Maze) -> Iterator[Claim]:
    """Pole on the top, and where the ball leaves the face."""
    R, angle = maze.rings[int(p["ring"])].outer, float(p["angle"])
    mu = _effective_mass(p, R)
    rate = pole(tilted_gravity(p), R + maze.ball, mu)
    cosine = leave_cosine(angle, mu)
    leaves = math.copysign(math.acos(cosine), angle)
    early = math.cosh(rate * float(p["t_end"])) > 1.1 * leaves / angle if angle else False
    if early and _plain(p, "outer") and _clear(p, maze, 0.5 * (math.pi - leaves), 0.5 * abs(leaves)):
        yield Claim(metric="unstable_pole", expected=rate, tier=Tier.A, source="sqrt(5 g/(7 rho)) in a locked maze")
        yield Claim(metric="leave_angle", expected=cosine, tier=Tier.A, source="10/17 rolling, 2/3 frictionless")


def _solved(p: Mapping[str, Value], maze: Maze) -> Iterator[Claim]:
    """Every ring is passed once; the ball falls from its start on top to the bottom of ring 0."""
    top, bottom = maze.rings[int(p["ring"])].outer + maze.ball, maze.rings[0].inner - maze.ball
    lost = float(p["ball_mass"]) * tilted_gravity(p) * (top * math.cos(float(p["angle"])) + bottom)
    if p["controller"] == "off" or float(p["t_end"]) < ARRIVED:
        return
    yield Claim(
        metric="ring_changes", expected=float(p["ring"]) + 1.0, tier=Tier.B, source="one change per ring, to the centre"
    )  # fmt: skip
    if not p["rolling_damping"]:
        yield Claim(
            metric="contact_loss", expected=lost, tier=Tier.A, source="weight times height; input works 1e-7 J"
        )  # fmt: skip


ARRIVED = 60.0  # from when on the default run is at rest in the centre, s


OBVIOUS = (
    "The obvious model builds rings of segments and has MuJoCo's own contact constants and "
    "friction, not the case's law: the ball rolls over facets, sinks in and slips."
)
_TOLERANCE = "a thousand times the default tolerance of 1e-9"
_LOG = "read between the samples of a run"
_SMALL = "a tolerance of 1e-9 in the height, relative to the height through which the ball moves"
_TOLERATED, _DEFAULT = 1e-9, 1e-6
"""Default tolerance, and the limit that every case has on energies over the largest kinetic one."""
_ENERGIES = ("energy_drift", "energy_integrator", "contact_work")
_CLAIMED: Mapping[str, tuple[float, str]] = {
    "swing_period": (1e-6, _LOG),
    "unstable_pole": (1e-6, _TOLERANCE),
    "leave_angle": (1e-5, _LOG),
    "ring_changes": (0.0, "a count"),
    "contact_loss": (7e-6, "1 % of 0.70 mJ: the work of the input is not in the claim"),
}
"""Judged where the case claims a number."""
_ALWAYS: Mapping[str, tuple[float, str]] = {"ring_change_times": (1e-6, _TOLERANCE)}
_MULTISTEP = (
    "backward differentiation errs by the tolerance of 1e-9 in every step, at worst always to "
    "one side, and takes up to 20,000 of them in stiff contact"
)


def limits(claims: Iterable[Claim], fallen: float) -> tuple[Limit, ...]:
    """The limits of one variant beside those that every case has.

    The ball falls on its face by a part of the radius of its circle; infinite where more than
    gravity drives it.
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
