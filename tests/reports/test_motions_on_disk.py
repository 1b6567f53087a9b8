"""What a run leaves on disk is what it was: every field of a motion, every number of a table; or it is told."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from crossbody import cases, engines
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.runs import choice, jobs, read_back, study
from crossbody.reports.runs.jobs import CaseResult


def result(label: str, who: str) -> CaseResult:
    case = cases.load(*label.split(":"))
    return jobs.run_case(case, choice.picks([who]), truth=truth_of(case))


@pytest.mark.parametrize(
    ("label", "who"),
    [("newtons_cradle:sliders", "reference:compiled"), ("rolling_sphere:side_spin", "reference:compiled"),
     ("bouncing_ball:listing", "mujoco:default"), ("red_body:resolved", "pinocchio:impulse")],
)  # fmt: skip
def test_a_run_is_read_back_as_it_was(label: str, who: str, tmp_path: Path) -> None:
    """With impulses of events, an account, what was counted, and rows that have no number."""
    (part := tmp_path / "part").mkdir()
    found = result(label, who)
    rows = study.write_case(part, found, "crossbody run")
    (out := tmp_path / "out").mkdir()
    assert len(study.assemble(out, [part], {})) == len(rows)


def column(path: Path, name: str) -> None:
    """Change a number of a column of a file."""
    table = pq.ParquetFile(path).read()
    values = np.array(table[name].to_numpy())
    values[len(values) // 2] += 1e-9
    table = table.set_column(table.column_names.index(name), name, pa.array(values))
    pq.write_table(table, path)


def told(path: Path, change: Callable[[dict[str, Any]], None]) -> None:
    """Change what is said beside a motion."""
    table = pq.ParquetFile(path).read()
    about = json.loads(table.schema.metadata[b"crossbody"])
    change(about)
    pq.write_table(table.replace_schema_metadata({b"crossbody": json.dumps(about)}), path)


def cell(part: Path, table: str, name: str) -> None:
    """Change one cell of a table."""
    whole = json.loads((part / study.CASE).read_text())
    whole[table][0][name] = "other"
    (part / study.CASE).write_text(json.dumps(whole))


CHANGES: dict[str, Callable[[Path], None]] = {
    "q": lambda part: column(part / "traces/0001.parquet", "q0"),
    "lam": lambda part: column(part / "traces/0000.parquet", "lam0"),
    "ledger": lambda part: column(part / "traces/0001.parquet", "work0"),
    "q of the truth beside it": lambda part: column(part / "traces/0001.parquet", "truth_q0"),
    "wall_s": lambda part: told(part / "traces/0001.parquet", lambda about: about.update(wall_s=1.0)),
    "events": lambda part: told(part / "traces/0001.parquet", lambda about: about["events"].pop()),
    "engine": lambda part: told(part / "traces/0001.parquet", lambda about: about["about"].update(engine="drake")),
    "took_s": lambda part: told(part / "traces/0001.parquet", lambda about: about["about"].update(took_s=0.0)),
    "files": lambda part: (part / "traces/0001.parquet").unlink(),
    "why": lambda part: cell(part, "verdicts", "why"),
    "reference": lambda part: cell(part, "audit", "reference"),
}


@pytest.mark.parametrize("what", CHANGES)
def test_what_is_stored_otherwise_is_told(what: str, tmp_path: Path) -> None:
    found = result("bouncing_ball:linear", "reference:compiled")
    rows, traces = study.write_case(tmp_path, found, ""), study.traces(found)
    read_back.check_case(tmp_path, found, rows, traces)
    CHANGES[what](tmp_path)
    with pytest.raises(RuntimeError, match=what):
        read_back.check_case(tmp_path, found, rows, traces)


@pytest.mark.parametrize("name", ["verdicts.csv", "verdicts.json", "audit.csv", "audit.json", "traces/0001.parquet"])
def test_tables_that_are_not_those_of_the_cases_are_told(name: str, tmp_path: Path) -> None:
    (part := tmp_path / "part").mkdir()
    rows = study.write_case(part, result("bouncing_ball:linear", "reference:compiled"), "")
    (out := tmp_path / "out").mkdir()
    study.assemble(out, [part], {})
    (out / name).write_bytes((out / name).read_bytes().replace(b"reference", b"Reference"))
    with pytest.raises(RuntimeError, match="is not what was judged"):
        read_back.check_tables(out, [part], rows)


def test_impulses_are_kept() -> None:
    """The law above would pass where no event has one."""
    run = engines.load("reference").prepare(cases.load("newtons_cradle", "sliders"), "compiled").run()
    assert any(event.impulse for event in run.events)


@pytest.mark.parametrize("who", ["mujoco:matched", "mujoco:default", "pinocchio:admm"])
def test_the_time_of_a_run_is_that_of_its_steps(who: str) -> None:
    """Of thousands of steps nearly all; a clock read before or behind them has next to nothing."""
    engine, profile = who.split(":")
    made = engines.load(engine).prepare(cases.load("bouncing_ball", "listing"), profile)
    made.run()
    began = perf_counter()
    run = made.run()
    took = perf_counter() - began
    assert 0.2 * took < run.wall_s <= took
