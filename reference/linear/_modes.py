"""What a linear model says: its modes, what inputs reach, what outputs show, and how poles move with a parameter."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from crossbody.cases import InvalidValue
from crossbody.cases.arguments import instance
from crossbody.cases.arrays import frozen, is_number
from crossbody.cases.entry_points import checked_arguments
from crossbody.reference.kinds import Array, Floats
from crossbody.reference.linear.model import Complex, LinearModel

RANK = 1e-9  # part of the largest singular value below which a direction counts as none


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Modes:
    """Eigenvalues of a linear model, the rightmost first.

    Attributes:
        poles (nx,): 1/s.
        vectors (nx, nx): right eigenvectors as columns, each with its largest component 1.
        participation (nx, nx): part of each state (row) in each mode (column), columns sum to 1
            (Perez-Arriaga 1982).
        states: names of the rows.
    """

    poles: Complex
    vectors: Complex
    participation: Floats
    states: tuple[str, ...]

    @property
    def frequency(self) -> Floats:
        """|pole| (nx,), rad/s."""
        return np.abs(self.poles)

    @property
    def damping(self) -> Floats:
        """Damping ratio -Re/|pole| (nx,); NaN for a pole at 0."""
        with np.errstate(invalid="ignore"):
            ratio: Floats = -self.poles.real / np.abs(self.poles)
        return ratio


@checked_arguments
def modes(model: LinearModel) -> Modes:
    """Poles and eigenvectors; those of a defective eigenvalue nearly coincide."""
    values, right = np.linalg.eig(model.A)
    order = np.lexsort((-values.imag, -values.real))
    values, right = values[order].astype(complex), right[:, order].astype(complex)
    places = np.abs(right).argmax(axis=0)
    right = right / right[places, np.arange(len(values))]
    share = np.abs(right * np.linalg.pinv(right).T)
    return Modes(
        poles=values, vectors=right, participation=share / share.sum(axis=0, keepdims=True), states=model.states
    )  # fmt: skip


def reached(A: Floats, B: Floats, tolerance: float = RANK) -> Floats:
    """Orthonormal basis (nx, r) of what the columns of B reach: of the span of B, A B, A^2 B, ...

    By the staircase of orthogonal complements (Van Dooren 1981), so that powers of A are never formed.
    """
    basis = _span(B, np.zeros((len(A), 0)), float(np.abs(B).max(initial=0.0)), tolerance)
    front = basis
    while front.shape[1] and basis.shape[1] < len(A):
        front = _span(A @ front, basis, float(np.linalg.norm(A, 2)), tolerance)
        basis = np.hstack([basis, front])
    return basis


def _span(columns: Floats, known: Floats, scale: float, tolerance: float) -> Floats:
    """Orthonormal directions of the columns beyond those known; twice, against rounding."""
    for _ in range(2):
        columns = columns - known @ (known.T @ columns)
    left, size, _ = np.linalg.svd(columns, full_matrices=False)
    return left[:, size > tolerance * scale] if scale else left[:, :0]


@checked_arguments
def controllable(model: LinearModel, tolerance: float = RANK) -> int:
    """Number of states that the inputs reach; states are scaled to like sizes first."""
    scale = _scales(model.A)
    return int(reached(model.A * scale / scale[:, None], model.B / scale[:, None], tolerance).shape[1])


@checked_arguments
def observable(model: LinearModel, tolerance: float = RANK) -> int:
    """Number of states that the outputs show."""
    scale = _scales(model.A)
    return int(reached((model.A * scale / scale[:, None]).T, (model.C * scale).T, tolerance).shape[1])


def _scales(A: Floats) -> Floats:
    """Sizes of states by which A is balanced; what rounding leaves of zeros in it would drive them to any size."""
    from scipy.linalg import matrix_balance

    plain = np.where(np.abs(A) > np.finfo(float).eps * np.abs(A).max(initial=0.0), A, 0.0)
    with np.errstate(invalid="ignore"):  # of a permutation that is not asked for, and that it reads all the same
        _, (scale, _) = matrix_balance(plain, permute=False, separate=True)
    return np.asarray(scale, dtype=np.float64)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Locus:
    """Poles over a parameter.

    Attributes:
        values (m,): of the parameter.
        poles (m, nx): each column is one branch, 1/s.
    """

    values: Floats
    poles: Complex

    @property
    def growth(self) -> Floats:
        """Largest real part (m,), 1/s."""
        largest: Floats = self.poles.real.max(axis=1)
        return largest


@checked_arguments
def locus(build: Callable[[float], LinearModel], values: Sequence[float] | ArrayLike) -> Locus:
    """Poles of build(value) at every value, joined to branches so that neighbours lie as near as they can.

    Raises:
        InvalidValue: if there is no value, or the number of states changes on the way.
    """
    from scipy.optimize import linear_sum_assignment

    grid: Floats = frozen("locus", "values", [values] if is_number(values) else values, (None,))
    if not len(grid):
        raise InvalidValue("locus: values is empty; give the values of the parameter.")
    found: list[Array] = []
    for value in grid.tolist():
        poles = instance("What locus.build returns", build(value), LinearModel, "a LinearModel").poles()
        if found and len(poles) != len(found[0]):
            raise InvalidValue(f"locus: the model has {len(poles)} states at {value:g} and {len(found[0])} before.")
        if found:
            _, order = linear_sum_assignment(np.abs(found[-1][:, None] - poles[None, :]))
            poles = poles[order]
        found.append(poles)
    return Locus(values=grid, poles=np.array(found))
