"""Two studies of one folder, and files of the user's beside them."""

from __future__ import annotations

from pathlib import Path

from crossbody.reports.runs.output import folder

MINE = {"notes.md": "mine", "bench/own.csv": "mine too", "traces/sketch.txt": "and mine"}


STUDIES = ("old", "new")


FILES = {
    "old": ("verdicts.json", "a.json", "traces/0000.parquet", "traces/0001.parquet", "index.html"),
    "new": ("verdicts.json", "b.json", "traces/0000.parquet", "index.html", "case.html"),
}


def put(place: Path, which: str, study: str = "run") -> None:
    """Write one of two studies, each with files that the other does not have."""
    with folder(place, study) as made:
        for name in FILES[which]:
            (made / name).parent.mkdir(exist_ok=True)
            (made / name).write_text(which)


def fresh(place: Path) -> Path:
    """A folder with an old study, one of another command, and files of the user's."""
    put(place, "old")
    with folder(place, "bode") as made:
        (made / "bode.json").write_text("beside")
    for name, text in MINE.items():
        (place / name).parent.mkdir(exist_ok=True)
        (place / name).write_text(text)
    return place


def content(place: Path) -> dict[str, str]:
    """Every file but those whose names begin with a dot."""
    found = (path for path in place.rglob("*") if path.is_file())
    inside = ((path.relative_to(place), path) for path in found)
    return {str(name): path.read_text() for name, path in inside if not any(p.startswith(".") for p in name.parts)}


def expected(which: str) -> dict[str, str]:
    return dict.fromkeys(FILES[which], which) | MINE | {"bode.json": "beside"}
