"""What `make bands` does: run all cases on all engines, and store what they give."""

from __future__ import annotations

import math
import sys

from joblib import Parallel, delayed

from crossbody import cases, engines
from crossbody.cases import Case
from crossbody.cases.defaults import limits_of
from crossbody.reports import metrics
from crossbody.reports.judging import stored
from crossbody.reports.judging.run_verdicts import Entry, measured
from crossbody.reports.judging.verdict import limit_for
from crossbody.reports.measuring.truth import shortened
from crossbody.reports.runs import choice, jobs

NEAR = (0.7, 1.4)
"""Tolerances of the runs beside a stored one, over its own: how far one run of adaptive steps is
off is chance, and moves tenfold with the last digit; the largest of three does not."""


def _measured(name: str, variant: str) -> list[stored.Laid]:
    """What all installed engines give on one variant, the largest near their tolerances."""
    (case,) = choice.load_cases([name], variant, {})
    wanted = choice.picks(engines.names())
    result = jobs.run_case(case, wanted, tell=print, refine=False)
    runs = [one for one in result.entries if one.run]
    found: dict[tuple[str, str], stored.Deviations] = {
        (one.engine, one.profile): measured(case, one, result.truth) for one in runs
    }
    for own in {one.settings["rtol"] for one in runs if "rtol" in one.settings}:
        alike = {(one.engine, one.profile) for one in runs if one.settings.get("rtol") == own}
        adaptive = [pick for pick in wanted if (pick.engine, pick.profile) in alike]
        for near in NEAR:
            beside = jobs.run_case(case, adaptive, near * float(own), print, truth=result.truth, refine=False)
            for one in (one for one in beside.entries if one.run):
                key = (one.engine, one.profile)
                found[key] = _largest(found[key], measured(case, one, result.truth), _known(case, one))
    end = shortened(result.truth).trusted
    return [stored.laid(case, one, found[one.engine, one.profile], end) for one in runs]


def _known(case: Case, entry: Entry) -> frozenset[str]:
    """Metrics that a known property explains, by half to twice what is stored: the run's own stands."""
    limits = limits_of(case)
    shown = limit_for(limits, "*", entry.engine, entry.profile)
    named = {limit.metric for limit in limits} | set(metrics.of(case))
    found = {name: limit_for(limits, name, entry.engine, entry.profile) or shown for name in named}
    return frozenset(name for name, limit in found.items() if limit is not None and limit.known)


def _largest(one: stored.Deviations, other: stored.Deviations, own: frozenset[str]) -> stored.Deviations:
    """Metric by metric; a number that only one of them has, and those of `own`, stay as `one` has them."""
    return {
        metric: value if metric in own else _larger(value, other.get(metric, math.nan)) for metric, value in one.items()
    }


def _larger(one: float, other: float) -> float:
    return max(one, other) if math.isfinite(one) and math.isfinite(other) else one


def main(names: list[str]) -> None:
    """Run cases, all if none is named, one process a core, and store what they gave; each as soon as it is there."""
    wanted = [(name, variant) for name in names or cases.names() for variant in cases.variants(name)]
    for found in Parallel(n_jobs=-1, return_as="generator_unordered")(delayed(_measured)(*one) for one in wanted):
        stored.write(found)


if __name__ == "__main__":
    from crossbody.reports.commands import bands  # workers import it by this name

    bands.main(sys.argv[1:])
