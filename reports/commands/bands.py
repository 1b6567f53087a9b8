"""What `make bands` does: run all cases on all engines, and store what they give."""

from __future__ import annotations

import sys

from joblib import Parallel, delayed

from crossbody import cases, engines
from crossbody.cases import Case
from crossbody.reports.judging import stored
from crossbody.reports.judging.comparison import Entry, measured
from crossbody.reports.runs import jobs


def _measured(name: str, variant: str) -> list[tuple[Case, Entry, stored.Deviations]]:
    """What all engines that are installed give on one variant."""
    (case,) = jobs.load_cases([name], variant, {})
    result = jobs.run_case(case, jobs.picks(engines.names()), tell=print, refine=False)
    return [(case, entry, measured(case, entry, result.truth)) for entry in result.entries if entry.run]


def main(names: list[str]) -> None:
    """Run cases, all if none is named, one process a core, and store what they gave; each as soon as it is there.

    Raises:
        CrossbodyError: for a name that does not exist.
    """
    wanted = [(name, variant) for name in names or cases.names() for variant in cases.variants(name)]
    for found in Parallel(n_jobs=-1, return_as="generator_unordered")(delayed(_measured)(*one) for one in wanted):
        stored.write(found)


if __name__ == "__main__":
    from crossbody.reports.commands import bands  # workers import it by this name

    bands.main(sys.argv[1:])
