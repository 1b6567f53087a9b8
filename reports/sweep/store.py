"""Rows on disk as they arrive: one part file a chunk, whole or not there; a killed sweep goes on."""

from __future__ import annotations

import hashlib
import json
import os
import pickle
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pandas as pd
from pyarrow import ArrowException

from crossbody.cases import OutputError, installed
from crossbody.reports.runs import files, manifest, output
from crossbody.reports.sources import code
from crossbody.reports.sweep.execute import COLUMNS, TIMES
from crossbody.reports.sweep.spec import Spec

STRESS = "stress"
"""The study's name; its parts, and which sweep's they are, are no tables and stay."""
SWEEP, PARTS = "sweep.json", "parts"


def identity(specs: Sequence[Spec], chunk: int, about: Mapping[str, Any]) -> dict[str, Any]:
    """What a sweep is: two with the same identity end with the same table."""
    digest = hashlib.sha256(pickle.dumps([repr(spec) for spec in specs], protocol=5)).hexdigest()[:16]
    return {"version": version("crossbody"), "code": code(), "runs": len(specs), "chunk": chunk, "draws": digest} | {
        "plugins": installed.digests(),
        **about,
    }


class Store:
    """The folder of one sweep."""

    def __init__(self, path: Path, about: Mapping[str, Any]) -> None:
        self.path, self.about = path, dict(about)
        self._open()

    def _open(self) -> None:
        output.check(self.path, STRESS)
        known = self.path / SWEEP
        if os.path.lexists(known):
            self._compare(known)
        else:
            self._begin()
        for stale in self._names():
            if stale.startswith("."):
                (self.path / PARTS / stale).unlink(missing_ok=True)

    def _begin(self) -> None:
        """Make the folder and its marker, unless it is ours already, then what says which sweep it is."""
        if os.path.lexists(self.path / PARTS):
            raise OutputError(f"{self.path / PARTS} exists; move it, or name a new folder for the sweep.")
        self.path.mkdir(parents=True, exist_ok=True)
        if not output.is_ours(self.path):
            manifest.write(self.path, manifest.Manifest())
        output.replace_text(self.path / SWEEP, json.dumps(self.about, indent=1))

    def _names(self) -> list[str]:
        """Names of the parts; their folder is made if need be, and no link followed."""
        with files.directory(self.path, PARTS, make=True):
            return files.listed(self.path, PARTS)

    def _compare(self, known: Path) -> None:
        try:
            before = dict(files.decoded(files.read_inside(known.parent, known.name)))
        except (OSError, ValueError, TypeError, RecursionError):
            raise OutputError(f"{known} cannot be read; name a new folder for the sweep.") from None
        other = [key for key in {**before, **self.about} if before.get(key) != self.about.get(key)]
        if other:
            said = ", ".join(
                f"{key} {_short(before.get(key))} there, {_short(self.about.get(key))} now" for key in other
            )
            raise OutputError(
                f"{self.path} holds a sweep of another version or of other parameters ({said}); "
                "repeat that command, or name a new folder."
            )

    def _part(self, chunk: int) -> Path:
        return self.path / PARTS / f"{chunk:06d}.parquet"

    def missing(self, chunks: int) -> list[int]:
        """Chunks that have no part yet."""
        return [i for i in range(chunks) if not self._part(i).is_file()]

    def put(self, chunk: int, rows: Sequence[Mapping[str, Any]]) -> None:
        """Write the rows of a chunk: under another name first, so that a part is whole if it is there."""
        path = self._part(chunk)
        frame = pd.DataFrame(rows, columns=[*COLUMNS, TIMES[1]]).astype({**COLUMNS, TIMES[1]: "float64"})
        temporary = path.with_name(f".{path.name}.{os.getpid()}")
        try:
            frame.to_parquet(temporary, index=False)
            os.replace(temporary, path)
        except OSError as error:
            raise OutputError(f"Part {path} cannot be written: {error.strerror or error}.") from error

    def table(self) -> tuple[pd.DataFrame, pd.DataFrame]:
        """All rows in the order of the sweep, and apart how long each took: never the same twice."""
        names = [name for name in self._names() if name.endswith(".parquet") and not name.startswith(".")]
        parts = [self._read(name) for name in names]
        joined = pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=[*COLUMNS, TIMES[1]])
        joined = joined.sort_values("index", ignore_index=True)
        return joined[list(COLUMNS)], joined[list(TIMES)]

    def _read(self, name: str) -> pd.DataFrame:
        try:
            with files.open_inside(self.path, f"{PARTS}/{name}") as file:
                return pd.read_parquet(file)[[*COLUMNS, TIMES[1]]]
        except OutputError:
            raise
        except (OSError, ValueError, KeyError, ArrowException) as error:
            raise OutputError(f"{self.path / PARTS / name} is not part of a sweep ({error}); remove it.") from None


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
