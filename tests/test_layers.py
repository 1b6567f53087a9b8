"""Imports go one way, and what only lists things imports nothing heavy."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
BELOW = {
    "cases": {"cases"},
    "reference": {"reference", "cases"},
    "engines": {"engines", "reference", "cases"},
    "hw": {"hw", "engines", "reference", "cases"},
    "reports": {"reports", "hw", "engines", "reference", "cases"},
}
HEAVY = ("numpy", "pandas", "numba", "scipy", "mujoco", "pinocchio", "plotly", "pyarrow", "sksundae")


def imported(path: Path) -> set[tuple[str, ...]]:
    """Return what a file imports of ours: the parts of each dotted name behind the first."""
    nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
    of = [(node.module or "", alias) for node in nodes if isinstance(node, ast.ImportFrom) for alias in node.names]
    names = [f"{module}.{alias.name}" for module, alias in of]
    names += [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    return {tuple(name.split(".")[1:]) for name in names if name.startswith("crossbody.")}


@pytest.mark.parametrize("layer", BELOW)
def test_imports_go_one_way(layer: str) -> None:
    files = list((ROOT / layer).rglob("*.py"))
    assert files
    for path in files:
        layers = {name[0] for name in imported(path)}
        assert layers <= BELOW[layer], f"{path.relative_to(ROOT)} imports from above"


def strangers(name: tuple[str, ...], home: tuple[str, ...]) -> bool:
    """Return whether a name is private to a package or module that does not hold the file that imports it."""
    return any(part[0] == "_" and part[:2] != "__" and home[:k] != name[:k] for k, part in enumerate(name))


@pytest.mark.parametrize("layer", BELOW)
def test_what_is_private_stays_in_its_package(layer: str) -> None:
    for path in (ROOT / layer).rglob("*.py"):
        home = path.relative_to(ROOT).parent.parts
        private = {".".join(name) for name in imported(path) if strangers(name, home)}
        assert not private, f"{path.relative_to(ROOT)} takes {sorted(private)}"


@pytest.mark.parametrize("layer", BELOW)
def test_no_folder_of_a_package_imports_in_a_circle(layer: str) -> None:
    """Imports inside functions count: a circle that is cut by laziness is one all the same."""
    folders = {path.name for path in (ROOT / layer).iterdir() if path.is_dir()}
    uses = {
        folder: {
            name[1]
            for path in (ROOT / layer / folder).rglob("*.py")
            for name in imported(path)
            if name[0] == layer and len(name) > 1 and name[1] in folders - {folder}
        }
        for folder in folders
    }
    while free := [folder for folder, below in uses.items() if not below & uses.keys()]:
        for folder in free:
            del uses[folder]
    assert not uses, f"a circle goes through {', '.join(sorted(uses))}"


def test_only_the_reference_runs_the_kernels_of_the_reference() -> None:
    """An engine that borrows a kernel of what it is compared with agrees whatever that kernel says."""
    own = {"reference.py", "equations.py"}
    for path in (ROOT / "engines").rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        borrowed = [
            name
            for name in ("reference.systems", "reference.core", "delta.kernels", "delta.kinematics")
            if name in text
        ]
        assert not borrowed or path.name in own, f"{path.relative_to(ROOT)} takes {borrowed}"


@pytest.mark.parametrize("arguments", [["--help"], ["list"], ["run", "--help"]])
def test_listing_imports_nothing_heavy(arguments: list[str]) -> None:
    code = (
        "import sys\nfrom crossbody.reports.cli import main\n"
        f"try:\n    main({arguments!r})\nexcept SystemExit as end:\n    assert end.code == 0, end.code\n"
        f"found = [name for name in {HEAVY!r} if name in sys.modules]\n"
        "assert not found, found\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "crossbody" in done.stdout or "bouncing_ball" in done.stdout or "Usage" in done.stdout


NOT_FOR_ONE_RUN = ("pandas", "scipy.optimize", "scipy.sparse", "scipy.signal", "mujoco", "pinocchio", "pydrake")


def test_one_run_and_its_page_import_what_they_use(tmp_path: Path) -> None:
    code = (
        "import sys\nfrom crossbody.reports.cli import main\n"
        f"asked = ['run', 'bouncing_ball:listing', '-e', 'reference:compiled', '--out', {str(tmp_path / 'out')!r}]\n"
        "try:\n    main(asked)\n"
        "except SystemExit as end:\n    assert end.code == 0, end.code\n"
        f"found = [name for name in {NOT_FOR_ONE_RUN!r} if name in sys.modules]\n"
        "assert not found, found\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "index.html").exists()
