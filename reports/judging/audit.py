"""The parity audit: whether the same physics reached every engine.

Numbers are laid side by side; M, bias, H and lam are evaluated at the same random states where an
engine shows them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from crossbody.cases import Case
from crossbody.cases.arrays import Floats
from crossbody.cases.rotations import normalised
from crossbody.cases.scene import UNBOUNDED, Joint, Tendon
from crossbody.cases.scene_contacts import softness

TOLERANCE = 1e-10
LAM_TOLERANCE = 1e-8
NUMBERS = ("masses", "gravity", "constants", "q0", "v0")
FUNCTIONS = ("M", "bias", "H", "lam")
STATES = 20
NEWTON = 20
CANCELS = 1e-4  # part of momentum times speed below which what is left of it is rounding, to the tolerance
ROUNDED = 1e-12  # part of a gap by which it may miss what was drawn
SEED = 20240917


@dataclass(frozen=True, slots=True, kw_only=True)
class AuditRow:
    """One quantity of one engine beside the reference's.

    Attributes:
        quantity: what is compared.
        mine, theirs: the values in words; "20 states" for a function.
        difference: largest difference over the largest value; NaN if the engine's contract says
            that it does not show it, infinite if it should.
        tolerance: how much is the same physics.
    """

    quantity: str
    mine: str
    theirs: str
    difference: float
    tolerance: float

    @property
    def ok(self) -> bool:
        """Whether it is the same; what the contract excuses is not held against an engine."""
        return np.isnan(self.difference) or self.difference <= self.tolerance


def _flat(value: Any) -> Floats:
    """Numbers of a value in a fixed order, named parts sorted by their names."""
    if isinstance(value, Mapping):
        return np.concatenate([_flat(value[k]) for k in sorted(value)]) if value else np.zeros(0)
    return np.atleast_1d(np.asarray(value, dtype=np.float64)).ravel()


def _words(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{k} {_words(v)}" for k, v in sorted(value.items()))
    return " ".join(f"{x + 0.0:.6g}" for x in _flat(value))  # no -0


def difference(mine: Any, theirs: Any, least: float = 0.0) -> float:
    """Max |mine - theirs| / max |theirs|, or `least`; infinite if names or sizes differ or a value is not finite."""
    if isinstance(mine, Mapping) and isinstance(theirs, Mapping) and set(mine) != set(theirs):
        return np.inf
    a, b = _flat(mine), _flat(theirs)
    if a.shape != b.shape:
        return np.inf
    worst = float(np.max(np.abs(a - b), initial=0.0))
    scale = float(np.max(np.abs(b), initial=least))
    if not np.isfinite(worst):
        return np.inf
    return worst / scale if scale else worst


def states(case: Case, theirs: Mapping[str, Any]) -> list[tuple[Floats, Floats]]:
    """Random states in which every contact is entered, the same for all engines; near the start if none can open.

    Args:
        case: the scene.
        theirs: the reference's audit with gap(q) and H(q), by which contacts are entered.
    """
    draw = np.random.default_rng(SEED)
    n, nv = len(case.q0), len(case.v0)
    if case.general or not case.law.unilateral.any() or "gap" not in theirs:
        near = [(case.q0 + draw.uniform(-0.1, 0.1, n), draw.uniform(-1.0, 1.0, nv)) for _ in range(STATES)]
        return [(normalised(q, case.quaternions), v) for q, v in near]
    return [_entered(case, theirs["gap"], theirs["H"], draw) for _ in range(STATES)]


def _entered(case: Case, gap: Any, H: Any, draw: np.random.Generator) -> tuple[Floats, Floats]:
    """A state near the start with gaps and rates that are drawn below zero: by Newton, in least change."""
    wanted = -1e-2 * np.maximum(np.abs(gap(case.q0)), 1e-3) * draw.uniform(0.01, 1.0, len(case.law.a0))
    q: Floats = np.array(case.q0)
    for _ in range(NEWTON):
        off = wanted - gap(q)
        if np.all(np.abs(off) <= ROUNDED * np.abs(wanted)):
            break
        q = q + np.linalg.lstsq(H(q), off)[0]
    rates = -draw.uniform(0.0, 1.0, len(case.law.a0))
    return q, np.linalg.lstsq(H(q), rates)[0]


def rounded(key: str, theirs: Mapping[str, Any], at: Sequence[tuple[Floats, Floats]]) -> float:
    """Return what a function is measured by at least: forces that cancel leave rounding of momentum times speed."""
    if key != "bias" or "M" not in theirs:
        return 0.0
    return CANCELS * max(float(np.max(np.abs(np.asarray(theirs["M"](q)) @ v)) * np.max(np.abs(v))) for q, v in at)


def _row(
    key: str, mine: Mapping[str, Any], shown: str, theirs: str, value: float, hidden: Mapping[str, str]
) -> AuditRow:
    """One row; what is not shown is excused by the engine's contract or infinitely far off."""
    if key not in mine:
        shown, value = ("not shown", np.nan) if key in hidden else ("not shown, without an accepted reason", np.inf)
    tolerance = LAM_TOLERANCE if key == "lam" else TOLERANCE
    return AuditRow(quantity=key, mine=shown, theirs=theirs, difference=value, tolerance=tolerance)


def _numbers(mine: Mapping[str, Any], theirs: Mapping[str, Any], hidden: Mapping[str, str]) -> Iterator[AuditRow]:
    for key in NUMBERS:
        if key in theirs:
            shown = (_words(mine[key]), difference(mine[key], theirs[key])) if key in mine else ("", np.nan)
            yield _row(key, mine, shown[0], _words(theirs[key]), shown[1], hidden)


def _function(
    key: str, mine: Mapping[str, Any], theirs: Mapping[str, Any], at: Sequence[tuple[Floats, Floats]],
    hidden: Mapping[str, str],
) -> AuditRow:  # fmt: skip
    worst = np.nan
    if key in mine:
        arguments = [(q,) if key in ("M", "H") else (q, v) for q, v in at]
        wanted = [(a, right) for a in arguments if np.isfinite(right := _flat(theirs[key](*a))).all()]
        if wanted:  # dependent rows have no one lam
            a, b = np.concatenate([_flat(mine[key](*a)) for a, _ in wanted]), np.concatenate([x for _, x in wanted])
            worst = difference(a, b, rounded(key, theirs, at))
    return _row(key, mine, f"{STATES} states", f"{STATES} states", worst, hidden)


def answered_once(shown: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return what an audit shows with functions that compute an answer once, however often they are asked for it."""
    return {key: _answered_once(value) if callable(value) else value for key, value in shown.items()}


def _answered_once(function: Callable[..., Any]) -> Callable[..., Any]:
    known: dict[tuple[bytes, ...], Any] = {}

    def ask(*at: Floats) -> Any:
        key = tuple(array.tobytes() for array in at)
        if key not in known:
            known[key] = function(*at)
        return known[key]

    return ask


def audit(
    mine: Mapping[str, Any], theirs: Mapping[str, Any], case: Case, hidden: Mapping[str, str] = MappingProxyType({}),
    at: Sequence[tuple[Floats, Floats]] = (),
) -> tuple[AuditRow, ...]:  # fmt: skip
    """Compare what `Run.audit()` of an engine shows with the reference's.

    Args:
        mine: of the engine; it may name itself what it hides.
        theirs: of the reference; what it lacks is not asked for.
        case: the scene.
        hidden: quantity -> why the engine does not show it (`crossbody.engines.hidden`).
        at: positions and velocities at which functions are compared; those of `states` if none are given.
    """
    hidden = {**hidden, **mine.get("hidden", {})}
    at = at or states(case, theirs)
    numbers = (*_numbers(mine, theirs, hidden), *_laws(mine, case), *_bounds(mine, case))
    functions = (_function(key, mine, theirs, at, hidden) for key in FUNCTIONS if key in theirs)
    return (*numbers, *functions)


def settings_kept(mine: Mapping[str, Any], used: Mapping[str, Any]) -> tuple[AuditRow, ...]:
    """Return a row of settings that a run is said to have, and that an engine's model has; none if it shows none.

    Args:
        mine: what `Run.audit()` of an engine shows: its own under `set`.
        used: `Run.settings`.
    """
    own = {name: value for name, value in mine.get("set", {}).items() if name in used}
    if not own:
        return ()
    off = max(_apart(value, used[name]) for name, value in own.items())
    said = (" ".join(f"{name}={one[name]}" for name in own) for one in (own, used))
    return (AuditRow(quantity="settings", mine=next(said), theirs=next(said), difference=off, tolerance=TOLERANCE),)


def _apart(mine: Any, asked: Any) -> float:
    """Return how far a setting is from what was asked for, as a part of that; infinite for another word."""
    if isinstance(mine, str) or isinstance(asked, str):
        return 0.0 if mine == asked else np.inf
    return difference(float(mine), float(asked))


def _laws(mine: Mapping[str, Any], case: Case) -> Iterator[AuditRow]:
    """Yield how far a0 or a1 of rows are off, each by its own, of those that an engine has that read the file."""
    if case.scene is None or "law" not in mine:
        return
    wanted = softness(case.scene, case.scene.pairs)
    off = [
        difference(mine["law"][name][k], law[k]) for name, law in wanted.items() if name in mine["law"] for k in (0, 1)
    ]
    said = f"a0 and a1 of {len(off) // 2} rows"
    yield AuditRow(quantity="law", mine=said, theirs=said, difference=max(off, default=0.0), tolerance=TOLERANCE)


def _bounds(mine: Mapping[str, Any], case: Case) -> Iterator[AuditRow]:
    """Yield how far ends and margins are off of bounds that an engine has that read the file, reached or not."""
    if case.scene is None or "bounds" not in mine:
        return
    every: tuple[Joint | Tendon, ...] = (*case.scene.joints, *case.scene.tendons)
    parts = [part for part in every if not set(part.range) <= set(UNBOUNDED)]
    wanted = {part.name: [part.range[0], part.range[1], part.margin] for part in parts}
    balls = {joint.name for joint in case.scene.joints if joint.type == "ball"}
    own = {name: [-np.inf if name in balls else low, *more] for name, (low, *more) in mine["bounds"].items()}
    off = [_apart_of_bounds(own.get(name), wanted.get(name)) for name in {*own, *wanted}]
    if not off:
        return
    said = (f"ends and margins of {len(one)} bounds" for one in (own, wanted))
    yield AuditRow(
        quantity="bounds", mine=next(said), theirs=next(said), difference=max(off, default=0.0), tolerance=TOLERANCE
    )


def _apart_of_bounds(mine: Sequence[float] | None, theirs: Sequence[float] | None) -> float:
    """Return by how much ends and margin are off, of the largest; infinite where one has no such bound."""
    if mine is None or theirs is None:
        return np.inf
    a, b = np.array(mine), np.array(theirs)
    finite = np.isfinite(b)
    return difference(a[finite], b[finite]) if np.array_equal(a[~finite], b[~finite]) else np.inf
