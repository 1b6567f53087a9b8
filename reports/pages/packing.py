"""What a page carries folded: texts as base64 of gzip, and values whose arrays of numbers are packed as bytes.

A packed value is the length of a JSON text (4 bytes), that text, and the bytes of all arrays that
were taken out of it. Of an array consecutive rows are subtracted as whole numbers (their bit
patterns), and the first bytes of all differences come first, then the second ones: what changes
slowly becomes long runs of equal bytes. Nothing is lost.
"""

from __future__ import annotations

import base64
import gzip
import json
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

LEVEL = 6
"""Of compression: more takes three times as long for a hundredth of the size."""


def packed_text(text: str) -> str:
    """A text as base64 of gzip."""
    return _folded(text.encode())


def packed_value(value: Any) -> str:
    """A JSON value whose arrays are as plotly reads them (`dtype`, `bdata`, `shape`), as base64 of gzip."""
    arrays: list[bytes] = []
    text = json.dumps(_taken(value, arrays), separators=(",", ":")).encode()
    return _folded(struct.pack("<I", len(text)) + text + b"".join(arrays))


def _folded(data: bytes) -> str:
    return base64.b64encode(gzip.compress(data, LEVEL, mtime=0)).decode()


def _taken(value: Any, arrays: list[bytes]) -> Any:
    """The value with every array replaced by where its bytes stand behind the text, kind, count and width of rows."""
    if isinstance(value, Mapping):
        if "bdata" not in value:
            return {key: _taken(each, arrays) for key, each in value.items()}
        numbers = np.frombuffer(base64.b64decode(value["bdata"]), dtype=value["dtype"])
        width = max(1, int(value["shape"].split(",")[-1])) if "shape" in value else 1
        place = sum(map(len, arrays))
        arrays.append(_bytes(numbers, width))
        return {"packed": [place, value["dtype"], len(numbers), width]}
    return [_taken(each, arrays) for each in value] if isinstance(value, list | tuple) else value


def _bytes(numbers: NDArray[Any], width: int) -> bytes:
    """Differences of rows as whole numbers, byte by byte."""
    whole = numbers.view(f"<u{numbers.itemsize}")
    apart = whole.copy()
    apart[width:] -= whole[:-width]
    return np.ascontiguousarray(apart.view(np.uint8).reshape(-1, numbers.itemsize).T).tobytes()
