"""Motions on disk: one Parquet file each, with all that is not an array as JSON in its metadata."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from crossbody.cases import Event, Ledger, LogFormatError, Mode, Outcome, OutputError, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.hw.budget import Budget, opening
from crossbody.hw.guard import plain_allocator
from crossbody.reports.runs.files import decoded, open_inside

_KEY = b"crossbody"
_ARRAYS = ("q", "v", "gap", "lam", "energy", "mode")


@dataclass(frozen=True, slots=True, kw_only=True)
class Trace:
    """A stored motion.

    Attributes:
        about: case, variant, engine, profile, settings, names and units; plain values.
        run: the motion.
        truth: the truth's q, v, gap and lam beside every sample, impacts matched; NaN where nothing is compared, None
            for the truth itself.
    """

    about: Mapping[str, Any]
    run: Trajectory
    truth: Trajectory | None = None

    @property
    def quaternions(self) -> tuple[int, ...]:
        """Where in q each quaternion begins, by the names of the coordinates."""
        names = [coordinate["name"] for coordinate in self.about.get("coordinates", ())]
        return tuple(i for i, name in enumerate(names) if name.endswith(" qw"))


def _columns(prefix: str, array: Floats) -> dict[str, Floats]:
    return {f"{prefix}{i}": array[:, i] for i in range(array.shape[1])}


def _arrays(run: Trajectory, prefix: str = "") -> dict[str, Floats]:
    found: dict[str, Floats] = {}
    for name in _ARRAYS:
        found |= _columns(prefix + name, getattr(run, name))
    return found


def save(path: Path, trace: Trace) -> None:
    """Write one motion."""
    run = trace.run
    data = {"t": run.t} | _arrays(run)
    if trace.truth is not None:
        data |= _arrays(trace.truth, "truth_")
    if run.ledger is not None:
        data |= _columns("work", run.ledger.contact) | {"input": run.ledger.input, "loss": run.ledger.dissipated}
    about = {
        "about": dict(trace.about),
        "events": [[e.t, e.contact, int(e.before), int(e.after), e.impulse] for e in run.events],
        "outcome": run.outcome.value, "message": run.message, "steps": run.steps, "wall_s": run.wall_s,
        "counts": dict(run.counts), "control_s": run.control_s,
    }  # fmt: skip
    columns = pa.table(data).replace_schema_metadata({_KEY: json.dumps(about, default=_plain).encode()})
    pq.write_table(columns, path, compression="zstd")


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else str(value)


def _block(data: pa.Table, name: str) -> Floats:
    """Columns name0, name1, ... as one array (n, k)."""
    columns: list[Floats] = []
    while f"{name}{len(columns)}" in data.column_names:
        columns.append(data.column(f"{name}{len(columns)}").to_numpy())
    return np.stack(columns, axis=1) if columns else np.zeros((len(data), 0))


def _motion(data: pa.Table, prefix: str) -> Trajectory:
    q, v, gap, lam, energy, mode = (_block(data, prefix + name) for name in _ARRAYS)
    t = data.column("t").to_numpy()
    return Trajectory(t=t, q=q, v=v, gap=gap, lam=lam, energy=energy, mode=mode.astype(np.int8))


def _ledger(data: pa.Table) -> Ledger | None:
    if "work0" not in data.column_names:
        return None
    given, lost = (data.column(name).to_numpy() for name in ("input", "loss"))
    return Ledger(contact=_block(data, "work"), input=given, dissipated=lost)


def _event(t: float, contact: int, before: int, after: int, impulse: float = 0.0) -> Event:
    return Event(t=t, contact=contact, before=Mode(before), after=Mode(after), impulse=impulse)


def peek(path: Path) -> dict[str, Any]:
    """What is told about a motion, without the motion: `about`, outcome, steps, run time, events.

    Raises:
        OutputError: if it is a link.
        OSError, ValueError, KeyError: if it is not one of ours; says which field is not as expected.
    """
    with _opened(path) as file:
        told = decoded((pq.read_schema(file).metadata or {})[_KEY])
    _check(told, "", _TOLD)
    _check(told["about"], "about.", _ABOUT)
    known: dict[str, Any] = told
    return known


def _opened(path: Path) -> BinaryIO:
    """A motion below its folder of results."""
    whole = path.absolute()
    return open_inside(whole.parent.parent, f"{whole.parent.name}/{whole.name}")


_TOLD: dict[str, type | tuple[type, ...]] = {
    "about": dict, "events": list, "outcome": str, "message": str, "steps": int, "wall_s": (int, float), "counts": dict,
}  # fmt: skip
_ABOUT: dict[str, type | tuple[type, ...]] = {
    "case": str,
    "variant": str,
    "engine": str,
    "profile": str,
    "coordinates": list,
    "contacts": list,
}


def _check(told: Any, where: str, kinds: Mapping[str, type | tuple[type, ...]]) -> None:
    """Whether what stands beside a motion has the fields that pages use.

    Raises:
        ValueError: naming the first that it has not.
    """
    if not isinstance(told, dict):
        raise ValueError("its metadata is no object")
    for name, kind in kinds.items():
        if not isinstance(given := told.get(name), kind):
            raise ValueError(f"its field {where}{name} is {str(given)[:60]!r}")


def load(path: Path) -> Trace:
    """Read one motion back.

    Raises:
        OutputError: if it is a link, or not a motion of ours; names file and field.
    """
    try:
        return _loaded(path)
    except OutputError:
        raise
    except LogFormatError:
        raise OutputError(f"{path} is not a motion of crossbody: it unfolds to more than a motion needs.") from None
    except _BROKEN as error:
        raise OutputError(f"{path} is not a motion of crossbody: {type(error).__name__}: {error}.") from None


MOTION, PEAK = 4 << 30, 3
"""Bytes that reading a motion may take in memory, a robot's on a thousand rows at 4e4 instants; and how many times its
numbers Arrow has there at once."""


def _table(path: Path) -> pa.Table:
    """The table of a motion, within the memory that one may take."""
    budget = Budget(path, MOTION)
    with _opened(path) as file, opening(budget), plain_allocator(path):
        parquet = pq.ParquetFile(file, pre_buffer=False)
        size = 8 * parquet.metadata.num_rows * parquet.metadata.num_columns
        if PEAK * size > budget.memory:
            raise ValueError(f"it needs {size / 1e6:.0f} MB in memory")
        return parquet.read(use_threads=False)


_BROKEN = (OSError, ValueError, KeyError, TypeError, AttributeError, IndexError, pa.ArrowException)


def _loaded(path: Path) -> Trace:
    data = _table(path)
    about = decoded((data.schema.metadata or {})[_KEY])
    _check(about, "", _TOLD)
    run = replace(
        _motion(data, ""),
        ledger=_ledger(data),
        events=tuple(_event(*given) for given in about["events"]),
        outcome=Outcome(about["outcome"]), message=about["message"], steps=about["steps"], wall_s=about["wall_s"],
        counts=about["counts"], control_s=float(about.get("control_s", 0.0)),
    )  # fmt: skip
    truth = _motion(data, "truth_") if "truth_q0" in data.column_names else None
    return Trace(about=about["about"], run=run, truth=truth)
