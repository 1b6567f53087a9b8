"""The pages of a run are read again: nothing is told of what is right, and any number that is another one is."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

from crossbody import cases
from crossbody.cases.errors import OwnFault
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.judging.verdict import Row, Verdict, Word
from crossbody.reports.pages import read_again, results, site, summary
from crossbody.reports.runs import choice, jobs, output, study

METRICS = ("position", "position (step)", "velocity", "energy_drift", "audit", "lam_impulse")
Shown = tuple[Path, list[Row], results.Times]


def drawn(seed: int) -> list[Row]:
    """Rows of some engines on some cases, of every verdict, with distinct numbers of any size, or none."""
    rng, rows = np.random.default_rng(seed), list[Row]()
    for case in ("ball", "ball_2", "robot.xml")[: rng.integers(1, 4)]:
        for who in rng.permutation(["a:p", "a:q_r", "b:p", "reference:compiled"])[: rng.integers(1, 5)]:
            engine, profile = str(who).split(":")
            skipped = rng.random() < 0.2
            for metric in METRICS[: 1 if skipped else rng.integers(1, 7)]:
                word = Word.SKIPPED if skipped else Word(rng.choice([w for w in Word if w != Word.SKIPPED]))
                value, expected, limit, known = (
                    float(rng.choice([math.nan, 0.0, 1.0, -1.0]) * 10.0 ** rng.uniform(-12.0, 9.0)) for _ in range(4)
                )
                rows.append(
                    Verdict(
                        case=case, variant="v", engine=engine, profile=profile, metric=metric, value=value, unit="m",
                        limit=abs(limit), expected=expected, tier="A", verdict=word, known=abs(known),
                        why=str(rng.choice(["known <b>", "other: reason"])),
                    ).row()
                )  # fmt: skip
    return rows


@pytest.mark.parametrize("seed", range(24))
def test_what_is_right_is_not_told(seed: int, tmp_path: Path) -> None:
    out, rows = tmp_path / "out", drawn(seed)
    with output.folder(out, "run") as made:
        study.write(made, [], rows, {})
        site.write(made)
    read_again.check(out, rows, {})


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Shown:
    """A run of two engines with its pages."""
    out, part = tmp_path_factory.mktemp("shown") / "out", tmp_path_factory.mktemp("part")
    case = cases.load("bouncing_ball:linear")
    found = jobs.run_case(case, choice.picks(["reference:compiled", "mujoco:default"]), truth=truth_of(case))
    rows = study.write_case(part, found, "crossbody run")
    with output.folder(out, "run") as made:
        study.assemble(made, [part], {})
        site.write(made)
    return out, rows, results.times_of(out)[0]


@pytest.mark.parametrize("name", ["index.html", "case-bouncing_ball.linear.html"])
def test_every_number_that_is_another_one_is_told(name: str, shown: Shown) -> None:
    out, rows, times = shown
    read_again.check(*shown)
    path = out / name
    whole, changed = path.read_text(encoding="utf-8"), 0
    try:
        for title, table in re.findall(r'<table[^>]*data-csv="([^"]*)"[^>]*>(.*?)</table>', whole, re.DOTALL):
            if not title.endswith(("-matrix", "-Engines", "-Expected-outside", "-verdicts", "-glance")):
                continue
            for found in re.finditer(r'data-v="([^"]*\d[^"]*)"', table):
                other = re.sub(r"\d", lambda digit: str((int(digit[0]) + 3) % 10), found[0], count=1)
                text = table[: found.start()] + other + table[found.end() :]
                path.write_text(whole.replace(table, text, 1), encoding="utf-8")
                with pytest.raises(OwnFault, match=re.escape(name)):
                    read_again.check(out, rows, times)
                changed += 1
    finally:
        path.write_text(whole, encoding="utf-8")
    assert changed >= 20


@pytest.mark.parametrize("count", [1, 3])
def test_a_row_or_a_cell_less_is_told(count: int, shown: Shown) -> None:
    out, rows, times = shown
    for path in out.glob("*.html"):
        whole = path.read_text(encoding="utf-8")
        lines = list(re.finditer(r"<tr data-verdict.*?</tr>|<td class=\"cell.*?</td>", whole, re.DOTALL))
        try:
            for line in lines[:: max(len(lines) // 10, 1)]:
                path.write_text(whole.replace(line[0], "", count), encoding="utf-8")
                with pytest.raises((OwnFault, ValueError)):
                    read_again.check(out, rows, times)
        finally:
            path.write_text(whole, encoding="utf-8")


@pytest.mark.parametrize("seed", range(6))
def test_the_index_has_the_median_of_the_ratios_of_a_benchmark(seed: int, tmp_path: Path) -> None:
    """Of the cases that were timed; the ratio of whole calls, or of the engine's own loop, is another one."""
    rng, known, rows = np.random.default_rng(seed), dict[str, list[float]](), []
    for case in ("a", "b", "c", "d"):
        for engine in rng.choice(["one", "two", "three"], 2, replace=False):
            ratio = None if rng.random() < 0.2 else float(10.0 ** rng.uniform(-2.0, 4.0))
            more = {"ratio_call": rng.uniform(), "ratio_native": rng.uniform(), "least_ratio": rng.uniform()}
            rows.append({"case": case, "engine": str(engine), "profile": "p", "ratio": ratio, **more})
            known.setdefault(f"{engine}:p", []).extend([] if ratio is None else [ratio])
    (tmp_path / "headline.json").write_text(json.dumps({"rows": rows, "provenance": {}}))
    wanted = {who: float(np.median(ratios)) for who, ratios in known.items() if ratios}
    assert summary._ratios(tmp_path) == pytest.approx(wanted)
