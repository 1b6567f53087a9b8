"""One test for every limit of a case under every engine and profile."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import pytest

from crossbody.cases import Case, installed
from crossbody.cases.defaults import limits_of
from crossbody.cases.loading import OF_USERS
from crossbody.reports.judging.verdict import Verdict, Word
from crossbody.reports.layout import unit_text
from crossbody.reports.runs.choice import Pick
from crossbody.reports.testing import plugin
from crossbody.reports.testing._bench import Bench
from crossbody.reports.testing._parameters import Named, Scene, picks, scenes

ALWAYS = ("finished", "audit", "truth")
RUN = "run"
TOLD = ("case", "variant", "engine", "profile", "metric", "verdict", "value", "unit", "expected", "limit", "tier")


class Outside(Exception):  # noqa: N818 - a verdict, no error
    """A number that is outside its limit."""


class Judged(pytest.Item):
    """One test that crossbody makes; what is off is reported in its own sentence."""

    where = plugin.MARKER

    def __init__(self, **more: Any) -> None:
        super().__init__(nodeid=f"{more['parent'].nodeid}::{more['name']}", **more)
        self.add_marker(plugin.MARKER)

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], *args: Any, **more: Any) -> Any:
        """A verdict, or wrong use, is reported in its own sentence; anything else with its traceback."""
        if isinstance(excinfo.value, Outside):
            return str(excinfo.value)
        if told := installed.sentence(excinfo.value):
            return told
        return super().repr_failure(excinfo, *args, **more)

    def reportinfo(self) -> tuple[str, None, str]:
        """Where the test stands and what it is called."""
        return self.where, None, self.nodeid


class Cases(pytest.Collector):
    """All cases asked for."""

    def collect(self) -> Iterator[pytest.Collector]:
        """One collector a case."""
        for scene in scenes(self.config):
            yield OneCase.from_parent(self, name=str(scene), scene=scene)


class OneCase(pytest.Collector):
    """One variant of a case under every engine."""

    def __init__(self, *, scene: Scene, **more: Any) -> None:
        super().__init__(nodeid=f"{more['parent'].nodeid}::{more['name']}", **more)
        self.scene = scene

    def collect(self) -> Iterator[pytest.Item]:
        """One test for every number that is judged; nothing is run yet."""
        bench = plugin.bench(self.config)
        try:
            case = bench.case(self.scene)
        except (Exception, SystemExit) as error:
            if told := installed.sentence(error):
                raise self.CollectError(told) from None
            raise
        for named in picks(self.config):
            for metric in judged(case, named.pick):
                yield OneLimit.from_parent(
                    self, name=f"{named}::{metric}", scene=self.scene, named=named, metric=metric
                )


def judged(case: Case, pick: Pick) -> tuple[str, ...]:
    """Metrics that are judged for an engine; one that is not installed has one test, to say so."""
    if pick.skipped:
        return (RUN,)
    covering = (limit.metric for limit in limits_of(case) if limit.covers(pick.engine, pick.profile))
    limited = (metric for metric in covering if metric != "*")
    return tuple(dict.fromkeys((*ALWAYS, *(claim.metric for claim in case.claims), *limited)))


class OneLimit(Judged):
    """One number of one run against its limit."""

    def __init__(self, *, scene: Scene, named: Named, metric: str, **more: Any) -> None:
        super().__init__(**more)
        self.scene, self.pick, self.metric = scene, named.pick, metric
        self.where = scene.name if scene.name.endswith(OF_USERS) else plugin.MARKER

    def runtest(self) -> None:
        """Judge; within passes, what is expected-outside is an xfail, what there is not is a skip."""
        bench = plugin.bench(self.config)
        row = self._row(bench)
        self.user_properties += [(name, str(getattr(row, name))) for name in (*TOLD, "why", "command")]
        if row.verdict == Word.SKIPPED:
            pytest.skip(row.why)
        if row.verdict == Word.EXPECTED:
            pytest.xfail(f"{_number(row)}. {row.why}")
        if row.verdict in (Word.OUTSIDE, Word.CRASHED):
            raise Outside(f"{_number(row)}. {row.why}\n{row.command}")

    def _row(self, bench: Bench) -> Verdict:
        rows = bench.verdicts(self.scene, self.pick)
        if self.metric in rows:
            return rows[self.metric]
        if RUN in rows:
            return rows[RUN]
        if rows.get("audit") is not None and rows["audit"].verdict == Word.OUTSIDE:
            pytest.skip(rows["audit"].why)
        pytest.skip(f"{self.metric}: this run has no such number.")


def _number(row: Verdict) -> str:
    wanted = "" if math.isnan(row.expected) else f" where {row.expected:.6g} is expected"
    limit = "" if math.isnan(row.limit) else f", limit {row.limit:.3g}"
    return f"{row.metric} is {row.value:.6g}{unit_text(row.unit)}{wanted}{limit}"
