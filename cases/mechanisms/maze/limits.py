"""How far each engine may be from the truth of the ball maze, and why."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from crossbody.cases.case import Claim, Limit

OBVIOUS = (
    "The obvious model builds rings of segments and has MuJoCo's own contact constants and friction, not the case's "
    "law: it rolls over facets, sinks in and slips."
)
_TOLERANCE = "a thousand times the default tolerance of 1e-9"
_LOG = "read between the samples of a run"
_SMALL = "a tolerance of 1e-9 in the height, over that through which the ball moves, a part of its circle's radius"
_TOLERATED, _DEFAULT = 1e-9, 1e-6
"""Default tolerance, and the limit that every case has on energies over the largest kinetic one."""
_ENERGIES = ("energy_drift", "energy_integrator", "contact_work")
_CLAIMED: Mapping[str, tuple[float, str]] = {
    "swing_period": (1e-6, _LOG),
    "unstable_pole": (1e-6, _TOLERANCE),
    "leave_angle": (1e-5, _LOG),
    "ring_changes": (0.0, "a count"),
    "contact_loss": (7e-6, "1 % of 0.70 mJ: what the input works is not in the claim"),
}
"""Judged where the case claims a number."""
_ALWAYS: Mapping[str, tuple[float, str]] = {"ring_change_times": (1e-6, _TOLERANCE)}
_MULTISTEP = (
    "backward differentiation errs by the tolerance of 1e-9 in every step, at worst always to one side, and takes up "
    "to 20,000 of them in stiff contact"
)


def limits(claims: Iterable[Claim], fallen: float) -> tuple[Limit, ...]:
    """The limits of one variant beside those that every case has.

    Args:
        claims: what it claims.
        fallen: height through which the ball moves on its face, over the radius of its circle; infinite where more
            than gravity drives it.
    """
    bounds = {**_ALWAYS, **{claim.metric: _CLAIMED[claim.metric] for claim in claims}}
    if _TOLERATED / fallen > _DEFAULT:
        bounds |= dict.fromkeys(_ENERGIES, (_TOLERATED / fallen, _SMALL))
    return (
        *(Limit(metric=metric, value=value, why=why) for metric, (value, why) in bounds.items()),
        *_of_engines(),
    )


def _of_engines() -> Iterator[Limit]:
    for metric in ("position", "energy_drift"):
        yield Limit(metric=metric, value=2e-5, engine="reference", profile="cvode", why=_MULTISTEP)
    for metric in ("*", "audit"):
        yield Limit(metric=metric, engine="mujoco", profile="default", known=OBVIOUS)
