"""What every engine offers. Structural: an engine inherits from nothing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Protocol

from crossbody.cases.entry_points import checked_arguments

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory

QUANTITIES = ("masses", "gravity", "constants", "q0", "v0", "M", "bias", "H", "lam", "ledger")
"""What an engine must show or name in `hidden`: keys of its audit where the reference has them, `lam` of its
trajectories where there are rows, and their account of energy."""


@checked_arguments
def hidden(engine: Engine, profile: str) -> Mapping[str, str]:
    """What an engine does not show under a profile, and why; a quantity of `QUANTITIES` each."""
    told: Mapping[str, Mapping[str, str]] = getattr(engine, "hidden", {})
    return {**told.get("*", {}), **told.get(profile, {})}


@checked_arguments
def interpreted(engine: Engine, profile: str) -> str:
    """What of an engine's timed runs is Python; empty for nothing."""
    told: Mapping[str, str] = getattr(engine, "interpreted", {})
    return told.get(profile, told.get("*", ""))


class Run(Protocol):
    """One prepared run: the model is built, what the scene does not need is left out.

    Attributes:
        engine, profile: who runs it.
        settings: what was really used, for provenance (tolerance, step, solver, ...).

    A run may have `follows`, a case: the same scene under the machine, the collision rule and the law that the engine
    really integrates, where they are not the case's own. Its step error is then measured against those.
    """

    engine: str
    profile: str
    settings: Mapping[str, Any]

    def run(self) -> Trajectory:
        """Integrate from the start; the same result every time. Numerical failure is an Outcome.

        Raises:
            CaseUnsupported: where the motion shows that this engine cannot do the case.
        """
        ...

    def audit(self) -> Mapping[str, Any]:
        """The physics as it reached the engine, for the parity audit (spec 5.3).

        Keys: masses, gravity, constants, q0, v0; and where the engine exposes them the functions
        `M(q)`, `bias(q, v)`, `H(q)` and `lam(q, v)` in the case's coordinates; and `hidden`, quantity -> why this
        mechanism's model does not show it, beside what the engine's own `hidden` says.
        """
        ...


class Engine(Protocol):
    """An engine under named profiles.

    Attributes:
        name: as in engines.names().
        profiles: profile -> one sentence; the first is the default one.
        versions: package -> version, for provenance.

    An engine may have `hidden`, profile ("*" for all) -> quantity -> why it does not show it. Whatever of `QUANTITIES`
    is not named there it must show: the parity audit and the metrics count what is missing as wrong.

    An engine may have `orders`, profile -> promised order of the error in its step `dt` or its tolerance `rtol`; the
    benchmark holds the observed one against it.

    An engine may have `of_scenes`, profile -> the one that stands for it in a scene, a robot's file say, where all
    profiles are meant.

    An engine may have `interpreted`, profile ("*" for all) -> what of its timed runs is Python, which the benchmark
    says beside its times; and its runs `native()`, the time in which its own loop makes the same steps without that, s.

    An engine may have `linearise(case, spot) -> tuple[Tangent, ...]` (`crossbody.engines.linear`): its derivatives of
    the accelerations at an equilibrium of the case, by each way that it has.
    """

    name: str
    profiles: Mapping[str, str]
    versions: Mapping[str, str]

    def why_not(self, case: Case, profile: str) -> str | None:
        """Why this engine cannot do that case, in one sentence; None if it can."""
        ...

    def prepare(self, case: Case, profile: str = "matched", **settings: Any) -> Run:
        """Build the engine's own model once, untimed.

        Args:
            case: the scene.
            profile: one of `profiles`. "matched" is the one that follows the case's own law most closely: the first
                of an engine that has no profile of that name. `Run.profile` says which one it was.
            settings: of the profile, by name.

        Raises:
            UnknownName: for a profile or setting that it does not have (the valid ones are listed).
            CaseUnsupported: with the sentence of `why_not`.
            InvalidValue: for a setting outside its range.
        """
        ...
