"""Predictions of a replay on disk as soon as they are there: the command that was interrupted goes on with them."""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from crossbody.cases import Outcome, OutputError
from crossbody.hw.models._contract import Model
from crossbody.hw.replaying.comparison import Prediction
from crossbody.reports.runs import files
from crossbody.reports.runs.parts import Parts

ABOUT, ARRAYS = "prediction.json", "prediction.npz"


def source(model: Model) -> str:
    """Digest of the file that a model is built by, which may be somebody's own."""
    file = getattr(sys.modules[model.build.__module__], "__file__", None)
    return hashlib.sha256(Path(file).read_bytes()).hexdigest() if file else ""


def keeper(parts: Parts) -> Callable[[str, Callable[[], Prediction]], Prediction]:
    """Return what gives a prediction by the words for it: from disk, or made and put there."""

    def keep(words: str, predict: Callable[[], Prediction]) -> Prediction:
        if parts.has(words):
            return _read(parts.part(words))
        found = predict()
        with parts.put(words) as made:
            _write(made, found)
        return found

    return keep


def _write(made: Path, found: Prediction) -> None:
    told = {
        "engine": found.engine, "profile": found.profile, "settings": dict(found.settings),
        "outcomes": [outcome.value for outcome in found.outcomes], "messages": found.messages,
        "wall_s": found.wall_s, "steps": found.steps, "rows": [len(y) for y in found.y],
    }  # fmt: skip
    (made / ABOUT).write_text(json.dumps(told), encoding="utf-8")
    np.savez(made / ARRAYS, y=np.concatenate(found.y), yd=np.concatenate(found.yd))


def _read(part: Path) -> Prediction:
    try:
        told: Any = files.decoded(files.read_inside(part, ABOUT))
        ends = np.cumsum(told.pop("rows"))[:-1]
        with files.open_inside(part, ARRAYS) as file, np.load(file, allow_pickle=False) as found:
            y, yd = (tuple(np.split(found[name], ends)) for name in ("y", "yd"))
        outcomes = tuple(map(Outcome, told.pop("outcomes")))
        return Prediction(**told | {"messages": tuple(told["messages"])}, outcomes=outcomes, y=y, yd=yd)
    except (OSError, ValueError, KeyError, TypeError, EOFError):
        raise OutputError(f"{part} is no part of a replay; remove {part.parent}.") from None
