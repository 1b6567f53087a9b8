"""Contacts of shapes that no row stands for: a motion in which one would happen is not the file's."""

from __future__ import annotations

from collections.abc import Set
from typing import Any

from crossbody.cases._arrays import Floats
from crossbody.cases.files import mjcf


def first_contact(model: Any, t: Floats, q: Floats, known: Set[frozenset[str]]) -> str:
    """Return a sentence on the first instant at which two shapes come within reach; empty if none do.

    Args:
        model: MuJoCo's, which knows the file's filters.
        t: instants (n,), s.
        q: positions there (n, nq).
        known: pairs of shapes that have rows.
    """
    import mujoco

    if model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_CONTACT):
        return ""
    data, name = mujoco.MjData(model), mjcf.names(model, "geom")
    for time, position in zip(t, q, strict=True):
        data.qpos[:] = position
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        if not data.ncon:  # the list of none costs thirty times what looking for them does
            continue
        for contact in data.contact:
            one, two = (name(int(i)) for i in contact.geom)
            if frozenset((one, two)) not in known:
                return (
                    f"Shapes {one!r} and {two!r} come within reach at t = {time:.6g} s: the model has no row for them, "
                    "because they have friction (without=friction leaves it out of every engine) or because no gap is "
                    "known for such shapes; without=contacts leaves all contacts out of every engine."
                )
    return ""
