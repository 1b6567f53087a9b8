"""What a suite says: scenes, the axes along which they are drawn, and what is asked of the reference on them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from types import MappingProxyType
from typing import TYPE_CHECKING, TypeAlias

from crossbody.cases import InvalidValue
from crossbody.reports.suites.axis import Axis, Levels

if TYPE_CHECKING:
    import numpy as np

    from crossbody.cases import Value

Drawn: TypeAlias = "Mapping[str, Value]"
Scene: TypeAlias = "Callable[[Drawn, np.random.Generator], Drawn]"


def as_drawn(drawn: Drawn, _rng: np.random.Generator) -> Drawn:
    """The axes are the case's parameters."""
    return drawn


@dataclass(frozen=True, slots=True, kw_only=True)
class Ladder:
    """Tolerances, for engines that have one, beside time steps, s, for the others: from coarse to fine."""

    rtol: tuple[float, ...]
    dt: tuple[float, ...]

    def __post_init__(self) -> None:
        """Check that both have as many rungs, from coarse to fine."""
        if len(self.rtol) != len(self.dt):
            raise InvalidValue(f"A ladder has {len(self.rtol)} tolerances and {len(self.dt)} steps; give as many.")
        for name, rungs in (("rtol", self.rtol), ("dt", self.dt)):
            if not rungs or any(a <= b for a, b in pairwise(rungs)) or rungs[-1] <= 0.0:
                raise InvalidValue(f"Ladder.{name} is {rungs}; it must fall, and stay above 0.")


USUAL = ("reference:compiled", "mujoco:matched", "pinocchio:law")
"""Who runs a suite unless it or the user says otherwise."""
TIGHT = Ladder(rtol=(1e-12,), dt=(1e-4,))
"""For scenes that multiply errors: asked for 1e-12, an error of 1e-6 is within reach, and 1e-9 not."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Family:
    """Scenes of one case.

    Attributes:
        case, variant: which.
        axes: drawn at random (quasi-random, so that few runs cover the space).
        grid: every combination once, in a mixed order, so that any first part of it is spread out.
        fixed: the same in every run.
        scene: from what was drawn and fixed to the case's parameters; the same names if not given.
        ladder: of tolerances and steps, a further axis of the grid.
        second: every how many runs the independent integrator is asked whatever it costs (tier
            C), and of the others wherever the run took few steps; 0 for never: it is not needed
            where the case has a closed form.
        limit: largest error of the reference against a truth of tier A to C at its default
            tolerance; on a rung of a ladder it grows with the tolerance. Its energy account may
            leave ten times as much open.
        finishes: whether the reference has to reach the horizon in each of them.
        ends: the end state alone is asked for: the reference runs them in threads, without a
            record and energy account.
        max_steps: bound on the steps of a run.
        time_limit: bound on its wall time, s.
        share: how many of the suite's runs for one of a family with share 1: cheap scenes more.
    """

    case: str
    variant: str
    axes: Mapping[str, Axis] = field(default_factory=lambda: MappingProxyType({}))
    grid: Mapping[str, Levels] = field(default_factory=lambda: MappingProxyType({}))
    fixed: Drawn = field(default_factory=lambda: MappingProxyType({}))
    scene: Scene = as_drawn
    ladder: Ladder | None = None
    second: int = 0
    limit: float = 1e-6
    finishes: bool = True
    ends: bool = False
    max_steps: int = 50_000
    time_limit: float = 10.0
    share: int = 1

    def __post_init__(self) -> None:
        """Check that every name has one source."""
        if self.share < 1:
            raise InvalidValue(f"{self.case}:{self.variant}: share is {self.share}; valid: 1 and more.")
        sources: list[Mapping[str, object]] = [self.axes, self.grid, self.fixed]
        for i, one in enumerate(sources):
            for other in sources[i + 1 :]:
                for name in one.keys() & other.keys():
                    raise InvalidValue(
                        f"{self.case}:{self.variant}: {name} is given twice, in the grid, "
                        "the axes or fixed; give it once."
                    )
        if not self.axes and not self.grid and self.ladder is None:
            raise InvalidValue(f"{self.case}:{self.variant}: a family needs an axis, a grid or a ladder.")

    @property
    def points(self) -> int:
        """Combinations of the grid; 1 without one."""
        count = 1 if self.ladder is None else len(self.ladder.rtol)
        for levels in self.grid.values():
            count *= len(levels.values)
        return count


@dataclass(frozen=True, slots=True, kw_only=True)
class Suite:
    """Families that stress one thing.

    Attributes:
        families: they share the runs, each by its own `share`.
        engines: what runs it unless the user says otherwise; the first makes every run, the others a share.
        runs: of the first engine if nothing is said; also its share in a number for several
            suites: cheap scenes more.
        about: what it stresses, in one line; of a suite in a file of its own that is the first of
            its docstring.
    """

    families: tuple[Family, ...]
    engines: tuple[str, ...] = USUAL
    runs: int = 200
    about: str = ""

    def __post_init__(self) -> None:
        """Check that something is run."""
        if not self.families or not self.engines or self.runs < 1:
            raise InvalidValue("A suite needs at least one family, one engine and one run.")
