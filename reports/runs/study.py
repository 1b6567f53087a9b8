"""A finished comparison on disk: verdicts, motions, audit, provenance, and the page made from them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from crossbody.cases import Case, OutputError, Trajectory
from crossbody.cases._arrays import Floats
from crossbody.reports.judging.comparison import Entry, judged, table
from crossbody.reports.judging.truth import Truth
from crossbody.reports.metrics._align import aligned
from crossbody.reports.pages.styles import TRUTH
from crossbody.reports.pages.thin import keep
from crossbody.reports.runs.jobs import CaseResult
from crossbody.reports.runs.store import Trace, save


def judge(results: Sequence[CaseResult], commands: Mapping[str, str]) -> pd.DataFrame:
    """Verdicts of all cases; `commands` names what reproduces each case (by its label)."""
    return table(
        row
        for result in results
        for row in judged(result.case, result.entries, result.truth, commands[result.case.label])
    )


def write(out: Path, results: Sequence[CaseResult], rows: pd.DataFrame, provenance: Mapping[str, Any]) -> None:
    """Write everything but the page into a folder."""
    write_table(out / "verdicts", rows, provenance)
    write_table(out / "audit", _audit(results), provenance)
    (out / "provenance.json").write_text(json.dumps(provenance, indent=2, default=str), encoding="utf-8")
    (out / "traces").mkdir()
    traces = [trace for result in results for trace in _traces(result)]
    for i, trace in enumerate(traces):
        save(out / "traces" / f"{i:04d}.parquet", trace)


def write_table(stem: Path, rows: pd.DataFrame, provenance: Mapping[str, Any]) -> None:
    """One table as Parquet (provenance in its metadata), CSV and JSON (provenance beside the rows)."""
    told = json.dumps(provenance, default=str)
    arrow = pa.Table.from_pandas(rows, preserve_index=False)
    metadata = {**(arrow.schema.metadata or {}), b"provenance": told.encode()}
    pq.write_table(arrow.replace_schema_metadata(metadata), stem.with_suffix(".parquet"))
    rows.to_csv(stem.with_suffix(".csv"), index=False)
    content = {"provenance": json.loads(told), "rows": json.loads(rows.to_json(orient="records", double_precision=15))}
    stem.with_suffix(".json").write_text(json.dumps(content, indent=1), encoding="utf-8")


def _audit(results: Sequence[CaseResult]) -> pd.DataFrame:
    rows = [
        {
            "case": result.case.label, "engine": entry.engine, "profile": entry.profile, "quantity": row.quantity,
            "reference": row.theirs, "value": row.mine, "difference": row.difference, "tolerance": row.tolerance,
            "same": row.ok,
        }
        for result in results for entry in result.entries for row in entry.audit
    ]  # fmt: skip
    columns = ["case", "engine", "profile", "quantity", "reference", "value", "difference", "tolerance", "same"]
    return pd.DataFrame(rows, columns=columns)


def _about(case: Case, engine: str, profile: str) -> dict[str, Any]:
    return {
        "case": case.name, "variant": case.variant, "title": case.title, "mechanism": case.mechanism,
        "engine": engine, "profile": profile,
        "coordinates": [{"name": c.name, "unit": c.unit} for c in case.coordinates],
        "contacts": list(case.contacts), "parameters": dict(case.parameters), "units": dict(case.units),
    }  # fmt: skip


def _traces(result: CaseResult) -> list[Trace]:
    case, truth = result.case, result.truth
    about = _about(case, TRUTH, "") | {"tier": truth.tier.value, "source": truth.source}
    found = [Trace(about=about, run=truth.trajectory)]
    return found + [_trace(case, entry, truth) for entry in result.entries if entry.run is not None]


def _trace(case: Case, entry: Entry, truth: Truth) -> Trace:
    assert entry.run is not None
    about = _about(case, entry.engine, entry.profile) | {"settings": dict(entry.settings)}
    about["steps"] = _steps(entry.run.t if entry.stepped is None else entry.stepped)
    return Trace(about=about, run=entry.run, truth=_beside(truth, entry.run))


def _beside(truth: Truth, run: Trajectory) -> Trajectory | None:
    """The truth at every sample of a run, impacts matched as the metrics match them; NaN where nothing is compared."""
    if not len(run.t):
        return None
    inside, exact = aligned(truth, run)
    if not inside.any():
        return None

    def put(rows: Floats) -> Floats:
        whole = np.full((len(inside), rows.shape[1]), np.nan)
        whole[inside] = rows
        return whole

    return Trajectory(
        t=run.t, q=put(exact.q), v=put(exact.v), gap=put(exact.gap), lam=put(exact.lam), energy=put(exact.energy),
        mode=np.where(inside[:, None], np.nan_to_num(put(exact.mode.astype(np.float64))), -1).astype(np.int8),
    )  # fmt: skip


def _steps(t: Floats) -> list[list[float]]:
    """Start and length of the steps between the instants t, s: no more of them than a plot shows."""
    ends = np.unique(t)
    starts, lengths = ends[:-1], np.diff(ends)
    kept = keep(starts, np.log(lengths), np.zeros(0))
    return [starts[kept].tolist(), lengths[kept].tolist()]


def read_json(path: Path) -> Any:
    """A JSON file of a study.

    Raises:
        OutputError: if it is not there or not readable.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        raise OutputError(f"{path.parent} is not a finished report folder: {path.name} cannot be read.") from None
