"""Which cases and engines a session asks for: by mark, command line or configuration file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from crossbody import cases
from crossbody.cases import CrossbodyError
from crossbody.cases.loading import OF_USERS, parted
from crossbody.reports.runs import choice
from crossbody.reports.runs.choice import Pick

NONE = (
    "No case is named: use --crossbody-case CASE, crossbody_cases in the configuration, or the mark "
    "@pytest.mark.crossbody(CASE)."
)


@dataclass(frozen=True, slots=True)
class Scene:
    """One variant of one case; `name` is a path for a case file of one's own."""

    name: str
    variant: str

    def __str__(self) -> str:
        """As it stands in the name of a test."""
        return f"{Path(self.name).stem}:{self.variant}"


@dataclass(frozen=True, slots=True)
class Named:
    """A pick that shows its name in the name of a test."""

    pick: Pick

    def __str__(self) -> str:
        """As on the command line; an engine that is not there has no profiles to name."""
        return f"{self.pick.engine}:{self.pick.profile}" if self.pick.profile != "*" else self.pick.engine


def scenes(config: pytest.Config, mark: pytest.Mark | None = None) -> list[Any]:
    """Every variant of every case asked for; one skipped parameter where there is none."""
    texts = mark.args if mark is not None and mark.args else _asked(config, "case")
    try:
        found = [scene for text in texts for scene in _variants(*parted(str(text)), _base(config, mark))]
    except CrossbodyError as error:
        raise pytest.Collector.CollectError(str(error)) from None
    return list(dict.fromkeys(found)) or [pytest.param(None, id="no-case", marks=pytest.mark.skip(reason=NONE))]


def picks(config: pytest.Config, mark: pytest.Mark | None = None) -> list[Named]:
    """Every profile of every engine asked for; those that `crossbody run` takes where none is named."""
    texts = mark.kwargs.get("engines", ()) if mark is not None else ()
    try:
        return [Named(pick) for pick in choice.picks(texts or _asked(config, "engine"))]
    except CrossbodyError as error:
        raise pytest.Collector.CollectError(str(error)) from None


def _asked(config: pytest.Config, option: str) -> Sequence[str]:
    found: Sequence[str] = config.getoption(f"--crossbody-{option}") or config.getini(f"crossbody_{option}s")
    return found


def _base(config: pytest.Config, mark: pytest.Mark | None) -> Path:
    """The folder that relative paths start from: where the command was typed, or the configuration stands."""
    typed = bool(config.getoption("--crossbody-case")) and not (mark is not None and mark.args)
    return config.invocation_params.dir if typed else config.rootpath


def _variants(name: str, variant: str | None, base: Path) -> list[Scene]:
    source = str(base / Path(name).expanduser()) if name.endswith(OF_USERS) else name
    known = cases.variants(source)
    if variant is not None and variant not in known:
        raise cases.UnknownName(f"variant of {Path(name).stem}", variant, known)
    return [Scene(source, each) for each in (known if variant is None else (variant,))]
