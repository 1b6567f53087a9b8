"""Cases whose collisions take no time, as engines have them that integrate every contact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from crossbody.cases import Case, Law


def one_set(law: Law) -> Law:
    """Return the constants of a row just entered as its only: those of COLLISION where it has two sets."""
    quick = law.b0 > 0.0
    return Law(
        a0=np.where(quick, law.b0, law.a0), a1=np.where(quick, law.b1, law.a1),
        a2=np.where(quick, 0.0, law.a2), unilateral=law.unilateral,
    )  # fmt: skip


def in_real_time(case: Case, fsm: str = "level", *, two_sets: bool = False) -> Case:
    """Return the scene with every contact integrated in real time, all together, under the machine `fsm`.

    Args:
        case: the scene.
        fsm: the machine.
        two_sets: whether a row that is captured is handed over to constants of its own.
    """
    law = case.law if case.real_time is None else case.real_time
    law = law if two_sets else one_set(law)
    return replace(case, law=law, fsm=fsm, collisions="resolved", closed_form=None, claims=())


def followed(case: Case, *, two_sets: bool = False) -> Case | None:
    """Return what an engine with the level machine follows instead of a case; None where it is the case.

    Args:
        case: the scene.
        two_sets: whether it knows COLLISION and hands over to CONTACT, as the rule `resolved` has it.
    """
    quick = bool((case.law.b0 > 0.0).any())
    same = case.fsm == "level" and (not quick or (two_sets and case.collisions == "resolved"))
    return None if same else in_real_time(case, two_sets=two_sets)
