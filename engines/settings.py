"""Settings of a run: named, checked, and kept for provenance."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from crossbody.cases import Case, Parameter, UnknownName, Value
from crossbody.cases.arguments import instance

MATCHED = "matched"


class UnknownSetting(UnknownName):
    """A setting that an engine does not have; `settings` are those that it has, by their names."""

    def __init__(self, kind: str, name: str, settings: Mapping[str, Parameter]) -> None:
        super().__init__(kind, name, settings)
        self.settings = dict(settings)


def chosen(engine: str, profile: str, known: Mapping[str, Parameter], given: Mapping[str, Any]) -> dict[str, Value]:
    """Every setting's value: the user's where given, else the default.

    Raises:
        UnknownSetting: for a setting that the profile does not have; the valid ones are listed.
        InvalidValue: for a value outside what the setting admits.
    """
    where = f"{engine}:{profile}"
    for name in given:
        if name not in known:
            raise UnknownSetting(f"setting of {where}", name, known)
    return {name: p.checked(f"{where}: {name}", given.get(name, p.default)) for name, p in known.items()}


def check_case(case: object) -> None:
    """Refuse what is no case.

    Raises:
        InvalidValue: saying where one comes from.
    """
    instance("case", case, Case, "a Case, as crossbody.cases.load returns it")


def profile_of(engine: str, profiles: Mapping[str, str], profile: str) -> str:
    """The profile, if the engine has it; "matched" is the first one of an engine that has no profile of that name.

    Raises:
        UnknownName: listing the profiles.
    """
    if not isinstance(profile, str):
        raise UnknownName(f"profile of {engine}", profile, profiles)
    if profile == MATCHED:
        return MATCHED if MATCHED in profiles else next(iter(profiles))
    if profile not in profiles:
        raise UnknownName(f"profile of {engine}", profile, profiles)
    return profile
