"""Column maps for published data sets that come along: their names, without what reads logs."""

from __future__ import annotations

import tomllib
from pathlib import Path

MAPS = Path(__file__).parents[1] / "maps"


def names() -> tuple[str, ...]:
    """Names of the maps."""
    return tuple(sorted(path.stem for path in MAPS.glob("*.toml")))


def summary(name: str) -> str:
    """Say what a map reads, in one line."""
    about = str(tomllib.loads((MAPS / f"{name}.toml").read_text(encoding="utf-8"))["about"])
    return f"{about.partition(': ')[0]}."
