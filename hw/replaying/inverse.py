"""Backwards: the torque that a recorded motion needs, and the force that nobody measured.

The measured coordinates y with their rates and accelerations, from polynomials through the
samples, give the whole motion of a mechanism whose rows are closed: H v = 0 and H v' = -H' v, so
v = S y' and v' = S y'' + s. With S^T H^T = 0 the multipliers drop out and

    S^T (M v' - f(q, v, 0)) = S^T B u

holds the torques that act (u of the motors) and the force that acts besides (u of the contact), B
= df/du. A smoothed acceleration is a mean over its samples: recorded torques are taken in the
same mean, and an estimated force is one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from crossbody.cases import SceneError, Value, arguments
from crossbody.cases.arrays import Floats
from crossbody.cases.entry_points import checked_arguments
from crossbody.engines.equations import system_of
from crossbody.hw import models
from crossbody.hw.models.contract import Model, Segment
from crossbody.hw.reading.log import Log
from crossbody.hw.windows.lift import check_measured, closed_by, lift, rows_at
from crossbody.hw.windows.rates import DEGREE, HALF, Rows, derivatives, felt
from crossbody.hw.windows.window import recorded_inputs
from crossbody.reference import System

SINGULAR = 1e9  # condition from which on a combination of inputs is lost in rounding
PART = 0.1  # of the largest weight of a direction: what belongs to it


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Inferred:
    """Something that was not measured, and how well it is known.

    Attributes:
        t (n,): s.
        names, unit: of the columns.
        value (n, k): the estimate.
        std (n, k): standard deviation that the noise of the measured coordinates gives it.
        recorded (n, k): the same as the log has it; NaN where it does not.
        condition (n,): of the map from what is estimated to the forces that the motion shows, its
            columns of size 1.
    """

    t: Floats
    names: tuple[str, ...]
    unit: str
    value: Floats
    std: Floats
    recorded: Floats
    condition: Floats = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Balance:
    """S^T (M v' - f) (n, k), S^T B (n, k, nu), S^T M S (n, k, k) and the noise of accelerations (n, k)."""

    t: Floats
    needed: Floats
    inputs: Floats
    mass: Floats
    noise: Floats


@checked_arguments
def inverse(
    log: Log, model: str | Model, *, parameters: Mapping[str, Value] | None = None, delay: float = 0.0,
    half: int = HALF, degree: int = DEGREE, stride: int = 1,
) -> Inferred:  # fmt: skip
    """Torques that the model needs for the recorded motion, beside the recorded ones.

    Args:
        log: what was recorded.
        model: its name in `hw.models`, or itself; its rows are always on and all its free
            coordinates are measured.
        parameters: of the model, where not its defaults.
        delay: of the measured coordinates beyond what the column map says, s.
        half: samples on each side of the polynomials: more for less noise, fewer for quicker motion.
        degree: of the polynomials.
        stride: of so many samples one is evaluated.

    Raises:
        SceneError: if the log or the model does not fit, or the motion cannot tell the torques apart:
            it names those that it cannot, the coordinates that none of them moves, and the condition.
        InvalidValue: for a log shorter than a polynomial.
    """
    chosen = models.chosen(model)
    balance = _balance(log, chosen, parameters, delay, half, degree, stride)
    B = balance.inputs[:, :, : len(chosen.inputs)]
    have = all(name in log.names("inputs") for name in chosen.inputs)
    rows = _rows(log, half, stride)
    recorded = (
        _felt(log, chosen, delay, half, degree, rows) if have else np.full((len(balance.t), len(chosen.inputs)), np.nan)
    )
    return _solved(balance, B, balance.needed, chosen, chosen.inputs, "N m", recorded)


@checked_arguments
def estimate_force(
    log: Log, model: str | Model, *, parameters: Mapping[str, Value] | None = None, delay: float = 0.0,
    half: int = HALF, degree: int = DEGREE, stride: int = 1,
) -> Inferred:  # fmt: skip
    """The force that acts on the mechanism besides the recorded torques, from motion and torque.

    Args and errors as for `inverse`; the model must have inputs for such a force (`Model.forces`).
    """
    chosen = pushed(model)
    balance = _balance(log, chosen, parameters, delay, half, degree, stride)
    own = len(chosen.inputs)
    torque = _felt(log, chosen, delay, half, degree, _rows(log, half, stride))
    left = balance.needed - np.einsum("nij,nj->ni", balance.inputs[:, :, :own], torque)
    names = chosen.forces
    nothing = np.full((len(balance.t), len(names)), np.nan)
    B = balance.inputs[:, :, own : own + len(names)]
    return _solved(balance, B, left, chosen, names, "N", nothing)


def pushed(model: str | Model) -> Model:
    """The model."""
    chosen = models.chosen(model)
    if not chosen.forces:
        raise SceneError(f"{chosen.name} has no input for a force that acts besides its torques.")
    return chosen


def shift_of(log: Log, model: Model, delay: float) -> float:
    """How much later than they were true the measured coordinates stand in the log, s."""
    return log.channel("coordinates", model.channels[0]).delay + delay


def _felt(log: Log, model: Model, delay: float, half: int, degree: int, rows: Rows) -> Floats:
    """The recorded inputs as the smoothed accelerations show them."""
    return felt(log.time, recorded_inputs(log, model), shift_of(log, model, delay), half, degree, rows)


def _solved(
    balance: _Balance, B: Floats, left: Floats, model: Model, names: tuple[str, ...], unit: str, recorded: Floats
) -> Inferred:
    condition = conditions(balance.t, B, tuple(c.name for c in model.measured), names, model.name)
    value = np.asarray(np.linalg.solve(B, left[:, :, None])[:, :, 0], dtype=np.float64)
    gain = np.linalg.solve(B, balance.mass)
    std: Floats = np.sqrt(np.einsum("nij,nj->ni", gain**2, balance.noise**2))
    return Inferred(t=balance.t, names=names, unit=unit, value=value, std=std, recorded=recorded, condition=condition)


def _balance(
    log: Log, model: Model, parameters: Mapping[str, Value] | None, delay: float, half: int, degree: int, stride: int
) -> _Balance:
    model.check_log(log)
    half, degree = arguments.whole("half", half), arguments.whole("degree", degree, 2)
    stride = arguments.whole("stride", stride)
    y, _ = model.read(model, log)
    rows = _rows(log, half, stride)
    smooth = derivatives(log.time, y, half, degree, rows)
    value, rate, acceleration, gain = smooth
    noise = gain[:, 2:] * noise_of(log.time, y, half, degree)
    segment = Segment(y=value[0], yd=rate[0], t_end=float(log.time[-1] - log.time[0]))
    case = model.build(model.numbers(parameters), segment)
    system = system_of(case)
    check_measured(system, model.seen, model.name)
    q, found = np.array(case.q0), []
    for k in range(len(rows)):
        terms = _one(system, model.seen, q, value[k], rate[k], acceleration[k])
        q = terms[0]
        found.append(terms[1:])
    needed, inputs, mass = (np.array([one[i] for one in found]) for i in range(3))
    return _Balance(
        t=log.time[rows] - shift_of(log, model, delay), needed=needed, inputs=inputs, mass=mass, noise=noise
    )


def _rows(log: Log, half: int, stride: int) -> Rows:
    return np.arange(half, len(log) - half, stride)


def _one(
    system: System, seen: tuple[int, ...], q: Floats, y: Floats, yd: Floats, ydd: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """Pose, S^T (M v' - f), S^T B and S^T M S of one instant."""
    p = system.p.astype(np.complex128)
    state = lift(system, seen, q.astype(np.complex128), y.astype(np.complex128), yd.astype(np.complex128), p)
    q, v = np.split(state.real, 2)
    H, _, drift = (part.real for part in rows_at(system, q.astype(np.complex128), v.astype(np.complex128), p))
    own = np.array(seen)
    others = np.setdiff1d(np.arange(system.n), own)
    S, vd = np.zeros((system.n, len(own))), np.zeros(system.n)
    S[own], vd[own] = np.eye(len(own)), ydd
    S[others] = -closed_by(H, others, H[:, own])
    vd[others] = -closed_by(H, others, drift + H[:, own] @ ydd)
    M, f = system.terms(q, v)
    B = np.column_stack([system.terms(q, v, e)[1] - f for e in np.eye(system.inputs)])
    return q, S.T @ (M @ vd - f), S.T @ B, S.T @ M @ S


def noise_of(t: Floats, y: Floats, half: int, degree: int) -> Floats:
    """Standard deviation of the samples about their polynomials (k,), whose parameters are paid for."""
    rows = np.arange(half, len(t) - half)
    value, _, _, gain = derivatives(t, y, half, degree, rows)
    # The residual at the middle of a polynomial has the variance 1 - gain^2 of the noise.
    left = (y[rows] - value) / np.sqrt(1.0 - gain[:, :1] ** 2)
    return np.asarray(np.sqrt(np.mean(left**2, axis=0)))


def conditions(t: Floats, B: Floats, rows: tuple[str, ...], names: tuple[str, ...], model: str) -> Floats:
    """Conditions (n,) of B (n, k, m), inputs of size 1 each, which must be square and regular.

    Args:
        t: times (n,), s.
        B: forces in the k measured coordinates by m inputs.
        rows: names of the coordinates.
        names: of the inputs.
        model: whose they are.
    """
    k, m = B.shape[1:]
    if not m:
        raise SceneError(f"{model} has no inputs: no force on {', '.join(rows)} can be estimated.")
    size = np.linalg.norm(B, axis=1, keepdims=True)
    U, s, Vt = np.linalg.svd(B / np.where(size > 0.0, size, 1.0))
    with np.errstate(divide="ignore"):
        condition: Floats = s[:, 0] / s[:, -1]
    rank = np.sum(s > s[:, :1] / SINGULAR, axis=1)
    bad = np.flatnonzero(rank < max(k, m))
    if not len(bad):
        return condition
    at = int(bad[0])
    r = int(rank[at])
    where = "everywhere" if len(bad) == len(t) else f"at {len(bad)} of {len(t)} instants, first at t = {t[at]:.6g} s"
    apart, idle = _named(Vt[at, r:], names), _named(U[at, :, r:].T, rows)
    told = (
        [(f"they cannot distinguish {' from '.join(apart)} (only a combination has an effect)")]
        if len(apart) > 1
        else []
    )
    told += [f"{apart[0]} does nothing"] if len(apart) == 1 else []
    told += [f"no input balances {', '.join(idle)}"] if idle else []
    raise SceneError(
        f"{model}: {m} inputs ({', '.join(names)}) and {k} measured coordinates "
        f"({', '.join(rows)}), rank {r} {where}, condition {condition[at]:.2g}: {'; '.join(told)}. "
        "One input is needed for each coordinate, away from singular poses."
    )


def _named(directions: Floats, names: tuple[str, ...]) -> list[str]:
    """Names of what belongs to any of some directions."""
    if not len(directions):
        return []
    weight = np.max(np.abs(directions), axis=0)
    return [name for name, w in zip(names, weight, strict=True) if w > PART * np.max(weight)]
