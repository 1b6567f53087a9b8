"""A limit that is wider for one engine is needed by what that engine gives, and not much wider than that."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest
from friction_scenes import sphere_on_floor

from crossbody import cases
from crossbody.cases import Case, Limit
from crossbody.cases.defaults import KNOWN, default_limits, limits_of
from crossbody.reports import metrics
from crossbody.reports.judging import stored
from crossbody.reports.judging.verdict import limit_for

NEEDED = 10.0
"""A run must come so near to the limit of all engines before one of them has a wider one."""
WIDE = 100.0
"""Times what the worst stored run gives: other parameters and horizons are within as well."""


def widened(case: Case) -> Iterator[tuple[Limit, float, float]]:
    """Limits of one engine that are wider than those of all, these, and the largest stored deviation under each."""
    limits, runs = limits_of(case), stored._table()[case.label]["runs"]
    for limit in limits:
        everyone = limit_for([x for x in limits if x.engine == "*"], limit.metric, "", "")
        if limit.engine == "*" or limit.known or everyone is None or limit.value <= everyone.value:
            continue
        gave = [
            float(run["deviations"].get(limit.metric, math.nan))
            for who, run in runs.items()
            if limit_for(limits, limit.metric, *who.split(":")) is limit
        ]
        yield limit, everyone.value, max((x for x in gave if math.isfinite(x)), default=0.0)


def worst(names: Iterable[str], *, default: bool) -> dict[tuple[str, str, str], tuple[float, float, float]]:
    """Of such limits of some cases, by metric and engine: the widest, the least of all engines, and what runs gave."""
    found: dict[tuple[str, str, str], tuple[float, float, float]] = {}
    for case in (cases.load(name, variant) for name in names for variant in cases.variants(name)):
        for limit, everyone, gave in widened(case):
            if (limit in default_limits(case)) == default:
                key = limit.metric, limit.engine, limit.profile
                before = found.get(key, (0.0, math.inf, 0.0))
                found[key] = max(before[0], limit.value), min(before[1], everyone), max(before[2], gave)
    return found


@pytest.mark.parametrize("name", [*cases.names(), ""])
def test_a_wider_limit_of_one_engine_is_needed(name: str) -> None:
    """By the case that has it; one that every case has, by any of them."""
    limits = worst([name], default=False) if name else worst(cases.names(), default=True)
    idle = [(key, numbers) for key, numbers in limits.items() if numbers[2] * NEEDED < numbers[1]]
    wide = [(key, numbers) for key, numbers in limits.items() if numbers[0] > WIDE * numbers[2]]
    assert idle == []
    assert wide == []


@pytest.mark.parametrize("name", cases.names())
def test_a_reason_reads_alone(name: str) -> None:
    """It stands behind a number and a limit in the terminal: what follows on a word left out says nothing there."""
    for variant in cases.variants(name):
        for limit in limits_of(cases.load(name, variant)):
            assert limit.known or limit.why, limit
            assert limit.why.split(" ")[0] not in ("of", "to", "by", "than", "times"), limit


@pytest.mark.parametrize("name", cases.names())
def test_a_property_that_leaves_a_stored_run_without_a_number_does_so_with_any_parameters(name: str) -> None:
    """Where nothing is stored a missing number would be outside; of the stored run it is expected-outside."""
    for variant in cases.variants(name):
        case = cases.load(name, variant)
        limits = limits_of(case)
        told = {claim.metric for claim in case.claims} | {  # or by an engine that hides what they need
            name for name, metric in metrics.of(case).items() if getattr(metric, "NEEDS", "")
        }
        for who, run in stored._table()[case.label]["runs"].items():
            lacking = {metric for metric, value in run["deviations"].items() if value == "nan"} - told
            found = {metric: limit_for(limits, metric, *who.split(":")) for metric in lacking}
            assert [(who, metric) for metric, one in found.items() if one and one.known and not one.covers_none] == []


BALL = """
<mujoco><worldbody><geom type="plane" size="5 5 .1" condim="{0}"/>
<body pos="0 0 .1"><freejoint/><geom size=".1" condim="{0}"/></body></worldbody></mujoco>
"""


@pytest.mark.parametrize("who", KNOWN)
@pytest.mark.parametrize("file", [False, True])
def test_engines_with_a_friction_of_their_own_are_known_to_be_off_in_any_scene_with_it(
    who: tuple[str, str], file: bool, tmp_path: Path
) -> None:
    """And in none without."""
    for mu, known in ((3, True), (1, False)):
        if file:
            path = tmp_path / f"{mu}.xml"
            path.write_text(BALL.format(mu), encoding="utf-8")
            case = cases.load(str(path), friction=1)
        else:
            case = cases.from_scene(sphere_on_floor(0.5 if known else 0.0, 0.1))
        limit = limit_for(limits_of(case), "position", *who)
        own = file and who == ("drake", "default")  # of a file its bounds are springs too
        assert limit is not None
        assert bool(limit.known) == (known or own)
