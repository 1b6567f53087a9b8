"""What `crossbody list` prints: everything that has a name, or what one case can be asked for."""

from __future__ import annotations

Named = dict[str, dict[str, str]]
"""Heading -> name -> one line."""


def everything() -> Named:
    """Return all that has a name; imports none of it."""
    from crossbody import cases, engines
    from crossbody.hw import models
    from crossbody.reports import metrics, suites

    sources = {"Cases": cases, "Engines": engines, "Metrics": metrics, "Stress suites": suites}
    sources["Models of logs"] = models
    return {title: {name: source.summary(name) for name in source.names()} for title, source in sources.items()}


def case(name: str) -> Named:
    """Return variants, parameters, rows and own metrics of a case.

    Args:
        name: of a case, or the path of a file with one.

    Raises:
        CrossbodyError: if there is no such case.
    """
    from crossbody import cases
    from crossbody.cases import loading

    source = loading.module(name)
    found = {variant: cases.load(name, variant) for variant in source.VARIANTS}
    parameters = {
        key: f"{each.doc} ({f'{_short(each.default)} {each.unit}'.strip()})" for key, each in source.PARAMETERS.items()
    }
    own = {key: f"{metric.doc} [{metric.unit}]" for one in found.values() for key, metric in one.metrics.items()}
    rows = {row: "" for one in found.values() for row in one.contacts}
    told = {
        "Variants": {variant: one.title for variant, one in found.items()},
        "Parameters": parameters, "Rows": rows, "Metrics of its own": own,
    }  # fmt: skip
    return {title: named for title, named in told.items() if named}


def _short(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def text(told: Named) -> str:
    """Return it as aligned lines."""
    lines = []
    for title, named in told.items():
        width = max(map(len, named), default=0)
        lines += [f"{title}:", *(f"  {name:<{width}}  {line}".rstrip() for name, line in named.items())]
    return "\n".join(lines)
