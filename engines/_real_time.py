"""Cases in real time: their laws, the steps that resolve them, how deep and fast rows get."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from crossbody.cases import Case, Law
from crossbody.cases.arrays import Floats


def one_set(law: Law) -> Law:
    """Return the constants of a row just entered as its only: those of COLLISION where it has two sets."""
    quick = law.b0 > 0.0
    return replace(
        law, a0=np.where(quick, law.b0, law.a0), a1=np.where(quick, law.b1, law.a1),
        a2=np.where(quick, 0.0, law.a2), b0=0.0 * law.b0, b1=0.0 * law.b1,
    )  # fmt: skip


def in_real_time(case: Case, fsm: str = "level", *, two_sets: bool = False) -> Case:
    """Return the scene with every contact integrated in real time, all together, under the machine `fsm`.

    With two sets a row that is captured is handed over to constants of its own.
    """
    law = case.law if case.real_time is None else case.real_time
    law = law if two_sets else one_set(law)
    return replace(case, law=law, fsm=fsm, collisions="resolved", closed_form=None, claims=())


def followed(case: Case, *, two_sets: bool = False) -> Case | None:
    """Return what an engine with the level machine follows instead of a case; None where it is the case.

    With two sets it knows COLLISION and hands over to CONTACT, as the rule `resolved` has it.
    """
    quick = bool((case.law.b0 > 0.0).any())
    same = case.fsm == "level" and (not quick or (two_sets and case.collisions == "resolved"))
    return None if same else in_real_time(case, two_sets=two_sets)


def resolving_step(law: Law, depth: float = 0.0, steps: int = 20) -> float:
    """A time step with that many steps in half a period of the fastest row, s. inf without a law.

    Args:
        law: constants of every row; the fast ones count too.
        depth: penetration at which the cubic part is linearised, m: w^2 = a0 + 3 a2 d^2. a1
            bounds the step as well.
        steps: in half a period.
    """
    stiffness = np.maximum(law.a0 + 3 * law.a2 * depth**2, law.b0)
    rate = float(np.max(np.maximum(np.sqrt(stiffness), np.maximum(law.a1, law.b1)), initial=0.0))
    return math.pi / rate / steps if rate > 0 else math.inf


def depths(constants: Floats, h: Floats, hd: Floats, hdd: Floats, opens: Any) -> tuple[Floats, Floats]:
    """Return how deep and how fast (nc,) rows get if what drives them at the start does so until they close.

    v^2/2 is |h'' h| and what moves and what is stored at the start; a0 d^2/2 + a2 d^4/4 holds it
    at the deepest.

    Args:
        constants: a0, a1, a2 (3, nc).
        h: gaps (nc,) at the start.
        hd: their rates.
        hdd: their accelerations with no row acting.
        opens: which rows can (nc,).
    """
    a0, _, a2 = constants
    stored = np.where((h < 0.0) | ~np.asarray(opens, dtype=bool), a0 * h**2 / 2 + a2 * h**4 / 4, 0.0)
    energy = 0.5 * hd * hd + np.abs(hdd * h) + stored
    with np.errstate(divide="ignore", invalid="ignore"):
        deep: Floats = np.nan_to_num(np.fmin(np.sqrt(2.0 * energy / a0), (4.0 * energy / a2) ** 0.25), posinf=0.0)
    return deep, np.sqrt(2.0 * energy)
