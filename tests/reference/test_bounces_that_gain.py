"""One bounce with friction is that of the law, also where it gives out more energy than it took in; and a run says so.

The oracle has no modes: the law of the gap, and Coulomb's friction smoothed below a slip of SMOOTH, in SciPy.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from crossbody import engines
from crossbody.cases import Outcome, Trajectory
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, Pair, RowLaw, Scene, Shape

Floats = NDArray[np.float64]
G, UP = 9.81, np.array([0.0, 0.0, 1.0])
SMOOTH = 1e-4  # m/s: a stick creeps, and a slip is wrong, by this part of a bounce's speeds
STEP = 1e-8  # of differences, far below SMOOTH
ALLOWED = 5e-3  # of the largest velocity: SMOOTH moves the ends of slips, and 0.8 of its own power moves what follows
KNOWN = 1e-5  # part of its energy to which a bounce tells what it gains
QUICK = (0, 3, 20)  # of which the last one gains
SLOW = tuple(k for k in range(40) if k not in QUICK)


@dataclass
class Bounce:
    """An ellipsoid that is about to touch the floor: y = (place 3, turn 4, velocity 3, turning 3 in its own axes)."""

    half: Floats
    mass: float
    inertia: Floats
    a0: float
    a1: float
    mu: float
    start: Floats

    @staticmethod
    def drawn(seed: int) -> Bounce:
        """Draw one."""
        rng = np.random.default_rng((19, seed))
        half, mass, a0 = rng.uniform(0.05, 0.2, 3), rng.uniform(0.3, 3.0), 10 ** rng.uniform(3.5, 5.0)
        inertia = mass / 5.0 * (np.sum(half**2) - half**2)
        a1 = 2.0 * rng.uniform(0.05, 0.8) * np.sqrt(a0)
        turn = Rotation.random(random_state=rng).as_quat(scalar_first=True)
        depth = np.linalg.norm(half * Rotation.from_quat(turn, scalar_first=True).as_matrix()[2])
        v = np.append(rng.normal(size=2) * 2.0, 0.0)
        start = np.concatenate([[0.0, 0.0, depth + 1e-3], turn, v, rng.normal(size=3) * 8.0])
        one = Bounce(half, mass, inertia, a0, a1, rng.uniform(0.2, 1.2), start)
        one.start[9] -= one.contact(start)[3] + rng.uniform(1.0, 5.0)  # its lowest point falls at 1 to 5 m/s
        return one

    def contact(self, y: Floats) -> tuple[float, Floats, Floats, float]:
        """Gap, rows (3, 6) of velocities at the lowest point by (v, w), v' of these at rest, and the gap's rate."""
        R, v, w = Rotation.from_quat(y[3:7], scalar_first=True).as_matrix(), y[7:10], y[10:13]
        d = R.T @ UP
        length = np.linalg.norm(self.half * d)
        arm = -(self.half**2 * d) / length  # from the centre to the lowest point, in the body's axes
        dd = -np.cross(w, d)
        slow = -(self.half**2 * dd) / length + self.half**2 * d * (self.half**2 * d @ dd) / length**3  # arm'
        jacobian = np.hstack([np.eye(3), R @ -_cross(arm)])
        bent = R @ (np.cross(w, np.cross(w, arm)) + np.cross(w, slow))
        return y[2] - length, jacobian, bent, float(UP @ (v + R @ np.cross(w, arm)))

    def press(self, y: Floats, touching: bool) -> tuple[float, float, Floats]:
        """Multiplier of the gap, its p, and the acceleration (6,)."""
        gap, J, bent, rate = self.contact(y)
        w = y[10:13]
        free = np.concatenate([-G * UP, -np.cross(w, self.inertia * w) / self.inertia])
        slip = (J @ y[7:13])[:2]
        direction = slip / np.hypot(np.linalg.norm(slip), SMOOTH)
        push = (J[2] - self.mu * direction @ J[:2]) / np.append(np.full(3, self.mass), self.inertia)
        p = float(J[2] @ push)
        lam = -(J[2] @ free + bent[2] + self.a1 * rate + self.a0 * gap) / p if touching else 0.0
        return lam, p, free + lam * push

    def change(self, y: Floats, touching: bool) -> Floats:
        """Return y'."""
        a, b, c, d = y[3:7]
        turn = 0.5 * np.array([[-b, -c, -d], [a, -d, c], [d, a, -b], [-c, b, a]]) @ y[10:13]
        return np.concatenate([y[7:10], turn, self.press(y, touching)[2]])

    def differences(self, y: Floats) -> Floats:
        """Jacobian of y' in contact: SciPy's own looks in vain for a step that shows what x and y do."""
        now = self.change(y, True)
        return np.array([(self.change(y + step, True) - now) / STEP for step in STEP * np.eye(len(y))]).T

    def left(self) -> tuple[float, Floats, float]:
        """When it leaves the floor, where, and the least p on the way."""

        def closes(_: float, y: Floats) -> float:
            return float(self.contact(y)[0])

        def lifts(_: float, y: Floats) -> float:
            return self.press(y, True)[0]

        closes.terminal = lifts.terminal = True  # type: ignore[attr-defined]
        lifts.direction = -1  # type: ignore[attr-defined]
        given = {"rtol": 1e-9, "atol": 1e-11}
        fall = solve_ivp(lambda _, y: self.change(y, False), (0.0, 1.0), self.start, "DOP853", events=closes, **given)
        touch = solve_ivp(
            lambda _, y: self.change(y, True),
            (fall.t[-1], 1.0),
            fall.y[:, -1],
            "Radau",
            events=lifts,
            jac=lambda _, y: self.differences(y),
            **given,
        )
        return touch.t[-1], touch.y[:, -1], min(self.press(y, True)[1] for y in touch.y.T)

    def energy(self, y: Floats) -> float:
        """Return kinetic and potential energy, J."""
        v, w = y[7:10], y[10:13]
        return float(0.5 * self.mass * v @ v + 0.5 * w @ (self.inertia * w) + self.mass * G * y[2])

    def run(self, t: float, solver: str = "compiled", **settings: Any) -> Trajectory:
        """The reference's own motion: at 0, at t, and where the gap has opened again."""
        scene = Scene(
            bodies=(Body(name="b", mass=self.mass, inertia=(*map(float, self.inertia), 0.0, 0.0, 0.0)),),
            joints=(Joint(name="free", body="b", type="free"),),
            shapes=(
                Shape(name="floor", type="plane"),
                Shape(name="b", body="b", type="ellipsoid", size=tuple(map(float, self.half))),
            ),
            pairs=(
                Pair(
                    name="floor:b", first="floor", second="b", friction=(self.mu, self.mu, 0.0, 0.0, 0.0), dimension=3,
                    law=RowLaw(a0=self.a0, a1=self.a1),
                ),
            ),
        )  # fmt: skip
        case = case_of(scene, q0=self.start[:7], v0=self.start[7:], t_end=t + 4.0 / np.sqrt(self.a0))
        given = {"rtol": 1e-9, "samples": [0.0, t, case.t_end], **settings}
        return engines.load("reference").prepare(case, solver, **given).run()


def _cross(a: Floats) -> Floats:
    """Return the matrix of a x."""
    return np.cross(np.eye(3), a).T * -1.0


def _is_of_the_law(seed: int) -> None:
    one = Bounce.drawn(seed)
    t, y, p = one.left()
    run = one.run(t)
    if p <= 0.0:
        assert run.outcome is Outcome.PAINLEVE
        return
    assert run.outcome is Outcome.FINISHED
    assert np.abs(run.v[1] - y[7:]).max() <= ALLOWED * np.abs(y[7:]).max()
    gain = run.ledger.contact[1, 0] if run.ledger is not None else np.nan
    assert (run.energy_gained > 0.0) == (gain > KNOWN * one.energy(one.start))
    assert run.energy_gained == pytest.approx(max(gain, 0.0), abs=KNOWN * one.energy(one.start))
    assert run.counts.get("touches_that_gained", 0) == (run.energy_gained > 0.0)
    assert (f"{run.energy_gained:.3g} J" in run.message) == (run.energy_gained > 0.0)


@pytest.mark.parametrize("seed", QUICK)
def test_a_bounce_with_friction_is_that_of_its_law_and_says_what_it_gains(seed: int) -> None:
    _is_of_the_law(seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", SLOW)
def test_forty_bounces_with_friction_are_those_of_their_laws(seed: int) -> None:
    _is_of_the_law(seed)


@pytest.mark.parametrize("seed", [0, 20, *(pytest.param(k, marks=pytest.mark.slow) for k in SLOW)])
def test_a_bounce_says_what_it_gains_by_either_machine_and_where_no_account_is_asked_for(seed: int) -> None:
    one = Bounce.drawn(seed)
    run = one.run(0.2)
    if run.outcome is Outcome.PAINLEVE:
        return
    known = KNOWN * one.energy(one.start)
    for other in (one.run(0.2, "cvode", rtol=1e-8), one.run(0.2, ledger=False)):
        assert other.energy_gained == pytest.approx(run.energy_gained, abs=known)
        told = [said.counts.get("touches_that_gained", 0) for said in (run, other)]
        assert told[0] == told[1] or run.energy_gained < known
        assert ("touches_that_gained" in other.message) == bool(told[1])
    assert one.run(0.2, ledger=False).ledger is None


def test_a_start_below_the_surface_says_what_it_gives_out() -> None:
    """The law pushes a ball from a depth d to a height g/a0, which is no gain of friction's."""
    mass, depth, a0 = 2.0, 0.02, 1e4
    ball = Bounce(
        np.full(3, 0.1), mass, np.full(3, 0.4 * mass * 0.01), a0, 1e-3, 0.5,
        np.array([0.0, 0.0, 0.1 - depth, 1.0, *np.zeros(9)]),
    )  # fmt: skip
    run = ball.run(0.05)
    given = float(run.total_energy[-1] - run.total_energy[0])
    assert run.counts["starts_inside"] == 1
    assert "touches_that_gained" not in run.counts
    assert given == pytest.approx(0.5 * mass * a0 * (depth + G / a0) ** 2, rel=1e-3)
    for told in (run, ball.run(0.05, "cvode"), ball.run(0.05, ledger=False)):
        amount = float(told.message.split(" J on their way")[0].split()[-1])
        assert amount == pytest.approx(given, rel=0.01)
