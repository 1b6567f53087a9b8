"""What pages carry folded, read back the other way: sums of what was subtracted."""

from __future__ import annotations

import base64
import gzip
import json
import re
from typing import Any

import numpy as np


def text_of(folded: str) -> str:
    """A folded text."""
    return gzip.decompress(base64.b64decode(folded)).decode()


def value_of(folded: str) -> Any:
    """A folded value; its arrays are NumPy's."""
    data = gzip.decompress(base64.b64decode(folded))
    end = 4 + int.from_bytes(data[:4], "little")

    def array(given: dict[str, Any]) -> Any:
        if "packed" not in given:
            return given
        place, kind, count, width, rows = given["packed"]
        size = np.dtype(kind).itemsize
        apart = np.frombuffer(data, np.uint8, count * size, end + place).reshape(size, count).T.copy()
        apart = apart.view(f"<u{size}").reshape(-1, width)
        found = np.cumsum(apart, axis=0, dtype=apart.dtype).ravel().view(f"<{kind}")
        return found.reshape(-1, width) if rows else found

    return json.loads(data[4:end], object_hook=array)


def whole(page: str) -> str:
    """A single file with all of its pages unfolded."""
    return re.sub(
        r'<script type="text/plain" data-packed>(.*?)</script>', lambda found: text_of(found[1]), page, flags=re.DOTALL
    )


def numbers(coded: Any) -> np.ndarray:
    """An array as plotly reads it, or one that was unfolded."""
    if isinstance(coded, np.ndarray | list):
        return np.asarray(coded)
    return np.frombuffer(base64.b64decode(coded["bdata"]), dtype=coded["dtype"])
