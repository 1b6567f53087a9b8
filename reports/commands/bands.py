"""What `make bands` does: run all cases on all engines, and store what they give."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence

from joblib import Parallel, delayed

from crossbody import cases, engines
from crossbody.cases import Case
from crossbody.cases.defaults import limits_of
from crossbody.reports import metrics
from crossbody.reports.judging import stored
from crossbody.reports.judging.run_verdicts import Entry, measured
from crossbody.reports.judging.verdict import ROUNDING, limit_for
from crossbody.reports.measuring.truth import Truth, shortened
from crossbody.reports.runs import choice, jobs

NEAR = (0.7, 1.4)
"""Tolerances of the runs beside a stored one, over its own: how far one run of adaptive steps is
off is chance, and moves tenfold with the last digit; the largest of three does not."""
NUDGED = 1.0 + 1e-9
"""Times a fixed step: another grid by less than any number of its run should tell."""
UNSTEADY = 0.01
"""Part of a number by which it moves then if rounding decides it, as it does the order of touches."""


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
    end, unsteady = shortened(result.truth).trusted, _unsteady(case, wanted, result.truth, runs, found)
    return [
        stored.laid(case, one, found[one.engine, one.profile], end, unsteady.get((one.engine, one.profile)))
        for one in runs
    ]


def _unsteady(
    case: Case, wanted: Sequence[choice.Pick], truth: Truth, runs: Sequence[Entry],
    found: Mapping[tuple[str, str], stored.Deviations],
) -> dict[tuple[str, str], list[str]]:  # fmt: skip
    """Metrics of engines that step on a fixed grid, which another one by a change of rounding's size moves."""
    steps = {
        (one.engine, one.profile): NUDGED * float(one.settings["dt"])
        for one in runs if "dt" in one.settings and "rtol" not in one.settings
    }  # fmt: skip
    asked = {f"{engine}:{profile}.dt": dt for (engine, profile), dt in steps.items()}
    picks = [pick for pick in wanted if (pick.engine, pick.profile) in steps]
    beside = jobs.run_case(case, picks, None, print, asked, truth=truth, refine=False) if picks else None
    entries = {(one.engine, one.profile): one for one in (beside.entries if beside else ()) if one.run}
    moved = {key: measured(case, entries[key], truth) if key in entries else {} for key in steps}
    return {key: [name for name, value in found[key].items() if _apart(value, moved[key].get(name))] for key in steps}


def _apart(one: float, other: float | None) -> bool:
    """Whether a number is another one, or gone."""
    if other is None or math.isfinite(one) != math.isfinite(other):
        return True
    return math.isfinite(one) and abs(one - other) > UNSTEADY * one + ROUNDING


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
