"""What touches with friction give out beyond what they took in, followed apart from the compiled account."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass

from crossbody.cases import Mode
from crossbody.reference.kinds import Floats

ON = frozenset({Mode.STICK, Mode.SLIP})


@dataclass(slots=True)
class Touch:
    """A contact from where it closes to where it opens.

    Attributes:
        work: of its normal row when it began, less what its penetration may hand out, J.
        given: that, J.
        error: of the energy account then, J.
        deepest: least gap so far, m.
        taken: what it had taken in there, J.
    """

    work: float
    given: float
    error: float
    deepest: float = 0.0
    taken: float = 0.0


class Touches:
    """The touches of contacts with friction.

    Args:
        contacts: with a bound that grows with their load.
        part: of the energies behind an account, to which it is known.

    Attributes:
        told: how many gained (`touches_that_gained`), and how many began below their surface (`starts_inside`).
        gained, handed: what these gave out, J.
    """

    def __init__(self, contacts: Collection[int], part: float) -> None:
        self.contacts, self.part, self.gained, self.handed = sorted(contacts), part, 0.0, 0.0
        self.told = Counter[str]()
        self._size, self._open = 0.0, dict[int, Touch]()

    @property
    def amounts(self) -> dict[str, float]:
        """What they gave out, as `noted` names it, J."""
        return {"energy_gained": self.gained, "energy_handed": self.handed}

    def follow(self, modes: list[Mode], gap: Floats, lam: Floats, z: Floats, energy: Floats, error: float) -> None:
        """Follow them to an instant.

        Args:
            modes (nc,): of all rows.
            gap (nc,): likewise, m.
            lam (nc,): likewise, N; only where modes have settled does it count.
            z (nc + 2,): work of every row, of the inputs, and dissipated, J.
            energy (2,): kinetic and potential, J.
            error: of the account, J.
        """
        self._size = max(self._size, float(abs(energy).sum() + abs(z).sum()))
        for i in self.contacts:
            touch, depth, work = self._open.get(i), float(gap[i]), float(z[i])
            if modes[i] in ON:
                if touch is None:
                    given = max(float(lam[i]), 0.0) * max(-depth, 0.0)
                    touch = self._open[i] = Touch(work + given, given, error)
                if depth < touch.deepest:
                    touch.deepest, touch.taken = depth, max(touch.work - work, 0.0)
            elif touch is not None and modes[i] == Mode.FREE:
                self._end(self._open.pop(i), depth, work, error)

    def _end(self, touch: Touch, gap: float, work: float, error: float) -> None:
        """Count a touch that ends at a gap; what a load does above the surface without friction is no gain."""
        gain = work - touch.work
        above = touch.taken * (gap / touch.deepest) ** 2 if gap > 0.0 and touch.deepest < 0.0 else 0.0
        least = above + abs(error - touch.error) + self.part * self._size
        given = min(touch.given, gain + touch.given)
        if gain > least:
            self.told["touches_that_gained"] += 1
            self.gained += gain
        if given > least:
            self.told["starts_inside"] += 1
            self.handed += given
