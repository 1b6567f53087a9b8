"""Every code block of the documentation runs, page by page, in the order in which it stands there.

Python and bash blocks run outside the repository; a block with a title is a file and is written. In bash, `crossbody`
and `pytest` lines run, each with the exit code that its comment names, 0 if none.
"""

from __future__ import annotations

import contextlib
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
import pytest
from places import FOLDERS

from crossbody.reference import code_store
from crossbody.reports.cli import cli, main

DOCS = Path(__file__).parent.parent / "docs"
PAGES = sorted(str(path.relative_to(DOCS)) for path in DOCS.rglob("*.md"))
BLOCK = re.compile(r"^```(\w+)([^\n]*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
COMMENT = re.compile(r"#\s*exit code (\d)(?:: (.*))?$")


@dataclass(frozen=True)
class Block:
    language: str
    title: str
    text: str


def blocks(page: str) -> list[Block]:
    found = BLOCK.findall((DOCS / page).read_text(encoding="utf-8"))
    titled = re.compile(r'title="([^"]+)"')
    return [Block(lang, m.group(1) if (m := titled.search(rest)) else "", text) for lang, rest, text in found]


RUN = [page for page in PAGES if blocks(page)]


def test_pages_have_blocks_and_no_unknown_language() -> None:
    assert len(RUN) >= 10
    assert {block.language for page in RUN for block in blocks(page)} == {"python", "bash", "toml"}


def test_sources_cite_what_a_reader_has() -> None:
    """Pages that are there, and no document that is not published with the sources."""
    for path in (path for folder in FOLDERS for path in (DOCS.parent / folder).rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"\bspec \d|\bdecks?\b", text), path
        for page in re.findall(r"\bdocs/[\w/-]+\.md\b", text):
            assert (DOCS.parent / page).is_file(), (path, page)


def test_every_command_is_in_the_reference() -> None:
    named = set(re.findall(r"^\| `crossbody (\w+)", (DOCS / "reference/commands.md").read_text(), re.MULTILINE))
    assert named == set(cli.commands)


OF_OTHERS = {"--help", "--junitxml", "--protocol", "--tls-ca-file"}
"""Options of click, pytest and dask."""


def options(command: click.Command) -> set[str]:
    below = command.commands.values() if isinstance(command, click.Group) else ()
    return {name for one in command.params for name in one.opts}.union(*map(options, below))


@pytest.mark.parametrize("page", PAGES)
def test_every_option_that_a_page_names_is_one(page: str) -> None:
    named = set(re.findall(r"(?<![\w-])--(?!crossbody)[a-z][a-z-]+", (DOCS / page).read_text(encoding="utf-8")))
    assert named <= options(cli) | OF_OTHERS


def test_every_how_to_page_has_its_figure_and_the_command_that_draws_it() -> None:
    source = (DOCS / "picture.py").read_text(encoding="utf-8")
    drawn = {name.replace("_", "-") for name in re.findall(r"^@drawn\ndef (\w+)", source, re.MULTILINE)}
    assert drawn == {path.stem for path in (DOCS / "figures").iterdir()}
    assert drawn >= {path.stem for path in (DOCS / "how-to").glob("*.md")}
    for name in drawn:
        (page,) = DOCS.rglob(f"{name}.md")
        text = page.read_text(encoding="utf-8")
        assert re.search(rf"!\[[^]]+\]\((\.\./)?figures/{name}\.svg\)", text), name
        assert f"Drawn by `python docs/picture.py {name}`." in text
        assert (DOCS / "figures" / f"{name}.svg").stat().st_size < 60_000


def test_what_is_installed_is_justified_in_one_place() -> None:
    """Each package of the base installation stands in its table, and nothing else does."""
    needed = tomllib.loads((DOCS.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]["dependencies"]
    rows = re.findall(r"^\| ([^|]+) \| \d+ \| [^|]+ \|$", (DOCS / "index.md").read_text(encoding="utf-8"), re.MULTILINE)
    named = {name.lower() for row in rows for name in row.replace(" with ", " ").split(", ")}
    assert named - {"llvmlite"} == {re.split(r"[<>=~]", one)[0] for one in needed}


@pytest.mark.parametrize("page", RUN)
def test_every_block_runs(
    page: str, own_plugins: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if any("cache clear" in block.text for block in blocks(page)):  # a copy of that of all other tests
        copy, kept = tmp_path / "cache" / "compiled", code_store.base()
        copy.mkdir(parents=True, mode=0o700)
        for code in kept.glob(f"*{code_store.CODE}") if kept else ():
            with contextlib.suppress(FileNotFoundError):  # another process drops what is old
                shutil.copy2(code, copy)
        monkeypatch.setenv("CROSSBODY_CACHE", str(copy.parent))
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)  # as Python does for a script that is run there
    scope: dict[str, Any] = {"__name__": "page", "__file__": str(tmp_path / "page.py")}
    for i, block in enumerate(blocks(page)):
        if block.title:
            Path(block.title).write_text(block.text, encoding="utf-8")
        elif block.language == "python":
            source = tmp_path / f"block{i}.py"  # compiled kernels are kept by their file
            source.write_text(block.text, encoding="utf-8")
            exec(compile(block.text, str(source), "exec"), scope)
        elif block.language == "bash":
            for line in block.text.strip().splitlines():
                bash(line, capsys)


def bash(line: str, capsys: pytest.CaptureFixture[str]) -> None:
    comment = COMMENT.search(line)
    wanted, says = (int(comment.group(1)), comment.group(2) or "") if comment else (0, "")
    program, *arguments = shlex.split(line, comments=True)
    if program == "crossbody":
        capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            main(arguments)
        told = capsys.readouterr()
        assert int(end.value.code or 0) == wanted, f"{line}\n{told.out}\n{told.err}"
        assert says in told.err + told.out
    else:
        assert program == "pytest", f"{line} is not run by the tests"
        done = subprocess.run(
            [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *arguments],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == wanted, f"{line}\n{done.stdout}\n{done.stderr}"
