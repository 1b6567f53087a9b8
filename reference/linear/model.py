"""A linear model with names: dx' = A dx + B du, dy = C dx + D du."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crossbody.cases import EngineUnavailable, InvalidValue, SceneError, UnknownName
from crossbody.cases.arrays import frozen, numbers
from crossbody.cases.entry_points import checked_arguments, checked_fields
from crossbody.reference.kinds import Floats, Index

if TYPE_CHECKING:
    from scipy.signal import StateSpace

Complex = NDArray[np.complex128]


@checked_fields
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinearModel:
    """A state-space model whose rows and columns have names.

    Attributes:
        A (nx, nx), B (nx, nu), C (ny, nx), D (ny, nu): the matrices; states, inputs and outputs in SI.
        states, inputs, outputs: names; a velocity is named as its coordinate with a prime.
    """

    A: Floats
    B: Floats
    C: Floats
    D: Floats
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def __post_init__(self) -> None:
        """Check shapes against the names.

        Raises:
            SceneError: naming the matrix and the shape wanted.
        """
        nx, nu, ny = len(self.states), len(self.inputs), len(self.outputs)
        for name, shape in (("A", (nx, nx)), ("B", (nx, nu)), ("C", (ny, nx)), ("D", (ny, nu))):
            object.__setattr__(self, name, frozen("LinearModel", name, getattr(self, name), shape))

    @property
    def matrices(self) -> tuple[Floats, Floats, Floats, Floats]:
        """(A, B, C, D), as scipy.signal and python-control take them."""
        return self.A, self.B, self.C, self.D

    def state_space(self) -> StateSpace:
        """The model as `scipy.signal.StateSpace`."""
        from scipy.signal import StateSpace

        return StateSpace(*self.matrices)

    def control(self) -> Any:
        """The model as `control.StateSpace` of python-control, with its names.

        Raises:
            EngineUnavailable: if the package `control` is not installed.
        """
        try:
            control = import_module("control")
        except ImportError:
            raise EngineUnavailable("python-control is not installed: pip install control.") from None
        names = {"states": list(self.states), "inputs": list(self.inputs), "outputs": list(self.outputs)}
        return control.ss(*self.matrices, **names)

    def poles(self) -> Complex:
        """Eigenvalues of A (nx,), 1/s, the rightmost first.

        A defective eigenvalue of multiplicity m comes out scattered by about (rounding)^(1/m) of its size.
        """
        found: Complex = np.linalg.eigvals(self.A).astype(np.complex128)
        return found[np.lexsort((-found.imag, -found.real))]

    @checked_arguments
    def response(self, omega: ArrayLike) -> Complex:
        """Frequency response C (i w - A)^-1 B + D (m, ny, nu) at angular frequencies omega (m,), rad/s.

        Raises:
            InvalidValue: if a frequency is not finite, or is itself a pole.
        """
        w: Floats = np.atleast_1d(numbers("LinearModel.response", "omega", omega))
        if not np.all(np.isfinite(w)):
            raise InvalidValue(f"LinearModel.response: omega is {w.tolist()}; every frequency must be finite.")
        resolvent = 1j * w[:, None, None] * np.eye(len(self.states)) - self.A
        driven = np.broadcast_to(self.B.astype(np.complex128), (len(w), *self.B.shape))
        try:
            solved = np.linalg.solve(resolvent, driven)
        except np.linalg.LinAlgError:
            raise InvalidValue("LinearModel.response: a frequency is a pole, where there is no response.") from None
        return (self.C @ solved + self.D).astype(np.complex128)

    @checked_arguments
    def pick(self, outputs: Sequence[str] | None = None, inputs: Sequence[str] | None = None) -> LinearModel:
        """The same dynamics with some outputs and inputs only, in the order asked for.

        Raises:
            UnknownName: for a name that is not there.
        """
        rows = _places("output of the linear model", self.outputs if outputs is None else outputs, self.outputs)
        columns = _places("input of the linear model", self.inputs if inputs is None else inputs, self.inputs)
        return replace(
            self, B=self.B[:, columns], C=self.C[rows], D=self.D[np.ix_(rows, columns)],
            inputs=tuple(self.inputs[i] for i in columns), outputs=tuple(self.outputs[i] for i in rows),
        )  # fmt: skip

    @checked_arguments
    def combined(self, weights: ArrayLike, outputs: Sequence[str]) -> LinearModel:
        """The outputs W y under new names; weights W is (len(outputs), ny)."""
        W = frozen("LinearModel.combined", "weights", weights, (len(outputs), len(self.outputs)))
        return replace(self, C=W @ self.C, D=W @ self.D, outputs=tuple(outputs))

    def without_idle(self) -> LinearModel:
        """Without the states on which neither a rate nor an output depends: integrals that nobody reads.

        Each of them adds an eigenvalue of exactly 0 that says nothing about stability.
        """
        model = self
        while True:
            used = np.any(model.A != 0.0, axis=0) | np.any(model.C != 0.0, axis=0)
            if used.all():
                return model
            model = model._kept(np.flatnonzero(used))

    def _kept(self, kept: Index) -> LinearModel:
        return replace(
            self, A=self.A[np.ix_(kept, kept)], B=self.B[kept], C=self.C[:, kept],
            states=tuple(self.states[i] for i in kept),
        )  # fmt: skip

    @checked_arguments
    def restricted(self, conditions: ArrayLike, tolerance: float = 1e-9, size: ArrayLike | None = None) -> LinearModel:
        """The same model on the subspace conditions @ dx = 0, which the dynamics must not leave.

        The states that remain are some of the present ones, chosen by pivoting so that they
        determine the others well.

        Args:
            conditions: (nr, nx); dependent ones are recognised.
            tolerance: part of the terms by which a motion may leave the subspace.
            size: (nx, nx + nu), size of the terms that make up A and B; what they have become in
                A and B if not given.

        Raises:
            SceneError: if the dynamics or the inputs leave the subspace.
        """
        from scipy.linalg import qr

        given = frozen("LinearModel.restricted", "conditions", conditions, (None, len(self.states)))
        if not np.any(given):
            return self
        _, R, order = qr(
            given / np.abs(given).max(axis=1, keepdims=True, initial=1e-300), mode="economic", pivoting=True
        )
        pivots = np.abs(np.diag(R))
        rank = int(np.sum(pivots > 1e-10 * pivots[0]))
        bound, kept = order[:rank], np.sort(order[rank:])
        basis = np.zeros((len(self.states), len(kept)))
        basis[kept, np.arange(len(kept))] = 1.0
        following = np.argsort(order[rank:])
        basis[bound] = -np.linalg.solve(R[:rank, :rank], R[:rank, rank:])[:, following]
        terms: Floats = np.hstack([self.A, self.B]) if size is None else np.asarray(size, dtype=np.float64)
        self._check_invariance(given, basis, tolerance, np.abs(terms))
        return replace(
            self, A=(self.A @ basis)[kept], B=self.B[kept], C=self.C @ basis,
            states=tuple(self.states[i] for i in kept),
        )  # fmt: skip

    def _check_invariance(self, conditions: Floats, basis: Floats, tolerance: float, size: Floats) -> None:
        flow, nx = np.hstack([self.A @ basis, self.B]), len(self.states)
        leaving = np.abs(conditions @ flow).max(initial=0.0)
        terms = np.hstack([size[:, :nx] @ np.abs(basis), size[:, nx:]])
        allowed = tolerance * (np.abs(conditions) @ terms).max(initial=0.0)
        if not leaving <= allowed:
            raise SceneError(
                f"LinearModel.restricted: the motion leaves the subspace at a rate of {leaving:.3g} "
                f"(allowed {allowed:.3g}); hold rows only where the mechanism is at rest."
            )


def _places(kind: str, wanted: Sequence[str], known: Sequence[str]) -> Index:
    for name in wanted:
        if name not in known:
            raise UnknownName(kind, name, known)
    return np.array([list(known).index(name) for name in wanted], dtype=np.int64)
