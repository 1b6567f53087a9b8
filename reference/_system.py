"""A mechanism: its kernels, its parameters, and the law of each of its constraint rows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numba.core.config as numba_config
import numpy as np
from numpy.typing import ArrayLike, NDArray

from crossbody.cases import SceneError
from crossbody.cases.arguments import flag, shown
from crossbody.cases.arrays import distinct, frozen, full, is_number
from crossbody.cases.control import Control
from crossbody.cases.entry_points import checked_arguments, finite, wholes
from crossbody.reference import kernels as kernel_types
from crossbody.reference._activations import Activations
from crossbody.reference._frictional_rows import frictional_rows
from crossbody.reference._indices import different
from crossbody.reference._structure import coupled, given_spans, parents, whole_blocks, whole_trees
from crossbody.reference.kinds import Bytes, Floats, Index
from crossbody.reference.systems import absent

LARGEST = 1_000_000  # of every size of a system


@dataclass(frozen=True, slots=True, weakref_slot=True, kw_only=True, eq=False)
class System:
    """The equations of one mechanism, ready for `simulate`.

    A system that is deleted takes its kernels with it, but LLVM gives no memory back that holds machine code: 1.5 to
    3 MB stay of each system with kernels of its own
    (`pytest tests/reference/test_kernels_released.py -m bench -s`). Where many are made, give one set of kernels other
    parameters.

    Attributes:
        n: number of velocities, and of positions unless nq says otherwise.
        nq: number of positions, at least n; more than n only with the kernel `velocity`.
        dynamics, gaps, rows, energy, power, velocity, solve, control, watch, switch: kernels as in
            `crossbody.reference.kernels`; control may be a `crossbody.cases.Control`, a callable
            of Python, too.
        quaternions: index in q of the first of the four entries, w first, of every quaternion.
            Its length is 1 in all that is handed over; inside a step it may differ by the
            tolerance, which kernels must bear.
        parameters: p of the kernels: an array, or names with values in the kernels' order.
        a0, a1, a2 (nc,): slow constants of every row; a number serves all rows (docs/explanation/model.md).
        b0, b1, b2 (nc,): fast constants of COLLISION; b0 = 0 where a row has one set only.
        unilateral (nc,): False for a row that is always on.
        redundant: indices of rows that are always on but follow from the others: they are held by these and
            stay off, mode FREE with a multiplier of 0. A run in which their gaps open ends as inconsistent.
        loose: of each of these the part of it that does not follow, 0 if not given: so far its gap may open.
        findings: sentences on what was decided when the system was made; they stand in the
            message of every run.
        cores: of each row whose direction jumps where it is deep: its name, and from which depth, m.
        follows (nc,): index of the row whose activity this one shares (a slip row follows its
            normal row); -1 none.
        mu (nc,): of a row that follows: coefficient of Coulomb friction. It is a tangential row, one
            of at most two of its normal row that stand one behind the other, with H v the velocity
            along an orthonormal direction: |lam_t| <= mu lam_n, and lam_t = -mu lam_n v_t/|v_t| where
            it slides. While it sticks it has its own law with a0 = 0: a1, or sqrt(a0) of the normal
            row, pulls a slip velocity back. Infinite, if not given, for a row that never slides.
        friction_loss (nc,): bound of a row's own dry friction, N or N m; 0, if not given, without. It
            follows no other and none follows it, has h = 0, and |lam| <= friction_loss, with equality
            against H v where it slides. Its law while it sticks is that of a tangential row.
        drift (nc,): velocity of the surface along a tangential row, m/s: v_t = H v - drift.
        mass_block: k, the size of the blocks on the mass matrix's diagonal; n if not given.
        inputs: nu, length of u.
        scratch: length of w.
        memory: length of the controller's state s.
        tick: sampling period of `control`, s.
        guards: length of g of `watch`.
        discrete: discrete variables at the start; they follow the parameters in p, and each
            change is an event.
        latched: numbers that `switch` alone writes; they follow the discrete variables in p.
        kinks: how many of the last discrete variables say on which side of a kink a force is that
            goes on there: the motion has its derivatives all the same. 0 stands for the side on
            which the state is. With kinks the very last numbers of p, counted in `latched`, are
            the run's tolerance and the inputs in force.
        span (nc, 2): first coordinate, and one past the last, that a row's H may touch; all of them
            if not given. With it the cost of a chain grows with its length, not with its square.
        above (n,): the nearest lower coordinate that M couples each one to, -1 for none: M is
            zero where neither of two is above the other. The one before it in its block if not
            given; a tree's parents make M cost its depth.
        constant_mass: M does not depend on q: it is factored once.
        activations: what some inputs follow from the others by, in closed form: the last ones,
            which no caller gives.
        affine: M and H are constant, f depends on u alone: arcs in closed form are admitted.

    Raises:
        SceneError: naming the field, its shape and the shape wanted; or the kernel that does not
            fill what it must.
    """

    n: int
    dynamics: Any
    gaps: Any = absent.gaps
    rows: Any = absent.rows
    energy: Any = absent.energy
    power: Any = absent.power
    velocity: Any = None
    solve: Any = None
    control: Any = None
    watch: Any = None
    switch: Any = None
    parameters: ArrayLike | Mapping[str, float] = ()
    a0: ArrayLike = ()
    a1: ArrayLike = ()
    a2: ArrayLike = 0.0
    b0: ArrayLike = 0.0
    b1: ArrayLike = 0.0
    b2: ArrayLike = 0.0
    unilateral: ArrayLike = True
    redundant: ArrayLike = ()
    loose: ArrayLike = ()
    findings: tuple[str, ...] = ()
    cores: Mapping[int, tuple[str, float]] = field(default_factory=dict)
    follows: ArrayLike = -1
    mu: ArrayLike = np.inf
    friction_loss: ArrayLike = 0.0
    drift: ArrayLike = 0.0
    nq: int = 0
    quaternions: ArrayLike = ()
    mass_block: int = 0
    inputs: int = 0
    scratch: int = 0
    memory: int = 0
    tick: float = 0.0
    guards: int = 0
    discrete: ArrayLike = ()
    latched: int = 0
    kinks: int = 0
    span: ArrayLike | None = None
    above: ArrayLike | None = None
    constant_mass: bool = False
    affine: bool = False
    activations: Activations | None = None
    p: Floats = field(init=False)
    friction: Floats = field(init=False)
    tangent: Index = field(init=False)
    tangents: Index = field(init=False)
    trees: Index = field(init=False, repr=False)
    alpha: Floats = field(init=False)
    beta: Floats = field(init=False)

    def __post_init__(self) -> None:
        """Bring every field to its shape and check it once."""
        put = object.__setattr__
        self._check_sizes()
        for name in ("gaps", "rows", "energy", "power"):
            put(self, name, getattr(absent, name) if getattr(self, name) is None else getattr(self, name))
        self._check_kernels()
        if isinstance(self.control, Control):
            self._put_callable(self.control)
        put(self, "tick", finite("System.tick", self.tick))
        for name in ("constant_mass", "affine"):
            put(self, name, flag(f"System.{name}", getattr(self, name)))
        nc = len(frozen("System", "a0", [self.a0] if is_number(self.a0) else self.a0, (None,)))
        for name in ("a0", "a1", "a2", "b0", "b1", "b2"):
            put(self, name, self._row_field(name, nc, np.float64))
        if not np.all(np.isin(self._row_field("unilateral", nc, np.float64), (0.0, 1.0))):
            raise SceneError(f"System.unilateral is {shown(self.unilateral)}; valid: True, False.")
        put(self, "unilateral", self._row_field("unilateral", nc, np.int8))
        put(self, "follows", self._row_field("follows", nc, np.int64))
        put(self, "redundant", different("System.redundant", wholes("System.redundant", self.redundant), nc))
        for name, value in self._friction(nc).items():
            put(self, name, value)
        self._check_told()
        if np.any(np.asarray(self.unilateral)[np.asarray(self.redundant)]):
            raise SceneError(
                f"System.redundant is {np.asarray(self.redundant).tolist()}; a row that may open cannot be redundant."
            )
        values = list(self.parameters.values()) if isinstance(self.parameters, Mapping) else self.parameters
        put(self, "discrete", frozen("System", "discrete", self.discrete, (None,)))
        self._check_kinks()
        state = np.concatenate([self.discrete, np.zeros(self.latched)])
        constants = frozen("System", "parameters", values, (None,))
        put(self, "p", frozen("System", "p", np.concatenate([constants, state]), (None,)))
        put(self, "mass_block", self.mass_block or self.n)
        self._check_positions()
        spans = given_spans(self.span, self.n, nc)
        put(self, "above", parents(self.above, self.n, self.mass_block))
        put(self, "trees", whole_trees(spans, np.asarray(self.above)))
        put(self, "span", whole_blocks(spans, self.mass_block))
        put(self, "alpha", frozen("System", "alpha", np.column_stack([self.a0, self.a1, self.a2]), (nc, 3)))
        put(self, "beta", frozen("System", "beta", np.column_stack([self.b0, self.b1, self.b2]), (nc, 3)))
        self._check_values()

    @property
    def nc(self) -> int:
        """Number of constraint rows."""
        return len(self.alpha)

    @property
    def jumps(self) -> bool:
        """Whether discrete variables change what a state's own values do not tell: not sides of kinks alone."""
        return self.switch is not None and np.size(self.discrete) > self.kinks

    @property
    def frictional(self) -> bool:
        """Whether a contact has friction, or a row of its own."""
        return bool(np.any(np.asarray(self.tangents) > 0))

    @property
    def dry(self) -> NDArray[np.bool_]:
        """Which rows (nc,) have dry friction of their own."""
        return np.asarray(self.friction_loss) > 0.0

    @property
    def held(self) -> NDArray[np.bool_]:
        """Which rows (nc,) are always on, without those that follow from them."""
        held: NDArray[np.bool_] = np.asarray(self.unilateral) == 0
        held[np.asarray(self.redundant)] = False
        return held

    @property
    def quaternion_entries(self) -> Index:
        """Indices in q (m, 4), of the quaternions' entries."""
        return np.asarray(self.quaternions, dtype=np.int64).reshape(-1, 1) + np.arange(4)

    @property
    def kernels(self) -> dict[str, Any]:
        """The ten functions in the order of `kernels.NAMES`; what is absent is a stand-in."""
        given = {name: getattr(self, name) for name in kernel_types.NAMES}
        if isinstance(self.control, Control):
            from crossbody.reference._callback import control

            given["control"] = control
        return {name: getattr(absent, name, None) if kernel is None else kernel for name, kernel in given.items()}

    def _friction(self, nc: int) -> dict[str, Any]:
        """The fields that say which rows rub, and how."""
        mu, loss, drift = (self._row_field(name, nc, np.float64) for name in ("mu", "friction_loss", "drift"))
        return frictional_rows(np.asarray(self.follows), np.asarray(self.unilateral) == 1, mu, loss, drift)

    def _row_field(self, name: str, nc: int, dtype: Any) -> Any:
        return full("System", name, getattr(self, name), nc, dtype)

    def coupled(self) -> NDArray[np.bool_]:
        """Whether M, as it is stored (n, k), may have an entry: one coordinate is above the other, or the same."""
        return coupled(np.asarray(self.above), self.mass_block)

    def _check_sizes(self) -> None:
        counts = (
            ("n", 1),
            *((name, 0) for name in ("nq", "mass_block", "inputs", "scratch", "memory", "guards", "latched", "kinks")),
        )
        for name, low in counts:
            value = getattr(self, name)
            whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
            if not whole or not low <= value <= LARGEST:
                raise SceneError(f"System.{name} is {shown(value)}; it must be a whole number from {low} to {LARGEST}.")
        if self.mass_block and self.n % self.mass_block:
            raise SceneError(f"System.mass_block is {self.mass_block}; it must divide n = {self.n}.")

    def _check_kinks(self) -> None:
        if self.kinks > min(np.size(self.discrete), self.guards) or (self.kinks and self.latched <= self.inputs):
            raise SceneError(
                f"System.kinks is {self.kinks}; each needs a discrete variable and a guard, "
                f"and `latched` room for the {self.inputs} inputs and the tolerance."
            )

    def _check_told(self) -> None:
        """Bring `loose` to the rows that are redundant, and check what comes with a scene."""
        count, loose = len(np.asarray(self.redundant)), frozen("System", "loose", self.loose, (None,))
        loose = frozen("System", "loose", loose if len(loose) else np.zeros(count), (count,))
        if not np.all(np.isfinite(loose)) or np.any(loose < 0.0):
            raise SceneError(f"System.loose is {loose.tolist()}; it must be finite and at least 0.")
        object.__setattr__(self, "loose", loose)
        if not isinstance(self.findings, tuple) or not all(isinstance(text, str) for text in self.findings):
            raise SceneError(f"System.findings is {shown(self.findings)}; it must be a tuple of texts.")
        behind = self.activations
        if behind is not None and not (isinstance(behind, Activations) and behind.width <= self.inputs):
            raise SceneError(
                f"System.activations is {shown(behind)}; valid: Activations of some of its inputs, or None."
            )

    def _put_callable(self, control: Control) -> None:
        """Take tick and memory of a controller in Python, and check how many inputs it sets."""
        from crossbody.reference._callback import MEMORY

        if not 0 < (control.width or self.inputs) <= self.inputs:
            raise SceneError(f"System.control sets {control.width} inputs; valid: 1 to System.inputs = {self.inputs}.")
        object.__setattr__(self, "tick", control.tick)
        object.__setattr__(self, "memory", MEMORY)

    def _check_positions(self) -> None:
        """Check nq, and what the kernel `velocity` asks for."""
        put, n = object.__setattr__, self.n
        put(self, "nq", self.nq or n)
        if self.nq < n or (self.nq > n and self.velocity is None):
            raise SceneError(
                f"System.nq is {self.nq} and System.n is {n}; valid: as many positions as "
                "velocities, or more with the kernel velocity, q' = N(q) v."
            )
        if self.affine and self.velocity is not None:
            raise SceneError("System.affine is true, but with a kernel velocity q' is not v: no arc has a closed form.")
        put(self, "quaternions", frozen("System", "quaternions", self.quaternions, (None,), np.int64))
        entries = self.quaternion_entries.ravel()
        if len(entries) and self.velocity is None:
            raise SceneError("System.quaternions are given without the kernel velocity, which turns them.")
        if len(entries) and (entries.min() < 0 or entries.max() >= self.nq or len(distinct(entries)) < len(entries)):
            raise SceneError(
                f"System.quaternions is {np.asarray(self.quaternions).tolist()}; each is the "
                f"first of four entries of its own, below nq = {self.nq}."
            )

    def _check_values(self) -> None:
        for name in ("alpha", "beta", "p"):
            if not np.all(np.isfinite(getattr(self, name))):
                raise SceneError(f"System.{name} holds a value that is not finite.")
        for name in ("alpha", "beta"):
            if np.any(getattr(self, name) < 0.0):
                letter = name[0]
                raise SceneError(f"System.{letter}0, {letter}1, {letter}2 must be at least 0.")
        follows: Index = np.asarray(self.follows)
        if np.any(follows >= self.nc) or np.any((follows == np.arange(self.nc)) & ~self.dry):
            raise SceneError(f"System.follows is {follows.tolist()}; it must name other rows, below {self.nc}.")
        if self.tick < 0.0 or (self.control is not None and self.tick == 0.0):
            raise SceneError(f"System.tick is {self.tick}; a system with a controller needs a period above 0 s.")

    def _check_kernels(self) -> None:
        for name, kernel in self.kernels.items():
            wanted = kernel_types.REAL[name]
            plain = numba_config.DISABLE_JIT and (kernel is None or callable(kernel))
            if not plain and wanted.args not in getattr(kernel, "signatures", ()):
                raise SceneError(
                    f"System.{name} is not a kernel of the right signature; "
                    f"declare it with @crossbody.reference.kernels.{name}."
                )

    def mass_matrix(self, q: ArrayLike, v: ArrayLike | None = None, u: ArrayLike | None = None) -> Floats:
        """M(q) as a dense (n, n) matrix."""
        return self.terms(q, v, u)[0]

    @checked_arguments
    def terms(
        self, q: ArrayLike, v: ArrayLike | None = None, u: ArrayLike | None = None, t: float = 0.0
    ) -> tuple[Floats, Floats]:
        """M(q) dense (n, n) and f(t, q, v, u) (n,) in the discrete state of the start."""
        q_, v_ = self._state(q, v)
        M, f, *_ = self._equations(np.array([t]), q_[None], v_[None], self._input(u)[None])
        return M[0], f[0]

    def constraint(self, q: ArrayLike, v: ArrayLike | None = None) -> tuple[Floats, Floats, Floats]:
        """All rows at (q, v): H (nc, n), h (nc,) and H' v (nc,)."""
        q_, v_ = self._state(q, v)
        _, _, H, h, Hdv = self._equations(np.zeros(1), q_[None], v_[None], self._input(None)[None])
        return H[0], h[0], Hdv[0]

    def equations_along(
        self, t: ArrayLike, q: ArrayLike, v: ArrayLike, u: ArrayLike | None = None
    ) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        """What the mechanism is at m instants of a motion, in the discrete state of its start.

        Args:
            t: instants (m,), s.
            q: positions (m, nq).
            v: velocities (m, n).
            u: inputs (m, inputs); zeros if not given.

        Returns:
            M (m, n, n) and f (m, n), H (m, nc, n), h (m, nc) and H'v (m, nc).
        """
        places, times = self._copied("q", q, (None,)), frozen("simulate", "t", t, (None,))
        speeds = self._copied("v", v, (len(places),))
        given = np.zeros((len(places), self.inputs)) if u is None else u
        return self._equations(times, places, speeds, frozen("simulate", "u", given, (len(places), self.inputs)))

    def _equations(self, t: Floats, q: Floats, v: Floats, u: Floats) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        m, n, k, p, every = len(q), self.n, self.mass_block, np.array(self.p), np.arange(self.nc)
        q, u, w = np.ascontiguousarray(q), np.array(u), np.zeros((m, self.scratch))
        blocks, f = np.zeros((m, n, k)), np.zeros((m, n))
        H, h, Hdv = np.zeros((m, self.nc, n)), np.zeros((m, self.nc)), np.zeros((m, self.nc))
        for i in range(m):
            self.dynamics(t[i], q[i], v[i], u[i], p, blocks[i], f[i], w[i])
            self.rows(t[i], q[i], v[i], p, w[i], every, self.nc, H[i], h[i], Hdv[i])
        M = np.zeros((m, n, n))
        for b in range(0, n, k):
            M[:, b : b + k, b : b + k] = blocks[:, b : b + k]
        return M, f, H, h, Hdv

    def gap(self, q: ArrayLike, v: ArrayLike | None = None) -> tuple[Floats, Floats]:
        """Gaps and their rates (nc,) at (q, v)."""
        h, hd = np.zeros(self.nc), np.zeros(self.nc)
        self.gaps(0.0, *self._state(q, v), np.array(self.p), h, hd)
        return h, hd

    def begun(self, q: ArrayLike, v: ArrayLike | None = None) -> Floats:
        """Return the parameters with the discrete state in which a motion begins at (q, v)."""
        from crossbody.reference._state import started

        return started(self, *self._state(q, v))[0]

    def gaps_along(self, q: ArrayLike, v: ArrayLike, p: Floats | None = None) -> tuple[Floats, Floats]:
        """Gaps and their rates (m, nc) along a motion, at its positions (m, nq) and velocities (m, n).

        In the discrete state of the parameters p, those of the system if not given.
        """
        places = np.ascontiguousarray(self._copied("q", q, (None,)))
        speeds, p = self._copied("v", v, (len(places),)), np.array(self.p if p is None else p)
        h, hd = np.zeros((len(places), self.nc)), np.zeros((len(places), self.nc))
        for i in range(len(places)):
            self.gaps(0.0, places[i], speeds[i], p, h[i], hd[i])
        return h, hd

    @checked_arguments
    def check(self, q: ArrayLike, v: ArrayLike | None = None, *, states: int = 100, t_end: float = 1.0) -> None:
        """Check the kernels at a state and at random ones near it.

        Every run does so at two states near its start when it is prepared for the first time.

        Args:
            q: positions (nq,).
            v: velocities (n,); zeros if not given.
            states: number of random states.
            t_end: the random states lie at times in [0, t_end], s; gaps are looked at there, and at t_end.

        Raises:
            SceneError: naming the kernel, the entry and both values: if h, H, h' and H'v do not belong
                together, if M is not symmetric and positive definite, if something is left unfilled or
                read or written beyond an array, or if `span`, `constant_mass` or `affine` are not true.
        """
        from crossbody.reference._check import check_kernels

        check_kernels(self, *self._state(q, v), t_end=t_end, states=states)

    def rates(self, q: Floats, v: Floats, t: float = 0.0, p: Floats | None = None) -> Floats:
        """Q' (nq,) at positions q (nq,) and velocities v (n,): v itself unless there is a kernel `velocity`."""
        if self.velocity is None:
            return v
        qd = np.zeros(self.nq)
        q, v, p = (np.require(x, np.float64, ("C", "W")) for x in (q, v, self.p if p is None else p))
        self.velocity(t, q, v, p, qd)  # kernels take no others
        return qd

    def displacement(self, q: Floats, d: Floats, p: Floats | None = None) -> Floats:
        """N(q) d (nq,): how positions change where velocities d (n,) act for a unit of time."""
        if self.velocity is None:
            return d
        return self.rates(q, d, 0.0, p) - self.rates(q, np.zeros(self.n), 0.0, p)

    def normalised(self, name: str, q: Floats) -> Floats:
        """Return positions (nq,) or (m, nq) with every quaternion of length 1.

        Raises:
            SceneError: naming `name` and the quaternion, if one is zero.
        """
        entries = self.quaternion_entries
        if not len(entries):
            return q
        found = np.array(q)
        turned = found[..., entries]
        length = np.linalg.norm(turned, axis=-1, keepdims=True)
        if np.any(length == 0.0):
            first = int(entries[int(np.argwhere(length == 0.0)[0][-2]), 0])
            raise SceneError(f"{name}: the quaternion at entries {first} to {first + 3} is zero; it has no direction.")
        found[..., entries] = turned / length
        return found

    def project(self, q: ArrayLike, v: ArrayLike | None = None) -> tuple[Floats, Floats]:
        """Put a state onto the rows that are always on, by the least change in the metric of M.

        Positions by Newton's method, q - M^-1 H^T (H M^-1 H^T)^-1 h, until h = 0 up to rounding;
        velocities there, v - M^-1 H^T (H M^-1 H^T)^-1 H v. Rows may depend on each other; one
        whose law has a1 alone holds no position.

        Args:
            q: positions (nq,).
            v: velocities (n,); zeros if not given.

        Returns:
            Positions (nq,) and velocities (n,).

        Raises:
            SceneError: if no state on the rows is found from there.
        """
        from crossbody.reference.start import project

        return project(self, *self._state(q, v))

    @checked_arguments
    def checked_state(self, name: str, value: ArrayLike) -> Floats:
        """A copy of q0 or v0.

        Raises:
            SceneError: if it has another shape than (nq,) or (n,), is not finite, or holds a
                quaternion that is zero.
        """
        return self._copied(name, value)

    def _copied(self, name: str, value: ArrayLike, along: tuple[int | None, ...] = ()) -> Floats:
        at = name.startswith("q")
        array: Floats = np.array(frozen("simulate", name, value, (*along, self.nq if at else self.n)))
        _finite(name, array)
        return self.normalised(f"simulate.{name}", array) if at else array

    def _state(self, q: ArrayLike, v: ArrayLike | None) -> tuple[Floats, Floats]:
        return self._copied("q", q), self._copied("v", np.zeros(self.n) if v is None else v)

    def _input(self, u: ArrayLike | None) -> Floats:
        return np.array(frozen("simulate", "u", np.zeros(self.inputs) if u is None else u, (self.inputs,)))


def _finite(name: str, array: Floats) -> Floats:
    if not np.all(np.isfinite(array)):
        raise SceneError(f"simulate.{name} is {array.tolist()}; it must be finite.")
    return array


def initial_modes(system: System, q: Floats | None = None, v: Floats | None = None) -> Bytes:
    """BILATERAL for every row that holds the others, FREE for every other; settling does the rest.

    One with dry friction slides, or sticks if it is known to stand.
    """
    found = np.where(system.held, 5, np.where(system.dry, 7, 0)).astype(np.int8)
    if q is not None and np.any(system.dry):
        found[system.dry & (system.gap(q, v)[1] == np.asarray(system.drift))] = 6
    return found
