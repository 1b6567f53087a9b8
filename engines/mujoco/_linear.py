"""Linear models of a matched scene by mjd_transitionFD.

MuJoCo differences its own time step, which must be Euler's here:

    v+ = v + dt a(q, v)      q+ = q + dt v+

so that the lower half of the discrete matrix, less the identity and over dt, is the derivative of
a: exactly, at every dt. Two centred differences, at eps and 2 eps, take out the error of order
eps^2. The logarithm of the discrete matrix over dt, which is what one does who knows nothing of
the step, is off by O(dt).

A row that carries little force (a light ball on a stiff face) leaves it within eps, and one that carries
none (touching balls at rest) is at the corner of lam >= 0, where a memoryless contact has no derivative.
They are pressed from outside by p and by 2 p: the derivative is affine in p and is extrapolated to p = 0.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from scipy.linalg import logm

from crossbody.cases import Case
from crossbody.cases.arrays import Floats
from crossbody.cases.files.warned import captured
from crossbody.engines.linear import Spot, Tangent, in_contact
from crossbody.engines.mujoco._model import build, default_step
from crossbody.engines.mujoco._rows import LIMITS, TOUCH
from crossbody.engines.mujoco._scene import Hook, constraint_jacobian, hooked, mass_matrix

EPS = 1e-5  # step of the centred differences, in the units of the coordinates
ONE_SIDED = 1e-6  # the step that MuJoCo's documentation suggests for one-sided differences
RESOLVED = 0.05  # largest product of the step whose logarithm is taken and the fastest pole
ONE_WAY = (*(int(kind) for kind in LIMITS), TOUCH)  # rows whose force is bounded by 0
HARDER = 0.1
"""Part of bounds' and loops' softness that is left: what it makes of slopes grows by their largest entry."""
PRESS = 10.0
"""Times the force by which a row changes in the differences: how hard one is pressed that carries less."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stand:
    """A compiled model put at an equilibrium, its rows on.

    Attributes:
        model, data: MjModel, MjData.
        hook: what MuJoCo calls in every evaluation; None if nothing.
    """

    model: Any
    data: Any
    hook: Hook | None


def linearise(case: Case, spot: Spot) -> tuple[Tangent, ...]:
    """What mjd_transitionFD makes of an equilibrium of a case."""
    case = in_contact(case)
    dt = default_step(case, "matched")
    with captured():
        stand = _stand(dt, case, spot)
    with _stepping(stand):
        exact = _pressed(stand, lambda: _extrapolated(stand))
        dt = min(dt, RESOLVED / max(_fastest(exact), RESOLVED / dt))
        stand.model.opt.timestep = dt
        plain = _pressed(stand, lambda: _logarithm(_discrete(stand, ONE_SIDED, centred=False), dt))
    return (
        Tangent(way="mjd_transitionFD, centred, its step undone", slope=exact),
        Tangent(
            way="mjd_transitionFD, one-sided, logarithm", slope=plain,
            explained=_logarithm(_step(exact, dt), dt),
            known=f"The logarithm of one step of semi-implicit Euler over its length, here {dt:.2g} s of the profile "
            "matched and not the file's, is off by its length.",
        ),
    )  # fmt: skip


def _stand(dt: float, case: Case, spot: Spot) -> Stand:
    """Return the matched scene at an equilibrium."""
    scene = build(case, "matched", dt)
    for softness in (scene.model.dof_invweight0, scene.model.tendon_invweight0):
        softness[:] *= HARDER
    scene.start()
    scene.data.qpos[:], scene.data.qvel[:], scene.data.time = spot.q, spot.v, spot.t
    scene.change(spot.t)
    if scene.arm is not None:
        scene.arm(spot.modes(case))
    return Stand(model=scene.model, data=scene.data, hook=scene.hook)


@contextmanager
def _stepping(stand: Stand) -> Iterator[None]:
    """Euler's step, without the implicit damping that MuJoCo adds to it; of 1 s, which rounds least."""
    option = stand.model.opt
    option.integrator, option.timestep = mujoco.mjtIntegrator.mjINT_EULER, 1.0
    option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP)
    with captured(), hooked(stand.hook):
        yield


def _discrete(stand: Stand, eps: float, *, centred: bool) -> Floats:
    """The transition matrix (2 nv, 2 nv) of one step."""
    A = np.zeros((2 * stand.model.nv,) * 2)
    mujoco.mjd_transitionFD(stand.model, stand.data, eps, centred, A, None, None, None)
    return A


def _extrapolated(stand: Stand) -> Floats:
    """The derivative (nv, 2 nv) of the acceleration, from the step that is undone."""
    nv, dt = stand.model.nv, stand.model.opt.timestep
    near, far = (_discrete(stand, eps, centred=True)[nv:] for eps in (EPS, 2.0 * EPS))
    found: Floats = ((4.0 * near - far) / 3.0 - np.eye(nv, 2 * nv, nv)) / dt
    return found


def _fastest(slope: Floats) -> float:
    """Largest modulus of the poles, 1/s."""
    nv = len(slope)
    A = np.vstack([np.eye(nv, 2 * nv, nv), slope])
    return float(np.abs(np.linalg.eigvals(A)).max(initial=0.0))


def _step(slope: Floats, dt: float) -> Floats:
    """The transition matrix of Euler's step for a derivative of the acceleration (nv, 2 nv)."""
    nv = len(slope)
    v = np.eye(nv, 2 * nv, nv) + dt * slope
    return np.vstack([np.eye(nv, 2 * nv) + dt * v, v])


def _logarithm(transition: Floats, dt: float) -> Floats:
    """The lower half (nv, 2 nv) of log(A)/dt."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of its accuracy, at 1e-13
        whole: Floats = np.asarray(logm(transition)).real
    return whole[len(whole) // 2 :] / dt


def _pressed(stand: Stand, slope: Callable[[], Floats]) -> Floats:
    """The derivative at the multipliers of the equilibrium, where rows of little force are pressed for it."""
    data = stand.data
    mujoco.mj_forward(stand.model, data)
    mass = mass_matrix(stand.model, data)
    J = constraint_jacobian(stand.model, data)[np.isin(data.efc_type, ONE_WAY)]
    if not len(J):
        return slope()
    first = slope()
    change = 2.0 * EPS * np.abs(first).max()  # of an acceleration, in the differences
    force = PRESS * change / np.abs(np.linalg.solve(mass, J.T)).max()
    if data.efc_force[np.isin(data.efc_type, ONE_WAY)].min() > force:
        return first
    near, far = (_under(stand, -times * force * J.sum(axis=0), slope) for times in (1.0, 2.0))
    return 2.0 * near - far


def _under(stand: Stand, load: Floats, slope: Callable[[], Floats]) -> Floats:
    """The derivative under a constant load (nv,), added where no hook sets it anew."""

    def hook(model: Any, data: Any) -> None:
        if stand.hook is not None:
            stand.hook(model, data)
        data.qfrc_passive[:] += load

    with hooked(hook):
        return slope()
