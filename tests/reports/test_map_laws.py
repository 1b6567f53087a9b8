"""What maps say of their runs, beside a count run by run of tables and motions at random."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from unpacked import numbers

from crossbody.cases import Case, Switch, Trajectory, load
from crossbody.reports.maps import figure, gapmap, stability

RULES = [f"to_{rule}" for rule in gapmap.BESIDE]


def table(random: np.random.Generator) -> pd.DataFrame:
    """Runs of three lines in any order; some have failed."""
    rows = []
    for n, machine in ((3, "level"), (3, "memoryless"), (5, "level")):
        for s in np.linspace(0.0, 3.0, 9):
            row = {"n": n, "engine": "one", "profile": "own", "machine": machine, "s": s, "outcome": "finished"}
            row |= {"energy_created": random.normal(), "to_sequential": random.choice([2.0 * s, 1e-4, 2e-3])}
            row |= {"nearest": f"rule {n}", "why": ""}
            failed = {"outcome": "step_limit", "energy_created": np.nan, "to_sequential": np.nan, "why": f"stuck {n}"}
            rows.append(row | (failed if random.random() < 0.2 else {}))
    return pd.DataFrame(rows).sample(frac=1.0, random_state=int(random.integers(99)))


@pytest.mark.parametrize("seed", range(12))
def test_a_line_of_the_gap_map_is_ideal_where_all_wider_gaps_are(seed: int) -> None:
    rows = table(np.random.default_rng(seed))
    for _, line in gapmap.summary(rows, ideal=1e-3).iterrows():
        runs = rows[(rows["n"] == line["n"]) & (rows["machine"] == line["machine"])].to_dict(orient="records")
        done = [run for run in runs if run["outcome"] == "finished"]
        most = max(done, key=lambda run: run["energy_created"])
        assert (line["most"], line["at_s"]) == (most["energy_created"], most["s"])
        assert line["failed"] == len(runs) - len(done)
        assert line["why"] == (f"stuck {line['n']}" if len(done) < len(runs) else "")
        assert line["at_touch"] == "".join(run["nearest"] for run in done if run["s"] == 0.0)
        ideal = [one["s"] for one in done if all(run["to_sequential"] <= 1e-3 for run in done if run["s"] >= one["s"])]
        assert line["ideal_from"] == pytest.approx(min(ideal, default=math.nan), nan_ok=True)


@pytest.mark.parametrize("seed", range(8))
def test_the_gap_of_a_map_is_a_part_of_the_deepest_penetration_of_one_pair(seed: int) -> None:
    """Which a ball reaches that closes on another with a speed v: v / sqrt(a0)."""
    random = np.random.default_rng(seed)
    s, n = float(random.uniform(0.1, 3.0)), int(random.integers(2, 6))
    case = gapmap.scene(n, s, "memoryless", "resolved")
    assert case.number("gap") == pytest.approx(s * case.number("speed") / math.sqrt(case.number("a0")), rel=1e-12)
    assert (case.fsm, case.collisions, len(case.q0)) == ("memoryless", "resolved", n)


@pytest.mark.parametrize("seed", range(20))
def test_the_rule_that_is_followed_is_the_nearest_or_of_equals_the_first(seed: int) -> None:
    random = np.random.default_rng(seed)
    apart = {name: float(random.choice([0.0, 5e-7, 3e-6, 0.1, 0.2])) for name in RULES}
    equals = [name for name in RULES if apart[name] <= min(apart.values()) + 1e-6]
    assert gapmap._nearest(apart) == equals[0].removeprefix("to_")


def moved(case: Case, switches: list[tuple[float, int, int, int]]) -> Trajectory:
    t = np.linspace(0.0, 9.0, 4)
    rows = len(case.contacts)
    widths = {"q": len(case.q0), "v": len(case.v0), "gap": rows, "lam": rows, "energy": 2}
    wide = {name: np.zeros((4, width)) for name, width in widths.items()}
    told = tuple(Switch(t=at, variable=variable, before=b, after=a) for at, variable, b, a in switches)
    return Trajectory(t=t, mode=np.zeros((4, rows), np.int8), switches=told, wall_s=0.25, **wide)


@pytest.mark.parametrize("last", [0, 1])
@pytest.mark.parametrize("later", [True, False])
def test_a_ball_has_arrived_that_is_in_the_middle_at_its_last_change_of_channel(last: int, later: bool) -> None:
    """Whatever other variables change afterwards."""
    case = load("ball_maze", "solve")
    channel = case.discrete.index("channel")
    other = next(i for i in range(len(case.discrete)) if i != channel)
    switches = [(1.0, channel, 2, 1 - last), (2.5, channel, 1 - last, last)] + [(4.0, other, 0, 1)] * later
    found = stability._measured(case, moved(case, switches))
    assert (found["arrived"], found["ended"], found["wall_ms"]) == (last == 0, 9.0, 250.0)
    assert found["arrival"] == pytest.approx(math.nan if last else 2.5, nan_ok=True)
    assert not stability._measured(case, moved(case, []))["arrived"]


def test_a_surprise_is_an_end_that_was_not_expected_of_a_run() -> None:
    rows = pd.DataFrame(
        [
            {"expected": expected, "arrived": arrived, "outcome": outcome}
            for expected in ("solved", "fails", "either") for arrived in (True, False)
            for outcome in ("finished", "step_limit", "skipped")
        ]
    )  # fmt: skip
    found = stability.surprises(rows)
    assert found[["expected", "arrived"]].drop_duplicates().to_numpy().tolist() == [["solved", False], ["fails", True]]
    assert set(found["outcome"]) == {"finished", "step_limit"}


@pytest.mark.parametrize("several", [True, False])
def test_every_end_of_the_stability_map_is_drawn_at_its_instant(several: bool) -> None:
    random = np.random.default_rng(several)
    rows = pd.DataFrame({
        "engine": ["one", "two" if several else "one"] * 6, "scene": ["", *(f"a = {k}" for k in range(11))],
        "arrived": random.random(12) < 0.5, "ended": random.uniform(0.0, 9.0, 12),
        "arrival": random.uniform(0.0, 9.0, 12), "expected": random.choice(["solved", "fails"], 12),
    })  # fmt: skip
    there, lost = figure.stability(rows)["data"]
    for trace, arrived, column in ((there, True, "arrival"), (lost, False, "ended")):
        kept = rows[rows["arrived"] == arrived].iloc[::-1]
        names = [
            f"{e}: {s or 'default'}" if several else s or "default" for e, s in kept[["engine", "scene"]].to_numpy()
        ]
        assert numbers(trace["x"]) == pytest.approx(kept[column].tolist())
        assert list(trace["y"]) == names
        assert list(trace["text"]) == ["expected: " + word for word in kept["expected"]]


def test_every_cell_of_the_stress_map_has_the_colour_of_its_error() -> None:
    random = np.random.default_rng(5)
    cells = pd.DataFrame({
        "engine": "one", "profile": "own", "knob": ["rtol"] * 6 + ["dt"] * 6, "a0": random.uniform(1.0, 1e6, 12),
        "setting": random.uniform(1e-9, 1e-3, 12), "worst_error": [*10.0 ** random.uniform(-15.0, 4.0, 11), np.nan],
        "finished": [7, 9] * 6, "runs": [9] * 12, "outcomes": ["stuck", ""] * 6,
    })  # fmt: skip
    traces = figure.stress_map(cells)["data"]
    for group, field, failed in zip((cells[:6], cells[6:]), traces[::2], traces[1::2], strict=True):
        known, bad = group[group["worst_error"].notna()], group[group["finished"] < group["runs"]]
        decades = [min(max(math.log10(error), -12.0), 2.0) for error in known["worst_error"]]
        assert numbers(field["marker"]["color"]) == pytest.approx(decades)
        assert (field["marker"]["cmin"], field["marker"]["cmax"]) == (-12.0, 2.0)
        for trace, drawn in ((field, known), (failed, bad)):
            assert numbers(trace["x"]) == pytest.approx(drawn["a0"].tolist())
            assert numbers(trace["y"]) == pytest.approx(drawn["setting"].tolist())
        assert all(text.startswith("7 of 9 finished") and text.endswith("; stuck") for text in failed["text"])
