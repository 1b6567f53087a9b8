"""Known answers are asked once for each version of the code: again where a byte is another, and if one is wrong."""

from __future__ import annotations

import os
import secrets
import subprocess
import sys
from pathlib import Path

import pytest
from plant_faults import Tree

from crossbody.cases import installed
from crossbody.reference import cache
from crossbody.reports import sources
from crossbody.reports.judging import known
from crossbody.reports.runs import watch

ASK = """
from crossbody.reports.judging import known
asked, known.once = known._asked, True
known._asked = lambda names: (print("asked"), *asked(names))[1:]
print(len(list(known.wrong())), "wrong")
"""
METRIC = "reports/metrics/position.py"
SAID = "Return the largest; "
WRONG = ("(off, t, named, scale)", "(-off, t, named,scale)")


class Copy(Tree):
    """Sources whose known answers can be asked for, with a cache that it may fill."""

    def ask(self) -> tuple[bool, int]:
        """Whether another process asked, and how many answers it found wrong."""
        told = subprocess.run(
            [sys.executable, "-B", "-c", ASK], cwd=self.root, capture_output=True, text=True, check=True,
            env={**os.environ, "PYTHONPATH": str(self.root)},
        ).stdout.split()  # fmt: skip
        return "asked" in told, int(told[-2])

    def change(self, old: str, new: str) -> None:
        """Put a text of the same length in the place of one that stands once, and keep the time of the file."""
        path = self.root / METRIC
        before, text = path.stat(), path.read_text(encoding="utf-8")
        assert text.count(old) == 1
        path.write_text(text.replace(old, new), encoding="utf-8")
        os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
        now = path.stat()
        assert (now.st_size, now.st_mtime_ns) == (before.st_size, before.st_mtime_ns)


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Copy:
    return Copy(tmp_path_factory.mktemp("copy"))


def test_a_file_of_the_same_size_and_time_is_asked_again(copy: Copy) -> None:
    copy.ask()  # in this version of the tests it may have been asked before
    assert copy.ask() == (False, 0)
    otherwise = secrets.token_hex(len(SAID) // 2)  # in no version of the tests it has been asked before
    copy.change(SAID, otherwise)
    assert copy.ask() == (True, 0)
    assert copy.ask() == (False, 0)
    copy.change(otherwise, SAID)
    assert copy.ask() == (False, 0)


def test_what_is_wrong_is_found_again_and_again(copy: Copy) -> None:
    copy.change(*WRONG)
    first = copy.ask()
    assert first[0]
    assert first[1] > 0
    assert copy.ask() == first
    copy.change(*reversed(WRONG))
    assert copy.ask()[1] == 0


def test_what_is_kept_is_not_believed_where_it_was_damaged(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("CROSSBODY_CACHE", str(tmp_path))
    monkeypatch.setattr(known, "once", True)
    asked: list[int] = []
    monkeypatch.setattr(known, "_asked", lambda _: iter(asked.append(1) or ()))
    assert [list(known.wrong()) for _ in range(3)] == [[], [], []]
    assert len(asked) == 1
    (path,) = (tmp_path / "compiled").glob("known_answers-*")
    path.write_bytes(path.read_bytes()[:-1] + b"!")
    assert list(known.wrong()) == []
    assert len(asked) == 2


def test_another_library_processor_or_plugin_is_asked_again(monkeypatch: pytest.MonkeyPatch) -> None:
    names = {known._name()}
    for module, name in ((known.np, "__version__"), (cache, "machine"), (installed, "digests"), (cache, "debugging")):
        with monkeypatch.context() as patch:
            patch.setattr(module, name, "0" if name == "__version__" else lambda: {"another": "one"})
            names.add(known._name())
    assert len(names) == 5


def test_a_process_that_others_share_asks_every_time(monkeypatch: pytest.MonkeyPatch) -> None:
    assert not watch.alone()
    asked: list[int] = []
    monkeypatch.setattr(known, "_asked", lambda _: iter(asked.append(1) or ()))
    assert [*known.wrong(), *known.wrong()] == []
    assert len(asked) == 2


def test_all_that_answers_are_made_of_is_in_the_digest() -> None:
    """Modules that only name others, and the digest itself, decide nothing."""
    ask = "from crossbody.reports.judging import known; list(known._asked((*known.KINDS, *known.OF_SCENES)))"
    tell = "import sys; print(*(n for n in sys.modules if n.startswith('crossbody.')))"
    told = subprocess.run([sys.executable, "-c", f"{ask}; {tell}"], capture_output=True, text=True, check=True).stdout
    within = [f"crossbody.{folder[3:]}" for folder in sources.SHOWN if folder.startswith("../")]
    assert set(sources.SHOWN) - {"."} < set(sources.FOLDERS)
    within.append("crossbody.reports")
    assert not {name for name in told.split() if not any(f"{name}.".startswith(f"{home}.") for home in within)}
