"""What is on disk is what was judged: a run reads its own tables and motions back, column by column.

What differs is a failure of crossbody itself, since a table that is not what was judged says nothing of any engine.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from crossbody.cases import Ledger, Trajectory
from crossbody.cases.arrays import Floats, distinct
from crossbody.cases.errors import OwnFault
from crossbody.reports.judging.run_verdicts import Entry
from crossbody.reports.judging.verdict import Row
from crossbody.reports.measuring.alignment import aligned
from crossbody.reports.measuring.apart import errors
from crossbody.reports.measuring.truth import TRUTH
from crossbody.reports.runs.jobs import CaseResult
from crossbody.reports.runs.store import Trace, as_plain, load

SIGNALS = ("q", "v", "gap", "lam", "energy", "mode")
SAME = 1e-9
"""Part of an error by which it may be another one."""
CLOSE, SIDES = 1e-9, 4
"""Part of the largest by which the truth beside a motion may be another one, but for so many samples beside each event:
a truth that is integrated anew may tell its instant from the other side."""
NOT_KEPT = (
    "switches",
    "inputs",
    "sol",
    "determined_until",
    "undetermined_by",
    "unique_until",
    "searched_until",
    "energy_gained",
    "energy_handed",
)
"""Of a motion, what pages and later comparisons do not ask for."""


def check_case(made: Path, result: CaseResult, judged: Sequence[Row], traces: Sequence[Trace]) -> None:
    """Check the folder of one case against what was judged.

    Args:
        made: the folder.
        result: the runs.
        judged: their verdicts.
        traces: their motions, with the truth beside them.

    Raises:
        OwnFault: naming what differs.
    """
    told = json.loads((made / "case.json").read_text(encoding="utf-8"))
    _expect(result.case.label, [*_rows(told["verdicts"], judged, "verdict"), *_audits(told["audit"], result)])
    entries = [None, *(one for one in result.entries if one.run is not None)]
    paths = sorted((made / "traces").iterdir())
    if not len(paths) == len(entries) == len(traces):
        _expect(result.case.label, [f"{len(entries)} motions are {len(paths)} files"])
    found = [load(path) for path in paths]
    for one, trace, entry in zip(found, traces, entries, strict=True):
        run = result.truth.trajectory if entry is None or entry.run is None else entry.run
        differing = [*_named(one.about, entry, result), *_read(one, run, trace)]
        if entry is not None:
            differing += [*_beside(one, run, result), *_errors(one, found[0], result, judged, entry)]
        _expect(f"{result.case.label} {TRUTH if entry is None else entry.engine}", differing)


def check_tables(out: Path, parts: Sequence[Path], rows: Sequence[Row], provenance: Mapping[str, Any]) -> None:
    """Check the tables and motions of a study against those of its cases.

    Args:
        out: folder of the study.
        parts: folders of its cases, in order.
        rows: its verdicts.
        provenance: what it depends on besides its numbers.

    Raises:
        OwnFault: naming what differs.
    """
    told = [json.loads((part / "case.json").read_text(encoding="utf-8")) for part in parts]
    audited = [row for one in told for row in one["audit"]]
    _expect("the study", _rows([row for one in told for row in one["verdicts"]], rows, "verdict"))
    said = [json.loads((out / "provenance.json").read_text(encoding="utf-8"))]
    for name, wanted in (("verdicts", rows), ("audit", audited)):
        for found, beside in _tables(out / name):
            _expect(name, _rows(found, wanted, "row"))
            said += [beside] if beside is not None else []
    if any(_text(one) != _text(provenance, str) for one in said):
        _expect("the study", ["its provenance is another one"])
    own = [path for part in parts for path in sorted((part / "traces").iterdir())]
    copies = sorted((out / "traces").iterdir())
    if len(own) != len(copies) or any(a.read_bytes() != b.read_bytes() for a, b in zip(own, copies, strict=True)):
        _expect("the study", ["its motions are not those of its cases"])


def _expect(where: str, differing: Sequence[str] | Iterator[str]) -> None:
    if (first := next(iter(differing), None)) is not None:
        raise OwnFault(f"What is stored of {where} is not what was judged: {first}.")


def _text(value: object, plain: Callable[[Any], Any] = as_plain) -> str:
    """Return plain values as JSON says them: what is the same there is the same on disk."""
    return json.dumps(value, default=plain)


def _tables(stem: Path) -> Iterator[tuple[Sequence[Mapping[str, Any]], Any]]:
    """Yield the rows of a table as JSON, CSV and Parquet have them, with the provenance beside them or None."""
    whole = json.loads(stem.with_suffix(".json").read_text(encoding="utf-8"))
    yield whole["rows"], whole["provenance"]
    with stem.with_suffix(".csv").open(encoding="utf-8", newline="") as file:
        yield list(csv.DictReader(file)), None
    table = _parquet(stem.with_suffix(".parquet"))
    yield table.to_pylist(), json.loads((table.schema.metadata or {})[b"provenance"])


def _parquet(path: Path) -> pa.Table:
    """Return a table, without what `pq.read_table` imports for folders of them."""
    with path.open("rb") as file:
        return pq.ParquetFile(file, pre_buffer=False).read(use_threads=False)


def _rows(found: Sequence[Mapping[str, Any]], wanted: Sequence[Row], what: str) -> Iterator[str]:
    """Yield what differs of rows that must be the same in every column."""
    if len(found) != len(wanted):
        yield f"{len(wanted)} rows are {len(found)}"
    for i, (one, other) in enumerate(zip(found, wanted, strict=False)):
        for name, value in other.items():
            if not _same(one.get(name, ...), value):
                yield f"{name} of {what} {i} is {one.get(name)!r}, not {value!r}"


def _same(found: Any, wanted: Any) -> bool:
    """Whether a cell says a value: no number is none or empty, and a text is that of a value."""
    if isinstance(wanted, float) and not isinstance(found, float):
        if found is None or found == "":
            return not math.isfinite(wanted)
        return isinstance(found, (int, str)) and _same(float(found), wanted)
    if isinstance(wanted, float):
        return bool(found == wanted or (math.isnan(found) and math.isnan(wanted)))
    if isinstance(found, str) and not isinstance(wanted, str):
        return found.lower() == str(wanted).lower()
    return bool(found == wanted or (found is None and wanted == ""))


def _audits(found: Sequence[Mapping[str, Any]], result: CaseResult) -> Iterator[str]:
    """Yield what differs of audits."""
    wanted = [
        dict(
            case=result.case.label, engine=entry.engine, profile=entry.profile, quantity=row.quantity, value=row.mine,
            reference=row.theirs, difference=float(row.difference), tolerance=row.tolerance, same=bool(row.ok),
        )
        for entry in result.entries for row in entry.audit
    ]  # fmt: skip
    yield from _rows(found, wanted, "audit")


def _named(about: Mapping[str, Any], entry: Entry | None, result: CaseResult) -> Iterator[str]:
    """Yield what differs of what is said of a motion; `entry` is None for the truth."""
    case, truth = result.case, result.truth
    said: dict[str, object] = {
        "case": case.name, "variant": case.variant, "engine": TRUTH, "profile": "", "contacts": case.contacts,
        "coordinates": [{"name": one.name, "unit": one.unit} for one in case.coordinates],
        "parameters": dict(case.parameters), "units": dict(case.units),
    }  # fmt: skip
    if entry is None:
        said |= {"tier": truth.tier.value, "source": truth.source}
    elif entry.run is not None:
        said |= {"engine": entry.engine, "profile": entry.profile, "took_s": entry.took_s}
        said["settings"] = dict(entry.settings)
        yield from _steps(about["steps"], entry.clock.run.t if entry.clock else entry.run.t)
    yield from (name for name, value in said.items() if _text(about[name]) != _text(value))


def _steps(found: Sequence[Sequence[float]], t: Floats) -> Iterator[str]:
    """Yield whether starts and lengths of steps are none of those between instants (n,)."""
    ends = distinct(t)
    starts, lengths = np.array(found[0]), np.array(found[1])
    at = np.searchsorted(ends[:-1], starts)
    there = at.max(initial=-1) < len(ends) - 1
    if not (there and _equal(ends[at], starts) and _equal(np.diff(ends)[at], lengths)):
        yield "its steps"


def _read(found: Trace, run: Trajectory, trace: Trace) -> Iterator[str]:
    """Yield what differs of a motion as pages read it, and of the truth that was put beside it."""
    for field in fields(Trajectory):
        if field.name not in NOT_KEPT and not _equal(getattr(found.run, field.name), getattr(run, field.name)):
            yield f"{field.name}, as it is read"
    for name in ("t", *SIGNALS):
        if not _equal(getattr(found.truth, name, None), getattr(trace.truth, name, None)):
            yield f"{name} of the truth beside it"


def _beside(found: Trace, run: Trajectory, result: CaseResult) -> Iterator[str]:
    """Yield what differs of the truth beside a motion from what metrics compare it with: nothing where they do not."""
    if not len(run.t):
        return
    inside, exact = aligned(result.truth, run, result.case)
    if (found.truth is None) == inside.any():
        yield "whether there is a truth beside it"
    if found.truth is None:
        return
    if not _equal(found.truth.t[inside], exact.t):
        yield "the clock of the truth beside it"
    many = SIDES * sum(event.t <= result.truth.trusted for event in result.truth.trajectory.events)
    for name in SIGNALS:
        mine, wanted = getattr(found.truth, name), getattr(exact, name)
        beyond = mine[~inside]
        nothing = (beyond == -1).all() if name == "mode" else np.isnan(beyond).all()
        if not (nothing and (_equal(mine[inside], wanted) or _alike(mine[inside], wanted, many))):
            yield f"{name} of the truth beside it"


def _alike(found: Floats, wanted: Floats, many: int) -> bool:
    """Whether columns are the same but for so many numbers each."""
    near = np.isclose(found, wanted, CLOSE, CLOSE * _largest(wanted), equal_nan=True)
    known = np.array_equal(np.isnan(found), np.isnan(wanted))
    return bool(known and (~near).sum() <= many * near.shape[1])


def _largest(values: Floats) -> Floats:
    """Return the largest number of each column (k,), of those that are finite."""
    largest: Floats = np.max(np.where(np.isfinite(values), np.abs(values), 0.0), axis=0, initial=0.0)
    return largest


def _errors(found: Trace, first: Trace, result: CaseResult, judged: Sequence[Row], entry: Entry) -> Iterator[str]:
    """Yield errors that a motion and the truth beside it have on disk, where they are not those that were judged.

    Of a truth that is trusted to its end: else less is judged than is stored.
    """
    truth, case = result.truth, result.case
    if found.truth is None or truth.trusted < truth.trajectory.t[-1] or truth.trajectory.switches:
        return
    touches, scales = case.law.touches, np.array(first.about["gap_scales"])
    gaps = np.abs(found.run.gap - found.truth.gap) / np.where(scales > 0.0, scales, 1.0)
    known = ~np.isnan(found.truth.q).all(axis=1)
    positions = errors(truth, found.run, found.truth, case)[0] / np.array(first.about["scales"])
    apart = {"position": positions, "gap_error": gaps[known][:, touches]}
    for row in judged:
        if row["metric"] in apart and (row["engine"], row["profile"]) == (entry.engine, entry.profile):
            value, said = float(np.max(apart[row["metric"]], initial=0.0)), row["value"]
            if math.isfinite(said) and not abs(value - said) <= SAME * max(value, said):
                yield f"its {row['metric']}, {value:g}, not {said:g}"


def _equal(found: Any, wanted: Any) -> bool:
    """Whether two values, arrays or accounts are the same; NaN is NaN."""
    if isinstance(wanted, Ledger):
        return isinstance(found, Ledger) and all(
            _equal(getattr(found, field.name), getattr(wanted, field.name)) for field in fields(Ledger)
        )
    if isinstance(wanted, np.ndarray):
        return np.array_equal(found, wanted, equal_nan=wanted.dtype.kind == "f")
    return bool(found == wanted)
