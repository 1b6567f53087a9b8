"""What the reference's integrators must give of motions in closed form: its explicit, implicit and exact steps.

Every run asks, whatever its case: a number of a truth is as good as the steps that made it, and a coefficient that is
off in some digits costs steps where a tolerance still holds. One mass on a row that is always on moves as the row's law
has it, whatever its weight:

    q'' + a1 q' + a0 q + a2 q^3 = 0

For a2 = 0 that is two exponentials. For a1 = 0 it returns after 2 pi / (sqrt(a0 + a2 q0^2) agm(1, sqrt(1 - m))), m =
a2 q0^2 / (2 (a0 + a2 q0^2)), and v^2 / 2 + a0 q^2 / 2 + a2 q^4 / 4 stays. Samples lie between steps, so that the dense
output is asked too, and so is the account of work. With a tolerance that is so many times tighter, steps become as many
more as the order of the method says.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from crossbody.cases import Mode, Outcome, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.case import Law
from crossbody.engines.equations import module
from crossbody.reference import Options, System, prepare, simulate
from crossbody.reference.core.layout import DONE, IMPLICIT, MORE
from crossbody.reports.judging.asked import Found

MASS, GRAVITY, SAMPLES = 2.0, 9.81, 62
FEW, MANY, OF_WORK = 10.0, 100.0, 1e3
"""How many times the tolerance errors may be: of steps of order 8, of order 4, and of their work."""
LOOSE, TIGHT = 1e-6, 1e-12
LOOSER, TIGHTER = 1e-5, 1e-8
"""Tolerances of methods of order 8, and of 4."""
UNLIKE = 1.5
"""By what factor steps may become more than the order says, or fewer: first steps, and those that are cut short."""
MOST = 1000  # steps of any of these
LEAST = 1e-12  # what rounding leaves of any error


@cache
def wrong() -> tuple[Found, ...]:
    """Return the integrator, number, least and most, and motion, of what is other than the closed form."""
    return (*_cubic(), *_stiff(), *_bounce())


def _system(a0: float, a1: float, a2: float, opens: bool = False) -> System:
    """Return a mass on a row that is always on, or that opens."""
    row = Law(a0=np.array([a0]), a1=np.array([a1]), a2=np.array([a2]), unilateral=np.array([opens]))
    ball = module("ball")
    assert ball is not None
    found: System = ball.build({"mass": MASS, "gravity": GRAVITY}, row)
    return found


def stepped(
    system: System, start: tuple[ArrayLike, ArrayLike], t: Floats, rtol: float, implicit: bool
) -> Trajectory:  # fmt: skip
    """Return a motion from q0 and v0 at instants t (n,), by explicit steps, or but for the first by implicit ones."""
    options = Options(
        t_end=t[-1], rtol=rtol, samples=t, ledger=True, consistent=False, shortcuts=False, implicit=implicit
    )  # fmt: skip
    run = prepare(system, *start, options)
    run.start()
    run.slice(1)
    if implicit:
        run.state["method"], run.state["have_jacobian"], run.state["full_jacobian"] = IMPLICIT, 0, 1
    while (code := run.slice(MOST)) == MORE:
        pass
    found: Trajectory = run.trajectory(Outcome.FINISHED if code == DONE else Outcome.STEP_LIMIT, 0.0)
    return found


def exponentials(a0: float, a1: float, start: tuple[float, float], t: Floats) -> tuple[Floats, Floats, Floats]:
    """Return q, v and v' (n,) of the linear law from a start, at instants t (n,)."""
    poles = np.roots([1.0, a1, a0]).astype(complex)
    parts = np.linalg.solve(np.stack([np.ones(2), poles]), np.array(start, dtype=complex))
    waves = np.exp(np.outer(t, poles))
    q, v, a = ((waves @ (parts * poles**k)).real for k in range(3))
    return q, v, a


def period(a0: float, a2: float, q0: float) -> float:
    """Return after how long an undamped cubic spring is back, s."""
    fast = a0 + a2 * q0**2
    x, y = 1.0, math.sqrt(1.0 - 0.5 * a2 * q0**2 / fast)
    while abs(x - y) > 1e-15:
        x, y = 0.5 * (x + y), math.sqrt(x * y)
    return 2.0 * math.pi / (math.sqrt(fast) * x)


def _told(name: str, what: str, value: float, most: float, least: float = 0.0) -> Iterator[Found]:
    if not least <= value <= most:
        yield f"reference {name}", value, (least, most), what


def _account(name: str, run: Trajectory, rtol: float, most: float) -> Iterator[Found]:
    """Yield what energies are off, and what work of the row does not account for."""
    said, energy = f"work at rtol = {rtol:g}", 0.5 * MASS * run.v[:, 0] ** 2 + MASS * GRAVITY * run.q[:, 0]
    if run.outcome is not Outcome.FINISHED or run.ledger is None:
        yield f"reference {name}", math.nan, (0.0, most), f"a motion that ends {run.outcome.value}"
        return
    size = float(np.ptp(energy))
    for off, allowed in ((run.total_energy - energy, LEAST), (energy - energy[0] - run.ledger.contact[:, 0], most)):
        yield from _told(f"{name} (work)", said, float(np.max(np.abs(off))) / size, max(allowed, LEAST))


def _more(name: str, order: float, runs: Sequence[Trajectory], times: float) -> Iterator[Found]:
    """Yield by how much steps become more as a tolerance becomes tighter, where that is not what an order says."""
    wanted, found = times ** (1.0 / order), runs[1].steps / max(runs[0].steps, 1)
    said = f"steps at a tolerance {times:g} times tighter"
    yield from _told(f"{name} (steps)", said, found, wanted * UNLIKE, wanted / UNLIKE)


def _cubic() -> Iterator[Found]:
    """Ask for an oscillation on a cubic spring, which returns: by explicit steps, and by implicit ones."""
    spring = a0, a2, q0 = 5.0, 20.0, 1.0
    t = np.linspace(0.0, period(*spring), SAMPLES)
    system = _system(a0, 0.0, a2)
    for name, implicit, order, tolerances in (
        ("explicit", False, 8.0, (LOOSE, TIGHT)), ("implicit", True, 4.0, (LOOSER, TIGHTER)),
    ):  # fmt: skip
        runs = [stepped(system, ([q0], [0.0]), t, rtol, implicit) for rtol in tolerances]
        for run, rtol in zip(runs, tolerances, strict=True):
            yield from _returns(name, run, spring, rtol, MANY if implicit else FEW)
            yield from _account(name, run, rtol, (OF_WORK if implicit else FEW) * rtol)
        yield from _more(name, order, runs, tolerances[0] / tolerances[1])


def _returns(
    name: str, run: Trajectory, spring: tuple[float, float, float], rtol: float, times: float
) -> Iterator[Found]:  # fmt: skip
    """Yield how far an undamped cubic spring is from its start, or from its energy between, where that is too far."""
    a0, a2, q0 = spring
    q, v, whole = run.q[:, 0], run.v[:, 0], 0.5 * a0 * q0**2 + 0.25 * a2 * q0**4
    kept = float(np.max(np.abs(0.5 * v**2 + 0.5 * a0 * q**2 + 0.25 * a2 * q**4 - whole))) / whole
    back = math.hypot(q[-1] / q0 - 1.0, v[-1] / (q0 * math.sqrt(a0 + a2 * q0**2)))
    for value in (kept, back):
        yield from _told(name, f"a cubic spring at rtol = {rtol:g}", value, max(times * rtol, LEAST))


def _stiff() -> Iterator[Found]:
    """Ask for a slow motion of a stiff row, for which implicit steps are chosen."""
    a0, a1, t = 1e6, 1e6, np.linspace(0.0, 2.0, SAMPLES)
    slow, rtol = float(np.max(np.roots([1.0, a1, a0]).real)), TIGHTER
    run = simulate(
        _system(a0, a1, 0.0), [1.0], [slow], 2.0, rtol=rtol, samples=t, ledger=True, consistent=False, shortcuts=False
    )  # fmt: skip
    yield from _account("implicit", run, rtol, MANY * rtol)
    for found, wanted in zip((run.q[:, 0], run.v[:, 0]), exponentials(a0, a1, (1.0, slow), run.t), strict=False):
        yield from _told("implicit", "a stiff row", float(np.max(np.abs(found - wanted))), FEW * rtol)
    yield from _told("implicit", "how many implicit steps a stiff row takes", run.counts["implicit_steps"], MOST, 1.0)


def _bounce() -> Iterator[Found]:
    """Ask for a fall onto a row that opens: when it touches, and what presses as it lets go."""
    a0, a1, height, rtol = 1e4, 20.0, 0.3, 1e-9
    fall, fast = math.sqrt(2.0 * height / GRAVITY), math.sqrt(2.0 * height * GRAVITY)
    system = _system(a0, a1, 0.0, opens=True)
    for shortcuts, name in ((False, "explicit"), (True, "exact")):
        run = simulate(system, [height], [0.0], 0.5, rtol=rtol, shortcuts=shortcuts)
        touch, release = (next((e.t for e in run.events if e.before == mode), math.nan)
                          for mode in (Mode.FREE, Mode.CONTACT))  # fmt: skip
        yield from _told(f"{name} (events)", "a touch of a fall", abs(touch / fall - 1.0), FEW * rtol)
        q, v, a = exponentials(a0, a1, (0.0, -fast), np.array([release - touch]))
        left = abs(float(a[0]) + GRAVITY) / (a0 * fast / math.sqrt(a0))
        yield from _told(f"{name} (events)", "what presses at the end of a touch", left, FEW * rtol)
        i = int(np.searchsorted(run.t, release))
        for found, wanted in ((run.q[i, 0], q[0]), (run.v[i, 0], v[0])):
            off = abs(found - wanted) / (fast / math.sqrt(a0) if wanted is q[0] else fast)
            yield from _told(f"{name} (events)", "a state at the end of a touch", float(off), FEW * rtol)
        most = MASS * pressed(a0, a1, fast, release - touch)
        off = abs(float(run.lam[:, 0].max()) / most - 1.0)
        yield from _told(f"{name} (peaks)", "what presses most in a touch", off, FEW * rtol)


def pressed(a0: float, a1: float, fast: float, lasts: float) -> float:
    """Return the largest acceleration a touch gives a mass that comes with a speed, m/s^2: where the jerk is none."""
    poles = np.roots([1.0, a1, a0]).astype(complex)
    parts = np.linalg.solve(np.stack([np.ones(2), poles]), np.array([0.0, -fast], dtype=complex))
    # The jerk is the real part of one rotating arrow, twice: its phase tells when it is none.
    jerk, pole = (parts * poles**3)[0], poles[0]
    turns = (0.5 * math.pi - np.angle(jerk) + math.pi * np.arange(-2, 3)) / pole.imag
    inside = turns[(turns > 0.0) & (turns < lasts)]
    return float(np.max(exponentials(a0, a1, (0.0, -fast), inside)[2])) + GRAVITY
