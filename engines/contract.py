"""What every engine offers: the two classes that an engine of one's own inherits from."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Set
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from crossbody.cases import CaseUnsupported

if TYPE_CHECKING:
    from crossbody.cases import Case, Parameter, Trajectory
    from crossbody.engines.linear import Spot, Tangent

QUANTITIES = ("masses", "gravity", "constants", "q0", "v0", "M", "bias", "H", "lam", "ledger")
"""What an engine must show or name in `hidden`: keys of its audit where the reference has them, `lam` of its
trajectories where there are rows, and their account of energy."""
NOTHING: Mapping[str, Any] = MappingProxyType({})


class Run(ABC):
    """One prepared run: the model is built, what the scene does not need is left out.

    Attributes:
        engine, profile: who runs it.
        settings: what was really used, for provenance (tolerance, step, solver, ...).
        follows: the same scene under the machine, the collision rule and the law that the engine really
            integrates, where they are not the case's own; its step error is then measured against those.
    """

    engine: str
    profile: str
    settings: Mapping[str, Any]
    follows: Case | None = None

    @abstractmethod
    def run(self) -> Trajectory:
        """Integrate from the start; the same result every time. Numerical failure is an Outcome.

        Raises:
            CaseUnsupported: where the motion shows that this engine cannot do the case.
        """

    @abstractmethod
    def audit(self) -> Mapping[str, Any]:
        """Return the physics as it reached the engine, for the parity audit.

        Keys: masses, gravity, constants, q0, v0; and where the engine exposes them the functions
        `M(q)`, `bias(q, v)`, `H(q)` and `lam(q, v)` in the case's coordinates; `set`, setting -> its value
        as the engine's own model has it; and `hidden`, quantity -> why this mechanism's model does not show
        it, beside what the engine's own `hidden` says.
        """

    def native(self) -> float:
        """Return the engine's own loop's time for the same steps without Python, s; NaN: none."""
        return math.nan


class Engine(ABC):
    """An engine under named profiles.

    Attributes:
        name: as in engines.names().
        profiles: profile -> one sentence; the first is the default one.
        versions: package -> version, for provenance.
        hidden: profile ("*" for all) -> quantity -> why it does not show it. Whatever of `QUANTITIES` is
            not named here it must show: the parity audit and the metrics count what is missing as wrong.
        orders: profile -> promised order of the error in its step `dt` or its tolerance `rtol`;
            the benchmark holds the observed one against it.
        steps: profile whose numbers expected-outside hide what it applies -> theta: a step of its setting `dt` moves by
            dt (v + theta (v+ - v)); NaN without such steps, infinite where theta is a file's. Those that it takes
            first, accelerations, friction and the setting `restitution` are held against the law's
            (`crossbody.reports.judging.first_steps`).
        held: profiles of these whose rows that are always on follow the law, to the order of the step; others hold
            them in a way of their own.
        late: profiles of these whose contacts push by the force of the step before: none of a first blow is held.
        of_scenes: profile -> the one that stands for it in a scene, a robot's file say, where all
            profiles are meant.
        interpreted: profile ("*" for all) -> what of its timed runs is Python, which the
            benchmark says beside them.
    """

    name: str
    profiles: Mapping[str, str]
    versions: Mapping[str, str]
    hidden: Mapping[str, Mapping[str, str]] = NOTHING
    orders: Mapping[str, float] = NOTHING
    steps: Mapping[str, float] = NOTHING
    held: Set[str] = frozenset()
    late: Set[str] = frozenset()
    of_scenes: Mapping[str, str] = NOTHING
    interpreted: Mapping[str, str] = NOTHING

    def why_not(self, case: Case, profile: str) -> str | None:
        """Return why this engine cannot do that case, in one sentence; None if it can."""
        return None

    @abstractmethod
    def prepare(self, case: Case, profile: str = "matched", **settings: Any) -> Run:
        """Build the engine's own model once, untimed.

        Args:
            case: the scene.
            profile: one of `profiles`. "matched" is the one that follows the case's own law most
                closely: the first of an engine that has no profile of that name. `Run.profile`
                says which one it was.
            settings: of the profile, by name.

        Raises:
            UnknownName: for a profile or setting that it does not have (the valid ones are listed).
            CaseUnsupported: with the sentence of `why_not`.
            InvalidValue: for a setting outside its range.
        """

    def planned(self, case: Case, profile: str = "matched", **settings: Any) -> Mapping[str, Any]:
        """Return the settings that a run would have; an engine that compiles for one overrides this."""
        return self.prepare(case, profile, **settings).settings

    def offered(self, case: Case, profile: str = "matched") -> Mapping[str, Parameter]:
        """Return the settings that a user may give: those that `planned` names where it is asked for another.

        What a run has beside them, such as its method, is fixed by the profile.

        Raises:
            CaseUnsupported: for a case that the engine cannot do.
        """
        from crossbody.cases import Parameter, UnknownName  # NumPy, which a list of names does not need
        from crossbody.engines.settings import UnknownSetting

        try:
            self.planned(case, profile, **{"": 0.0})
        except UnknownSetting as error:
            return error.settings
        except (UnknownName, TypeError):  # an engine of a user's own, which refuses in its own way
            pass
        return {name: Parameter(default=value) for name, value in self.planned(case, profile).items()}

    def linearise(self, case: Case, spot: Spot) -> tuple[Tangent, ...]:
        """Return its derivatives of the accelerations at an equilibrium of the case, by each way that it has.

        Raises:
            CaseUnsupported: where it has none.
        """
        raise CaseUnsupported(f"The engine {self.name!r} does not linearise.")

    def hidden_in(self, profile: str) -> Mapping[str, str]:
        """Return what it does not show under a profile, and why; a quantity of `QUANTITIES` each."""
        return {**self.hidden.get("*", {}), **self.hidden.get(profile, {})}

    def interpreted_in(self, profile: str) -> str:
        """Return what of its timed runs is Python; empty for nothing."""
        return self.interpreted.get(profile, self.interpreted.get("*", ""))
