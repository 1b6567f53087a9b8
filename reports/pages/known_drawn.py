"""What is drawn of a case of crossbody's own must move as its equations say: forces open the gaps of their rows.

A picture is made from coordinates and multipliers by functions of its own, and no number of a run comes from it. But
the power of a force at its place is the multiplier times the rate of its gap, and its place is by that gap off what it
meets.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache

import numpy as np

from crossbody import cases
from crossbody.cases import Case
from crossbody.cases.arrays import Floats
from crossbody.reports import scenes
from crossbody.reports.judging.asked import Found, Within, unlike
from crossbody.reports.measuring.equations import equations
from crossbody.reports.scenes import Stage

SEED, AWAY, STEP = 4, 2e-3, 1e-6
"""Of states; how far they are off the start, and by how much differences move, m and rad."""
FROM_DATA = "scene"
"""Pictures of scenes from data, of which `known_playback` asks."""
CLOSE, MOVES = 1e-6, 1e-9
"""By which slopes by differences are off; and slopes below which nothing moves."""


@cache
def wrong(name: str) -> tuple[Found, ...]:
    """Return what of the pictures of a case moves or stands otherwise than its gaps say; nothing of scenes from data.

    Args:
        name: of one of crossbody's own cases.
    """
    return unlike((lambda: _drawn(name),), "picture", f"pictures of {name}, which end in")


def _drawn(name: str) -> Iterator[Within]:
    for variant in cases.variants(name):
        case = cases.load(name, variant)
        if case.mechanism != FROM_DATA and case.mechanism in scenes.names():
            yield from (_planar if _stage(case).dimensions == 2 else _spatial)(case)


def _stage(case: Case) -> Stage:
    return scenes.load(case.mechanism).stage(case.parameters)


def _slopes(of: Callable[[Floats], Floats], q: Floats) -> Floats:
    """Return the slopes of what q (m, n) moves, by differences: the first index is that of the coordinate."""
    ways = STEP * np.eye(len(q))
    ahead, behind = np.split(of(np.concatenate([q + ways, q - ways])), 2)
    found: Floats = (ahead - behind) / (2.0 * STEP)
    return found


def _state(case: Case) -> Floats:
    found: Floats = case.q0 + AWAY * np.random.default_rng(SEED).standard_normal(len(case.q0))
    return found


def _gaps(case: Case) -> Callable[[Floats], Floats] | None:
    """Return the gaps (m, nc) of a case as a function of its coordinates (m, nq); None where it has no equations."""
    system = equations(case)
    return None if system is None else lambda q: system.gaps_along(q, np.zeros((len(q), len(case.v0))))[0]


def _planar(case: Case) -> Iterator[Within]:
    """Yield by how much the power of each force is off its gap's slope, and its place off the outlines of two bodies.

    Looked at are coordinates that move its body alone; of forces at one place, that of the least gap.
    """
    if (gaps := _gaps(case)) is None:
        return
    scene, q, count = scenes.load(case.mechanism), _state(case), len(case.contacts)
    h, slopes = gaps(q[None])[0], _slopes(gaps, q)
    pose = scene.poses(q[None], case.parameters)[0]
    rates = _slopes(lambda x: scene.poses(x, case.parameters), q)
    arrows = scene.arrows(np.tile(q, (count, 1)), np.eye(count), case.parameters)  # of one row after another
    least: dict[tuple[float, ...], tuple[float, int, int]] = {}
    for i in np.flatnonzero(np.abs(slopes).max(axis=0) > MOVES).tolist():
        for k in np.flatnonzero(arrows[i, :, 2:].any(axis=1)).tolist():
            place = tuple(arrows[i, k, :2].tolist())
            least[place] = min(least.get(place, (np.inf, 0, 0)), (float(h[i]), i, k))
    yield "picture", f"arrows of {case.label}", float(bool(least)), 1.0, 0.0
    for gap, i, k in least.values():
        at, force = arrows[i, k, :2], arrows[i, k, 2:]
        what = f"the force of {case.contacts[i]} in {case.label}"
        yield "force", what, float(np.linalg.norm(force)), 1.0, MOVES
        off = [_off(rates, b, at - pose[b, :2], force, slopes[:, i]) for b in range(len(pose))]
        body = int(np.argmin(off))
        yield "power", what, float(off[body]), 0.0, CLOSE
        if np.abs(at - pose[body, :2]).max() > MOVES:  # forces of a maze are drawn at the middle of its ball
            yield "place", f"{what} on its body", _from_bodies(case, pose, at, (body,)), 0.0, CLOSE
            others = tuple(b for b in range(-1, len(pose)) if b != body)
            yield "place", f"{what} off what it meets", _from_bodies(case, pose, at - gap * force, others), 0.0, CLOSE


def _off(rates: Floats, body: int, arm: Floats, force: Floats, slopes: Floats) -> float:
    """Return by how much a force's power is off slopes (m,) by coordinates that move its body alone."""
    power = (rates[:, body, :2] + rates[:, body, 2:] * (-arm[1], arm[0])) @ force
    alone = np.abs(np.delete(rates, body, axis=1)).max(axis=(1, 2), initial=0.0) < MOVES
    has = np.abs(power[alone]).max(initial=0.0) > MOVES
    return float(np.abs(power - slopes)[alone].max()) if has else np.inf


def _from_bodies(case: Case, pose: Floats, at: Floats, bodies: tuple[int, ...]) -> float:
    """Return how far a place is off the nearest line that is drawn of some bodies, -1 for what stands still."""
    stage, found = _stage(case), [np.inf]
    for b in bodies:
        x, y, turn = (0.0, 0.0, 0.0) if b < 0 else pose[b]
        c, s = np.cos(turn), np.sin(turn)
        own = (at - (x, y)) @ np.array([[c, -s], [s, c]])
        found += [_from_line(shape, own) for shape in (stage.still if b < 0 else stage.bodies[b])]
    return float(min(found))


def _from_line(shape: scenes.Shape, at: Floats) -> float:
    if "circle" in shape:
        *middle, radius = shape["circle"]
        return float(abs(np.linalg.norm(at - middle) - radius))
    points = np.array(shape["points"])
    ends = np.roll(points, -1, axis=0) if shape["closed"] else points[1:]
    found = []
    for a, b in zip(points, ends, strict=False):
        part = np.clip((at - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        found.append(float(np.linalg.norm(a + part * (b - a) - at)))
    return min(found)


def _spatial(case: Case) -> Iterator[Within]:
    """Yield by how much the power of all forces is off that of their rows, by each coordinate that moves their places.

    What opens is pushed apart; drawn of a loop is the force on its first body, at a place of the other.
    """
    if (gaps := _gaps(case)) is None:
        return
    scene, q = scenes.load(case.mechanism), _state(case)
    lam = np.random.default_rng(SEED).uniform(1.0, 2.0, len(case.contacts))

    def of(x: Floats) -> Floats:
        return scene.arrows(x, np.tile(lam, (len(x), 1)), case.parameters)

    arrows, ends = of(q[None])[0], _slopes(lambda x: of(x)[:, :, :3], q)
    power = np.einsum("nki,ki->n", ends, arrows[:, 3:])
    wanted = _slopes(gaps, q) @ np.where(case.law.unilateral, lam, -lam)
    yield "picture", f"arrows of {case.label}", float(np.abs(power).max(initial=0.0) > MOVES), 1.0, 0.0
    for j in np.flatnonzero(np.abs(ends).max(axis=(1, 2)) > MOVES).tolist():
        what = f"all forces of {case.label} by {case.coordinates[j].name}"
        yield "power", what, float(power[j]), float(wanted[j]), CLOSE
