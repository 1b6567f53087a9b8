"""Drake as an engine: profiles, settings, and prepared runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib.metadata import version
from time import perf_counter
from typing import Any

import numpy as np
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import EventStatus

from crossbody.cases import Case, CaseUnsupported, Outcome, Parameter, Trajectory
from crossbody.cases._arrays import Floats
from crossbody.engines import _settings
from crossbody.engines._line import Line, followed, law_name, line
from crossbody.engines._peer import HIDDEN, PeerRun, ended, sampled, why_not
from crossbody.engines.drake._plant import offsets, plant
from crossbody.engines.drake._symbolic import system

SCHEMES = ("runge_kutta5", "runge_kutta3", "bogacki_shampine3", "radau3")
USUAL_SCHEME, USUAL_ACCURACY = "runge_kutta3", 1e-4
"""What a Simulator of 1.51.1 starts with."""
LONGEST = 0.1  # s, Drake's own bound on a step
SHORTEST = 1e-14  # s

Sample = tuple[float, Floats]


class Sim:
    """A simulator that keeps the state at the end of every step.

    Args:
        root: system or diagram that is simulated.
        x0: its state at t = 0.
        scheme: what integrates.
        accuracy: what it is asked for; 0 for a system in discrete time.
    """

    def __init__(self, root: Any, x0: Floats, scheme: str, accuracy: float) -> None:
        self.root, self.x0, self.scheme, self.accuracy = root, x0, scheme, accuracy
        self.simulator = Simulator(root)
        self.rows: list[Sample] = []

    def start(self) -> None:
        """Back to the start, with an integrator that remembers no step of an earlier run."""
        context = self.simulator.get_mutable_context()
        context.SetTime(0.0)
        if not self.accuracy:
            context.SetDiscreteState(self.x0)
            return
        context.SetContinuousState(self.x0)
        ResetIntegratorFromFlags(self.simulator, self.scheme, LONGEST)
        chosen = self.simulator.get_mutable_integrator()
        chosen.set_target_accuracy(self.accuracy)
        chosen.set_requested_minimum_step_size(SHORTEST)
        chosen.set_throw_on_minimum_step_size_violation(False)

    def state(self, context: Any) -> Floats:
        """The state (2 n,)."""
        vector = context.get_continuous_state_vector() if self.accuracy else context.get_discrete_state_vector()
        found: Floats = vector.CopyToVector()
        return found

    def run(self, t_end: float, max_steps: int) -> None:
        """From the start to t_end, s, or through so many steps."""
        rows: list[Sample] = []
        self.rows = rows
        kept, state = rows.append, self.state

        def monitor(now: Any) -> Any:
            kept((now.get_time(), state(now)))
            if len(rows) > max_steps and now.get_time() < t_end:
                return EventStatus.ReachedTermination(self.root, "steps")
            return None

        self.simulator.set_monitor(monitor)
        self.simulator.Initialize()
        self.simulator.AdvanceTo(t_end)

    def rates(self, times: Floats, states: Floats) -> Floats:
        """X' at given states (n, 2 nb), as the system evaluates it."""
        context = self.root.CreateDefaultContext()
        found = np.empty_like(states)
        for i, (t, x) in enumerate(zip(times.tolist(), states, strict=True)):
            context.SetTime(t)
            context.SetContinuousState(x)
            found[i] = self.root.EvalTimeDerivatives(context).CopyToVector()
        return found


def _runner(case: Case, scene: Line, sim: Sim, shift: Floats, max_steps: int, dt: float) -> Callable[[], Trajectory]:
    n = len(scene.masses)

    def integrate() -> Trajectory:
        sim.start()
        told, start = "", perf_counter()
        try:
            sim.run(case.t_end, max_steps)
        except RuntimeError as error:
            told = " ".join(str(error).split())
        wall = perf_counter() - start
        t, x = np.array([r[0] for r in sim.rows]), np.array([r[1] for r in sim.rows])
        q, v = x[:, :n] - shift, x[:, n:]
        q[0], v[0] = scene.q0, scene.v0
        lam = _multipliers(scene, sim, t, x, dt)
        outcome, what = _ended(case, scene, t, q, v, max_steps, told)
        place = f"t = {t[-1]:g} s, q = {q[-1].tolist()}, v = {v[-1].tolist()}"
        return sampled(
            scene, t, q, v, lam, wall_s=wall, steps=len(t) - 1, outcome=outcome,
            message="" if outcome.ok else f"{place}: {what}.",
        )  # fmt: skip

    return integrate


def _ended(
    case: Case, scene: Line, t: Floats, q: Floats, v: Floats, max_steps: int, told: str
) -> tuple[Outcome, str]:  # fmt: skip
    if told:
        return Outcome.STEP_TOO_SMALL, f"Drake says: {told}"
    if t[-1] < case.t_end:
        return Outcome.STEP_LIMIT, f"{max_steps} steps were not enough"
    return ended(scene, q[-1], v[-1]), "the state left what the scene can reach"


def _multipliers(scene: Line, sim: Sim, t: Floats, x: Floats, dt: float) -> Floats:
    """Lam (n, nc), N, from the accelerations that Drake evaluates, or from the steps of the discrete plant."""
    n = len(scene.masses)
    if dt:
        change = np.vstack([np.zeros((1, n)), np.diff(x[:, n:], axis=0) / dt + scene.gravity])
    else:
        change = sim.rates(t, x)[:, n:] + scene.gravity
    lam = scene.transmitted(change)
    rounding = 1e-9 * float(scene.masses.max()) * max(scene.gravity, 1e-3)
    return np.where(scene.unilateral, np.where(lam > rounding, lam, 0.0), lam)


class Drake:
    """Drake; see `crossbody.engines.Engine`."""

    name = "drake"
    profiles: Mapping[str, str] = {
        "matched": "the case's law as a symbolic system, Runge-Kutta 5 with error control at a tight accuracy; "
        "memoryless, every row as if it were alone",
        "continuous": "a MultibodyPlant in continuous time, point contact with the law's stiffness, the simulator's "
        "own integrator (Runge-Kutta 3) and accuracy (1e-4)",
        "default": "a discrete MultibodyPlant with steps of 1 ms and point contact with the law's stiffness",
    }
    hidden = HIDDEN
    versions: Mapping[str, str] = {"drake": version("drake")}
    orders: Mapping[str, float] = dict.fromkeys(profiles, 1.0)

    def why_not(self, case: Case, profile: str) -> str | None:
        """Mechanisms that are not on a line; contacts of a plant that never open."""
        _settings.check_case(case)
        _settings.profile_of(self.name, self.profiles, profile)
        reason = why_not("Drake", case)
        if reason is None and profile != "matched" and not case.law.unilateral.all():
            return "A contact of a MultibodyPlant pushes only: a row that is always on is none."
        if reason is None and profile != "matched" and not float(line(case).a0[0]) > 0.0:
            return "A contact of a MultibodyPlant needs a stiffness above 0."
        return reason

    def prepare(self, case: Case, profile: str = _settings.MATCHED, **settings: Any) -> PeerRun:
        """Build the system and its simulator.

        Args:
            case: the scene.
            profile: one of `profiles`.
            settings: matched: rtol (Drake's accuracy), scheme; continuous: rtol; default: dt, s; all: max_steps.

        Raises:
            UnknownName, CaseUnsupported, InvalidValue: see `crossbody.engines.Engine`.
        """
        reason = self.why_not(case, profile)
        if reason is not None:
            raise CaseUnsupported(reason)
        used = _settings.chosen(self.name, profile, _known(case, profile), settings)
        scene, dt, physics = line(case), float(used.get("dt", 0.0)), {}
        if profile == "matched":
            root, shift = system(scene), np.zeros(len(scene.masses))
            physics = {"masses": scene.masses, "constants": {"a0": scene.a0, "a1": scene.a1, "a2": scene.a2}}
        else:
            root, made = plant(scene, dt)
            shift, physics = np.array(offsets(scene)), _read(scene, made)
        start = np.concatenate((scene.q0 + shift, scene.v0))
        sim = Sim(root, start, str(used.get("scheme", USUAL_SCHEME)), float(used.get("rtol", 0.0)))
        law = {"law": law_name(case)} if profile == "matched" else {}
        return PeerRun(
            engine=self.name, profile=profile, settings=used | law,
            integrate=_runner(case, scene, sim, shift, int(used["max_steps"]), dt),
            physics={"gravity": scene.gravity, "q0": case.q0, "v0": case.v0} | physics,
            follows=followed(case) if profile == "matched" else None,
        )  # fmt: skip


def _read(scene: Line, made: Any) -> dict[str, Any]:
    """Numbers as the plant has them; its contact has a stiffness and no constants of the law."""
    context = made.CreateDefaultContext()
    masses = [made.GetBodyByName(f"ball {i}").get_mass(context) for i in range(len(scene.masses))]
    gravity = -float(made.gravity_field().gravity_vector()[2])
    return {"masses": masses, "gravity": gravity, "constants": {"stiffness": scene.reduced * scene.a0}}


def _known(case: Case, profile: str) -> dict[str, Parameter]:
    steps = Parameter(default=1_000_000, doc="bound on the number of steps", low=1, high=1e9)
    if profile == "default":
        step = Parameter(default=min(1e-3, case.t_end), unit="s", doc="time step", low=0.0, open_low=True)
        return {"dt": step, "max_steps": steps}
    default = 1e-11 if profile == "matched" else USUAL_ACCURACY
    accuracy = Parameter(default=default, doc="accuracy that is asked for", low=1e-14, high=1e-1)
    scheme = Parameter(default=SCHEMES[0], doc="integration scheme", choices=SCHEMES)
    return {"rtol": accuracy, "max_steps": steps} | ({"scheme": scheme} if profile == "matched" else {})
