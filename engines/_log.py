"""The record of a run, from which its `Trajectory` is made when the clock has stopped."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from crossbody.cases import Acts, Event, Mode, Outcome, Switch, Trajectory
from crossbody.cases.arrays import Floats

Observe = Callable[[Floats, Floats], tuple[Floats, Floats]]
"""(q (n, nq), v (n, nv)) of the engine -> gap (n, nc), energy (n, 2)."""
Chart = Callable[[Floats, Floats], tuple[Floats, Floats]]
"""(q (n, nq), v (n, nv)) of an engine -> those of the case."""
Modes = tuple[int, ...]


class Log:
    """One entry an instant.

    Attributes:
        motion: t, q, v of every instant.
        lam: multipliers, N: a number, or one a row.
        mode: modes of the rows.
        events: transitions, in order.
        switches: changes of discrete variables, in order.
        aside_s: wall time in which nothing was integrated, s, but told of what is inside of steps.
        acts: when the multipliers of an instant act.
        follows: index of the row whose mode each one shares, which has no events of its own; -1 for none.
    """

    def __init__(self) -> None:
        self.motion: list[tuple[float, Floats, Floats]] = []
        self.lam: list[Any] = []
        self.mode: list[Modes] = []
        self.events: list[Event] = []
        self.switches: list[Switch] = []
        self.aside_s = 0.0
        self.acts = Acts.AT
        self.follows: Sequence[int] = ()

    def add(self, t: float, q: Floats, v: Floats, lam: Any, mode: Modes) -> None:
        """Append one instant; q and v are kept, not copied."""
        self.motion.append((t, q, v))
        self.lam.append(lam)
        self.mode.append(mode)

    def switch(self, t: float, before: Modes, after: Modes) -> None:
        """Append an event for every row whose mode changed."""
        for i, (b, a) in enumerate(zip(before, after, strict=True)):
            if a != b and (not self.follows or self.follows[i] < 0):
                self.events.append(Event(t=t, contact=i, before=Mode(b), after=Mode(a)))

    def columns(self) -> tuple[Floats, Floats, Floats]:
        """Times (n,), q (n, nq), v (n, nv)."""
        t, q, v = zip(*self.motion, strict=True)
        return np.array(t), np.array(q), np.array(v)

    def trajectory(
        self,
        observe: Observe,
        outcome: Outcome,
        message: str = "",
        steps: int = 0,
        wall_s: float = 0.0,
        counts: Mapping[str, int] | None = None,
        chart: Chart | None = None,
    ) -> Trajectory:
        """The run; gaps and energies are evaluated here."""
        t, q, v = self.columns()
        with np.errstate(all="ignore"):  # a run that failed may end where squares overflow
            gap, energy = observe(q, v)
            if chart is not None:
                q, v = chart(q, v)
        return Trajectory(
            t=t,
            q=q,
            v=v,
            gap=gap,
            lam=np.reshape(np.array(self.lam), gap.shape),
            acts=self.acts,
            energy=energy,
            mode=np.reshape(np.array(self.mode, np.int8), gap.shape),
            events=tuple(self.events),
            switches=tuple(self.switches),
            outcome=outcome,
            message=message,
            steps=steps,
            wall_s=wall_s,
            counts=counts or {},
        )
