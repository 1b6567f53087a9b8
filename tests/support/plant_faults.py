"""Plant faults in a copy of the sources, one at a time, and see whether the named run or test fails.

    python tests/support/plant_faults.py                     all of faults.toml, less what was seen before
    python tests/support/plant_faults.py --jobs 2 --only lam those whose name has "lam", two at a time
    python tests/support/plant_faults.py --quick             those that cost little: the sample that the gate takes
    python tests/support/plant_faults.py --faults mine.toml  those of a list of one's own, written as faults.toml is

A fault is a change of the text of one file. It is seen by `run` if `crossbody run` with those arguments says that a
number is outside (exit code 1), by `command` if another command ends otherwise than with 0, and by `test`, which is
asked where these see nothing, if pytest fails there. What sees a fault must pass on the sources as they are: it is
asked once without any. What was seen is kept in `--kept`, by a digest of all sources, so that a run that was
interrupted goes on; the exit code is 1 if fewer were seen than `RUN_SEES` and `ALL_SEE` ask for.
"""

from __future__ import annotations

import argparse
import compileall
import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from py_compile import PycInvalidationMode
from queue import SimpleQueue

from places import DATA, FOLDERS, ROOT

FAULTS = ROOT / "tests" / "faults.toml"
RUN_SEES, ALL_SEE = 7 / 8, 39 / 40
LIMIT_S = 1800.0
BEGIN = ("-c", "from crossbody.reports.entry import main; main()")
FAILED, NO_TEST = 1, 5
"""Exit codes: of `crossbody run` and of pytest where something is wrong with what they looked at; of pytest where
its arguments select nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """One change of the sources.

    Attributes:
        name: what is wrong with it, in words.
        file: of the sources.
        old, new: the text that stands there once, and what is put in its place.
        run: arguments of `crossbody run`; empty where only a test can see it.
        command: arguments of `crossbody`, of a command that judges no run; empty where there is none.
        test: arguments of pytest; empty where `run` sees it.
        quick: whether it is one of the sample of the gate.
    """

    name: str
    file: str
    old: str
    new: str
    run: str = ""
    command: str = ""
    test: str = ""
    quick: bool = False

    @property
    def checks(self) -> tuple[tuple[str, str], ...]:
        """("run", "command" or "test", arguments) of each that is named."""
        kinds = (("run", self.run), ("command", self.command), ("test", self.test))
        return tuple((kind, said) for kind, said in kinds if said)


def faults(table: Path = FAULTS) -> tuple[Fault, ...]:
    """Every fault of a table."""
    return tuple(Fault(**fault) for fault in tomllib.loads(table.read_text(encoding="utf-8"))["fault"])


class NoTestError(Exception):
    """A fault names a test that does not exist."""


class Tree:
    """A copy of the sources that can be changed and run."""

    def __init__(self, folder: Path) -> None:
        self.root = folder
        package = folder / "crossbody"
        for name in FOLDERS:
            shutil.copytree(ROOT / name, package / name, ignore=shutil.ignore_patterns("__pycache__"))
            (folder / name).symlink_to(package / name)
        (package / "__init__.py").touch()  # regular: it comes before what is installed, without a warning
        # By their content: a fault comes and goes within the second by which times would tell it.
        compileall.compile_dir(package, quiet=2, invalidation_mode=PycInvalidationMode.CHECKED_HASH)
        shutil.copytree(ROOT / "tests", folder / "tests", ignore=shutil.ignore_patterns("__pycache__"))
        for name in ("pyproject.toml", "docs", "README.md", "Makefile", "action.yml", ".ci"):
            (folder / name).symlink_to(ROOT / name)

    @contextmanager
    def planted(self, fault: Fault) -> Iterator[None]:
        """The sources with a fault.

        Raises:
            ValueError: where its text does not stand in the file exactly once.
        """
        path = self.root / fault.file
        whole = path.read_text(encoding="utf-8")
        if whole.count(fault.old) != 1:
            raise ValueError(f"{fault.name}: its text stands {whole.count(fault.old)} times in {fault.file}.")
        path.write_text(whole.replace(fault.old, fault.new), encoding="utf-8")
        try:
            yield
        finally:
            path.write_text(whole, encoding="utf-8")

    def fails(self, kind: str, arguments: str) -> bool:
        """Whether `run`, a command or `test` says that something is wrong.

        Raises:
            ValueError: where it ends in another way than by passing or failing.
            NoTestError: where no test is selected, with whatever fault.
        """
        start = {
            "run": [*BEGIN, "run", "-q", "--out", str(self.root / "out")], "command": BEGIN,
            "test": ["-m", "pytest", "-q", "-x", "-p", "no:cacheprovider"],
        }[kind]  # fmt: skip
        shutil.rmtree(self.root / "out", ignore_errors=True)
        ended = subprocess.run(
            [sys.executable, "-B", *start, *arguments.split()],
            cwd=self.root, env={**os.environ, "PYTHONPATH": str(self.root), "CROSSBODY_DATA": str(DATA)},
            capture_output=True, text=True, timeout=LIMIT_S, check=False,
        )  # fmt: skip
        if kind == "test" and ended.returncode == NO_TEST:
            raise NoTestError(f"pytest {arguments} selects no test.")
        if kind == "command":
            return ended.returncode != 0
        if ended.returncode not in (0, FAILED):
            said = (ended.stdout + ended.stderr)[-2000:]
            raise ValueError(f"{kind} {arguments} ended with exit code {ended.returncode}:\n{said}")
        return ended.returncode == FAILED


def digest() -> str:
    """Of all that decides what is seen, but the table itself."""
    found = hashlib.sha256()
    for folder in (*FOLDERS, "tests"):
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix in (".py", ".json", ".toml") and path != FAULTS:
                found.update(str(path.relative_to(ROOT)).encode() + path.read_bytes())
    return found.hexdigest()


class Kept:
    """What was seen before, a line of JSON each."""

    def __init__(self, path: Path) -> None:
        self.path, self.sources, self.known = path, digest(), dict[str, dict[str, bool]]()
        for line in path.read_text(encoding="utf-8").splitlines() if path.is_file() else ():
            row = json.loads(line)
            self.known[row["key"]] = row["seen"]

    def key(self, what: object) -> str:
        """Of a fault or a check, with the sources as they are."""
        return hashlib.sha256(f"{self.sources} {what!r}".encode()).hexdigest()

    def put(self, what: object, found: dict[str, bool]) -> None:
        """One more."""
        self.known[self.key(what)] = found
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps({"key": self.key(what), "what": getattr(what, "name", what), "seen": found}) + "\n")


def seen(tree: Tree, fault: Fault, kept: Kept) -> dict[str, bool]:
    """Whether the checks that a fault names fail with it, and without it pass, up to the first that does."""
    found: dict[str, bool] = {}
    for kind, arguments in fault.checks:
        with tree.planted(fault):
            fails = stopped(tree, fault, kind, arguments)
        found[kind] = fails and not failing(tree, (kind, arguments), kept)
        if found[kind]:
            break
    return found


def stopped(tree: Tree, fault: Fault, kind: str, arguments: str) -> bool:
    """Whether a check fails with a fault. One that ends in a third way does: nobody takes that for a pass."""
    try:
        return tree.fails(kind, arguments)
    except (ValueError, subprocess.TimeoutExpired) as error:
        print(f"{fault.name}: {error}", file=sys.stderr)
        return True


def failing(tree: Tree, check: tuple[str, str], kept: Kept) -> bool:
    """Whether a check fails on the sources as they are: it would see anything."""
    if kept.key(check) not in kept.known:
        kept.put(check, {"fails": tree.fails(*check)})
    fails = kept.known[kept.key(check)]["fails"]
    if fails:
        print(f"{' '.join(check)}: fails without any fault", file=sys.stderr)
    return fails


def look(wanted: Sequence[Fault], kept: Kept, jobs: int) -> dict[Fault, dict[str, bool]]:
    """What is seen of each fault, each worker in a tree of its own; those that are kept are not asked again."""
    left = [fault for fault in wanted if kept.key(fault) not in kept.known]
    with tempfile.TemporaryDirectory(prefix="crossbody-faults-") as work:
        trees: SimpleQueue[Tree] = SimpleQueue()
        for i in range(min(jobs, len(left))):
            trees.put(Tree(Path(work) / str(i)))

        def ask(fault: Fault) -> None:
            tree = trees.get()
            try:
                kept.put(fault, seen(tree, fault, kept))
            finally:
                trees.put(tree)
            print(told(fault, kept.known[kept.key(fault)]), flush=True)

        with ThreadPoolExecutor(jobs) as pool:
            list(pool.map(ask, left))
    return {fault: kept.known[kept.key(fault)] for fault in wanted}


def told(fault: Fault, found: dict[str, bool]) -> str:
    """One line."""
    words = ", ".join(f"{kind} {'sees it' if value else 'DOES NOT SEE IT'}" for kind, value in found.items())
    return f"{fault.name}: {words}"


def summary(found: dict[Fault, dict[str, bool]]) -> tuple[str, bool]:
    """How many were seen, in words, and whether these are enough."""
    asked = [seen for seen in found.values() if "run" in seen]
    by_run = sum(seen["run"] for seen in asked)
    by_any = sum(any(seen.values()) for seen in found.values())
    words = f"run sees {by_run} of the {len(asked)} put to it; run and tests see {by_any} of {len(found)}"
    return words, by_run >= RUN_SEES * len(asked) and by_any >= ALL_SEE * len(found)


def main() -> int:
    """The command line; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--only", action="append", help="part of the name of a fault or of its file; repeatable")
    parser.add_argument("--quick", action="store_true", help="the sample of the gate")
    parser.add_argument("--faults", type=Path, default=FAULTS, help="the table")
    parser.add_argument("--kept", type=Path, default=ROOT / "build" / "faults.jsonl", help="what was seen before")
    asked = parser.parse_args()
    named = asked.only or [""]
    every = faults(asked.faults)
    wanted = [f for f in every if any(x in f"{f.name} {f.file}" for x in named) and (f.quick or not asked.quick)]
    try:
        words, enough = summary(look(wanted, Kept(asked.kept), asked.jobs))
    except NoTestError as error:
        print(error, file=sys.stderr)
        return 2
    print(words)
    return int(not enough)


if __name__ == "__main__":
    sys.exit(main())
