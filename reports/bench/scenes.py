"""What a benchmark runs when nothing is named: scenes whose truth is known, the quick ones or all."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from crossbody import cases, engines
from crossbody.cases import Case, Value
from crossbody.reports.bench.ladder import Effort
from crossbody.reports.runs import choice

ENGINES = (*choice.DEFAULT_ENGINES, "exudyn", "drake", "dart", "pymunk")


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """One case of the benchmark, with parameters that differ from the variant's own."""

    name: str
    variant: str
    given: Mapping[str, Value] = field(default_factory=lambda: MappingProxyType({}))

    def case(self) -> Case:
        """The case."""
        return labelled(cases.load(self.name, self.variant, **self.given), self.given)


def labelled(case: Case, given: Mapping[str, Value]) -> Case:
    """The case under a label that tells what was changed, so that no two scenes are taken for one."""
    changed = ",".join(f"{k}={v:g}" if isinstance(v, float) else f"{k}={v}" for k, v in given.items())
    return replace(case, variant=f"{case.variant}({changed})") if changed else case


DROP = Scene(name="bouncing_ball", variant="elastic", given={"a0": 1e5, "a1": 0.0, "a2": 0.0, "t_end": 2.0})
"""A stiff elastic floor, 1 m below, for 2 s: what every engine can do in its own way."""
PAIR = Scene(name="newtons_cradle", variant="sliders", given={"n": 2, "collisions": "resolved"})
"""One collision of two balls, in real time."""
QUICK = (
    DROP,
    Scene(name="bouncing_ball", variant="listing"),
    Scene(name="bouncing_ball", variant="linear"),
    PAIR,
    Scene(name="newtons_cradle", variant="sliders"),
    Scene(name="delta_impulse", variant="light"),
)
QUICK_EFFORT = Effort(repeats=3, slow=0.2, longest=0.5, climb=2.0, rounds=10.0, every=2)
FULL_EFFORT = Effort(repeats=7, slow=0.3, longest=4.0, climb=8.0, rounds=30.0)


def default(full: bool) -> tuple[Case, ...]:
    """The quick scenes, or every variant of every case and the two special ones."""
    if not full:
        return tuple(scene.case() for scene in QUICK)
    every = [cases.load(name, variant) for name in cases.names() for variant in cases.variants(name)]
    return (DROP.case(), PAIR.case(), *every)


def chosen(names: Sequence[str], variant: str | None, given: Mapping[str, Value], full: bool) -> tuple[Case, ...]:
    """The cases that were named, in the variant that was, else the default ones."""
    if not (names or variant or given):
        return default(full)
    return tuple(labelled(case, given) for case in choice.load_cases(names, variant, given))


def effort(full: bool, every_rung: bool, repeats: int | None, each: float = math.inf) -> Effort:
    """What is spent on them; scenes that were named are run on every rung.

    Args:
        full: every case, or the quick scenes.
        every_rung: whether no rung is left out.
        repeats: timed runs of each rung, if it was said.
        each: time for an engine on a scene, s: half of it to climb its ladder, half for its share
            of the rounds.
    """
    chosen = FULL_EFFORT if full else QUICK_EFFORT
    chosen = replace(chosen, every=1) if every_rung else chosen
    chosen = replace(
        chosen, climb=min(chosen.climb, 0.5 * each), longest=min(chosen.longest, 0.25 * each),
        slow=min(chosen.slow, 0.05 * each), rounds=min(chosen.rounds, 3.0 * each),
    )  # fmt: skip
    return chosen if repeats is None else replace(chosen, repeats=repeats)


def picks(wanted: Sequence[str]) -> tuple[choice.Pick, ...]:
    """What was asked for, else every engine that is known, installed or not."""
    known = engines.names()
    return choice.picks(wanted or [name for name in ENGINES if name in known])
