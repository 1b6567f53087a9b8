"""The tables of walking robots in docs/explanation/contacts.md and the README, measured anew by `make walkers`.

The robots are the files of gymnasium's wheel, under motors whose controls are drawn once (seed 0) and held as long as
gymnasium holds an action.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from speed import markdown, replaced

from crossbody import cases
from crossbody.cases import Case, Tier
from crossbody.reports.judging.comparison import judged
from crossbody.reports.judging.parts import Positions, splits
from crossbody.reports.judging.run_verdicts import Entry
from crossbody.reports.judging.verdict import Row
from crossbody.reports.measuring.truth import Truth, shortened
from crossbody.reports.runs.choice import picks
from crossbody.reports.runs.jobs import run_case

PAGE = Path(__file__).parent / "explanation" / "contacts.md"
README = Path(__file__).parent.parent / "README.md"
HEADLINE = {"hopper.xml", "walker2d.xml", "humanoid.xml"}
"""Robots in the README."""
HELD = {"hopper": 0.008, "half_cheetah": 0.05, "ant": 0.05, "walker2d": 0.008, "humanoid": 0.015}
"""Robot -> how long gymnasium holds an action, s."""
T_END, BUDGET = 1.0, 60.0
"""Horizon and budget of a run, s."""


def main() -> None:
    """Measure, and put the table in its place."""
    rows = [row_of(name) for name in sys.argv[1:] or HELD]
    head = ("Robot", "Compared", "Known by", "Reference", "MuJoCo as it stands", "of its model", "of its step")
    table = markdown(head, rows)
    print(table)
    if not sys.argv[1:]:
        PAGE.write_text(replaced(PAGE.read_text(encoding="utf-8"), {"walkers": table}), encoding="utf-8")
        README.write_text(replaced(README.read_text(encoding="utf-8"), {"walkers": headline(rows)}), encoding="utf-8")


def headline(rows: Iterable[tuple[object, ...]]) -> str:
    """Lay out the table of the README: some robots, and what says most of each."""
    head = ("Robot", "Truth known for", "Error of MuJoCo", "of its model", "of its step")
    told = {str(robot).strip("`"): (robot, until, *errors) for robot, until, _, _, *errors in rows}
    return markdown(head, [row for name, row in told.items() if name in HEADLINE])


def row_of(name: str) -> tuple[object, ...]:
    """One robot: how far it is compared, and errors of position over the motion."""
    found = find_spec("gymnasium")
    if found is None or found.origin is None:
        raise SystemExit("The robots are gymnasium's, which is not installed: pip install gymnasium.")
    path = Path(found.origin).parent / "envs" / "mujoco" / "assets" / f"{name}.xml"
    with tempfile.TemporaryDirectory() as work:
        case = cases.load(str(path), ctrl=str(controls(path, HELD[name], Path(work))), t_end=T_END)
        result = run_case(case, picks(("reference:compiled", "mujoco:as_is")), budget=BUDGET)
    rows = [row.row() for row in judged(result.case, result.entries, result.truth, "")]
    trusted = shortened(result.truth)
    (truth,) = (row for row in rows if row["engine"] == "truth")
    until = float(truth["compared"]) * T_END
    return (
        f"`{name}.xml`", f"{until:.3g} s", "two witnesses (C)" if truth["tier"] == Tier.C else "itself (D)",
        size(rows, "reference", "position"), size(rows, "mujoco", "position"),
        *parts(result.case, trusted, result.entries[-1]),
    )  # fmt: skip


def parts(case: Case, truth: Truth, entry: Entry) -> tuple[str, str]:
    """How much of MuJoCo's worst error is its model's and how much its step's, and what both are known to."""
    assert entry.run is not None
    assert entry.study is not None
    split = splits(case, truth, entry.run, entry.study)["position"]
    if "model" in split.there:
        known = split.known["model"]
        return f"{split.there['model']:.1e} ± {known:.0e}", f"{split.there['step']:.1e} ± {known:.0e}"
    laid, (coarse, fine) = Positions(case, truth, entry.run), entry.study.runs[-2:]
    return (f"not settled ({np.abs(laid(coarse) - laid(fine)).max():.1e})",) * 2


def controls(path: Path, held: float, work: Path) -> Path:
    """Write a table of controls, uniform in the range of every motor."""
    actuators = cases.load(str(path)).scene.actuators
    times, rng = np.arange(0.0, T_END - 1e-9, held), np.random.default_rng(0)
    low, high = np.array([actuator.control_range for actuator in actuators]).T
    table = np.column_stack([times, rng.uniform(low, high, size=(len(times), len(actuators)))])
    names = ["t", *(actuator.name for actuator in actuators)]
    np.savetxt(work / "controls.csv", table, delimiter=",", header=",".join(names), comments="", fmt="%.17g")
    return work / "controls.csv"


def size(rows: list[Row], engine: str, metric: str) -> str:
    """A number, or a dash where it was not measured."""
    values = [row["value"] for row in rows if (row["engine"], row["metric"]) == (engine, metric)]
    return f"{values[0]:.1e}" if values and np.isfinite(values[0]) else "-"


if __name__ == "__main__":
    main()
