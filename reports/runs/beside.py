"""Tables of other studies taken into a folder of results, so that its pages show them too."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path

from crossbody.cases import OutputError
from crossbody.reports.runs.output import MARKER

OWN = ("verdicts", "audit", "provenance")
"""Of every folder; they stay those of the folder that is taken into."""
TABLES = (".json", ".csv", ".parquet")


def tables(folder: Path) -> list[Path]:
    """Files of the studies in a folder.

    Raises:
        OutputError: if it is not one of ours, or holds no study.
    """
    if not (folder / MARKER).is_file():
        raise OutputError(f"{folder} was not written by crossbody; name the folder of an earlier study.")
    found = sorted(path for path in folder.iterdir() if path.suffix in TABLES and path.stem not in OWN)
    if not found:
        raise OutputError(
            f"{folder} holds no study: name a folder that crossbody bench, stress, gapmap, stability, bode, analyse, "
            "replay or identify wrote."
        )
    return found


def take(out: Path, others: Sequence[Path]) -> None:
    """Copy the tables of other folders into `out`; a study that is there already is replaced.

    Raises:
        OutputError: as `tables`, or if the disk refuses.
    """
    for path in [path for other in others if other.resolve() != out.resolve() for path in tables(other)]:
        copy = out / f".{path.name}"
        try:
            shutil.copyfile(path, copy)
            copy.replace(out / path.name)
        except OSError as error:
            raise OutputError(f"{path} cannot be taken into {out}: {error.strerror}.") from None
