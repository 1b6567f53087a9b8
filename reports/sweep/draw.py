"""From suites to runs: quasi-random draws that depend on the seed and their own number alone.

A run's numbers are those of point i of a scrambled Halton sequence (Owen, A randomized Halton
algorithm in R, 2017), so a longer sweep begins with the shorter one, and neither workers nor
engines change what is drawn.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import count

import numpy as np
from scipy.stats import qmc

from crossbody.cases import InvalidValue, UnknownName, Value
from crossbody.cases.loading import module
from crossbody.reports.runs.choice import Pick
from crossbody.reports.suites.contract import Family, Suite
from crossbody.reports.sweep.spec import Spec

SHARE = 400
LEAST = 3
"""One run of another engine beside so many of the first, and at least so many, where none is named."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """What one draw of a family came to."""

    draw: int
    parameters: dict[str, Value]
    rung: int
    seed: int
    second: bool


def check(name: str, suite: Suite) -> None:
    """Say before anything runs whether a suite's families can be built."""
    for family in suite.families:
        source = module(family.case)
        if family.variant not in source.VARIANTS:
            raise UnknownName(f"variant of {family.case}", family.variant, source.VARIANTS)
        for key, value in family.fixed.items():
            if key not in source.PARAMETERS:
                raise UnknownName(f"parameter of {family.case}", key, source.PARAMETERS)
            source.PARAMETERS[key].checked(f"suite {name}: {key}", value)
        first = next(iter(scenes(name, family, 0, 1, 0)), None)
        for key in () if first is None else first.parameters:
            if key not in source.PARAMETERS:
                raise UnknownName(f"parameter of {family.case}", key, source.PARAMETERS)
        for key in family.grid.keys() & source.PARAMETERS.keys():
            for value in family.grid[key].values:
                source.PARAMETERS[key].checked(f"suite {name}: {key}", value)


def scenes(name: str, family: Family, place: int, runs: int, seed: int) -> Iterator[Scene]:
    """The draws of one family; without random axes no more than its grid has points."""
    root = np.random.SeedSequence([seed, zlib.crc32(name.encode()), place])
    order, scramble, runs_root = root.spawn(3)
    total = runs if family.axes else min(runs, family.points)
    points = np.random.default_rng(order).permutation(family.points)
    halton = qmc.Halton(max(len(family.axes), 1), rng=np.random.default_rng(scramble)).random(total)
    uniform = halton[:, : len(family.axes)]
    for i, child in enumerate(runs_root.spawn(total)):
        rng = np.random.default_rng(child)
        drawn = {key: axis.at(float(u)) for (key, axis), u in zip(family.axes.items(), uniform[i], strict=True)}
        grid, rung = _grid(family, int(points[i % family.points]))
        parameters = {**family.fixed, **family.scene({**family.fixed, **drawn, **grid}, rng)}
        second = family.second > 0 and i % family.second == 0
        yield Scene(draw=i, parameters=parameters, rung=rung, seed=int(child.generate_state(1)[0]), second=second)


def _grid(family: Family, point: int) -> tuple[dict[str, Value], int]:
    """Combination `point` of the grid, and the rung of the ladder."""
    found: dict[str, Value] = {}
    for key, levels in family.grid.items():
        point, i = divmod(point, len(levels.values))
        found[key] = levels.values[i]
    return found, -1 if family.ladder is None else point


def specs(
    suites: Sequence[tuple[str, Suite]], engines: Mapping[str, Sequence[Pick]], runs: int | None, seed: int, share: bool
) -> list[Spec]:
    """Every run of a sweep, in the order of its table.

    The first engine of a suite makes all of its runs, shared over the suites as their own numbers
    are; those behind it, if they share, one in `SHARE`.
    """
    if runs is not None and runs < 1:
        raise InvalidValue(f"--runs is {runs}; a sweep needs at least 1.")
    found, number = [], count()
    whole = sum(suite.runs for _, suite in suites)
    for name, suite in suites:
        own = suite.runs if runs is None else -(-runs * suite.runs // whole)
        parts = sum(family.share for family in suite.families)
        for place, family in enumerate(suite.families):
            drawn = list(scenes(name, family, place, -(-own * family.share // parts), seed))
            for i, pick in enumerate(engines[name]):
                # Of a ladder the others make all: that is the stability map.
                least = max(family.points if family.ladder is not None else LEAST, -(-len(drawn) // SHARE))
                kept = min(len(drawn), least) if share and i > 0 else len(drawn)
                found += [_spec(name, family, place, scene, pick, next(number)) for scene in drawn[:kept]]
    return found


def _spec(suite: str, family: Family, place: int, scene: Scene, pick: Pick, index: int) -> Spec:
    reference = (pick.engine, pick.profile) == ("reference", "compiled")
    return Spec(
        suite=suite, index=index, draw=place * 1_000_000 + scene.draw, case=family.case,
        variant=family.variant, parameters=scene.parameters, engine=pick.engine, profile=pick.profile,
        rung=scene.rung, ladder=family.ladder, seed=scene.seed, second=scene.second and reference,
        afford=reference and not family.ends, limit=family.limit, finishes=family.finishes,
        ends=family.ends and reference, max_steps=family.max_steps, time_limit=family.time_limit,
    )  # fmt: skip
