"""Drake's Simulator over a system, from its start, with what is kept of every step."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import EventStatus

from crossbody.cases.arrays import Floats

LONGEST = 0.1  # s, Drake's own bound on a step
SHORTEST = 1e-14  # s
Keep = Callable[[float, Floats], object]  # time, s, and state behind a step -> whether to end there


class Sim:
    """A simulator of a system or diagram from its state x0, with a scheme and its accuracy.

    The accuracy is 0 for a system in discrete time; the step that is tried first, s, for Drake's
    own.
    """

    def __init__(self, root: Any, x0: Floats, scheme: str, accuracy: float, first: float = 0.0) -> None:
        self.first = first
        self.root, self.x0, self.scheme, self.accuracy = root, x0, scheme, accuracy
        self.simulator = Simulator(root)
        self.steps = 0

    def start(self) -> None:
        """Go back to the start, with an integrator that remembers no step of an earlier run."""
        context = self.simulator.get_mutable_context()
        context.SetTime(0.0)
        self.steps = 0
        self.put(self.x0)
        if not self.accuracy:
            return
        ResetIntegratorFromFlags(self.simulator, self.scheme, LONGEST)
        chosen = self.simulator.get_mutable_integrator()
        chosen.set_target_accuracy(self.accuracy)
        chosen.set_requested_minimum_step_size(SHORTEST)
        chosen.set_throw_on_minimum_step_size_violation(False)
        if self.first:
            chosen.request_initial_step_size_target(self.first)

    def put(self, x: Floats) -> None:
        """Put a state in; what was computed from the last one is computed anew."""
        context = self.simulator.get_mutable_context()
        (context.SetContinuousState if self.accuracy else context.SetDiscreteState)(x)

    def state(self, context: Any = None) -> Floats:
        """Return the state (n,), of now if no context is given."""
        at = self.simulator.get_context() if context is None else context
        vector = at.get_continuous_state_vector() if self.accuracy else at.get_discrete_state_vector()
        found: Floats = vector.CopyToVector()
        return found

    def run(self, t_end: float, max_steps: int, keep: Keep) -> str:
        """Go on to t_end, s, or through so many steps since the start; what Drake said where it could not."""

        def monitor(now: Any) -> Any:
            ended = keep(now.get_time(), self.state(now))
            self.steps += 1
            if now.get_time() < t_end and (ended or self.steps > max_steps):
                return EventStatus.ReachedTermination(self.root, "ended")
            return None

        self.simulator.set_monitor(monitor)
        try:
            self.simulator.Initialize()
            self.simulator.AdvanceTo(t_end)
        except RuntimeError as error:
            return " ".join(str(error).split())
        return ""

    def rates(self, times: Floats, states: Floats) -> Floats:
        """Return x' at given states (n, 2 nb), as the system evaluates it."""
        context = self.root.CreateDefaultContext()
        found = states.copy()
        for i, (t, x) in enumerate(zip(times.tolist(), states, strict=True)):
            context.SetTime(t)
            context.SetContinuousState(x)
            found[i] = self.root.EvalTimeDerivatives(context).CopyToVector()
        return found
