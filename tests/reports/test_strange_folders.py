"""A folder of results that a stranger sent: no link in it is followed, and what is not as expected is a sentence."""

from __future__ import annotations

import json
import os
import random
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from ladder import ladder

from crossbody.cases import OutputError, load
from crossbody.reports.cli import main
from crossbody.reports.judging.run_verdicts import Entry
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.pages import site
from crossbody.reports.runs import files, manifest, store, study
from crossbody.reports.runs.jobs import CaseResult
from crossbody.reports.runs.output import folder


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the verdicts of one case."""
    case = load("bouncing_ball", "linear")
    truth = truth_of(case)
    results = [CaseResult(case=case, truth=truth, entries=(Entry(engine="fake", profile="p", run=truth.trajectory),))]
    out = tmp_path_factory.mktemp("sent") / "out"
    with folder(out, "run") as made:
        study.write(made, results, study.judge(results, {case.label: "crossbody run"}), {"command": "x", "time": ""})
    return out


@pytest.fixture
def out(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "out"))


def report(out: Path) -> int:
    with pytest.raises(SystemExit) as end:
        main(["report", str(out), "--quiet"])
    return int(end.value.code or 0)


ANYTHING = (None, 0, -1.5, "x", [], {}, [[]], [{}], {"a": 1}, True, "</script>", 1e999, [1, "x", None])


def places(found: Any, above: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths of all values of JSON."""
    inside = found.items() if isinstance(found, dict) else enumerate(found) if isinstance(found, list) else ()
    return [above, *(place for key, value in inside for place in places(value, (*above, key)))]


def changed(found: Any, place: tuple[Any, ...], value: Any) -> Any:
    """JSON with one value replaced."""
    if not place:
        return value
    copy = dict(found) if isinstance(found, dict) else list(found)
    copy[place[0]] = changed(found[place[0]], place[1:], value)
    return copy


@pytest.mark.parametrize("count", [8, pytest.param(400, marks=pytest.mark.slow)])
def test_any_value_anywhere_is_shown_or_refused_in_a_sentence(
    out: Path, capsys: pytest.CaptureFixture[str], count: int
) -> None:
    """A wrong value is no traceback: exit code 2 and one sentence that names the file, or a page that can be made."""
    rng = random.Random(5)
    refused = 0
    for _ in range(count):
        name = rng.choice(("verdicts.json", "audit.json", "provenance.json"))
        text = (out / name).read_text()
        value = json.loads(text)
        crafted = changed(value, rng.choice(places(value)), rng.choice(ANYTHING))
        (out / name).write_text(json.dumps(crafted))
        code = report(out)
        said = capsys.readouterr().err
        assert code in (0, 2), (name, crafted, said)
        if code:
            refused += 1
            assert said.startswith("crossbody: ")
            assert said.count("\n") == 1
            assert name in said or "cannot be shown" in said
        (out / name).write_text(text)
    assert refused > count / 20 - 1


CRAFTED: dict[str, tuple[str, Callable[[Any], Any], str]] = {
    "no object": ("verdicts.json", lambda _: [], r"verdicts\.json holds a list"),
    "no rows": ("verdicts.json", lambda t: t | {"rows": {}}, r"verdicts\.json: rows is not a list"),
    "rows of numbers": ("audit.json", lambda t: t | {"rows": [1]}, r"audit\.json: rows is not a list"),
    "a number for a case": (
        "verdicts.json", lambda t: t | {"rows": [t["rows"][0] | {"case": 7}]}, r"rows\[0\]\.case is '7'; .* a text",
    ),
    "a text for a value": (
        "verdicts.json", lambda t: t | {"rows": [{**t["rows"][0], "value": "x"}]},
        r"rows\[0\]\.value is 'x'; .* a number",
    ),
    "provenance of nothing": ("verdicts.json", lambda t: t | {"provenance": 3}, r"provenance is not an object"),
    "versions of nothing": ("provenance.json", lambda t: t | {"versions": []}, r"provenance\.json: versions"),
}  # fmt: skip


@pytest.mark.parametrize("kind", CRAFTED)
def test_file_and_field_are_named(out: Path, kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    name, craft, said = CRAFTED[kind]
    (out / name).write_text(json.dumps(craft(json.loads((out / name).read_text()))))
    assert report(out) == 2
    assert re.search(said, capsys.readouterr().err)


def test_a_motion_that_unfolds_to_too_much_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "traces").mkdir()
    path = tmp_path / "traces" / "0000.parquet"
    pq.write_table(pa.table({f"q{i}": pa.nulls(1 << 20, pa.float64()) for i in range(10)}), path)
    assert path.stat().st_size < 30_000
    monkeypatch.setattr(store, "MOTION", 50_000_000)
    with pytest.raises(OutputError, match="it needs 84 MB in memory"):
        store.load(path)


def test_nested_a_million_times_is_a_sentence(out: Path) -> None:
    (out / "verdicts.json").write_text("[" * 1_000_000)
    assert report(out) == 2


def test_a_crafted_motion_is_told(out: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = out / "traces" / "0001.parquet"
    table = pq.read_table(path)
    for told in (b"[]", b"{}", b'{"about": 3}', b"\xff", json.dumps({"about": {"case": 1}, "wall_s": "x"}).encode()):
        pq.write_table(table.replace_schema_metadata({b"crossbody": told}), path)
        assert report(out) in (0, 2), capsys.readouterr().err
    meta = table.schema.metadata
    pq.write_table(pa.table({"t": np.zeros(3)}).replace_schema_metadata(meta), path)
    assert report(out) in (0, 2), capsys.readouterr().err


@pytest.mark.parametrize("name", ["verdicts.json", "audit.json", "provenance.json", "traces/0000.parquet", "traces"])
def test_no_link_is_followed_on_reading(
    out: Path, tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (out / name).rename(tmp_path / "outside")
    (out / name).symlink_to(tmp_path / "outside")
    assert report(out) == 2
    assert "follows no link" in capsys.readouterr().err


def test_no_link_is_followed_on_writing(out: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    precious = tmp_path / "precious"
    precious.write_text("mine")
    for name in ("index.html", ".bench.json", ".crossbody.html", "crossbody.css"):
        (out / name).symlink_to(precious)
    (out / "bench.json").symlink_to(precious)
    base = ladder(tmp_path / "bench", "bouncing_ball:linear")
    with pytest.raises(OutputError):
        site.write(out, others=[base])
    assert precious.read_text() == "mine"
    for name in ("index.html", "crossbody.css", "bench.json"):
        (out / name).unlink()
    site.write(out, others=[base])
    assert precious.read_text() == "mine"


@pytest.mark.parametrize("name", ["bench.json", "case.html"])
def test_what_stands_where_a_file_of_ours_was_is_not_ours(out: Path, tmp_path: Path, name: str) -> None:
    """A link, even to its own content, a folder, or another content; what is gone or as it was remains ours."""
    (out / name).write_text("ours")
    manifest.write(out, manifest.read(out).updated("bench", [name]))
    named = manifest.read(out).files
    assert name in named
    (out / name).rename(tmp_path / "moved")
    assert manifest.read(out).files == named
    for put in (lambda: (out / name).symlink_to(tmp_path / "moved"), lambda: (out / name).write_text("theirs")):
        put()
        assert manifest.read(out).files == named - {name}
        (out / name).unlink()
    (out / name).mkdir()
    assert manifest.read(out).files == named - {name}


def test_a_pipe_is_not_waited_for(out: Path) -> None:
    (out / "verdicts.json").unlink()
    os.mkfifo(out / "verdicts.json")
    assert report(out) == 2


def test_a_manifest_that_lies_removes_nothing(out: Path, tmp_path: Path) -> None:
    """Files are removed by the manifest: one that names the user's file inside the folder is all that it can reach."""
    (tmp_path / "notes.md").write_text("mine")
    (out / ".crossbody").write_text(json.dumps({"studies": {"run": ["../notes.md"]}}))
    with pytest.raises(OutputError, match="not a file of this folder"), folder(out, "run"):
        pytest.fail("must not start")
    assert (tmp_path / "notes.md").read_text() == "mine"


def test_pages_run_their_own_scripts_alone(out: Path) -> None:
    for single in (False, True):
        text = site.write(out, single_file=single).read_text()
        found = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', text)
        assert found
        assert "default-src &#39;none&#39;" in found[1]
        assert "unsafe-eval" not in found[1]
        assert "http" not in found[1]


def test_what_is_no_plain_name_is_never_ours() -> None:
    for name in ("a/../b", "/a", "a//b", ".a", "a/b/c", "", "a\0", "a\n", None, 3):
        assert not files.is_plain(name)


@pytest.mark.parametrize("name", ["audit.json", "provenance.json", "verdicts.json"])
def test_half_a_surrogate_pair_is_refused(out: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """JSON can hold one, no file can."""
    told = json.loads((out / name).read_text())
    told["said"] = "\ud800"
    (out / name).write_text(json.dumps(told))
    assert report(out) == 2
    assert f"{name} cannot be read" in capsys.readouterr().err


def test_whole_surrogate_pairs_and_backslashes_are_read(out: Path) -> None:
    told = json.loads((out / "provenance.json").read_text())
    told["command"] = "\U0001f680 \\ud800"
    (out / "provenance.json").write_text(json.dumps(told))
    assert report(out) == 0
