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
from numpy.typing import NDArray

from crossbody.cases import Acts, Event, Ledger, LogFormatError, Mode, Outcome, OutputError, Trajectory
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
        truth: the truth's q, v, gap and lam beside every sample, impacts matched; NaN where
            nothing is compared, None for the truth itself.
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
        data |= {"truth_t": trace.truth.t} | _arrays(trace.truth, "truth_")
    if run.ledger is not None:
        data |= _columns("work", run.ledger.contact) | {"input": run.ledger.input, "loss": run.ledger.dissipated}
    about = {
        "about": dict(trace.about),
        "events": [[e.t, e.contact, int(e.before), int(e.after), e.impulse] for e in run.events],
        "outcome": run.outcome.value, "message": run.message, "steps": run.steps, "wall_s": run.wall_s,
        "counts": dict(run.counts), "control_s": run.control_s, "acts": run.acts,
    }  # fmt: skip
    columns = {name: _column(values) for name, values in data.items()}
    table = pa.table(columns, metadata={_KEY: json.dumps(about, default=as_plain).encode()})
    pq.write_table(table, path, compression="zstd")


def _column(values: Floats) -> pa.Array:
    """Return the bytes of an array as a column: `pa.array` imports pandas (.3 s) to look at it."""
    held = pa.py_buffer(np.ascontiguousarray(values))
    return pa.Array.from_buffers(pa.from_numpy_dtype(values.dtype), len(values), [None, held])


def as_plain(value: Any) -> Any:
    """A value of NumPy as JSON knows it; else its text."""
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else str(value)


def _blocks(data: pa.Table) -> dict[str, Floats]:
    """Return all columns, those called name0, name1, ... as one array (n, k).

    Raises:
        ValueError: for columns out of order.
    """
    found: dict[str, list[NDArray[Any]]] = {}
    for name, column in zip(data.column_names, data.itercolumns(), strict=True):
        block = found.setdefault(name.rstrip("0123456789"), [])
        if name[-1].isdigit() and not name.endswith(f"{len(block)}"):
            raise ValueError(f"its column {name!r} is out of order")
        block.append(np.from_dlpack(column.combine_chunks()))  # `to_numpy` imports pandas
    return {name: np.stack(block, axis=1) for name, block in found.items()}


def _motion(blocks: Mapping[str, Floats], prefix: str = "") -> Trajectory:
    t = blocks.get(f"{prefix}t", blocks["t"])[:, 0]
    none = np.zeros((len(t), 0))
    q, v, gap, lam, energy, mode = (blocks.get(prefix + name, none) for name in _ARRAYS)
    return Trajectory(t=t, q=q, v=v, gap=gap, lam=lam, energy=energy, mode=mode.astype(np.int8))


def _ledger(blocks: Mapping[str, Floats]) -> Ledger | None:
    if "input" not in blocks:
        return None
    none = np.zeros((len(blocks["input"]), 0))  # of a motion without rows
    return Ledger(contact=blocks.get("work", none), input=blocks["input"][:, 0], dissipated=blocks["loss"][:, 0])


def _event(t: float, contact: int, before: int, after: int, impulse: float = 0.0) -> Event:
    return Event(t=t, contact=contact, before=Mode(before), after=Mode(after), impulse=impulse)


def peek(path: Path) -> dict[str, Any]:
    """What is known about a motion, without the motion: `about`, outcome, steps, run time, events.

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
    "about": dict, "events": list, "outcome": str, "message": str, "steps": int,
    "wall_s": (int, float), "counts": dict,
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
        raise ValueError("its metadata is not an object")
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
        raise OutputError(
            f"{path} is not a motion of crossbody: it decompresses to more than a motion needs."
        ) from None
    except _BROKEN as error:
        raise OutputError(f"{path} is not a motion of crossbody: {type(error).__name__}: {error}.") from None


MOTION, PEAK = 4 << 30, 3
"""Bytes that reading a motion may take in memory, a robot's on a thousand rows at 4e4 instants;
and how many times its numbers Arrow has there at once."""


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
    blocks = _blocks(data)
    run = replace(
        _motion(blocks), ledger=_ledger(blocks), events=tuple(_event(*given) for given in about["events"]),
        outcome=Outcome(about["outcome"]), message=about["message"], steps=about["steps"],
        wall_s=about["wall_s"], counts=about["counts"], control_s=float(about.get("control_s", 0.0)),
        acts=Acts(about.get("acts", Acts.AT)),
    )  # fmt: skip
    truth = _motion(blocks, "truth_") if "truth_q" in blocks else None
    return Trace(about=about["about"], run=run, truth=truth)
