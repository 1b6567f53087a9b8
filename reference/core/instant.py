"""What is done at an instant where modes may change: code of its own, called at its address.

The transitions that fire, the iteration over modes and the sharing of loads (`settle`) are a third of the code of the
loop, which asks for them once an event. Compiled on their own they are compiled beside it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.apart import count_at
from crossbody.reference.core.layout import Buffers, Model, Work

FIRE, SETTLE, SHARE, JAM, ALL_JAM = np.arange(5)


@compiled
def ask(what: int, K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """Have it done by `instant_answers`, which returns a code."""
    return int(count_at(s.instant_code, (what, K, s, m, w, b)))
