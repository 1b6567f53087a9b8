"""What the loop asks for at an instant where modes may change, answered by one function that stands at one address."""

from __future__ import annotations

from typing import Any

from crossbody.reference.core.firing import all_jam, fire, jams
from crossbody.reference.core.instant import FIRE, JAM, SETTLE, SHARE
from crossbody.reference.core.layout import Buffers, Model, Work
from crossbody.reference.core.settle import settle, share


def answer(what: int, K: Any, s: Any, m: Model, w: Work, b: Buffers) -> int:
    """Do what is asked, and return its code.

    FIRE     what fired at a step's end changes modes and discrete variables
    SETTLE   these iterate until they agree
    SHARE    rows in contact share what they carry
    JAM      1 where contacts that slide jam, or nearly
    ALL_JAM  1 where contacts that let go in turn would jam, or nearly, if all pressed that close
    """
    if what == FIRE:
        return int(fire(K, s, m, w, b))
    if what == SETTLE:
        return int(settle(K, s, m, w, b))
    if what == SHARE:
        return int(share(K, s, m, w, b))
    return int(jams(K, s, m, w, b) if what == JAM else all_jam(K, s, m, w, b))
