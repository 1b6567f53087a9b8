"""What a mechanism gives to the stepping loops, and what is set and read of MuJoCo around them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np

from crossbody.cases import Switch
from crossbody.cases.arrays import Floats
from crossbody.cases.scene import Scene
from crossbody.engines._acting import Acting
from crossbody.engines._contacts import Poses
from crossbody.engines._log import Modes, Observe

Hook = Callable[[Any, Any], None]


@contextmanager
def hooked(hook: Hook | None) -> Iterator[None]:
    """Call `hook(model, data)` in every evaluation, between the rows' reference accelerations and the solver.

    It sits in the slot of the control callback, which Runge-Kutta visits in every stage.
    Compiling a model while it is set would call it too: compile before.
    """
    previous = mujoco.get_mjcb_control()
    mujoco.set_mjcb_control(hook)
    try:
        yield
    finally:
        mujoco.set_mjcb_control(previous)


@dataclass(slots=True, kw_only=True)
class Prepared:
    """A compiled model with views and closures on it.

    The closures read `data` after mj_forward and are called every step: they touch only views
    made beforehand.

    Attributes:
        model, data: MjModel, MjData.
        nc: constraint rows of the case.
        start: puts data at the start of the case (state, rows open or closed).
        modes: -> mode of every row.
        lam: -> multiplier of every row, N (one number for one row).
        safe: -> whether the state is finite and within what the scene can reach.
        observe: gaps and energies of many states of the model.
        instants: when the inputs change, s, increasing.
        change: puts in force what acts from such an instant on.
        acting: what acts on a case's scene from outside, controllers included; None elsewhere.
        hook: adds to efc_aref what solref cannot say, and sets forces that depend on the state;
            None if nothing.
        always: whether the hook acts while all rows are free too.
        arm: opens and closes rows to suit their modes (matched profile only).
        margins: -> for every row its gap, m, and the sign of the multiplier that it would have
            without the bound lam >= 0 (matched profile only).
        entered: modes of rows that push or not -> those of rows with two sets of constants, which
            collide first.
        outlives: whether a row that pushes stays on above its surface until it no longer does, as
            the law has it.
        lost: -> why the motion has ended, as the case's own switch says; empty while it goes on.
        follows: index of the row whose mode each one shares; empty where none does.
        switches: changes of the case's discrete variables, in order.
        machine: which state machine the rows follow.
        audit: the physics read back from the compiled model.
    """

    model: Any
    data: Any
    nc: int
    start: Callable[[], None]
    modes: Callable[[], Modes]
    lam: Callable[[], Any]
    safe: Callable[[], bool]
    observe: Observe
    instants: Sequence[float] = ()
    change: Callable[[float], None] = lambda _t: None
    acting: Acting | None = None
    hook: Hook | None = None
    always: bool = False
    arm: Callable[[Modes], None] | None = None
    margins: Callable[[], list[tuple[float, float]]] | None = None
    entered: Callable[[Sequence[int]], Modes] = tuple
    outlives: bool = False
    lost: Callable[[], str] = lambda: ""  # nothing ends a motion before its horizon
    switches: Sequence[Switch] = ()
    follows: Sequence[int] = ()
    machine: str = "memoryless"
    audit: Mapping[str, Any] = field(default_factory=dict)


def mass_matrix(model: Any, data: Any) -> Floats:
    """Return the dense M (nv, nv) at the state that was looked at last."""
    full: Floats = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    return full


def constraint_jacobian(model: Any, data: Any) -> Floats:
    """Return the dense rows (nefc, nv) that are active; MuJoCo's are sparse from 60 velocities on."""
    if not mujoco.mj_isSparse(model):
        return np.array(data.efc_J).reshape(-1, model.nv)
    full: Floats = np.zeros((data.nefc, model.nv))
    if data.nefc:
        mujoco.mju_sparse2dense(full, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind)
    return full


def numbers(scene: Scene) -> dict[str, int]:
    """Return MuJoCo's number of every body, and the world, whose name is empty; a file need not."""
    return {"": 0, **{body.name: i for i, body in enumerate(scene.bodies, start=1)}}


def pose_of(data: Any, bodies: Mapping[str, int]) -> Poses:
    """Return what gives the pose of a body by its name, where the kinematics were computed last."""
    return lambda body: (data.xmat[bodies[body]].reshape(3, 3), data.xpos[bodies[body]])
