"""Cut a step at the first event of its rows: retry from the saved state with a smaller time step."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import mujoco
from scipy.optimize import brentq

from crossbody.cases import Mode
from crossbody.engines._log import Modes
from crossbody.engines.mujoco._scene import Scene

FREE, CONTACT, BALLISTIC = int(Mode.FREE), int(Mode.CONTACT), int(Mode.BALLISTIC)
COLLISION, SEPARATED = int(Mode.COLLISION), int(Mode.COLLISION_SEPARATION)
TOGETHER = 1e-12
"""Part of a step within which rows cross together: which of them is located first is rounding."""
TRIALS = 300  # most that one row takes; bisection alone takes 50
Sign = tuple[int, int, float]
"""(row, 0 for its gap or 1 for its multiplier, sign that it has in its present mode)."""
WATCHED: dict[int, tuple[tuple[int, float], ...]] = {
    FREE: ((0, 1.0),),
    **dict.fromkeys((CONTACT, COLLISION), ((0, -1.0), (1, 1.0))),
    **dict.fromkeys((BALLISTIC, SEPARATED), ((0, -1.0), (1, -1.0))),
}


OUTLIVING = WATCHED | dict.fromkeys((CONTACT, COLLISION), ((1, 1.0),))
"""Of rows that push above their surface too until their multiplier is zero, as the law has it."""


def signs(modes: Modes, watched: Mapping[int, tuple[tuple[int, float], ...]] = WATCHED) -> list[Sign]:
    """What must keep its sign while the modes last."""
    return [(i, which, sign) for i, mode in enumerate(modes) for which, sign in watched.get(mode, ())]


class Locator:
    """Finds and lands on the first instant of a step at which a row leaves its mode.

    The rows keep the equations of their modes in every trial (a closed one outlives its gap), so that the
    end of a trial is a smooth function of its length and the order of the integrator survives the event.
    """

    def __init__(self, scene: Scene, advance: Callable[[], None], rewind: Callable[[], None]) -> None:
        assert scene.margins is not None
        self.model, self.data, self.margins = scene.model, scene.data, scene.margins
        self.advance, self.rewind, self.outlives, self.entered = advance, rewind, scene.outlives, scene.entered
        self.watched = OUTLIVING if scene.outlives else WATCHED

    def beyond(self, modes: Modes) -> Modes:
        """The modes just behind the event: those rows that crossed are taken by their gap and multiplier."""
        found = [
            mode if mode not in WATCHED or (self.outlives and mode in (CONTACT, COLLISION) and lam > 0.0)
            else FREE if h > 0.0 else CONTACT if lam > 0.0 else BALLISTIC
            for mode, (h, lam) in zip(modes, self.margins(), strict=True)
        ]  # fmt: skip
        return self.entered(found)

    def land(self, modes: Modes) -> int:
        """Redo the step so that it ends just behind its first event; returns the trials that it took.

        It ends behind all rows that cross together there: of those that one motion moves alike
        any may be the one that bears. A change of constants alone (COLLISION to CONTACT) crosses
        nothing: it is taken at the end of the step.
        """
        if not (crossed := self._crossed(modes)):
            return 0
        full, trials = self.model.opt.timestep, 0

        def value(tau: float, row: int, which: int) -> float:
            nonlocal trials
            trials += 1
            self._redo(tau)
            return self.margins()[row][which]

        roots = []
        for row, which, sign in crossed:
            start = value(0.0, row, which)
            bracketed = sign * start > 0.0
            try:
                roots.append(brentq(value, 0.0, full, (row, which), 1e-15 * full, maxiter=TRIALS) if bracketed else 0.0)
            except ValueError:  # a trial starts from an evaluation of its own, and may just miss what the step passed
                roots.append(full)
        tau, nudge = min(roots), 1e-16 * full
        together = {one for one, root in zip(crossed, roots, strict=True) if root <= tau + TOGETHER * full}
        self._redo(tau)
        while not together.issubset(self._crossed(modes)) and tau < full:
            tau, nudge = min(tau + nudge, full), 2.0 * nudge
            self._redo(tau)
            trials += 1
        return trials

    def _crossed(self, modes: Modes) -> list[Sign]:
        now = self.margins()
        # A gap of exactly 0 is closed, a multiplier of exactly 0 does not push.
        return [s for s in signs(modes, self.watched) if (now[s[0]][s[1]] > 0.0) == (s[2] < 0.0)]

    def _redo(self, tau: float) -> None:
        self.rewind()
        self.model.opt.timestep = tau
        mujoco.mj_forward(self.model, self.data)
        if tau > 0.0:
            self.advance()
            mujoco.mj_forward(self.model, self.data)
