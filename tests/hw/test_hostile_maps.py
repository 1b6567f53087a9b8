"""Column maps and paths that are made to cost, to wait, or to be refused by the system."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from crossbody import hw
from crossbody.cases import ColumnMapError, InvalidValue
from crossbody.cases.regular import open_regular
from crossbody.reference.code_store import CODE, Store
from crossbody.reports.cli import main
from crossbody.reports.testing._baseline import Baseline

SECONDS = 20.0  # of processor time: what such a map is made for takes minutes
LONG = "x" * 300
DIGITS = "9" * 5000


@pytest.fixture(autouse=True)
def _ends() -> Iterator[None]:
    """A call that waits for a writer ends as a failure."""
    before = signal.signal(signal.SIGALRM, lambda *_: pytest.fail("it waits"))
    signal.alarm(60)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


HOSTILE = {
    "key": ".".join("a" * 200_000) + " = 1",
    "spaced key": " . ".join("a" * 200_000) + " = 1",
    "quoted key": ".".join(['"a"'] * 200_000) + " = 1",
    "header": "[" + ".".join("a" * 200_000) + "]",
    "inline": "x = {" + ".".join("a" * 200_000) + " = 1}",
    "keys": "".join(".".join("a" * 250) + f".b{i} = 1\n" for i in range(1500)),
    "deep": "x = " + "[" * 400_000,
    "number": f"x = {DIGITS}",
    "date": "x = 9999-99-99",
    "binary": b"\xff\xfe\x00",
    "known": f'[time]\nscale = {"9" * 4000}\n[sensors.a]\ncolumn = "a"\n',
    "hexadecimal": f'[time]\nscale = 0x{"f" * 100_000}\n[sensors.a]\ncolumn = "a"\n',
    "option": f'options = {{skip = 0x{"f" * 100_000}}}\n[time]\nunit = "s"\n[sensors.a]\ncolumn = "a"\n',
}


@pytest.mark.parametrize("what", HOSTILE)
def test_a_hostile_map_is_told_in_no_time(what: str) -> None:
    before = time.process_time()
    with pytest.raises(ColumnMapError) as told:
        hw.parse_columns(HOSTILE[what])
    assert time.process_time() - before < SECONDS
    assert len(str(told.value)) < 1000


def test_random_bytes_are_a_map_or_told() -> None:
    draw = np.random.default_rng(16)
    pieces = [
        "[",
        "]",
        "{",
        "}",
        ".",
        "=",
        '"',
        "'",
        "\n",
        "time",
        "column",
        "1",
        "9" * 4400,
        "inf",
        "0x",
        "-",
        "T",
        ":",
    ]
    for _ in range(300):
        text = "".join(draw.choice(pieces, size=int(draw.integers(1, 30))))
        with suppress(ColumnMapError):
            hw.parse_columns(text)


def test_a_map_that_is_a_pipe_is_told(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "map.toml")
    with pytest.raises(ColumnMapError, match="pipe"):
        hw.load_columns(tmp_path / "map.toml")


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir])
def test_nothing_but_a_file_is_opened(make: object, tmp_path: Path) -> None:
    make(tmp_path / "thing")  # type: ignore[operator]
    with pytest.raises(OSError, match="folder, a pipe or a device"):
        open_regular(tmp_path / "thing")
    with pytest.raises(OSError, match="folder, a pipe or a device"):
        open_regular("/dev/zero")


def test_a_pipe_in_the_cache_is_dropped(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.write("a", b"code")
    assert store.read("a") == b"code"
    (tmp_path / ("a" + CODE)).unlink()
    os.mkfifo(tmp_path / ("a" + CODE))
    assert store.read("a") is None
    assert not (tmp_path / ("a" + CODE)).exists()


def test_a_baseline_of_a_stranger_is_told(tmp_path: Path) -> None:
    for content in ("[" * 100_000, f'{{"a": {DIGITS}}}', "{}x", '{"a": {"b": 1}}'):
        (tmp_path / "b.json").write_text(content)
        with pytest.raises(InvalidValue, match="is not a JSON object"):
            Baseline(tmp_path / "b.json").check({"a": 1.0})


@pytest.mark.parametrize(
    "given",
    [
        ["bode", "soft_contact", "--out", LONG],
        ["run", "bouncing_ball", "-e", "mujoco", "--out", LONG],
        ["report", LONG],
        ["report", "a/" * 3000],
        ["log", "info", LONG],
        ["log", "info", __file__, "--columns", LONG],
        ["run", LONG + ".xml"],
        ["run", LONG],
        ["run", "bouncing_ball", "--against", LONG],
        ["bench", "--against", LONG, "bouncing_ball"],
    ],
    ids=lambda given: " ".join(word[:20] for word in given),
)
def test_a_name_that_no_file_system_has_is_wrong_use(
    given: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(given)
    told = capsys.readouterr().err
    assert ended.value.code == 2, told
    assert "fault of crossbody" not in told
