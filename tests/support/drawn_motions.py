"""A motion at random for the truth of a case, and a run that is off by drawn errors and later and later."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from crossbody.cases import Event, Ledger, Mode, Tier, Trajectory, load
from crossbody.cases.arrays import Floats
from crossbody.reports import metrics
from crossbody.reports.measuring.truth import Truth

CASES = [
    ("ball_maze", "inside"), ("delta_free", "light"), ("red_body", "resolved"), ("rolling_sphere", "straight"),
    ("stacked_blocks", "apart"), ("newtons_cradle", "pendulums"), ("soft_contact", "delta"),
    ("bouncing_ball", "bilateral"),
]  # fmt: skip
N = 120


class Drawn:
    """A case with a motion at random for a truth, and one for a run.

    Attributes:
        case, truth, run: as metrics take them.
        exact: the truth's samples, each beside its own of the run.
        trusted: number of samples that may be compared.
    """

    def __init__(self, name: str, variant: str, seed: int) -> None:
        self.random = np.random.default_rng(seed)
        self.case = load(name, variant)
        random, case = self.random, self.case
        self.t = np.append(0.0, np.sort(random.uniform(0.0, case.t_end, N - 1)))
        self.exact = self.motion(self.t)
        changed = {}
        for what in ("q", "v", "gap", "lam", "energy"):
            right = getattr(self.exact, what)
            changed[what] = right + random.uniform(0.01, 0.2) * random.normal(size=right.shape)
        for at in case.quaternions:
            changed["q"][:, at : at + 4] /= np.linalg.norm(changed["q"][:, at : at + 4], axis=1, keepdims=True)
            changed["q"][:, at : at + 4] *= random.choice([-1.0, 1.0], (N, 1))
        book = self.exact.ledger
        assert book is not None
        ledger = Ledger(
            contact=book.contact + 0.1 * random.normal(size=book.contact.shape),
            input=book.input + random.normal(size=N), dissipated=book.dissipated + random.normal(size=N),
        )  # fmt: skip
        events = tuple(replace(e, t=float(self.late(e.t)), impulse=1.3 * e.impulse) for e in self.exact.events)
        self.run = replace(self.exact, t=self.late(self.t), events=events, ledger=ledger, **changed)
        until = float(random.uniform(max(self.knots[-1], 0.7 * case.t_end), 1.1 * case.t_end))
        self.trusted = int(np.sum(self.t <= until))
        self.truth = Truth(
            tier=Tier.A, source="drawn", trajectory=self.exact, at=self.lookup, agreement={}, trusted=until
        )

    def motion(self, t: Floats) -> Trajectory:
        """Waves of sizes from a tenth to ten, with contacts at random and impulses that take no time."""
        random, case = self.random, self.case
        rows, unilateral = len(case.law.a0), np.flatnonzero(case.law.unilateral)
        shapes = {"q": len(case.coordinates), "v": len(case.velocities), "gap": rows, "lam": rows, "energy": 2}
        made = {name: self.waves(t, width) for name, width in shapes.items()}
        for at in case.quaternions:
            made["q"][:, at : at + 4] /= np.linalg.norm(made["q"][:, at : at + 4], axis=1, keepdims=True)
        made["lam"] *= 300.0
        made["energy"] = np.abs(made["energy"])
        made["energy"][:, 1] -= 20.0
        events, ends = [], np.sort(random.uniform(0.05, 0.95, 8)) * case.t_end
        for k, (touch, release) in enumerate(ends.reshape(-1, 2)):
            if len(unilateral):
                row = int(unilateral[k % len(unilateral)])
                events += [Event(t=touch, contact=row, before=Mode.FREE, after=Mode.CONTACT)]
                events += [Event(t=release, contact=row, before=Mode.CONTACT, after=Mode.FREE)]
                if k % 2:
                    at = release + 1e-3 * case.t_end
                    events += [
                        Event(t=at, contact=row, before=Mode.FREE, after=Mode.FREE, impulse=random.uniform(1, 50))
                    ]
        self.knots = [0.0, *(e.t for e in events if e.after == Mode.CONTACT)]
        self.lates = np.append(0.0, np.cumsum(np.diff(self.knots) * random.uniform(0.8, 1.2, len(self.knots) - 1)))
        mode = random.choice([Mode.FREE, Mode.CONTACT], (len(t), rows)).astype(np.int8)
        ledger = Ledger(contact=self.waves(t, rows), input=self.waves(t, 1)[:, 0], dissipated=self.waves(t, 1)[:, 0])
        return Trajectory(t=t, mode=mode, events=tuple(events), steps=len(t), ledger=ledger, **made)

    def waves(self, t: Floats, width: int) -> Floats:
        sizes, rates, phases = 10.0 ** self.random.uniform(-1.0, 1.0, width), *self.random.uniform(1.0, 9.0, (2, width))
        return sizes * np.sin(np.multiply.outer(t / t.max(), rates) + phases)

    def late(self, t: Floats | float) -> Floats:
        """The run's time: straight between touches, and as long as the truth's behind the last."""
        return np.interp(t, self.knots, self.lates) + np.maximum(np.asarray(t) - self.knots[-1], 0.0)

    def lookup(self, t: Floats) -> Trajectory:
        """Return the truth at samples of its own."""
        at = np.argmin(np.abs(self.t[:, None] - t), axis=0) if len(t) else np.zeros(0, int)
        np.testing.assert_allclose(self.t[at], t, atol=1e-9)
        book = self.exact.ledger
        assert book is not None
        ledger = Ledger(contact=book.contact[at], input=book.input[at], dissipated=book.dissipated[at])
        signals = {name: getattr(self.exact, name)[at] for name in ("t", "q", "v", "gap", "lam", "energy", "mode")}
        return replace(self.exact, ledger=ledger, **signals)

    def measured(self, name: str) -> float | None:
        return metrics.of(self.case)[name].measure(self.truth, self.run, self.case)
