"""Where a signal first leaves what is allowed, in one sentence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crossbody.cases.arrays import Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Signal:
    """One signal beside what it should be.

    Attributes:
        name: for the sentence, with its index.
        t (n,): instants, s.
        found, wanted (n,): values.
        allowed: largest difference that is fine, in the signal's own unit.
        basis: where `allowed` comes from, in words.
    """

    name: str
    t: Floats
    found: Floats
    wanted: Floats
    allowed: float
    basis: str

    def offence(self) -> str:
        """The sentence; empty where the signal stays within. What is NaN on one side only is off."""
        off = np.abs(self.found - self.wanted)
        both = np.isnan(self.found) & np.isnan(self.wanted)
        bad = ~(off <= self.allowed) & ~both
        if not bad.any():
            return ""
        first, worst = int(np.argmax(bad)), int(np.argmax(np.where(bad, np.where(np.isnan(off), np.inf, off), -1.0)))
        return (
            f"{self.name} is off first at t = {self.t[first]:.9g} s: {self.found[first]:.9g} where "
            f"{self.wanted[first]:.9g} is expected, a difference of {off[first]:.3g} where {self.allowed:.3g} is "
            f"allowed ({self.basis}); the worst is {off[worst]:.3g} at t = {self.t[worst]:.9g} s, and "
            f"{int(bad.sum())} of {len(bad)} samples are off."
        )


def fail_if_any(sentences: list[str]) -> None:
    """Raise AssertionError with all sentences that are not empty."""
    told = [text for text in sentences if text]
    if told:
        raise AssertionError("\n".join(told))
