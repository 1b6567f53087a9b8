"""Steps that the reason of a limit names are those that the engines take which it judges."""

from __future__ import annotations

import re

import pytest

from crossbody import cases, engines
from crossbody.cases import Limit
from crossbody.cases.errors import EngineUnavailable
from crossbody.cases.loading import module

STEP = re.compile(r"(?:Euler at|fixed steps? of|and steps of) (\S+) ms")


def steps_of(limit: Limit, case: cases.Case) -> list[float]:
    """Default steps, ms, of the profiles that a limit judges and that have one."""
    found: list[float] = []
    for name in engines.names() if limit.engine == "*" else [limit.engine]:
        try:
            engine = engines.load(name)
        except EngineUnavailable:
            continue
        for profile in engine.profiles if limit.profile == "*" else [limit.profile]:
            if engine.why_not(case, profile) is None and "dt" in (offered := engine.offered(case, profile)):
                found.append(1e3 * float(offered["dt"].default))
    return found


@pytest.mark.parametrize("name", cases.REGISTRY.own())
def test_steps_in_reasons_of_limits_are_taken(name: str) -> None:
    for variant in module(name).VARIANTS:
        case = cases.load(name, variant)
        for limit in case.limits:
            for told in STEP.findall(limit.why):
                taken = steps_of(limit, case)
                assert not taken or pytest.approx(float(told)) in taken, (variant, limit)
