"""What a table says of the truth itself."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from crossbody.cases import Case, Trajectory
from crossbody.cases.scene_contacts import turning
from crossbody.reports.judging.stored import SAME_END, compared_until
from crossbody.reports.judging.truth import GAINS, PARTED
from crossbody.reports.judging.verdict import Regression, Verdict, Word
from crossbody.reports.measuring.truth import TRUTH, Truth, shortened

BESIDE_MOTION = ("energy_integrator", "contact_work", "lam_impulse_path", *GAINS, *GAINS.values())
"""Of a second source, what it records beside its motion: that this is right its motion does not tell."""


STARTED = 1e-9
"""Depth over the size of the coordinates, or 1, beyond which a contact of a start is deeper than rounding."""
NAMED = 3  # contacts that are named


def start_below(case: Case, truth: Truth) -> str:
    """Say which contacts and bounds of a scene are beyond their surface at the start; nothing if none is."""
    if case.scene is None or not len(truth.trajectory.t):
        return ""
    gap = np.where(case.law.touches, truth.trajectory.gap[0], 0.0)
    least = -STARTED * max(1.0, float(np.max(np.abs(case.q0), initial=0.0)))
    deep = [int(i) for i in np.argsort(gap, kind="stable") if gap[i] < least]
    angles = turning(case.scene)
    named = [f"{case.contacts[i]} by {-gap[i]:.2g} {'rad' if case.contacts[i] in angles else 'm'}" for i in deep]
    more = f" and {len(deep) - NAMED} more" * (len(deep) > NAMED)
    return f"Beyond their surfaces at the start, and pushed back: {', '.join(named[:NAMED])}{more}." if deep else ""


def truth_row(case: Case, truth: Truth, command: str) -> list[Verdict]:
    """Whether the sources of a truth agree as far as they must; none for a truth that has one source and was given.

    One that is known less far than when runs were stored is worse than it was.
    """
    if math.isnan(truth.allowed):
        return []
    known = case.chaos or truth.horizon
    until = case.t_end if known is None else min(known.until, case.t_end)
    value = max(truth.agreement.get("position", math.inf), truth.agreement.get("event_times", 0.0) / case.t_end)
    short, other = truth.trusted < until, int(truth.agreement.get("modes", 0.0))
    most = _beside(case, truth.agreement.get("position", 0.0))
    beside = {name: off for name in BESIDE_MOTION if not (off := truth.agreement.get(name, 0.0)) <= most}
    told = [f"{_whose(name)} is {off:.1e}, beyond {most:.2g}." for name, off in beside.items()]
    if other:
        told.append(f"At {other} samples its two sources have rows in other modes.")
    if short:
        told.append(f"It must be trusted to {until:.4g} s.")
    if known is not None:
        told.append(f"Known up to {until:.4g} s: {known.why}.")
    told.append(f"{truth.source}.")
    if many := truth.trajectory.counts.get("not_searched", 0):
        told.append(
            f"At {many} instant{'s' * (many > 1)}, from {truth.trajectory.searched_until:.4g} s on, "
            "too many contacts could change to search for a second motion."
        )
    if many := truth.trajectory.counts.get("touches_that_gained", 0):
        gained = truth.trajectory.energy_gained
        told.append(f"Touches with friction that gave out more than they took in: {many}, by {gained:.3g} J in all.")
    if below := start_below(case, truth):
        told.append(below)
    if truth.part < 1.0:
        asked = case.t_end / truth.part
        told.append(f"Followed to {case.t_end:.4g} s of {asked:.4g} s: {truth.short}.")
    if lost := shortened(truth).trusted < compared_until(case) - SAME_END * case.t_end:
        told.append(f"The stored runs were compared up to {compared_until(case):.4g} s.")
    return [Verdict(
        case=case.name, variant=case.variant, engine=TRUTH, profile="", metric=TRUTH, value=value, unit="1",
        limit=truth.allowed, tier=truth.tier.value, why=" ".join(told), command=command,
        verdict=Word.WITHIN if value <= truth.allowed and not (short or other or beside) else Word.OUTSIDE,
        regression=Regression.LOST if lost else "",
        compared=truth.part * min(truth.trusted / case.t_end, 1.0),
    )]  # fmt: skip


def _beside(case: Case, apart: float) -> float:
    """Return by how much sources of a motion may differ in forces and energies, which are apart by a part of it.

    Forces are second derivatives: where a scene's laws are faster than its motion they are off by as much more.
    """
    law = case.law
    fastest = float(np.max(np.maximum(law.a1, np.sqrt(law.a0)), initial=0.0)) * case.t_end
    return max(PARTED, apart * fastest**2) if case.general else PARTED


def _whose(name: str) -> str:
    """Say of what a number is: of the second source, or of what both tell of touches in another way."""
    both = name in (*GAINS, *GAINS.values())
    return f"The difference of its sources in {name}" if both else f"The {name} of its second source"


TOUCHING = "touches (all engines)"  # the row that says that all engines touch otherwise than a truth does


def touching(case: Case, truth: Truth, runs: Sequence[Trajectory], command: str) -> list[Verdict]:
    """Say that none of a truth's contacts touches, but some of every engine's do, or the other way round.

    Args:
        case: the scene.
        truth: up to where it is trusted.
        runs: of engines that share nothing with the truth.
        command: for the row.
    """
    ran = [run for run in runs if run.outcome.ok and len(run.t)]
    if not (ran and case.law.touches.any()):
        return []
    does = bool(truth.contacts(truth.compared(truth.trajectory)))
    if any(bool(truth.contacts(truth.compared(run))) == does for run in ran):
        return []
    none = "no contact of the truth touches, but some of every engine do"
    said = "some contacts of the truth touch, but none of any engine does" if does else none
    return [of_truth(case, TOUCHING, f"In {case.label} {said}.", command, verdict=Word.INFO)]


def of_truth(case: Case, metric: str, why: str, command: str, **more: Any) -> Verdict:
    """Return a row that is outside of no run: no metric has its name, so that nobody looks for one."""
    said: dict[str, Any] = {"value": math.nan, "verdict": Word.OUTSIDE, "tier": ""} | more
    return Verdict(
        case=case.name, variant=case.variant, engine=TRUTH, profile="", metric=metric, unit="", command=command,
        why=why, **said,
    )  # fmt: skip
