"""Tables of other studies taken into a folder of results, so that its pages show them too."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from crossbody.cases import OutputError
from crossbody.reports.runs import files
from crossbody.reports.runs.output import recover, require_ours, took

OWN = ("verdicts", "audit", "provenance")
"""Of every folder; they stay those of the folder that is taken into."""
TABLES = (".json", ".csv", ".parquet")


def tables(folder: Path) -> list[Path]:
    """Files of the studies in a folder.

    Raises:
        OutputError: if it is not one of ours, or holds no study.
    """
    recover(folder)
    require_ours(folder, "study")
    paths = (folder / name for name in files.listed(folder))
    found = [path for path in paths if path.suffix in TABLES and path.stem not in OWN]
    if not found:
        raise OutputError(
            f"{folder} contains no study: name a folder that crossbody bench, stress, gapmap, "
            "stability, bode, analyse, replay or identify wrote."
        )
    return found


def take(made: Path, others: Sequence[Path]) -> None:
    """Copy the tables of other folders into one that is being written; a study that is there already is replaced.

    Raises:
        OutputError: as `tables`, if a table is a link, or if the disk refuses.
    """
    for path in [path for other in others for path in tables(other)]:
        try:
            (made / path.name).unlink(missing_ok=True)
            (made / path.name).write_bytes(files.read_inside(path.parent, path.name))
            took(made, path.name)
        except OutputError:
            raise
        except OSError as error:
            raise OutputError(f"{path} cannot be copied into {made.parent}: {error.strerror}.") from None
