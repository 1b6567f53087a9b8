"""What `crossbody list` prints: everything that has a name, or what one of them can be asked for."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from crossbody.reports import layout

if TYPE_CHECKING:
    from crossbody.cases import Parameter

Named = dict[str, dict[str, str]]  # heading -> name -> one line
EVERYTHING = "(-inf, inf)"


def everything() -> Named:
    """Return all that has a name; imports none of it."""
    from crossbody import cases, engines
    from crossbody.hw import models
    from crossbody.reports import metrics, suites

    sources = {"Cases": cases, "Engines": engines, "Metrics": metrics, "Stress suites": suites}
    sources["Models of logs"] = models
    return {title: {name: source.summary(name) for name in source.names()} for title, source in sources.items()}


def case(name: str) -> Named:
    """Return variants, parameters, rows and own metrics of a case."""
    from crossbody import cases
    from crossbody.cases import loading

    name, wanted = loading.parted(name)
    source = loading.module(name)
    found = {variant: cases.load(name, variant) for variant in ((wanted,) if wanted else source.VARIANTS)}
    parameters = {key: _parameter(each) for key, each in source.PARAMETERS.items()}
    own = {key: f"{metric.doc} [{metric.unit}]" for one in found.values() for key, metric in one.metrics.items()}
    rows = {row: "" for one in found.values() for row in one.contacts}
    told = {
        "Variants": {variant: one.title for variant, one in found.items()},
        "Parameters": parameters, "Rows": rows, "Metrics of its own": own,
    }  # fmt: skip
    return {title: named for title, named in told.items() if named}


def _parameter(one: Parameter) -> str:
    """Return its sentence, its default with the unit, and what is valid where that is bounded."""
    default = f"{one.default:g}" if isinstance(one.default, float) else str(one.default)
    told = [f"{default} {one.unit}".strip(), "" if one.valid == EVERYTHING else one.valid]
    return f"{one.doc} ({'; '.join(filter(None, told)) or 'empty'})"


def engine(name: str) -> Named:
    """Return profiles of an engine, the settings that each has for the bouncing ball, and versions of its packages."""
    from crossbody import cases, engines
    from crossbody.reports.judging.stored import words

    found, ball, settings = engines.load(name), cases.load("bouncing_ball"), dict[str, str]()
    for profile in found.profiles:
        with suppress(cases.CaseUnsupported):
            settings[profile] = words(found.planned(ball, profile))
    return {"Profiles": dict(found.profiles), "Settings for bouncing_ball": settings, "Versions": dict(found.versions)}


def model(name: str) -> Named:
    """Return the parameters of a model of logs."""
    from crossbody.hw import models

    return {"Parameters": {key: _parameter(each) for key, each in models.load(name).parameters.items()}}


def one(name: str) -> Named:
    """Return what can be asked of the case, file, engine or model of that name."""
    from crossbody import cases, engines
    from crossbody.cases.loading import parted
    from crossbody.hw import models

    known = (*cases.names(), *engines.names(), *models.names())
    if "." not in name and parted(name)[0] not in known:
        raise cases.UnknownName("case, engine or model", name, known)
    return engine(name) if name in engines.names() else model(name) if name in models.names() else case(name)


def text(told: Named) -> str:
    """Return it as aligned lines."""
    lines = []
    for title, named in told.items():
        width = max(map(len, named), default=0)
        all_ = (f"  {name:<{width}}  {line}".rstrip() for name, line in named.items())
        lines += [f"{title}:", *(layout.told(line, indent=width + 4) for line in all_)]
    return "\n".join(lines)
