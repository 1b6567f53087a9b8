"""What `crossbody list` prints: everything that has a name, or what one of them can be asked for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from crossbody.reports import layout

if TYPE_CHECKING:
    from crossbody.cases import Case, Parameter, Value

Named = dict[str, dict[str, str]]  # heading -> name -> one line
EVERYTHING = "(-inf, inf)"


def everything() -> Named:
    """Return all that has a name; imports none of it."""
    from crossbody import cases, engines
    from crossbody.hw import models
    from crossbody.hw.reading import published
    from crossbody.reports import metrics, suites

    sources = {"Cases": cases, "Engines": engines, "Metrics": metrics, "Stress suites": suites}
    sources |= {"Models of logs": models, "Column maps of logs": published}
    return {title: {name: source.summary(name) for name in source.names()} for title, source in sources.items()}


def case(name: str) -> Named:
    """Return variants, parameters, rows and own metrics of a case; of a file also the names that options take."""
    from crossbody import cases
    from crossbody.cases import loading

    name, wanted = loading.parted(name)
    source = loading.module(name)
    found = {variant: cases.load(name, variant) for variant in ((wanted,) if wanted else source.VARIANTS)}
    values = found[wanted].parameters if wanted else {}
    idle = set.intersection(*map(_idle, found.values()))
    parameters = {
        key: _parameter(each, values.get(key, each.default))
        for key, each in source.PARAMETERS.items() if key not in idle
    }  # fmt: skip
    own = {key: f"{metric.doc} [{metric.unit}]" for one in found.values() for key, metric in one.metrics.items()}
    rows = {row: "" for one in found.values() for row in one.contacts}
    told = {
        "Variants": {variant: f"{one.title}{_changes(one, source.PARAMETERS)}" for variant, one in found.items()},
        "Parameters": parameters, "Rows": rows, **_of_scene(next(iter(found.values()))), "Metrics of its own": own,
    }  # fmt: skip
    return {title: named for title, named in told.items() if named}


def _idle(case: Case) -> set[str]:
    """Return parameters of a file that nothing in it takes."""
    if case.scene is None or not case.file:
        return set()
    from crossbody.cases.files.controls import movable

    scene, rows = case.scene, bool(case.contacts or case.scene.pairs)
    takes = {
        ("ctrl", "control", "tick"): bool(scene.actuators), ("rank", "assemble"): bool(scene.loops),
        ("push",): bool(movable(scene)), ("friction",): bool(scene.pairs), ("a0", "a1"): rows,
    }  # fmt: skip
    return {name for names, what in takes.items() if not what for name in names}


def _of_scene(case: Case) -> Named:
    """Return rows that friction adds, and the names of what starts, is pushed and is driven in a file."""
    if case.scene is None or not case.file:
        return {}
    from crossbody.cases.files.case import rubbing
    from crossbody.cases.files.controls import movable

    rubs, can = rubbing(case), movable(case.scene)
    return {
        "Rows if its motion comes to a contact with friction": dict.fromkeys(
            () if rubs is None else [row for row in rubs.contacts if row not in case.contacts], ""
        ),
        "Coordinates (--start)": {one.name: one.unit for one in case.coordinates if one.unit != "1"},
        "Velocities (--rate)": {one.name: f"{one.unit}/s" for one in case.velocities},
        "Bodies (--push)": {body.name: f"{body.mass:g} kg" for body in case.scene.bodies if body.name in can},
        "Actuators (columns of --ctrl)": {
            one.name: "[{:g}, {:g}]".format(*one.control_range) for one in case.scene.actuators
        },
    }


def _changes(case: Case, known: Mapping[str, Parameter]) -> str:
    """Return what a variant sets to something else than the defaults."""
    values = case.parameters
    told = ", ".join(f"{key} {_plain(values[key])}" for key, one in known.items() if values[key] != one.default)
    return f" ({told})" if told else ""


def _parameter(one: Parameter, *values: Value) -> str:
    """Return its sentence, its values with the unit, and what is valid where that is bounded."""
    told = [f"{', '.join(map(_plain, values))} {one.unit}".strip(), "" if one.valid == EVERYTHING else one.valid]
    return f"{one.doc} ({'; '.join(filter(None, told)) or 'empty'})"


def _plain(value: Value) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def engine(name: str) -> Named:
    """Return profiles of an engine, the settings that each has for the bouncing ball, and versions of its packages."""
    from crossbody import cases, engines
    from crossbody.engines.settings import profile_of
    from crossbody.reports.judging.stored import words

    name, _, wanted = name.partition(":")
    found, ball = engines.load(name), cases.load("bouncing_ball")
    profiles = {wanted: found.profiles[profile_of(name, found.profiles, wanted)]} if wanted else dict(found.profiles)
    able = [profile for profile in profiles if found.why_not(ball, profile) is None]
    used = {profile: found.planned(ball, profile) for profile in able}
    offered = {profile: found.offered(ball, profile) for profile in able}
    told = {
        "Profiles": profiles,
        "Settings for bouncing_ball": {
            key: _setting(each, {profile: used[profile][key] for profile in able if key in offered[profile]}, len(able))
            for key, each in {key: one for mine in offered.values() for key, one in mine.items()}.items()
        },
        "Fixed for bouncing_ball": {
            profile: words({key: value for key, value in used[profile].items() if key not in offered[profile]})
            for profile in able
        },
        "Versions": dict(found.versions),
    }
    return {title: named for title, named in told.items() if any(named.values()) or title == "Versions"}


def _setting(one: Parameter, values: Mapping[str, Value], profiles: int) -> str:
    """Return a setting with its value, or with those of the profiles where they differ or some have none."""
    owners: dict[Value, list[str]] = {}
    for profile, value in values.items():
        owners.setdefault(value, []).append(profile)
    told = (f"{' and '.join(who)}: {_plain(value)}" for value, who in owners.items())
    return _parameter(one, *(owners if len(owners) == 1 and len(values) == profiles else told))


def model(name: str) -> Named:
    """Return the parameters of a model of logs."""
    from crossbody.hw import models

    return {"Parameters": {key: _parameter(each, each.default) for key, each in models.load(name).parameters.items()}}


def one(name: str) -> Named:
    """Return what can be asked of the case, file, engine or model of that name, or what a metric or a suite is."""
    from crossbody import cases, engines
    from crossbody.cases.loading import parted
    from crossbody.hw import models
    from crossbody.reports import metrics, suites

    told = {"Metrics": metrics, "Stress suites": suites}
    summaries = {title: {name: source.summary(name)} for title, source in told.items() if name in source.names()}
    known = (*cases.names(), *engines.names(), *models.names())
    head = name if "." in name else parted(name)[0]
    if "." not in name and head not in known:
        if summaries:
            return summaries
        raise cases.UnknownName(
            "case, engine, metric, suite or model", head, {*known, *metrics.names(), *suites.names()}
        )
    if head in engines.names():
        return engine(name)
    if name in models.names():
        return model(name)
    return case(name)


def text(told: Named) -> str:
    """Return it as aligned lines."""
    lines = []
    for title, named in told.items():
        width = max(map(len, named), default=0)
        all_ = (f"  {name:<{width}}  {line}".rstrip() for name, line in named.items())
        lines += [f"{title}:", *(layout.told(line, indent=width + 4) for line in all_)]
    return "\n".join(lines)
