"""What is asked for: cases, engines, settings. Imports nothing that wrong words would wait for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from crossbody import cases, engines
from crossbody.cases import Case, CaseUnsupported, EngineUnavailable, InvalidValue, UnknownName, Value
from crossbody.cases.loading import parted
from crossbody.reports.runs import watch

DEFAULT_CASES = ("bouncing_ball",)
DEFAULT_ENGINES = ("reference", "mujoco", "pinocchio")
DEAR = 4.0
"""Time, in budgets, that a run of a file may take unless its profile is asked for: engines that follow the law take
their steps in Python."""
COMPILED = ("reference", "compiled")  # who follows what the truth has followed
CVODE = "reference:cvode"  # the witness of most truths of files
_EXAMPLES = {"--set": "a1=0", "--set-engine": "dt=1e-4", "--at": "z=0.4"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Pick:
    """One engine under one profile, or the sentence that says why it cannot be had.

    Attributes:
        engine, profile: who.
        skipped: why it cannot be had; empty if it can.
        every: whether it is one of all profiles, so that another may stand for it (`of_case`).
    """

    engine: str
    profile: str
    skipped: str = ""
    every: bool = field(default=False, compare=False)


def parse_engine(text: str) -> tuple[str, str | None]:
    """E or E:PROFILE."""
    engine, _, profile = text.partition(":")
    return engine, profile or None


def parse_settings(pairs: Sequence[str], option: str = "--set") -> dict[str, Value]:
    """Parameters or settings from k=v; a number where it reads as one.

    Raises:
        InvalidValue: for a text without "=".
    """
    found: dict[str, Value] = {}
    for pair in pairs:
        name, equals, text = pair.partition("=")
        if not equals or not name.strip() or not text.strip():
            raise InvalidValue(f"{option} {pair!r} is not name=value, for example {option} {_EXAMPLES[option]}.")
        try:
            found[name.strip()] = float(text)
        except ValueError:
            found[name.strip()] = text.strip()
    return found


def load_cases(
    names: Sequence[str], variant: str | None, overrides: Mapping[str, Value], limit: float = watch.LIMIT
) -> tuple[Case, ...]:
    """Every case asked for, in all its variants unless one is named.

    Raises:
        CaseUnsupported: for one that was not built within the limit, s.
    """
    found = []
    for name in names or DEFAULT_CASES:
        label = f"{name} (build)"
        if why := watch.lost(label):
            raise CaseUnsupported(f"{name} cannot be built. {why}")
        watch.limited(label, limit)
        found += [cases.load(name, each, **overrides) for each in _variants(name, variant)]
    watch.unlimited()
    return tuple(found)


def sources(names: Sequence[str], variant: str | None) -> tuple[str, ...]:
    """Return what each of the cases that `load_cases` returns is loaded by: a name or a file."""
    return tuple(parted(name)[0] for name in names or DEFAULT_CASES for _ in _variants(name, variant))


def _variants(name: str, variant: str | None) -> tuple[str, ...]:
    return (variant,) if variant is not None else cases.variants(name)


def offered(case: Case, pick: Pick) -> Mapping[str, Any] | None:
    """Return the settings that an engine offers for a case; None where it would not run."""
    try:
        return engines.load(pick.engine).offered(case, pick.profile)
    except CaseUnsupported:
        return None


def picks(wanted: Sequence[str]) -> tuple[Pick, ...]:
    """Every engine and profile asked for; an engine that is not installed is a pick that says so.

    Raises:
        UnknownName: for an engine or profile that does not exist.
    """
    names = wanted or [name for name in DEFAULT_ENGINES if name in engines.names()]
    return tuple(dict.fromkeys(pick for text in names for pick in _profiles(*parse_engine(text))))


def _profiles(name: str, profile: str | None) -> Iterator[Pick]:
    try:
        engine = engines.load(name)
    except EngineUnavailable as error:
        yield Pick(engine=name, profile=profile or "*", skipped=str(error))
        return
    if profile is not None and profile not in engine.profiles:
        raise UnknownName(f"profile of {name}", profile, engine.profiles)
    others = engine.of_scenes.values()
    for each in engine.profiles if profile is None else (profile,):
        if profile is not None or each not in others:
            yield Pick(engine=name, profile=each, every=profile is None)


def of_case(pick: Pick, case: Case) -> Pick:
    """Return a pick, or for one of all profiles the one that stands for it where the case is a file."""
    if not pick.every or pick.skipped or not case.file:
        return pick
    return replace(pick, profile=engines.load(pick.engine).of_scenes.get(pick.profile, pick.profile))


def bounded(case: Case, pick: Pick) -> bool:
    """Return whether a run is left out where it takes too long, or is the witness of its truth."""
    return pick.every and bool(case.file) and (pick.engine, pick.profile) != COMPILED


def with_bound(case: Case, pick: Pick, asked: Mapping[str, Value], budget: float) -> dict[str, Value]:
    """Return the settings that are asked for, with the time that the run may take, in budgets of so many s."""
    return {"time_limit": DEAR * budget, **asked} if bounded(case, pick) else dict(asked)


def of_pick(settings: Mapping[str, Value], pick: Pick) -> dict[str, Value]:
    """The settings that an engine is given: those of all, over them its own, over them its profile's."""
    found = {name: value for name, value in settings.items() if "." not in name}
    for who in (pick.engine, f"{pick.engine}:{pick.profile}"):
        found |= {name.removeprefix(f"{who}."): value for name, value in settings.items() if name.startswith(f"{who}.")}
    return found


def check_tolerance(rtol: float | None) -> None:
    """Check the tolerance that all engines are given."""
    if rtol is not None and not 1e-14 <= rtol <= 1e-1:
        raise InvalidValue(f"--rtol is {rtol:g}; valid: [1e-14, 0.1].")


def check_known(settings: Mapping[str, Value], ran: Sequence[tuple[str, str, Mapping[str, Any]]]) -> None:
    """Check that somebody has each setting.

    Args:
        settings: asked for.
        ran: engine, profile and settings that it offers, of those that can run.

    Raises:
        UnknownName: for one that none of those who are meant has.
    """
    for name in settings:
        who, _, key = name.rpartition(".")
        own = [known for engine, profile, known in ran if who in ("", engine, f"{engine}:{profile}")]
        if own and not any(key in known for known in own):
            raise UnknownName(f"setting of {who or 'these engines'}", key, {known for one in own for known in one})


def check_asked(settings: Mapping[str, Value], wanted: Sequence[Pick]) -> None:
    """Check that the engines whose settings are given are run.

    Raises:
        UnknownName: for an engine that is not, or a profile that it does not have.
    """
    for name in settings:
        who, dot, key = name.rpartition(".")
        if dot and not (who and key):
            raise InvalidValue(f"--set-engine {name}= has no {'setting' if who else 'engine'}; mujoco.dt=1e-4 would.")
    for who in {name.rpartition(".")[0] for name in settings} - {""}:
        name, profile = parse_engine(who)
        known = {pick.engine for pick in wanted}
        if name not in known:
            raise UnknownName("engine in this run", name, known)
        if profile is not None and profile not in engines.load(name).profiles:
            raise UnknownName(f"profile of {name}", profile, engines.load(name).profiles)
