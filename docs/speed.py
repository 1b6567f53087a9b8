"""The tables of docs/explanation/speed.md, measured: `make speed` writes them anew.

    python docs/speed.py [MINUTES]      of the largest part, the ladders of all engines on all cases; 6 if not given

All of them in one process after another on the machine as it is: run it where nothing else runs. What is not between
a pair of marks of the page is left as it stands.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import pandas as pd

PAGE = Path(__file__).parent / "explanation" / "speed.md"
MINUTES = sys.argv[1] if len(sys.argv) > 1 else "6"
PACKAGES = ("mujoco", "pin", "exudyn", "drake", "dartpy", "pymunk", "scikit-sundae")
DROP = "bouncing_ball:elastic(a0=100000,a1=0,a2=0,t_end=2)"


def main() -> None:
    """Measure, and put the tables in their places."""
    studies = {
        "bench": ("--full", "--minutes", MINUTES, "--repeats", "3"),
        "skip": ("--skip",), "throughput": ("--throughput",),
    }  # fmt: skip
    written({"with": installed()})
    for name, options in studies.items():  # each is written when it is there
        with tempfile.TemporaryDirectory() as work:
            out = measured(Path(work) / name, *options)
            if name == "bench":
                lines = pd.read_parquet(out / "headline.parquet")
                written({"every": every(lines), "drop": drop(lines)})
            else:
                written({name: ratios(pd.read_parquet(out / f"{name}.parquet"))})


def written(tables: Mapping[str, str]) -> None:
    """Put tables in their places on the page."""
    PAGE.write_text(replaced(PAGE.read_text(encoding="utf-8"), tables), encoding="utf-8")


def measured(out: Path, *options: str) -> Path:
    """The folder of one benchmark; a row that is beyond its limit is in it, and its exit code is 1."""
    command = "from crossbody.reports.entry import main; main()"
    done = subprocess.run([sys.executable, "-c", command, "bench", "-q", "--out", str(out), *options], check=False)
    if done.returncode not in (0, 1):
        raise SystemExit(f"bench {' '.join(options)} ended with exit code {done.returncode}.")
    return out


def installed() -> str:
    """What was compared, in which version."""
    found = []
    for package in PACKAGES:
        try:
            found.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            found.append(f"{package} not installed")
    return ", ".join(found) + "."


def every(lines: pd.DataFrame) -> str:
    """A line a case: how many engines reach an error, the least ratios, and where the reference is not ahead."""
    rows = []
    for case, group in lines.groupby("case", sort=False):
        reached = group[group["best_error"].notna()]
        behind = reached[reached["ahead"] != "yes"]
        who = ", ".join(f"{row.engine}:{row.profile}" for row in behind.itertuples()) or "none"
        rows.append((f"`{case}`", f"{len(reached)} of {len(group)}", reached["ratio"].min(),
                     reached["ratio_native"].min(), reached["least_ratio"].min(), who))  # fmt: skip
    head = ("Case", "Lines", "Least at best errors", "Least of native loops", "Least at any error", "Not ahead of")
    return markdown(head, rows)


def drop(lines: pd.DataFrame) -> str:
    """One drop in all engines: error, ratio there, and that of the native loop."""
    group = lines[(lines["case"] == DROP) & lines["best_error"].notna()].sort_values("best_error")
    rows = [(f"{row.engine}:{row.profile}", row.best_error, row.ratio, row.ratio_native, row.interpreted)
            for row in group.itertuples()]  # fmt: skip
    return markdown(("Engine", "Best error", "Ratio of times there", "Its own loop alone", "Interpreted"), rows)


def ratios(rows: pd.DataFrame) -> str:
    """What was measured and its limit."""
    return markdown(("What", "Measured", "Limit"), [(row.what, row.value, row.limit) for row in rows.itertuples()])


def markdown(head: tuple[str, ...], rows: list[tuple[object, ...]]) -> str:
    """A table; numbers to two digits, empty where there is none."""
    lines = [head, ("---",) * len(head), *(tuple(map(cell, row)) for row in rows)]
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines)


def cell(value: object) -> str:
    """One cell."""
    if not isinstance(value, float):
        return str(value)
    return "" if pd.isna(value) else f"{value:.2g}" if abs(value) < 100.0 else f"{value:.0f}"


def replaced(text: str, tables: Mapping[str, str]) -> str:
    """The page with each table between its marks.

    Raises:
        SystemExit: where a mark is missing.
    """
    for name, table in tables.items():
        pattern = re.compile(rf"(<!-- {name} -->\n).*?(<!-- end {name} -->)", re.DOTALL)
        text, count = pattern.subn(lambda found, table=table: f"{found[1]}{table}\n{found[2]}", text)
        if count != 1:
            raise SystemExit(f"{PAGE} has {count} places for {name}; it must have one.")
    return text


if __name__ == "__main__":
    main()
