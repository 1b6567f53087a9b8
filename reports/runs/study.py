"""A finished comparison on disk: verdicts, motions, audit, provenance, and the page made from them."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from pyarrow.csv import ConvertOptions, ParseOptions, read_csv

from crossbody.cases import Case, OutputError, Trajectory
from crossbody.cases.arrays import Floats, distinct
from crossbody.cases.scene_contacts import contacts, turning
from crossbody.cases.scene_plain import plain
from crossbody.reports.judging.comparison import judged, unlike_stored
from crossbody.reports.judging.run_verdicts import Entry
from crossbody.reports.judging.verdict import COLUMNS, Row
from crossbody.reports.measuring.alignment import aligned
from crossbody.reports.measuring.scale import scale_of, still
from crossbody.reports.measuring.truth import TRUTH, Truth
from crossbody.reports.metrics.position import gap_scale_of
from crossbody.reports.runs import files, read_back, watch
from crossbody.reports.runs.jobs import CaseResult
from crossbody.reports.runs.store import Trace, as_plain, save
from crossbody.reports.runs.thin import keep
from crossbody.reports.voice import finite

if TYPE_CHECKING:
    import pandas as pd

CASE = "case.json"
AUDIT = {
    **dict.fromkeys(("case", "engine", "profile", "quantity", "reference", "value"), str),
    "difference": float, "tolerance": float, "same": bool,
}  # fmt: skip
_ARROW = {str: pa.string(), float: pa.float64(), bool: pa.bool_()}


def judge(results: Sequence[CaseResult], commands: Mapping[str, str]) -> list[Row]:
    """Verdicts of all cases; `commands` names what reproduces each case (by its label)."""
    try:
        return [row for result in results for row in _judged(result, commands[result.case.label])]
    finally:
        watch.unlimited()


def _judged(result: CaseResult, command: str) -> list[Row]:
    """Verdicts of one case.

    Raises:
        RuntimeError: where a run has none: it would count as within.
    """
    found = judged(result.case, result.entries, result.truth, command, _begun)
    rows = [row.row() for row in (*found, *unlike_stored(result.case, command))]
    shown = {(row["engine"], row["profile"]) for row in rows}
    if lost := [f"{one.engine}:{one.profile}" for one in result.entries if (one.engine, one.profile) not in shown]:
        raise RuntimeError(f"{result.case.label}: nothing is said of {', '.join(lost)}.")
    return rows


def _begun(label: str) -> str:
    """Let a metric take as long as an engine; why it is not to be begun again, if it did not come back."""
    watch.limited(label)
    return watch.lost(label)


def write(out: Path, results: Sequence[CaseResult], rows: Sequence[Row], provenance: Mapping[str, Any]) -> None:
    """Write everything but the page into a folder."""
    _write_judged(out, rows, _audit(results), provenance)
    _save_traces(out, [trace for result in results for trace in traces(result)])


def _write_judged(out: Path, rows: Sequence[Row], audited: Sequence[Row], provenance: Mapping[str, Any]) -> None:
    write_rows(out / "verdicts", rows, COLUMNS, provenance)
    write_rows(out / "audit", audited, AUDIT, provenance)
    (out / "provenance.json").write_text(json.dumps(provenance, indent=2, default=str), encoding="utf-8")


def write_case(made: Path, result: CaseResult, command: str) -> list[Row]:
    """Write the verdicts, audit and motions of one case into a folder of their own; the verdicts."""
    judged = judge([result], {result.case.label: command})
    told = {"verdicts": judged, "audit": _audit([result])}
    (made / CASE).write_text(json.dumps(told, default=as_plain), encoding="utf-8")
    motions = traces(result)
    _save_traces(made, motions)
    read_back.check_case(made, result, judged, motions)
    return judged


def assemble(out: Path, parts: Sequence[Path], provenance: Mapping[str, Any]) -> list[Row]:
    """Join the folders of `write_case` into one study, as `write` does of results in memory; its verdicts."""
    told = [_read_case(part) for part in parts]
    rows = [row for one in told for row in one["verdicts"]]
    _write_judged(out, rows, [row for one in told for row in one["audit"]], provenance)
    (out / "traces").mkdir()
    traces = [part / "traces" / name for part in parts for name in files.listed(part, "traces")]
    for i, trace in enumerate(traces):
        name = f"{trace.parent.name}/{trace.name}"
        (out / "traces" / f"{i:04d}.parquet").write_bytes(files.read_inside(trace.parent.parent, name))
    read_back.check_tables(out, parts, rows, provenance)
    return rows


def _read_case(part: Path) -> dict[str, list[dict[str, Any]]]:
    try:
        told: Any = files.decoded(files.read_inside(part, CASE))
        return {name: [dict(row) for row in told[name]] for name in ("verdicts", "audit")}
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        raise OutputError(f"{part} is not part of a run; remove {part.parent}.") from None


def _save_traces(out: Path, traces: Sequence[Trace]) -> None:
    (out / "traces").mkdir()
    for i, trace in enumerate(traces):
        save(out / "traces" / f"{i:04d}.parquet", trace)


def write_table(stem: Path, rows: pd.DataFrame, provenance: Mapping[str, Any]) -> None:
    """One table as Parquet (provenance in its metadata), CSV and JSON (provenance beside the rows)."""
    texts = rows.select_dtypes(exclude=["number", "bool"])
    rows.to_csv(stem.with_suffix(".csv"), index=False, quoting=_quoting(texts.to_numpy().ravel()))
    plain = json.loads(rows.to_json(orient="records", double_precision=15))
    _write_both(stem, pa.Table.from_pandas(rows, preserve_index=False), plain, provenance)


def write_rows(stem: Path, rows: Sequence[Row], kinds: Mapping[str, type], provenance: Mapping[str, Any]) -> None:
    """The same of plain rows whose columns are known.

    Parquet is made of what the CSV says: `pa.array` imports pandas (.3 s) to see whether it is
    given one of its own.
    """
    path = stem.with_suffix(".csv")
    told = [["" if value != value else value for value in (row[name] for name in kinds)] for row in rows]
    with path.open("w", encoding="utf-8", newline="") as file:
        lines = csv.writer(file, lineterminator="\n", quoting=_quoting(chain(*told)))
        lines.writerows([kinds, *told])
    table = read_csv(
        path,
        parse_options=ParseOptions(newlines_in_values=True),
        convert_options=ConvertOptions(column_types={name: _ARROW[kind] for name, kind in kinds.items()}),
    )
    _write_both(stem, table, [{name: finite(row[name]) for name in kinds} for row in rows], provenance)


def _quoting(cells: Iterable[object]) -> Literal[0, 1]:
    """What is quoted: a carriage return is text to the writer, the end of a line to readers."""
    returns = any("\r" in cell for cell in cells if isinstance(cell, str))
    return csv.QUOTE_ALL if returns else csv.QUOTE_MINIMAL


def _write_both(stem: Path, arrow: pa.Table, plain: Sequence[Row], provenance: Mapping[str, Any]) -> None:
    told = json.dumps(provenance, default=str)
    metadata = {**(arrow.schema.metadata or {}), b"provenance": told.encode()}
    pq.write_table(arrow.replace_schema_metadata(metadata), stem.with_suffix(".parquet"))
    content = {"provenance": json.loads(told), "rows": plain}
    stem.with_suffix(".json").write_text(json.dumps(content, indent=1), encoding="utf-8")


def _audit(results: Sequence[CaseResult]) -> list[Row]:
    return [
        {
            "case": result.case.label, "engine": entry.engine, "profile": entry.profile,
            "quantity": row.quantity, "reference": row.theirs, "value": row.mine,
            "difference": row.difference, "tolerance": row.tolerance, "same": bool(row.ok),
        }
        for result in results for entry in result.entries for row in entry.audit
    ]  # fmt: skip


def _about(case: Case, engine: str, profile: str) -> dict[str, Any]:
    found = {
        "case": case.name, "variant": case.variant, "title": case.title, "mechanism": case.mechanism,
        "engine": engine, "profile": profile,
        "coordinates": [{"name": c.name, "unit": c.unit} for c in case.coordinates],
        "contacts": list(case.contacts), "parameters": dict(case.parameters), "units": dict(case.units),
    }  # fmt: skip
    if case.scene is None or not case.general:
        return found
    met = tuple(contact.pair for contact in contacts(case.scene))
    drawn = case.scene.replace(pairs=met, actuators=(), pushes=())  # what a picture of it needs
    return found | {"scene": plain(drawn), "turning": sorted(turning(case.scene).intersection(case.contacts))}


def traces(result: CaseResult) -> list[Trace]:
    """Return the motions of a case as they are stored: the truth's first, then every engine's beside it."""
    case, truth = result.case, result.truth
    about = _about(case, TRUTH, "") | {"tier": truth.tier.value, "source": truth.source}
    about["scales"] = scale_of(truth.trajectory, case).tolist()
    about["gap_scales"], about["still"] = _gap_scales(truth, case), still(truth.trajectory)
    found = [Trace(about=about | _inputs(case, truth.trajectory), run=truth.trajectory)]
    return found + [_trace(case, entry, truth) for entry in result.entries if entry.run is not None]


def _gap_scales(truth: Truth, case: Case) -> list[float]:
    """What the gap of every row that touches is measured by, m or rad; 0 of the others."""
    rows = case.law.touches
    found = np.zeros(len(rows))
    if rows.any():
        found[rows] = gap_scale_of(truth, case, rows)
    return [float(scale) for scale in found]


def _trace(case: Case, entry: Entry, truth: Truth) -> Trace:
    assert entry.run is not None
    about = _about(case, entry.engine, entry.profile) | {"settings": dict(entry.settings)}
    about["took_s"] = entry.took_s
    about["steps"] = _steps((entry.run if entry.clock is None else entry.clock.run).t)
    about |= _inputs(case, entry.run)
    return Trace(about=about, run=entry.run, truth=_beside(truth, entry.run, case))


def _beside(truth: Truth, run: Trajectory, case: Case) -> Trajectory | None:
    """The truth at every sample of a run, impacts matched as in metrics; NaN where nothing is compared."""
    if not len(run.t):
        return None
    inside, exact = aligned(truth, run, case)
    if not inside.any():
        return None

    def put(rows: Floats) -> Floats:
        whole = np.full((len(inside), rows.shape[1]), np.nan)
        whole[inside] = rows
        return whole

    return Trajectory(
        t=put(exact.t[:, None])[:, 0], q=put(exact.q), v=put(exact.v), gap=put(exact.gap), lam=put(exact.lam),
        energy=put(exact.energy),
        mode=np.where(inside[:, None], np.nan_to_num(put(exact.mode.astype(np.float64))), -1).astype(np.int8),
    )  # fmt: skip


def _inputs(case: Case, run: Trajectory) -> dict[str, Any]:
    """Names, instants and values (nu, m) of what acted on a run from outside, as many as a plot shows; if anything."""
    from crossbody.reports.measuring.controlled import acting  # numba, which a page does without

    given = acting(case, run)
    if given is None or not given.names or not len(given.times):
        return {}
    kept = distinct(*(keep(given.times, column, np.zeros(0)) for column in given.values.T))
    again = given is not case.inputs and given is not run.inputs
    told = {"inputs": [list(given.names), given.times[kept].tolist(), given.values[kept].T.tolist()]}
    return told | {"asked_again": again}


def _steps(t: Floats) -> list[list[float]]:
    """Start and length of the steps between the instants t, s: no more of them than a plot shows."""
    ends = distinct(t)
    starts, lengths = ends[:-1], np.diff(ends)
    kept = keep(starts, np.log(lengths), np.zeros(0))
    return [starts[kept].tolist(), lengths[kept].tolist()]


def read_json(path: Path) -> Any:
    """A JSON file of a study; no link is followed.

    A table (any file but `provenance.json`) is checked: `rows` is a list of objects, `provenance` an object.

    Raises:
        OutputError: if it is not there, not readable, a link, or not of that form; names file and field.
    """
    try:
        found = files.decoded(files.read_inside(path.parent, path.name))
    except OutputError:
        raise
    except (OSError, ValueError, RecursionError):
        raise OutputError(f"{path.parent} is not a finished report folder: {path.name} cannot be read.") from None
    if not isinstance(found, dict):
        raise OutputError(f"{path} holds a {type(found).__name__} where an object is expected.")
    return found if path.name == "provenance.json" else _checked(path, found)


def _checked(path: Path, table: dict[str, Any]) -> dict[str, Any]:
    rows, told = table.get("rows"), table.get("provenance", {})
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise OutputError(f"{path}: rows is not a list of objects.")
    if not isinstance(told, dict):
        raise OutputError(f"{path}: provenance is not an object.")
    return table


def check_fields(path: Path, rows: Sequence[Mapping[str, Any]], kinds: Mapping[str, tuple[type, ...]]) -> None:
    """Check the types of the fields of a table that was read.

    Args:
        path: of the table.
        rows: its rows.
        kinds: field -> the types that it may have; a field that is not there is None.

    Raises:
        OutputError: naming file, row and field of the first that has another.
    """
    for i, row in enumerate(rows):
        for name, kind in kinds.items():
            if not isinstance(row.get(name), kind):
                raise OutputError(
                    f"{path}: rows[{i}].{name} is {str(row.get(name))[:60]!r}; it must be {_words(kind)}."
                )


def _words(kinds: tuple[type, ...]) -> str:
    named = {str: "a text", float: "a number", int: "", bool: "true or false", type(None): "null", dict: "an object"}
    return " or ".join(dict.fromkeys(named.get(kind, kind.__name__) for kind in kinds if named.get(kind, "x")))
