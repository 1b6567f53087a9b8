"""The runs behind the tests of one session, each made when its first test asks for it."""

from __future__ import annotations

import shlex
from collections import OrderedDict
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import pytest

from crossbody import cases, engines
from crossbody.cases import Case, CaseUnsupported, installed
from crossbody.engines import Run
from crossbody.reports.judging.run_verdicts import Entry, verdicts
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.judging.truth_row import truth_row
from crossbody.reports.judging.verdict import Verdict
from crossbody.reports.measuring.truth import Truth
from crossbody.reports.runs import jobs
from crossbody.reports.runs.choice import Pick
from crossbody.reports.testing._parameters import Scene

_Made = TypeVar("_Made")

KEPT = 12
"""Cases, truths and runs that stay in memory; tests come case by case, verdicts are kept for all of them."""


@dataclass(frozen=True, slots=True)
class Chosen:
    """An engine under one profile."""

    engine: str
    profile: str

    @classmethod
    def of(cls, pick: Pick) -> Chosen:
        """The pick, or a skip with its sentence where the engine is not installed."""
        if pick.skipped:
            pytest.skip(pick.skipped)
        return cls(pick.engine, pick.profile)

    def prepare(self, case: Case, **settings: Any) -> Run:
        """As `Engine.prepare`; a case that the engine cannot run is a skip with its sentence."""
        try:
            return engines.load(self.engine).prepare(case, self.profile, **settings)
        except CaseUnsupported as error:
            pytest.skip(str(error))


class Bench:
    """Cases, truths, runs and verdicts, each made once."""

    def __init__(self) -> None:
        self._recent: OrderedDict[Hashable, Any] = OrderedDict()
        self._verdicts: dict[tuple[Scene, Pick], Mapping[str, Verdict]] = {}

    def case(self, scene: Scene) -> Case:
        """The case."""
        return self._kept(("case", scene), lambda: cases.load(scene.name, scene.variant))

    def truth(self, scene: Scene) -> Truth:
        """What it is judged against."""
        return self._kept(("truth", scene), lambda: truth_of(self.case(scene)))

    def entry(self, scene: Scene, pick: Pick) -> Entry:
        """The run, with the audit and the finer run beside it."""
        return self._kept(
            ("entry", scene, pick),
            lambda: jobs.run_case(self.case(scene), [pick], truth=self.truth(scene)).entries[0],
        )

    def verdicts(self, scene: Scene, pick: Pick) -> Mapping[str, Verdict]:
        """Metric -> verdict; "run" alone, with its sentence, where there is no run."""
        if (scene, pick) not in self._verdicts:
            entry = self.entry(scene, pick)
            asked = (self.case(scene), self.truth(scene), repeat(scene))
            rows = verdicts(asked[0], entry, *asked[1:])
            if entry.run is not None:
                rows += truth_row(*asked)
            self._verdicts[scene, pick] = {row.metric: row for row in rows}
        return self._verdicts[scene, pick]

    def _kept(self, key: Hashable, make: Callable[[], _Made]) -> _Made:
        if key not in self._recent:
            self._recent[key] = make()
        self._recent.move_to_end(key)
        while len(self._recent) > KEPT:
            self._recent.popitem(last=False)
        found: _Made = self._recent[key]
        return found


def repeat(scene: Scene) -> str:
    """The command that reproduces the verdicts of a case, but for its engine."""
    return shlex.join(["crossbody", "run", scene.name, "--variant", scene.variant, *installed.options()])
