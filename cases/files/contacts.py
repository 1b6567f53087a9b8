"""Contacts of shapes that no row stands for: a motion in which one would happen is not the file's."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Set
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.case import Case
from crossbody.cases.files import mjcf
from crossbody.cases.files.pairs import allowed
from crossbody.cases.files.reading import model_of
from crossbody.cases.scene_contacts import PLACES, contacts, inert, unknown

APART, HALVINGS = 1e-3, 30
"""Longest time between two looks, s, and how often it is halved where two shapes have met in between."""


class Meeting(NamedTuple):
    """Two shapes without a row come within reach: when, s, and a sentence on it."""

    t: float
    told: str


def meeting(case: Case, t: Floats, q: Floats, v: Floats) -> Meeting | None:
    """Return the first of shapes of a file whose contacts no row stands for, if they meet.

    Positions (n, nq) and velocities (n, nv) are those at the instants t (n,), s.
    """
    model = model_of(Path(case.file), str(case.parameters.get("without", "")))
    pairs = () if case.scene is None else (*(one.pair for one in contacts(case.scene)), *inert(case.scene))
    rubs = {} if case.scene is None else unknown(case.scene)
    return _first(model, t, q, v, {frozenset((pair.first, pair.second)) for pair in pairs}, rubs)


def _first(
    model: Any, t: Floats, q: Floats, v: Floats, known: Set[frozenset[str]], rubs: Mapping[frozenset[str], str]
) -> Meeting | None:
    """Return the first instant at which two shapes come within reach, and a sentence on it; None if none do.

    `known` are pairs of shapes that have rows; `rubs` says of those that have none because of their
    friction what is wrong with it.
    """
    import mujoco

    if model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_CONTACT):
        return None
    data, name = mujoco.MjData(model), mjcf.names(model, "geom")
    if all(frozenset((name(a), name(b))) in known for a, b in allowed(model)):
        return None

    def met(position: Floats) -> tuple[int, ...]:
        data.qpos[:] = position
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        # The list of none costs thirty times what looking for them does.
        both = (contact.geom.tolist() for contact in data.contact) if data.ncon else ()
        return next((tuple(pair) for pair in both if frozenset(map(name, pair)) not in known), ())

    for before, time, position in _looks(model, t, q, v):
        if pair := met(position(time)):
            for _ in range(HALVINGS if time > before else 0):
                half = 0.5 * (before + time)
                sooner = met(position(half))
                before, time, pair = (before, half, sooner) if sooner else (half, time, pair)
            both = " and ".join(_named(model, geom) for geom in pair)
            return Meeting(
                time,
                f"Shapes {both} come within reach at t = {time:.6g} s: the model has no row for "
                f"them, because {_why(model, pair, rubs)}. {_advice(model, pair)}without=contacts "
                "leaves all contacts out, and a shorter t_end ends before.",
            )
    return None


def _why(model: Any, pair: tuple[int, ...], rubs: Mapping[frozenset[str], str]) -> str:
    """Return why such shapes have no row."""
    import mujoco

    if reason := rubs.get(frozenset(map(mjcf.names(model, "geom"), pair))):
        return f"{reason}; without=friction leaves friction out of every engine"
    types = (mujoco.mjtGeom(int(model.geom_type[geom])).name.removeprefix("mjGEOM_").lower() for geom in pair)
    one, two = ("hull" if kind == "mesh" else kind for kind in types)
    if not {(one, two), (two, one)} & PLACES.keys():
        return f"the gap between a {one} and a {two} is not implemented"
    if "hull" in (one, two):
        most = PLACES["plane", "hull"]
        return f"the hull has more than {most} corners (a mesh of a file has at most its maxhullvert)"
    return "no joint moves one relative to the other"


def _named(model: Any, geom: int) -> str:
    """Return a shape's name; of one that has none in the file that of its body too."""
    named, body = mjcf.names(model, "geom")(geom), mjcf.names(model, "body")(int(model.geom_bodyid[geom]))
    return f"{named!r}" if model.geom(geom).name or not body else f"{named!r} of {body!r}"


def _advice(model: Any, pair: tuple[int, ...]) -> str:
    """Return how such shapes are kept out of every engine, if both are of bodies."""
    bodies = [str(model.body(int(model.geom_bodyid[geom])).name) for geom in pair]
    if not all(bodies):
        return ""
    return (
        f"without=pair:{':'.join(bodies)} leaves what these two bodies touch each other with "
        "out of every engine, without=overlaps that of all that overlap in the reference pose, "
    )


def _looks(model: Any, t: Floats, q: Floats, v: Floats) -> Iterator[tuple[float, float, Any]]:
    """Yield instants at which to look, behind the one before, with what gives positions up to there."""
    if len(t):
        yield float(t[0]), float(t[0]), lambda _: q[0]
    for i, j in pairwise(range(len(t))):
        between = _cubic(model, t[[i, j]], q[[i, j]], v[[i, j]])
        looks = np.linspace(t[i], t[j], 1 + max(1, math.ceil((t[j] - t[i]) / APART))).tolist()
        yield from ((a, b, between) for a, b in pairwise(looks))


def _cubic(model: Any, t: Floats, q: Floats, v: Floats) -> Any:
    """Return what gives positions between two instants: a cubic along the joints, by both ends."""
    import mujoco

    dt, way = float(t[1] - t[0]), np.zeros(model.nv)
    mujoco.mj_differentiatePos(model, way, 1.0, q[0], q[1])

    def position(time: float) -> Floats:
        x = (time - float(t[0])) / dt if dt > 0.0 else 1.0
        found: Floats = q[int(x >= 1.0)].copy()
        if x >= 1.0:
            return found
        along = x * (1.0 - x) ** 2 * dt * v[0] + x**2 * (3.0 - 2.0 * x) * way - x**2 * (1.0 - x) * dt * v[1]
        mujoco.mj_integratePos(model, found, along, 1.0)
        return found

    return position
