"""Linear models of systems whose actuators have activations: each is one state more, a' = u or tau a' = u - a.

The kernels take an activation as the value from which it goes on, as an input, and the instant at
which it was there. At that instant it is the value itself: the derivatives by it are those by
that input, and what drives it acts on nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from crossbody.cases.arrays import frozen
from crossbody.reference._activations import Activations
from crossbody.reference._system import System
from crossbody.reference.kinds import Floats
from crossbody.reference.linear._derivatives import Derivatives


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Driven:
    """The activations at a point, na of them, none if the system has none.

    Attributes:
        u (nu,): inputs of the kernels with what stands for the activations.
        A (na,): of da' = A da + B du; 0 of one that leans on an end of its range.
        B (na, inputs given).
    """

    u: Floats
    A: Floats
    B: Floats

    @property
    def names(self) -> tuple[str, ...]:
        """Of the states."""
        return tuple(f"a[{i}]" for i in range(len(self.A)))

    def split(self, columns: Floats) -> tuple[Floats, Floats]:
        """Part derivatives (..., nu) by all inputs of the kernels: those by activations, those by inputs given."""
        given = self.B.shape[1]
        return columns[..., given + 1 :: 2], columns[..., :given]

    def widened(self, found: Derivatives) -> Derivatives:
        """Return the derivatives by x = (dq, v, a) and by the inputs given."""
        n2, none = found.vd_x.shape[1], np.zeros((len(found.gap_x), len(self.A)))
        by_a, by_u = self.split(found.vd_u)
        lam_a, lam_u = self.split(found.lam_u)
        size_a, size_u = self.split(found.size[:, n2:])
        return replace(
            found, vd_x=np.hstack([found.vd_x, by_a]), vd_u=by_u, lam_x=np.hstack([found.lam_x, lam_a]),
            lam_u=lam_u, gap_x=np.hstack([found.gap_x, none]), rate_x=np.hstack([found.rate_x, none]),
            size=np.hstack([found.size[:, :n2], size_a, size_u]),
        )  # fmt: skip


def driven(system: System, u: ArrayLike | None, activations: ArrayLike | None, t: float) -> Driven:
    """Return the activations of a system at values (na,), those of its start if not given.

    Raises:
        SceneError: for inputs or activations of another shape.
    """
    behind = system.activations
    count, given = (0, system.inputs) if behind is None else (len(behind.driven), system.inputs - behind.width)
    start = np.zeros(0) if behind is None else behind.begin
    values = frozen("linearise", "u", np.zeros(given) if u is None else u, (given,))
    a = frozen("linearise", "activations", start if activations is None else activations, (count,))
    A, B = (np.zeros(0), np.zeros((0, given))) if behind is None else _slopes(behind, np.array(a), np.array(values))
    stand = np.column_stack([np.full(count, t), a]).ravel()
    return Driven(u=np.concatenate([values, stand]), A=A, B=B)


def _slopes(behind: Activations, a: Floats, u: Floats) -> tuple[Floats, Floats]:
    """A (na,) and B (na, nu) at values a (na,) and inputs u (nu,)."""
    low, high = behind.control.T
    own = u[behind.driven]
    rate = np.clip(own, low, high) - np.where(behind.tau > 0.0, a, 0.0)
    first, last = behind.span.T
    moves = ~(((a >= last) & (rate > 0.0)) | ((a <= first) & (rate < 0.0)))
    tau = np.where(behind.tau > 0.0, behind.tau, 1.0)
    B = np.zeros((len(a), len(u)))
    B[np.arange(len(a)), behind.driven] = moves * ((own >= low) & (own <= high)) / tau
    A: Floats = -1.0 * moves * (behind.tau > 0.0) / tau
    return A, B
