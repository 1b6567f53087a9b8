"""What a run leaves on disk is what it was: every field of a motion, every number of a table; or it is told."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from crossbody import cases, engines
from crossbody.cases.errors import OwnFault
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.runs import choice, jobs, read_back, study
from crossbody.reports.runs.jobs import CaseResult
from crossbody.reports.runs.store import Trace


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


Changed = Callable[[Any], Any]


def of_array(change: Callable[[Any], Any], *names: str) -> Changed:
    """Return a change of arrays of a motion."""
    return lambda run: replace(run, **{name: change(np.array(getattr(run, name))) for name in names})


def nought(array: Any) -> Any:
    return np.where(np.isnan(array), 0.0, array)


BESIDE: dict[str, Changed] = {
    "nought where nothing is compared": of_array(nought, "q"),
    "unknown at its last sample": of_array(lambda a: np.where(np.isnan(np.roll(a, -1, axis=0)), np.nan, a), "q"),
    "one sample late": of_array(lambda a: np.roll(a, 1, axis=0), "q"),
    "velocities of the other sign": of_array(np.negative, "v"),
    "gaps in mm": of_array(lambda a: 1e3 * a, "gap"),
    "forces of single precision": of_array(lambda a: 1.0 - (1.0 - a).astype(np.float32), "lam"),
    "energies in another order": of_array(lambda a: a[:, ::-1], "energy"),
    "modes of nothing": of_array(lambda a: np.where(a < 0, 0, a).astype(np.int8), "mode"),
}


@pytest.fixture(scope="module")
def known_in_part() -> CaseResult:
    """A run beside a truth that is trusted for a fifth of it."""
    case = cases.load("bouncing_ball:linear")
    return jobs.run_case(case, choice.picks(["mujoco:matched"]), truth=replace(truth_of(case), trusted=1.0))


@pytest.mark.parametrize("what", BESIDE)
def test_a_truth_beside_a_run_is_held_against_the_truth_and_not_against_what_put_it_there(
    what: str, known_in_part: CaseResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own, change = study._beside, BESIDE[what]
    (right := tmp_path / "right").mkdir()
    study.write_case(right, known_in_part, "")
    monkeypatch.setattr(study, "_beside", lambda *given: change(own(*given)))
    (wrong := tmp_path / "wrong").mkdir()
    with pytest.raises(OwnFault, match="of the truth beside it"):
        study.write_case(wrong, known_in_part, "")


ABOUT: dict[str, Callable[[dict[str, Any]], None]] = {
    "coordinates": lambda about: about["coordinates"].append(about["coordinates"][0]),
    "contacts": lambda about: about["contacts"].reverse() or about["contacts"].append("another"),
    "parameters": lambda about: about["parameters"].update(height=2.0),
    "units": lambda about: about["units"].update(height="mm"),
    "settings": lambda about: about.get("settings", {}).update(rtol=1e-3),
    "scales": lambda about: about.get("scales", []).append(about.get("scales", [0.0]).pop() * 2.0),
}


@pytest.mark.parametrize("what", ABOUT)
def test_what_is_said_beside_a_motion_is_held_against_the_case(
    what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own, found = study.save, result("bouncing_ball:linear", "reference:compiled")

    def save(path: Path, trace: Trace) -> None:
        own(path, trace)
        told(path, lambda about: ABOUT[what](about["about"]))

    monkeypatch.setattr(study, "save", save)
    with pytest.raises(OwnFault, match={"scales": "its position"}.get(what, what)):
        study.write_case(tmp_path, found, "")


def test_provenance_that_is_another_one_is_told(tmp_path: Path) -> None:
    (part := tmp_path / "part").mkdir()
    rows = study.write_case(part, result("bouncing_ball:linear", "reference:compiled"), "")
    for i, name in enumerate(("provenance.json", "audit.json", "verdicts.json", "verdicts.parquet")):
        (out := tmp_path / f"out{i}").mkdir()
        study.assemble(out, [part], {"command": "crossbody run", "seed": 3})
        (out / name).write_bytes((out / name).read_bytes().replace(b"crossbody run", b"crossbody fun"))
        with pytest.raises(OwnFault, match="provenance"):
            read_back.check_tables(out, [part], rows, {"command": "crossbody run", "seed": 3})


@pytest.mark.parametrize("name", ["verdicts.csv", "verdicts.json", "audit.csv", "audit.json", "traces/0001.parquet"])
def test_tables_that_are_not_those_of_the_cases_are_told(name: str, tmp_path: Path) -> None:
    (part := tmp_path / "part").mkdir()
    rows = study.write_case(part, result("bouncing_ball:linear", "reference:compiled"), "")
    (out := tmp_path / "out").mkdir()
    study.assemble(out, [part], {})
    (out / name).write_bytes((out / name).read_bytes().replace(b"reference", b"Reference"))
    with pytest.raises(RuntimeError, match="is not what was judged"):
        read_back.check_tables(out, [part], rows, {})


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
