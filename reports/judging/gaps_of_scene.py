"""Gaps and slips of a truth's pairs, held against nearest points sought in each shape's own axes.

All sources of a truth take both from the same kernels. Here bodies stand by the scene's joints, written out in NumPy,
and what is material moves with them by differences, so that no derivative of the kernels is used.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Case
from crossbody.cases.arrays import Floats
from crossbody.cases.remembered import remembered
from crossbody.cases.rotations import normalised, rates
from crossbody.cases.scene import Scene
from crossbody.cases.scene_contacts import WAYS, Contact, contacts
from crossbody.engines.nearest import across, lying
from crossbody.reports.judging.audit import AuditRow
from crossbody.reports.measuring.equations import equations
from crossbody.reports.scenes.scene import Pose, body_poses, meeting, placed

if TYPE_CHECKING:
    from crossbody.reference import System

BESIDE, TOUCHING, NEAR, SEED = 12, 24, 0.3, 20250311
"""States beside the start, and those at which pairs come near; how far the first are off it; of what is drawn."""
CLOSE, PULLS, LEAP, TINY = 0.01, 3, 0.5, 1e-12
"""Gap up to which pairs come near, m; in how many steps, how long each is at most, and the least |H|^2 that moves."""
MOST = 8  # pairs that are looked at
EXACT = 1e-9
"""Part of the lengths in a scene by which gaps in another order of sums differ; near parallels roots lose digits."""
STEP, SMOOTH = 1e-5, 1e-6
"""s of the motion over which material is differenced, and part of its speed that is left of slopes over so much."""
WANDERS = 30.0
"""Times the speeds of bodies, at which where they meet goes on at most: else there is a kink, or one is close."""
DEEP = 0.25
"""Part of a shape's smallest extent down to which it is in another one: farther in, the way out jumps."""
CLEAR = 2.0
"""Times the angle at which shapes begin to lie along each other: between it and its inverse nothing is compared."""


@remembered(2)
def gaps_of_scene(case: Case) -> tuple[AuditRow, ...]:
    """Return rows for the parity audit of a scene with pairs: gaps and slips beside the start, and near contact."""
    plain = case.general and case.scene is not None and contacts(case.scene)
    system = equations(case) if plain else None
    return gaps_against(case, system) if system is not None else ()


def gaps_against(case: Case, system: System) -> tuple[AuditRow, ...]:
    """Return the same rows of equations that may be others' (as `gaps_of_scene` of the case's own)."""
    assert case.scene is not None
    draw = np.random.default_rng(SEED)
    pairs = _some(case.scene)
    q = _states(case, system, pairs, draw)
    v = draw.normal(size=(len(q), len(case.v0)))
    gaps, slips = [], []
    held = [_equations(system, at, rate) for at, rate in zip(q, v, strict=True)]
    h, moves = (np.array([one[k] for one in held]) for k in (0, 1))
    sides = [body_poses(case.scene, q + way * STEP * rates(q, v, case.quaternions)) for way in (-1.0, 0.0, 1.0)]
    for contact, row, rub in pairs:
        sure = _sure(contact, sides[1])
        mine = h[:, row : row + contact.places]
        theirs, normals, points = meeting(contact, sides[1])
        gaps.append(_gaps(contact, mine, theirs, sure))
        if contact.friction > 0.0:
            own = moves[:, rub : rub + 2 * contact.places].reshape(len(q), contact.places, len(WAYS))
            slips.append(_slips(contact, sides, (theirs, normals, points), own, sure))
    rows = [_compared("gaps of pairs", gaps, EXACT)]
    return (*rows, _compared("slips of pairs", slips, SMOOTH)) if slips else tuple(rows)


def _some(scene: Scene) -> list[tuple[Contact, int, int]]:
    """Return up to MOST of `_rows`: first one of every two types of shapes and friction, then another of each."""
    seen: dict[tuple[str, str, bool], int] = {}
    ranked = []
    for found in _rows(scene):
        kind = (found[0].first.type, found[0].second.type, found[0].friction > 0.0)
        seen[kind] = seen.get(kind, -1) + 1
        ranked.append((seen[kind], found))
    return [found for _, found in sorted(ranked, key=lambda one: one[0])[:MOST]]


def _rows(scene: Scene) -> Iterator[tuple[Contact, int, int]]:
    """Yield contacts, and where their normal rows and their tangential ones begin."""
    met = contacts(scene)
    row = sum(loop.width for loop in scene.loops) + sum(int(np.isfinite(part.range).sum()) for part in scene.bounded)
    rub = row + sum(contact.places for contact in met)
    for contact in met:
        yield contact, row, rub
        row, rub = row + contact.places, rub + len(contact.tangents)


def _equations(system: System, q: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
    """Return gaps, H v (nc,) and H (nc, nv) in the discrete state in which a motion begins there."""
    p, n, k = system.begun(q, v), system.n, system.mass_block
    w, H, h, more = np.zeros(system.scratch), np.zeros((system.nc, n)), np.zeros(system.nc), np.zeros(system.nc)
    q, v = np.array(q), np.array(v)
    system.dynamics(0.0, q, v, np.zeros(system.inputs), p, np.zeros((n, k)), np.zeros(n), w)
    system.rows(0.0, q, v, p, w, np.arange(system.nc), system.nc, H, h, more)
    return system.gaps_along(q[None], v[None], p)[0][0], H @ v, H


def _states(case: Case, system: System, pairs: list[tuple[Contact, int, int]], draw: np.random.Generator) -> Floats:
    """Return positions (m, nq) beside the start, and others from which pairs in turn were drawn to small gaps.

    H only says which way to go.
    """
    assert case.scene is not None
    none = np.zeros(len(case.v0))
    q = case.q0 + draw.uniform(-NEAR, NEAR, (BESIDE + TOUCHING, len(case.q0)))
    q = np.array([normalised(at, case.quaternions) for at in q])
    wanted = draw.uniform(-CLOSE, CLOSE, TOUCHING)
    for _ in range(PULLS):
        for k, (contact, row, _) in enumerate(pairs):
            mine = slice(BESIDE + k, None, len(pairs))
            met = meeting(contact, body_poses(case.scene, q[mine]))[0]
            for at, gaps, aim in zip(q[mine], met, wanted[k :: len(pairs)], strict=True):
                best = int(np.argmin(np.where(np.isfinite(gaps), gaps, np.inf)))
                way = _equations(system, at, none)[2][row + best]
                step = way * (aim + contact.pair.margin - gaps[best]) / max(float(way @ way), TINY)
                if np.isfinite(step).all():
                    step *= min(1.0, LEAP / max(float(np.linalg.norm(step)), LEAP))
                    at[:] = normalised(at + rates(at[None], step[None], case.quaternions)[0], case.quaternions)
    return q


def _sure(contact: Contact, bodies: Mapping[str, Pose]) -> NDArray[np.bool_]:
    """Return at which states (m,) it is clear whether shapes lie along each other."""
    stand = [placed(bodies[one.body], one.position, one.orientation) for one in (contact.first, contact.second)]
    at, by = ((rotation, origin) for origin, rotation in stand)
    kinds, sizes = (
        (contact.first.type, contact.second.type),
        (contact.first.extents, contact.second.extents),
    )
    sines = [np.full(len(at[1]), times * contact.parallel) for times in (1.0 / CLEAR, CLEAR)]
    few, many = (lying(kinds, sizes, at, by, sine) for sine in sines)
    return np.asarray(few == many)


def _gaps(contact: Contact, mine: Floats, theirs: Floats, sure: NDArray[np.bool_]) -> tuple[Floats, Floats, Floats]:
    """Return the smallest gaps (k,) in the equations and by nearest points, and the sizes they are parts of."""
    nearest = np.min(np.where(np.isfinite(theirs), theirs, np.inf), axis=1)
    kept = sure & np.isfinite(nearest) & (nearest > -_depth(contact))
    size = np.abs(nearest[kept]) + sum(float(np.abs(one.extents).max()) for one in (contact.first, contact.second))
    told = np.min(np.where(np.isfinite(theirs), mine, np.inf), axis=1)
    return told[kept], nearest[kept] - contact.pair.margin, size


def _depth(contact: Contact) -> float:
    """Return how deep shapes may be in each other: no plane has an inside, nor any but its own a hull."""
    if contact.first.type == "plane":
        return float(np.inf)
    return DEEP * min(float(one.extents[one.extents > 0.0].min(initial=1.0)) for one in (contact.first, contact.second))


def _slips(
    contact: Contact, sides: list[Mapping[str, Pose]], met: tuple[Floats, ...], mine: Floats, sure: NDArray[np.bool_]
) -> tuple[Floats, Floats, Floats]:
    """Return velocities (2 k,) of shapes over each other where they meet, by H v and by material, and speeds of bodies.

    They are counted along the two directions of tangential rows. Over a plane it is that of the point of the shape, of
    two solids that of the first one.
    """
    gaps, normals, points = met
    (before, x, behind) = (points if k == 1 else meeting(contact, bodies)[2] for k, bodies in enumerate(sides))
    wander = np.linalg.norm(np.stack([before - x, behind - x]), axis=-1).max(axis=0) / STEP
    there = x if contact.first.type == "plane" else x - np.where(np.isfinite(gaps), gaps, 0.0)[..., None] * normals
    one, two = (_carried(shape.body, sides, there) for shape in (contact.first, contact.second))
    apart = two - one
    shapes = (contact.first, contact.second)
    at, by = (placed(sides[1][one.body], one.position, one.orientation)[1][:, None] for one in shapes)
    ways = across(contact.first.type, at, by, normals)
    along = np.einsum("mki,mkji->mkj", apart, ways)
    fast = np.maximum(np.linalg.norm(one, axis=-1), np.linalg.norm(two, axis=-1))
    with np.errstate(invalid="ignore"):  # where shapes have no normal nothing is compared
        smooth = wander <= WANDERS * fast
    normal = np.abs(np.linalg.norm(normals, axis=-1) - 1.0) < EXACT
    kept = sure[:, None] & np.isfinite(gaps) & normal & smooth & (fast > 0.0) & (gaps > -_depth(contact))
    return mine[kept].ravel(), along[kept].ravel(), np.repeat(fast[kept], len(WAYS))


def _carried(body: str, sides: list[Mapping[str, Pose]], x: Floats) -> Floats:
    """Return the velocity of a body's material at points x (m, k, 3) of the world."""
    (p, R), (o, Q), (r, S) = (poses[body] for poses in sides)
    local = (x - o[:, None]) @ Q
    found: Floats = ((r - p)[:, None] + local @ np.swapaxes(S - R, 1, 2)) / (2.0 * STEP)
    return found


def _compared(quantity: str, parts: list[tuple[Floats, Floats, Floats]], tolerance: float) -> AuditRow:
    """Return the largest difference, by the size of each."""
    found, wanted, sizes = (np.concatenate(part) for part in zip(*parts, strict=True))
    off = np.abs(found - wanted) / sizes
    if not len(off):
        return AuditRow(quantity=quantity, mine="none", theirs="none", difference=0.0, tolerance=tolerance)
    worst = int(np.argmax(np.where(np.isfinite(off), off, np.inf)))
    value = float(off[worst]) if np.isfinite(off[worst]) else np.inf
    mine, theirs = (f"{float(one[worst]) + 0.0:.6g}" for one in (found, wanted))
    return AuditRow(quantity=quantity, mine=mine, theirs=theirs, difference=value, tolerance=tolerance)
