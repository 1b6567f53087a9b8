"""Tables of the command line: no line is wider than the terminal, and what is shown is whole."""

from __future__ import annotations

import random
import string
from collections.abc import Mapping
from itertools import count
from pathlib import Path

import click
import numpy as np
import pandas as pd
import pytest

from crossbody.reports import layout
from crossbody.reports.cli import main


def drawn(draw: random.Random) -> tuple[list[str], dict[str, list[str]], list[str]]:
    """Names of lines, cells by unique heads, and what stands above; texts that are not part of each other."""
    rows, number = draw.randrange(1, 7), count()

    def word(longest: int) -> str:
        return f"{draw.choice(string.ascii_letters)}{next(number):04d}" + "x" * draw.randrange(longest)

    def cell() -> str:
        return draw.choice(["-", f"{draw.gauss(0.0, 1.0) * 10.0 ** draw.randrange(-300, 300):.6g}"])

    kinds = [draw.random() < 0.3 for _ in range(draw.randrange(1, 13))]
    cells = {word(12): [word(20) if words else cell() for _ in range(rows)] for words in kinds}
    names, above = [word(60) for _ in range(rows)], [word(100) for _ in range(rows)]
    return names, cells, draw.choice([[], above])


def shown(cells: Mapping[str, list[str]]) -> dict[str, list[str]]:
    return {head: column for head, column in cells.items() if set(column) - layout.NOTHING}


@pytest.mark.parametrize("seed", range(50))
def test_a_head_of_two_lines_ends_above_its_numbers_and_takes_no_more_room_than_its_longer_line(seed: int) -> None:
    draw = random.Random(seed)
    names, cells, above = drawn(draw)
    head = "-\n".join("abcdefghij"[: draw.randrange(1, 11)] for _ in range(2))
    numbers = [str(draw.randrange(10)) for _ in names]
    lines = click.unstyle(layout.laid_out(names, {head: numbers, **cells}, 10000, above=above)).split("\n")
    plain = click.unstyle(layout.laid_out(names, {"x": numbers, **cells}, 10000, above=above)).split("\n")
    first, second = head.split("\n")
    wide = max(map(len, (first, second)))
    end = lines[1].index(second) + len(second)
    assert lines[1].strip() == second
    assert lines[0][end - wide : end].strip() == first
    assert len(lines) == len(plain) + 1
    own = [line for line in lines[2:] if not above or line.startswith("  ")]
    assert [line[end - 1] for line in own] == numbers


@pytest.mark.parametrize("seed", range(200))
def test_no_line_is_too_wide_and_columns_go_in_order_and_whole(seed: int) -> None:
    draw = random.Random(seed)
    names, cells, above = drawn(draw)
    width, heads = draw.randrange(72, 200), list(cells)
    left_out = draw.sample(heads, draw.randrange(len(heads)))
    found = layout.laid_out(names, cells, width, above=above, left_out=left_out)
    first, *body = click.unstyle(found).split("\n")
    assert max(map(len, (first, *body))) <= width
    if above:
        body = [line for line in body if line.startswith("  ")]
    assert len(body) == len(names)
    told = shown(cells)
    kept = [head for head in told if head in first]
    assert first.split() == kept
    beside = sum(2 + max(map(len, (head, *told[head]))) for head in kept)
    assert all(
        ("…" in line) == (len(name) > width - beside - 2 * bool(above)) for name, line in zip(names, body, strict=True)
    )
    for i, line in enumerate(body):
        assert line.split()[1:] == [told[head][i] for head in kept]
    order = [head for head in (*left_out, *reversed([head for head in heads if head not in left_out])) if head in told]
    gone = order[: len(told) - len(kept)]
    assert sorted(gone) == sorted(set(told) - set(kept))
    longest = max(map(len, names)) + 2 * bool(above)
    if gone:  # nothing more would fit
        back = [*kept, gone[-1]]
        beside = sum(2 + max(map(len, (head, *told[head]))) for head in back)
        assert min(longest, width // 2) + beside > width


@pytest.mark.parametrize("seed", range(50))
def test_columns_that_are_all_needed_stand_in_several_tables(seed: int) -> None:
    draw = random.Random(seed)
    names, cells, _ = drawn(draw)
    width = draw.randrange(72, 200)
    lines = layout.split(names, shown(cells), width).split("\n")
    assert max(map(len, lines), default=0) <= width
    tables = "\n".join(lines).split("\n\n")
    heads = [head for table in tables for head in table.split("\n")[0].split()]
    assert heads == list(shown(cells))
    assert all(len(table.split("\n")) == len(names) + 1 for table in tables if table)


def test_a_table_of_pandas_has_units_in_its_heads_and_names_engines_once() -> None:
    rows = pd.DataFrame(
        {
            "case": ["a", "a", "b"], "engine": ["x", "y", "x"], "profile": ["p", "p", "q"],
            "median_ms": [1.5, np.nan, 2.0], "growth": [1.0, 2.0, 3.0], "ok": [True, False, True],
            "empty": ["", "", ""], "unit": ["1", "1", "m"],
        }
    )  # fmt: skip
    found = click.unstyle(layout.frame(rows, 80, heads={"growth": "growth [1/s]"}, above="case"))
    assert found == (
        "  engine  median [ms]  growth [1/s]  ok   unit\n"
        "a\n"
        "  x:p             1.5             1  yes\n"
        "  y:p               -             2  no\n"
        "b\n"
        "  x:q               2             3  yes  m"
    )


RIG = """
[time]
column = "t [s]"
unit = "s"
sample_time = 2e-3
[coordinates.th1]
column = "angle [deg]"
unit = "deg"
"""
LOG = ("rig.csv", "-m", "single_pendulum", "--columns", "rig.toml", "--restart", "2")
COMMANDS = (
    ("run", "bouncing_ball", "newtons_cradle", "rocking_block", "-e", "reference:compiled"),
    ("run", "bouncing_ball:listing", "-e", "mujoco", "--dry-run"),
    ("bench", "bouncing_ball:listing", "delta_free:light", "-e", "reference:compiled", "--repeats", "1"),
    ("gapmap", "--points", "3", "-e", "reference:compiled"),
    ("bode", "soft_contact"),
    ("analyse", "soft_contact"),
    ("stress", "bounces", "gap", "--runs", "2", "-e", "reference:compiled"),
    ("log", "info", "rig.csv", "--columns", "rig.toml"),
    ("replay", *LOG, "--limit", "fit=99.99"),
    ("identify", *LOG, "--free", "I1", "--free", "k1"),
    ("list",), ("list", "bouncing_ball"), ("list", "mujoco"), ("list", "tossed_cube"),
)  # fmt: skip


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a log of a pendulum that swings freely, and its map."""
    folder = tmp_path_factory.mktemp("rig")
    t = np.arange(2500) * 2e-3
    angle = 180.0 + 20.0 * np.exp(-0.1 * t) * np.cos(7.0 * t) + np.random.default_rng(1).normal(0.0, 0.05, len(t))
    np.savetxt(folder / "rig.csv", np.stack([t, angle], 1), delimiter=",", header="t [s],angle [deg]", comments="")
    (folder / "rig.toml").write_text(RIG)
    return folder


@pytest.mark.parametrize("asked", COMMANDS, ids=lambda asked: "_".join(asked[:2]))
def test_every_command_stays_within_a_terminal_of_80_columns(
    asked: tuple[str, ...], rig: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(rig)
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    writes = asked[0] not in ("list", "log", "analyse") and "--dry-run" not in asked
    with pytest.raises(SystemExit) as end:
        main([*asked, *(("--out", f"out-{abs(hash(asked))}") if writes else ())])
    lines = click.unstyle(capsys.readouterr().out).split("\n")
    assert end.value.code in (0, 1)
    assert len(lines) > 2
    assert [line for line in lines if len(line) > 80 and not line.startswith(("Report: ", "outside: skipped"))] == []
