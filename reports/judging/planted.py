"""Faults of known size in the truth's own motion, by which the judge is judged (`crossbody.reports.judging.controls`).

What must come out follows from each fault in closed form: neither a metric nor a limit is asked for it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from crossbody.cases import Case, Trajectory
from crossbody.reports.judging.planted_events import clocks, counts, handed, modes, released, switched, touches
from crossbody.reports.judging.planted_forces import forces
from crossbody.reports.judging.planted_friction import friction
from crossbody.reports.judging.planted_motions import energies, gaps, positions, starts, velocities
from crossbody.reports.judging.planting import FEW, Control, Plain

KINDS: tuple[Callable[[Plain], Iterator[Control]], ...] = (
    positions, velocities, starts, gaps, energies, forces, modes, counts, touches, released, handed, switched, clocks,
    friction,
)  # fmt: skip


def faults(case: Case, run: Trajectory) -> Iterator[Control]:
    """Yield every fault that a motion has room for.

    Args:
        case: what moved.
        run: the motion of its truth, some hundred samples or more.
    """
    plain = Plain(case, run)
    for kind in KINDS if len(plain.quiet) >= FEW else ():
        yield from kind(plain)
