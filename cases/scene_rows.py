"""The rows of a scene in the order of all engines: loops, bounds, contacts, dry friction."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from crossbody.cases.case import Law
from crossbody.cases.scene import RowLaw, Scene
from crossbody.cases.scene_contacts import contacts

COMPONENTS = ("x", "y", "z", "rx", "ry", "rz")
"""Of a loop in space: its points, then its axes; of a joint its velocities."""


def rows_of(scene: Scene) -> tuple[list[str], list[RowLaw], list[bool]]:
    """Return names, laws and whether they can open, of the rows in the order of all engines."""
    names, laws, unilateral = [], [], []
    for loop in scene.loops:
        for k in range(loop.width):
            names.append(loop.name if loop.width == 1 else f"{loop.name} {COMPONENTS[k]}")
            laws.append(loop.law)
            unilateral.append(False)
    for part in scene.bounded:
        for side, bound in zip(("low", "high"), part.range, strict=True):
            if np.isfinite(bound):
                names.append(f"{part.name} {side}")
                laws.append(part.law)
                unilateral.append(True)
    met = contacts(scene)
    for contact in met:
        names += contact.normals
        laws += [contact.pair.law] * contact.places
        unilateral += [True] * contact.places
    for contact in met:
        names += contact.tangents
        laws += [_held_back(contact.pair.law)] * len(contact.tangents)
        unilateral += [True] * len(contact.tangents)
    for part, width in scene.dry:
        ways = ("",) if width == 1 else COMPONENTS[-width:]
        names += [f"{part.name} friction {way}".strip() for way in ways]
        laws += [_held_back(part.law)] * width
        unilateral += [True] * width
    return names, laws, unilateral


def _held_back(law: RowLaw) -> RowLaw:
    """Return the law of rows that friction holds, by that of their contact or joint: a slip decays as fast as a gap."""
    return RowLaw(a0=0.0, a1=law.a1 or math.sqrt(law.a0))


def law_of(scene: Scene) -> Law:
    """Return the constants of a scene's rows."""
    _, laws, unilateral = rows_of(scene)
    a0, a1, a2, b0, b1 = np.array([dataclasses.astuple(one) for one in laws]).reshape(-1, 5).T
    return Law(a0=a0, a1=a1, a2=a2, b0=b0, b1=b1, unilateral=np.array(unilateral, dtype=bool))


def under_law(scene: Scene, law: Law) -> Scene:
    """Return the scene whose parts have the constants of a law's rows, of several those of the first."""
    names = [field.name for field in dataclasses.fields(RowLaw)]
    rows = zip(*(getattr(law, name).tolist() for name in names), strict=True)
    laws = (RowLaw(**dict(zip(names, row, strict=True))) for row in rows)

    def put(part: Any, count: int) -> Any:
        mine = [next(laws) for _ in range(count)]
        return dataclasses.replace(part, law=mine[0]) if mine and mine[0] != part.law else part

    loops = [put(loop, loop.width) for loop in scene.loops]
    bounded = [put(part, int(np.isfinite(part.range).sum())) for part in scene.bounded]
    places = {contact.pair.name: contact.places for contact in contacts(scene)}
    pairs = [put(pair, places.get(pair.name, 0)) for pair in scene.pairs]
    n = len(scene.joints)
    return scene.replace(loops=loops, joints=bounded[:n], tendons=bounded[n:], pairs=pairs)
