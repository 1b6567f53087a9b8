"""The system of a scene, ready for the integrators."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from crossbody.cases import Law
from crossbody.cases.control import Control
from crossbody.cases.scene import Body, Scene
from crossbody.cases.scene_contacts import WAYS, contacts, rows_of
from crossbody.reference import System
from crossbody.reference._activations import Activations
from crossbody.reference._redundant import dead_centre, ranked
from crossbody.reference.kinds import Floats, Index
from crossbody.reference.tree import layout
from crossbody.reference.tree.mechanism import velocity
from crossbody.reference.tree.quantities import KERNELS, row_kernels
from crossbody.reference.tree.switches import switching_kernels
from crossbody.reference.tree.table import Table, dof_parents, tabulate
from crossbody.reference.tree.traced import compiled_sweeps


def activations(scene: Scene, act0: Floats | None) -> Activations:
    """Return the activations of a scene's actuators, which start at act0 (na,), or at 0."""
    parts = [scene.actuators[i] for i in scene.activated]
    return Activations(
        driven=np.array(scene.activated, dtype=np.int64), tau=np.array([part.time_constant for part in parts]),
        control=np.array([part.control_range for part in parts]),
        span=np.array([part.activation_range for part in parts]),
        start=np.zeros(len(parts)) if act0 is None else np.array(act0),
    )  # fmt: skip


def _friction(scene: Scene, nc: int) -> dict[str, Any]:
    """Return which normal row each tangential row follows, its coefficient, and bounds of dry friction of its own."""
    met, follows, mu, loss = contacts(scene), np.full(nc, -1), np.full(nc, np.inf), np.zeros(nc)
    own = [part.friction_loss for part, width in scene.dry for _ in range(width)]
    first = nc - len(own)
    loss[first:] = own
    normal, row = first - sum(len(one.rows) for one in met), first - sum(len(one.tangents) for one in met)
    for contact in met:
        count = len(contact.tangents)
        follows[row : row + count] = normal + np.arange(count) // len(WAYS)
        mu[row : row + count] = contact.friction
        normal, row = normal + contact.places, row + count
    return {"follows": follows, "mu": mu, "friction_loss": loss}


def _spans(scene: Scene, table: Table, nc: int) -> Index:
    """Return the velocities that each row may touch: of contacts those of the trees that meet, of others all."""
    parents, bodies, above = dof_parents(table), {body.name: body for body in scene.bodies}, dict[str, int]()
    root = np.arange(scene.nv)
    for i in range(scene.nv):
        root[i] = root[parents[i]] if parents[i] >= 0 else i
    for joint in scene.joints:
        above[joint.body] = int(root[table.dofs[joint.name]])
    spans, met = np.tile([0, scene.nv], (nc, 1)), contacts(scene)
    rows = [len(one.normals) for one in met], [len(one.tangents) for one in met]
    row = nc - sum(width for _, width in scene.dry) - sum(map(sum, rows))
    for kind in rows:
        for contact, count in zip(met, kind, strict=True):
            trees = [_tree(bodies, above, shape.body) for shape in (contact.first, contact.second)]
            moved = np.flatnonzero(np.isin(root, trees))
            spans[row : row + count] = moved[0], moved[-1] + 1
            row += count
    return spans


def _cores(scene: Scene, nc: int) -> dict[int, tuple[str, float]]:
    """Return the rows of spheres whose centre may come into a solid, and from which depth, m."""
    met = contacts(scene)
    row, found = nc - sum(width for _, width in scene.dry) - sum(len(one.rows) for one in met), {}
    for one in met:
        if one.first.type == "sphere" and one.second.type in ("box", "cylinder"):
            found[row] = one.pair.name, one.first.size[0] + one.pair.margin
        row += one.places
    return found


def _tree(bodies: Mapping[str, Body], above: Mapping[str, int], name: str) -> int:
    """Return the first velocity of the tree that a body belongs to, -1 of the world's."""
    while name and name not in above:
        name = bodies[name].parent
    return above[name] if name else -1


def system(
    scene: Scene, law: Law, q0: Floats | None = None, control: Control | None = None, act0: Floats | None = None,
    rank: int = -1, traced: bool | None = False,
) -> System:  # fmt: skip
    """Return the equations of a scene; nothing is compiled for it but what `traced` asks for.

    Args:
        scene: bodies, joints and what acts between them.
        law: of its rows.
        q0: an assembled start (nq,), at which rows of loops that follow from others are found and left out; without it
            none is.
        control: of the user's own, which gives the controls.
        act0: activations (na,) at the start; 0 if not given.
        rank: how many rows of loops hold; below 0 those whose pivot is above 1e-4 of the first.
        traced: take code of the sweeps that is compiled for this model alone; None takes it if it was compiled before.
            Results are the same to the last bit.

    Raises:
        SceneError: for a scene that the kernels cannot do, or a rank that the rows do not have.
    """
    table, paired = tabulate(scene), bool(contacts(scene))
    turning: dict[str, Any] = {}
    if table.quaternions:
        turning = {"velocity": velocity, "quaternions": table.quaternions}
    if table.sides or table.kinks:
        turning |= {
            **switching_kernels(paired),
            "guards": table.sides + table.kinks,
            "discrete": np.zeros(table.sides + table.kinks),
            "latched": table.latched,
            "kinks": table.kinks,
        }
    code = 0.0 if traced is False else compiled_sweeps(table.p, scene.nq, scene.nv, anew=bool(traced))
    parameters = table.p[: table.constants].copy()
    parameters[layout.TRACED] = code
    fields: dict[str, Any] = dict(
        n=scene.nv, nq=scene.nq, above=dof_parents(table), span=_spans(scene, table, len(law.a0)),
        parameters=parameters, **turning,
        a0=law.a0, a1=law.a1, a2=law.a2, b0=law.b0, b1=law.b1, unilateral=law.unilateral,
        **_friction(scene, len(law.a0)), cores=_cores(scene, len(law.a0)),
        inputs=len(scene.inputs) + 2 * len(scene.activated), scratch=table.scratch, control=control,
        activations=activations(scene, act0) if scene.activated else None, **KERNELS, **row_kernels(paired),
    )  # fmt: skip
    whole = System(**fields)
    if q0 is None or not scene.loops:
        return whole
    ends = np.cumsum([0, *(loop.width for loop in scene.loops)]).tolist()
    found = ranked(whole, q0, [range(a, b) for a, b in pairwise(ends)])
    count = found.held(rank)
    names, held = rows_of(scene)[0], sorted(found.order[:count])
    out = sorted(zip(found.order[count:], found.pivots[count:], strict=True))
    told = (found.finding(count, names), dead_centre(whole, q0, held, dict(out), names))
    if not out and not any(told):
        return whole
    return System(
        **fields, redundant=[row for row, _ in out], loose=[pivot for _, pivot in out],
        findings=tuple(filter(None, told)),
    )  # fmt: skip
