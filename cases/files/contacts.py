"""Contacts of shapes, which no model here has: a motion in which one would happen is not the file's."""

from __future__ import annotations

from typing import Any

from crossbody.cases._arrays import Floats


def first_contact(model: Any, t: Floats, q: Floats) -> str:
    """Return a sentence on the first instant at which two shapes come within reach; empty if none do.

    Args:
        model: MuJoCo's, which knows the file's filters.
        t: instants (n,), s.
        q: positions there (n, nq).
    """
    import mujoco

    if model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_CONTACT):
        return ""
    data = mujoco.MjData(model)
    for time, position in zip(t, q, strict=True):
        data.qpos[:] = position
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        if data.ncon:
            one, two = (model.geom(int(i)).name or f"shape{i}" for i in data.contact.geom[0])
            return (
                f"Shapes {one!r} and {two!r} come within reach at t = {time:.6g} s: contacts of shapes are not in the "
                "model; without=contacts leaves them out of every engine."
            )
    return ""
