"""A file as it stands, at any step: what MuJoCo makes of it by its own step, and the same from its scene."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from crossbody.cases.files import mjcf
from crossbody.cases.files.pairs import constants_of
from crossbody.cases.scene import Scene
from crossbody.engines.mujoco._build import compiled, spec_of

DRY = ("dof_solref", "dof_solimp", "tendon_solref_fri", "tendon_solimp_fri")
RAISED = ("eq_solref", "jnt_solref", "tendon_solref_lim", "pair_solref", "geom_solref", *DRY[::2])
"""Time constants that MuJoCo raises to two steps."""


def held(model: Any) -> Any:
    """Return the model with time constants of rows raised to two of the file's steps, and no more with the step.

    MuJoCo raises them to two of the steps that it takes (refsafe), so that a study of steps would
    be one of laws too. It does so to the mean of two shapes, which it is the same to do to each
    unless one alone is below: then the model stays as it is.
    """
    off = int(mujoco.mjtDisableBit.mjDSBL_REFSAFE)
    if model.opt.disableflags & off:
        return model
    least = 2.0 * model.opt.timestep
    constants = model.geom_solref[:, 0]
    touching = (model.geom_contype | model.geom_conaffinity) != 0
    low = touching & (constants > 0.0) & (constants < least)
    if low.any() and (touching & (constants > least)).any():
        return model
    for name in RAISED:
        values = getattr(model, name).reshape(-1, 2)
        values[(values[:, 0] > 0.0) & (values[:, 0] < least), 0] = least
    model.opt.disableflags |= off
    return model


def rebuilt(scene: Scene, model: Any) -> Any:
    """Return the model that is built from a scene, with the options and the softness of the rows of the file's model.

    What it and the file's model differ in is what one of both readers has made of the file.
    """
    spec = spec_of(scene)
    made = compiled(spec, scene)
    for name in (name for name in dir(made.opt) if not name.startswith("_")):
        value = getattr(model.opt, name)
        if not callable(value):
            if hasattr(value, "shape"):
                getattr(made.opt, name)[:] = value
            else:
                setattr(made.opt, name, value)
    made.actuator_dyntype[:] = model.actuator_dyntype  # filters alike, stepped by a formula or by the integrator
    on = model.eq_active0.astype(bool)
    made.eq_solref[:], made.eq_solimp[:] = model.eq_solref[on], model.eq_solimp[on]
    for name in ("jnt_solref", "jnt_solimp", "tendon_solref_lim", "tendon_solimp_lim", *DRY):
        getattr(made, name)[:] = getattr(model, name)
    named = mjcf.names(model, "geom")
    for i in range(model.ngeom):
        if spec.mesh(named(i)) is not None:
            _join(made, int(made.mesh(named(i)).id), model, int(model.geom_dataid[i]))
    soft, stated = constants_of(model, named), {frozenset((pair.first, pair.second)): pair for pair in scene.pairs}
    for i in range(made.npair):
        both = frozenset((_geom(made, 1, i), _geom(made, 2, i)))
        made.pair_solref[i], made.pair_solimp[i], made.pair_solreffriction[i] = soft[both]
        made.pair_dim[i] = stated[both].dimension  # of a coefficient of 0 MuJoCo makes 1e-5
    return made


def _join(made: Any, mesh: int, model: Any, its: int) -> None:
    """Join the corners of a hull as the file's are: a flat face's edges are the compiler's choice."""
    graph, own = model.mesh_graph[model.mesh_graphadr[its] :], made.mesh_graph[made.mesh_graphadr[mesh] :]
    corners, faces = graph[:2]
    if tuple(own[:2]) != (corners, faces):
        return
    globals_ = graph[2 + corners : 2 + 2 * corners]
    first, last = 2 + 3 * corners + 3 * faces, 2 + 3 * corners + 6 * faces
    own[:first] = graph[:first]
    own[2 + corners : 2 + 2 * corners] = np.arange(corners)
    own[first:last] = [np.flatnonzero(globals_ == one)[0] for one in graph[first:last]]


def _geom(model: Any, which: int, i: int) -> str:
    return str(model.geom(int(getattr(model, f"pair_geom{which}")[i])).name)
