"""Predictions of a replay on disk as soon as they are there: an interrupted command goes on with them."""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import msgspec
import numpy as np

from crossbody.cases import Outcome, OutputError
from crossbody.hw.replaying.comparison import Prediction
from crossbody.reports.runs import files
from crossbody.reports.runs.parts import Parts

if TYPE_CHECKING:
    from crossbody.hw.models import Model

ABOUT, ARRAYS = "prediction.json", "prediction.f8"


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
        "width": found.y[0].shape[1],
    }  # fmt: skip
    (made / ABOUT).write_text(json.dumps(told), encoding="utf-8")
    (made / ARRAYS).write_bytes(np.stack([np.concatenate(found.y), np.concatenate(found.yd)]).tobytes())


class _Told(msgspec.Struct, forbid_unknown_fields=True):
    """What stands beside the numbers of a prediction."""

    engine: str
    profile: str
    settings: dict[str, Any]
    outcomes: tuple[Outcome, ...]
    messages: tuple[str, ...]
    wall_s: float
    steps: int
    rows: list[Annotated[int, msgspec.Meta(ge=0)]]
    width: Annotated[int, msgspec.Meta(ge=1)]


def _read(part: Path) -> Prediction:
    try:
        told = msgspec.json.decode(files.read_inside(part, ABOUT), type=_Told)
        whole = np.frombuffer(bytearray(files.read_inside(part, ARRAYS))).reshape(2, sum(told.rows), told.width)
    except (OSError, ValueError, msgspec.MsgspecError):
        raise OutputError(f"{part} is not part of a replay; remove {part.parent}.") from None
    y, yd = (tuple(np.split(one, np.cumsum(told.rows)[:-1])) for one in whole)
    return Prediction(
        engine=told.engine, profile=told.profile, settings=told.settings, outcomes=told.outcomes,
        messages=told.messages, wall_s=told.wall_s, steps=told.steps, y=y, yd=yd,
    )  # fmt: skip
