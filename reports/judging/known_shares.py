"""How a box that stands on a slope must share its load among its corners: what the law leaves open, written out.

Balance gives three numbers for four normal forces n, and three for eight tangential ones t. Of all that balance, the
reference takes the normal ones of least sum n_i^2 G_ii, G = H M^-1 H', and then the tangential ones of least sum
|t_i|^2 / (mu n_i) (docs/explanation/contacts.md):

    n = D^-1 A' y, (A D^-1 A') y = w        t = N B' z, (B N B') z = f        D = diag(G), N = diag(mu n)
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from itertools import product

import numpy as np

from crossbody import engines
from crossbody.cases import Case
from crossbody.cases.arrays import Floats
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, Pair, RowLaw, Scene, Shape
from crossbody.reports.judging.asked import Found, Within, unlike

WHO, SEED, BOXES, LASTS, CLOSE = "reference", 41, 3, 0.01, 1e-8
"""Who shares so; how many boxes are drawn, how long they stand, s, and part of the weight by which a share is off."""
HALVES, G, MU = np.array([0.2, 0.15, 0.1]), 9.81, 0.9
"""Half sizes, m."""


@cache
def wrong(name: str) -> tuple[Found, ...]:
    """Return what, number, least and most, and of what, where an engine's answer is another one.

    Args:
        name: of one of crossbody's own engines, which is installed.
    """
    return unlike((_shares,), WHO, "a box that stands, which ends in") if name == WHO else ()


def _shares() -> Iterator[Within]:
    """Yield by how much shares of boxes that are drawn are off."""
    draw = np.random.default_rng(SEED)
    for _ in range(BOXES):
        mass, off = float(draw.uniform(0.5, 3.0)), HALVES * draw.uniform(-0.4, 0.4, 3)
        inertia, slope = draw.uniform(0.03, 0.05, 3), draw.uniform(-0.15, 0.15, 2)
        pull = G * np.array([*slope, -1.0])
        for profile in ("compiled", "cvode"):
            run = engines.load(WHO).prepare(_stands(mass, off, inertia, pull), profile).run()
            places = len(run.lam[-1]) // 3
            normal, along = run.lam[-1, :places], run.lam[-1, places:].reshape(places, 2)
            for what, mine, theirs in zip(("normal", "tangential"), (normal[:4], along[:4]),
                                          shared(mass, off, inertia, pull), strict=True):  # fmt: skip
                most = float(np.max(np.abs(mine - theirs))) / (mass * G)
                yield f"{WHO}:{profile} ({what} shares)", "a box that stands on its corners", most, 0.0, CLOSE


def _stands(mass: float, off: Floats, inertia: Floats, pull: Floats) -> Case:
    floor = Shape(name="floor", type="plane", size=(1.0, 1.0, 1.0))
    rubs = Pair(name="a", first="floor", second="box", dimension=3, friction=(MU, MU, 0.0, 0.0, 0.0),
                law=RowLaw(a0=1e4, a1=200.0))  # fmt: skip
    scene = Scene(
        bodies=(Body(name="box", mass=mass, com=_vector(off), inertia=(*_vector(inertia), 0.0, 0.0, 0.0)),),
        joints=(Joint(name="float", body="box", type="free"),), pairs=(rubs,), gravity=_vector(pull),
        shapes=(floor, Shape(name="box", body="box", type="box", size=_vector(HALVES))),
    )  # fmt: skip
    return case_of(scene, name="stands", q0=[0.0, 0.0, float(HALVES[2]), 1.0, 0.0, 0.0, 0.0], v0=[0.0] * 6, t_end=LASTS)


def _vector(values: Floats) -> tuple[float, ...]:
    return tuple(float(x) for x in values)


def shared(mass: float, off: Floats, inertia: Floats, pull: Floats) -> tuple[Floats, Floats]:
    """Return normal (4,) and tangential (4, 2) forces, N, of the corners below, from the lowest x and y, x first."""
    corners = [(y, x) for x, y in product((-1.0, 1.0), repeat=2)]
    x, y = (np.array(corners) * HALVES[:2] - off[:2]).T
    high, (fx, fy, fz) = float(HALVES[2] + off[2]), (-mass * pull).tolist()
    balance, wanted = np.stack([np.ones(4), y, -x]), np.array([fz, -high * fy, high * fx])
    size = 1.0 / mass + y**2 / inertia[0] + x**2 / inertia[1]
    normal: Floats = (balance / size).T @ np.linalg.solve(balance / size @ balance.T, wanted)
    across = np.stack([np.stack([one, other], axis=1).ravel() for one, other in
                       ((np.ones(4), np.zeros(4)), (np.zeros(4), np.ones(4)), (-y, x))])  # fmt: skip
    bound = across * np.repeat(normal, 2)
    along = bound.T @ np.linalg.solve(bound @ across.T, np.array([fx, fy, 0.0]))
    return normal, along.reshape(4, 2)
