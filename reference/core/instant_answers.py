"""What the loop asks for at an instant where modes may change, answered by one function that stands at one address."""

from __future__ import annotations

from typing import Any

from crossbody.reference.core.instant import SETTLE
from crossbody.reference.core.layout import Buffers, Model, Work
from crossbody.reference.core.settle import settle, share


def answer(what: int, K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """Do what is asked, and return its code.

    SETTLE  modes and discrete variables iterate until they agree
    SHARE   rows in contact share what they carry
    """
    return int(settle(K, s, m, w, b)) if what == SETTLE else int(share(K, s, m, w, b))
