"""Activations of actuators: a' = u of an integrator, tau a' = u - a of a filter, each held within its range.

Inputs hold from one change to the next. So each activation is known there in closed form, from the
instant t0 at which it was a0: t0 and a0 are two more inputs, and there is nothing to integrate.
Where an activation comes to an end of its range is an instant too, at which an input changes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from crossbody.cases import Inputs
from crossbody.cases.arrays import distinct
from crossbody.reference.kinds import Floats, Index

Row = tuple[float, Floats, Floats]  # an instant, and t0 and a0 (na,) from there on


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Activations:
    """Those of one system.

    Attributes:
        driven (na,): input that drives each.
        tau (na,): time constants of filters, s; 0 for an integrator.
        control (na, 2), span (na, 2): ranges of these inputs, and of the activations.
        start (na,): values at t = 0.
    """

    driven: Index
    tau: Floats
    control: Floats
    span: Floats
    start: Floats

    @property
    def width(self) -> int:
        """Number of inputs that stand for them, behind all others: t0 and a0 of each in turn."""
        return 2 * len(self.driven)

    @property
    def begin(self) -> Floats:
        """Values (na,) at the start, within their ranges."""
        return self._held(self.start)

    def _held(self, a: Floats) -> Floats:
        return np.clip(a, *self.span.T)

    def _target(self, u: Floats) -> Floats:
        return np.clip(u[self.driven], *self.control.T)

    def after(self, a: Floats, u: Floats, dt: Floats) -> Floats:
        """Return values (na,) a time dt (na,) after a (na,) under inputs u that hold."""
        c, filtered = self._target(u), self.tau > 0.0
        tau = np.where(filtered, self.tau, 1.0)
        return self._held(np.where(filtered, c + (a - c) * np.exp(-dt / tau), a + c * dt))

    def end(self, a: Floats, u: Floats) -> tuple[Floats, Floats]:
        """Return after what times (na,) values a come to an end of their range, infinite for never, and which ends."""
        c, found = self._target(u), np.full(len(a), np.inf)
        filtered = self.tau > 0.0
        way = np.where(filtered, c - a, c)  # which way it goes
        ends = np.where(way > 0.0, self.span[:, 1], self.span[:, 0])
        left = ends - a
        for i in np.flatnonzero(np.isfinite(left) & (np.sign(left) * np.sign(way) > 0.0)):
            if not filtered[i]:
                found[i] = left[i] / way[i]
            elif abs(left[i]) < abs(way[i]):
                found[i] = -self.tau[i] * np.log1p(-left[i] / way[i])
        return found, ends

    def columns(self, times: Floats, values: Floats) -> tuple[Floats, Floats]:
        """Return inputs with those that stand for the activations, and the instants at which one comes to an end.

        Args:
            times (m,): when inputs change, s.
            values (m, nu): from then on; 0 before.
        """
        if not len(times) or times[0] > 0.0:
            times, values = np.concatenate([[0.0], times]), np.vstack([np.zeros((1, values.shape[1])), values])
        rows: list[tuple[float, Floats]] = []
        a = self.begin
        for (t, end), u in zip(pairwise([*times.tolist(), np.inf]), values, strict=True):
            for instant, t0, a0 in self._between(t, end, a, u):
                rows.append((instant, np.concatenate([u, np.column_stack([t0, a0]).ravel()])))
            a = self.after(a, u, np.full(len(a), end - t)) if np.isfinite(end) else a
        return np.array([t for t, _ in rows]), np.array([row for _, row in rows])

    def extended(self, inputs: Inputs) -> Inputs:
        """Return inputs with those that stand for the activations."""
        times, values = self.columns(inputs.times, inputs.values)
        names = tuple(f"{inputs.names[i]}: {what}" for i in self.driven for what in ("since [s]", "activation"))
        return Inputs(names=(*inputs.names, *names), times=times, values=values)

    def _between(self, t: float, end: float, a: Floats, u: Floats) -> Iterator[Row]:
        """Yield what holds from t on, and from every instant before `end` at which one comes to an end of its range."""
        t0, a0 = np.full(len(a), t), np.array(a)
        yield t, t0.copy(), a0.copy()
        left, ends = self.end(a, u)
        for stop in distinct(t + left):
            if t < stop < end:
                there = t + left == stop
                t0[there], a0[there] = stop, ends[there]
                yield float(stop), t0.copy(), a0.copy()


@dataclass(slots=True, eq=False)
class Live:
    """The activations of one run whose inputs come from a controller, tick by tick."""

    of: Activations
    t: float = 0.0
    a: Floats = field(init=False)
    u: Floats = field(init=False)

    def __post_init__(self) -> None:
        """Begin at the start."""
        self.a, self.u = self.of.begin, np.zeros(int(self.of.driven.max(initial=0)) + 1)

    def put(self, t: float, u: Floats) -> None:
        """Write what stands for the activations from t on behind the other inputs u, which hold from there on."""
        self.a = self.of.after(self.a, self.u, np.full(len(self.a), t - self.t))
        self.t, self.u = t, np.array(u[: len(self.u)])
        u[len(u) - self.of.width :] = np.column_stack([np.full(len(self.a), t), self.a]).ravel()
