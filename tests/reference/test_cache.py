"""The folder of compiled code: nothing in it can fail a command, mislead it or block it without a word."""

from __future__ import annotations

import json
import os
import random
import re
import signal
import subprocess
import sys
import tempfile
import textwrap
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import llvmlite.binding as llvm
import numba.core.config as numba_config
import numpy as np
import pytest
from click.testing import CliRunner
from numba.core import types

from crossbody.reference import cache, code_store, compiling, kernels
from crossbody.reference.cache import Compiled, compiled
from crossbody.reference.code_store import CODE, LOCK, Store
from crossbody.reports.cli import cli, main

ROOT = os.name == "posix" and os.geteuid() == 0
PROGRAM = """
    import os
    import sys
    import numpy as np
    from crossbody.reference import code_store, compiling, kernels

    compiling.SLOW_S = 600.0  # nothing is told for a machine that is busy elsewhere

    def make(value):
        @kernels.energy
        def energy(q, v, p, e):
            e[0], e[1] = value, 0.0
        return energy

    z, e = np.zeros(1), np.zeros(2)
    if "DROP" in os.environ:  # to another user, once the interpreter has imported what compiling needs
        make(-1.0)
        code_store._opened.cache_clear()
        for name in os.environ["FORGET"].split():
            os.environ.pop(name, None)
        os.setresuid(*[int(os.environ["DROP"])] * 3)
    for value in map(float, sys.argv[1:]):
        kernel = make(value)
        kernel(z, z, z, e)
        print(e[0], sum(kernel._cache_hits.values()))
"""

CIRCLES = """
    import numpy as np
    from crossbody.reference import kernels
    from crossbody.reference.kernels import helper

    @helper
    def factorial(n):
        return 1.0 if n <= 1 else n * factorial(n - 1)

    @helper
    def even(n):
        return True if n == 0 else odd(n - 1)

    @helper
    def odd(n):
        return False if n == 0 else even(n - 1)

    def times(factor):
        @helper
        def scaled(x):
            return factor * x
        return scaled

    two, three = times(2.0), times(3.0)

    @kernels.energy
    def energy(q, v, p, e):
        e[0] = factorial(5) + even(int(q[0])) + 10.0 * odd(7)
        e[1] = two(q[0]) + 10.0 * three(q[0])

    z, e = np.full(1, 4.0), np.zeros(2)
    energy(z, z, z, e)
    print(*e, sum(energy._cache_hits.values()))
"""

CALLS = """
    import sys
    import numpy as np
    from crossbody.reference import kernels

    @kernels.energy
    def energy(q, v, p, e):
        e[0], e[1] = 7.0 * q[0], 0.0

    @kernels.gaps
    def gaps(t, q, v, p, h, hd):
        energy(q, v, p, h)
        hd[0] = 2.0 * h[0]

    q, h, hd = np.full(1, 3.0), np.zeros(2), np.zeros(1)
    energy(q, q, q, h)
    if sys.argv[1:]:
        gaps(0.0, q, q, q, h, hd)
    print(h[0], hd[0], sum(energy._cache_hits.values()))
"""


MAKES = """
    import sys
    import numpy as np
    from numba.core import types
    from numba.core.runtime import rtsys
    from crossbody.reference.cache import compiled

    def squares(x):
        found = np.zeros((3, len(x)))
        for k in range(3):
            found[k] = x * x + k
        return [row.sum() for row in found], found

    signature = types.Tuple((types.List(types.float64), types.float64[:, ::1]))(types.float64[::1])
    squares = compiled(squares, [signature])
    begun = rtsys._init
    for _ in range(1000):
        sums, rows = squares(np.arange(4.0))
    print(*sums, rows.sum(), sys.getrefcount(rows), sum(squares._cache_hits.values()), int(begun))
"""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """An empty cache of this test's own."""
    monkeypatch.setenv("CROSSBODY_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(code_store, "_told", set())
    return tmp_path / "cache" / "compiled"


def _run(tmp_path, *values, **more):
    """Values and hits that the program prints, and what it says on stderr."""
    path = tmp_path / "program.py"
    path.write_text(textwrap.dedent(PROGRAM))
    path.chmod(0o644)
    done = subprocess.run(
        [sys.executable, str(path), *map(str, values)], capture_output=True, text=True, check=True, **more
    )
    return [tuple(map(float, line.split())) for line in done.stdout.splitlines()], done.stderr


def test_helpers_that_call_themselves_or_each_other_are_found_also_in_code_that_is_read_back(tmp_path):
    (tmp_path / "circles.py").write_text(textwrap.dedent(CIRCLES))
    for hits in (0, 1):
        done = subprocess.run(
            [sys.executable, str(tmp_path / "circles.py")], capture_output=True, text=True, check=True
        )
        assert done.stdout.split() == ["131.0", "128.0", str(hits)]


def test_code_that_was_read_back_is_taken_in_by_code_that_is_compiled(tmp_path):
    (tmp_path / "calls.py").write_text(textwrap.dedent(CALLS))
    for more, told in (([], "21.0 0.0 0"), (["both"], "21.0 42.0 1"), (["both"], "21.0 42.0 1")):
        command = [sys.executable, str(tmp_path / "calls.py"), *more]
        assert subprocess.run(command, capture_output=True, text=True, check=True).stdout.split() == told.split()


def test_code_that_makes_arrays_needs_no_functions_compiled_for_memory_when_it_is_read_back(tmp_path):
    (tmp_path / "makes.py").write_text(textwrap.dedent(MAKES))
    for hits, begun in (("0", "1"), ("1", "0")):
        done = subprocess.run([sys.executable, str(tmp_path / "makes.py")], capture_output=True, text=True, check=True)
        assert done.stdout.split() == ["14.0", "18.0", "22.0", "54.0", "2", hits, begun]


def test_code_that_calls_what_numba_compiles_for_memory_has_it_compiled(monkeypatch):
    """Whatever a version of numba leaves outside: a name that nobody has would end the process."""
    begun, library = [], compiled(_add, [types.float64(types.float64)]).overloads[(types.float64,)].library
    monkeypatch.setattr(cache.rtsys, "initialize", begun.append)
    assert not cache._asks_for_more(library)
    text = 'declare void @"NRT_incref"(ptr)\ndeclare void @"NRT_Free"(ptr)\n'
    outside = SimpleNamespace(_final_module=llvm.parse_assembly(text))
    assert cache._asks_for_more(outside)
    cache._make_ready("context", True)
    assert begun == ["context"]


def _add(x):
    return x + 1.0


def _kernel(value):
    @kernels.energy
    def energy(q, v, p, e):
        e[0] = value
        e[1] = 0.0

    return energy


def _value(kernel):
    e = np.zeros(2)
    kernel(np.zeros(1), np.zeros(1), np.zeros(1), e)
    return e[0]


def test_code_of_two_versions_from_two_processes_is_told_apart(tmp_path):
    assert _run(tmp_path, 1) == ([(1.0, 0.0)], "")
    assert _run(tmp_path, 2) == ([(2.0, 0.0)], "")
    assert _run(tmp_path, 1, 2, 3, 1) == ([(1.0, 1.0), (2.0, 1.0), (3.0, 0.0), (1.0, 1.0)], "")


def test_a_type_that_has_moved_to_another_module_is_another_key():
    """What is kept names the modules of its types: two versions that share a folder would drop each other's files."""
    kept = Compiled(lambda x: x)._cache
    kinds = [type("Kind", (types.Type,), {"__module__": home})("kind") for home in ("here", "there")]
    one, other = (kept.key("content", (kind,)) for kind in kinds)
    assert str(kinds[0]) == str(kinds[1])
    assert one != other


def test_a_constant_and_a_helper_of_another_file_are_never_stale(tmp_path):
    (tmp_path / "constants.py").write_text("G = 1.0\n")
    (tmp_path / "helpers.py").write_text(
        "from crossbody.reference import kernels\nimport constants\n"
        "@kernels.helper\ndef twice(x):\n    return FACTOR * x * constants.G\nFACTOR = 2.0\n"
    )
    (tmp_path / "user.py").write_text(
        "import numpy as np\nfrom crossbody.reference import kernels\nfrom helpers import twice\n"
        "@kernels.energy\ndef energy(q, v, p, e):\n    e[0] = twice(q[0])\n    e[1] = 0.0\n"
        "e = np.zeros(2)\nenergy(np.ones(1), np.ones(1), np.ones(1), e)\n"
        "print(e[0], sum(energy._cache_hits.values()))\n"
    )

    def run():
        # Without bytecode: Python's own is stale where a file of the same size is written in the same second.
        command = [sys.executable, "-B", "user.py"]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True).stdout.split()

    assert run() == ["2.0", "0"]
    (tmp_path / "helpers.py").write_text("# a comment\n" + (tmp_path / "helpers.py").read_text())
    assert run() == ["2.0", "1"]
    (tmp_path / "constants.py").write_text("G = 9.81\n")
    assert run() == ["19.62", "0"]
    (tmp_path / "helpers.py").write_text((tmp_path / "helpers.py").read_text().replace("FACTOR = 2.0", "FACTOR = 3.0"))
    assert float(run()[0]) == pytest.approx(29.43)


MADE = """
    from crossbody.reference import kernels

    scope = {"kernels": kernels, **eval(HOME)}
    exec("@kernels.energy\\ndef energy(q, v, p, e):\\n    e[0], e[1] = 3.0, 0.0\\n", scope)
    import numpy as np
    z, e = np.zeros(1), np.zeros(2)
    scope["energy"](z, z, z, e)
    print(e[0])
"""


@pytest.mark.parametrize(
    "home",
    [
        "{}",
        *(pytest.param(home, marks=pytest.mark.slow) for home in ("{'__name__': 'nowhere'}", "{'__name__': None}")),
        "globals()",
    ],
)
def test_kernels_made_of_text_run_again_without_a_word(tmp_path, home):
    code = textwrap.dedent(MADE).replace("HOME", repr(home))
    for _ in range(2):  # from a command and from stdin
        for arguments in (["-c", code], ["-"]):
            done = subprocess.run(
                [sys.executable, "-W", "error", *arguments], cwd=tmp_path, input=code, capture_output=True, text=True,
                check=False,
            )  # fmt: skip
            said = re.sub("crossbody: compiling the reference .* functions\n", "", done.stderr)  # on a busy machine
            assert (done.stdout, said) == ("3.0\n", "")


def test_damaged_files_are_dropped_told_and_compiled_again(folder, capsys):
    draw = random.Random(3)
    for trial in range(8):
        assert _value(_kernel(5.0)) == 5.0
        (path,) = folder.glob(f"*{CODE}")
        data = bytearray(path.read_bytes())
        if trial == 0:
            data = bytearray()
        elif trial < 3:
            data = data[: draw.randrange(len(data))]
        else:
            data[draw.randrange(len(code_store.MAGIC), len(data))] ^= 1 << draw.randrange(8)
        path.write_bytes(data)
        code_store._told.clear()
        assert _value(_kernel(5.0)) == 5.0
        assert f"{path} was damaged; it is compiled again." in capsys.readouterr().err
        assert path.read_bytes() != bytes(data)


def test_a_file_of_another_format_is_written_over_without_a_word(folder, capsys):
    assert _value(_kernel(2.5)) == 2.5
    (path,) = folder.iterdir()
    whole = path.read_bytes()
    path.write_bytes(whole.replace(code_store.MAGIC, code_store.ANY_FORMAT + b"0\n", 1))
    assert _value(_kernel(2.5)) == 2.5
    assert path.read_bytes().startswith(code_store.MAGIC)
    assert capsys.readouterr().err == ""


def test_a_compilation_that_takes_long_is_told_and_what_is_read_back_is_not(monkeypatch):
    monkeypatch.setattr(compiling, "SLOW_S", 0.0)
    said = []
    for expected in ([(0, 1), (1, 1)], []):
        monkeypatch.setattr(cache, "count", compiling.Count(show=lambda *told: said.append(told)))
        assert _value(_kernel(5.0)) == 5.0
        assert said == expected
        assert bool(cache.count.seconds) == bool(expected)
        said.clear()


@pytest.mark.parametrize("seed", range(3))
def test_no_flipped_or_cut_file_is_believed(folder, seed):
    folder.mkdir(parents=True)
    store, draw = Store(folder), random.Random(seed)
    data = draw.randbytes(5000)
    for _ in range(60):
        store.write("name", data)
        path = folder / f"name{CODE}"
        whole = bytearray(path.read_bytes())
        if draw.random() < 0.5:
            whole[draw.randrange(len(whole))] ^= 1 << draw.randrange(8)
        else:
            del whole[draw.randrange(len(whole)) :]
        path.write_bytes(whole)
        assert store.read("name") is None
        assert not path.exists()
    store.write("name", data)
    (folder / f"name{CODE}").rename(folder / f"other{CODE}")
    assert store.read("other") is None, "a file under another's name"


def test_whole_code_that_cannot_be_loaded_is_compiled_again(folder, capsys):
    _value(_kernel(6.0))
    (path,) = folder.glob(f"*{CODE}")
    Store(folder).write(path.name.removesuffix(CODE), b"no pickle at all")
    assert _value(_kernel(6.0)) == 6.0
    assert "cannot be used here" in capsys.readouterr().err


@pytest.mark.skipif(not ROOT, reason="needs to give files away")
def test_a_folder_and_a_file_of_another_user_are_refused(folder, capsys):
    _value(_kernel(7.0))
    (path,) = folder.glob(f"*{CODE}")
    before = path.read_bytes()
    os.chown(path, 12345, 12345)
    assert Store(folder).read(path.name.removesuffix(CODE)) is None
    assert "another user" in capsys.readouterr().err
    path.write_bytes(before)
    os.chown(folder, 12345, 12345)
    code_store._opened.cache_clear()
    kernel = _kernel(7.0)
    assert _value(kernel) == 7.0
    assert not kernel._cache_hits
    assert f"{folder} belongs to user 12345" in capsys.readouterr().err


def test_a_file_that_others_may_write_and_a_link_are_refused(folder):
    folder.mkdir(parents=True)
    store = Store(folder)
    store.write("open", b"data")
    assert store.read("open") == b"data"
    assert (folder / f"open{CODE}").stat().st_mode & 0o777 == 0o600
    (folder / f"open{CODE}").chmod(0o622)
    assert store.read("open") is None
    store.write("there", b"data")
    (folder / f"there{CODE}").rename(folder / "elsewhere")
    (folder / f"there{CODE}").symlink_to(folder / "elsewhere")
    assert store.read("there") is None
    assert (folder / "elsewhere").exists()


def test_a_folder_of_ours_is_closed_to_others(folder):
    folder.mkdir(parents=True)
    folder.chmod(0o777)
    assert code_store.current() is not None
    assert folder.stat().st_mode & 0o022 == 0


@pytest.mark.skipif(not ROOT, reason="needs another user")
def test_a_complete_cache_that_is_read_only_serves(monkeypatch):
    with tempfile.TemporaryDirectory() as name:  # a place that another user can reach
        home = Path(name)
        monkeypatch.setenv("CROSSBODY_CACHE", str(home / "cache"))
        home.chmod(0o755)
        _run(home, 8)
        folder = home / "cache" / "compiled"
        for path in (folder, *folder.iterdir()):
            path.chmod(0o755 if path.is_dir() else 0o644)
        rows, told = _run(home, 8, 9, env={**os.environ, "DROP": "65534", "FORGET": ""})
        assert rows == [(8.0, 1.0), (9.0, 0.0)]
        assert told.count("cannot be kept") == 1
        assert sorted(path.name for path in home.iterdir()) == ["cache", "program.py"]


@pytest.mark.skipif(not ROOT, reason="needs a user without a name")
def test_a_user_without_a_home_runs(tmp_path):
    places = "HOME CROSSBODY_CACHE XDG_CACHE_HOME"
    rows, told = _run(tmp_path, 1, env={**os.environ, "DROP": "54321", "FORGET": places})
    assert rows == [(1.0, 0.0)]
    assert "no home folder" in told


def test_a_stopped_holder_of_a_lock_is_told_and_not_waited_for(folder, monkeypatch, capsys):
    monkeypatch.setattr(code_store, "_told", set())
    monkeypatch.setattr(code_store.count, "told", False)
    monkeypatch.setattr(code_store, "TELL_S", 0.1)
    monkeypatch.setattr(code_store, "WAIT_S", 2.0)
    _value(_kernel(10.0))
    (path,) = folder.glob(f"*{CODE}")
    path.unlink()
    code = (
        "import fcntl, sys, time; f = open(sys.argv[1], 'a'); fcntl.flock(f, fcntl.LOCK_EX);"
        "print('held', flush=True); time.sleep(60)"
    )
    with subprocess.Popen([sys.executable, "-c", code, str(path.with_suffix(LOCK))], stdout=subprocess.PIPE) as holder:
        holder.stdout.readline()
        holder.send_signal(signal.SIGSTOP)
        began = time.monotonic()
        assert _value(_kernel(10.0)) == 10.0
        assert time.monotonic() - began < 20.0
        holder.kill()
    said = capsys.readouterr().err
    assert "waiting for it" in said
    assert "compiles for itself" in said


def test_one_process_compiles_while_others_wait(tmp_path):
    with_pause = textwrap.dedent(PROGRAM)
    program = tmp_path / "program.py"
    program.write_text(with_pause)
    workers = [
        subprocess.Popen([sys.executable, str(program), "11"], stdout=subprocess.PIPE, text=True) for _ in range(3)
    ]
    printed = [worker.communicate()[0].split() for worker in workers]
    assert all(value == "11.0" for value, _ in printed)
    assert not list((tmp_path / "cache" / "compiled").glob(f"*{LOCK}"))


def test_threads_leave_the_folder_of_numba_alone():
    before = numba_config.CACHE_DIR
    seen = set()

    def work(value):
        _kernel(value)
        seen.add(numba_config.CACHE_DIR)

    threads = [threading.Thread(target=work, args=(20.0 + i,)) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert seen == {before} == {numba_config.CACHE_DIR}


def test_what_is_not_used_and_what_is_too_much_goes(folder):
    folder.mkdir(parents=True)
    store = Store(folder)
    names = [f"kernel-{i:032x}" for i in range(4)]
    for age, name in enumerate(names):
        store.write(name, bytes(1000))
        then = time.time() - 50.0 * 86400.0 * age
        os.utime(folder / f"{name}{CODE}", (then, then))
    (folder / "notes.txt").write_text("of a user")
    assert store.prune(120.0) == 1
    assert store.prune(120.0, largest=2500) == 1
    assert [store.read(name) is not None for name in names] == [True, True, False, False]
    assert time.time() - (folder / f"{names[1]}{CODE}").stat().st_mtime < 3600.0, "it was read just now"
    assert store.clear() == 2
    assert [path.name for path in folder.iterdir()] == ["notes.txt"]


def test_the_command_shows_and_clears(folder):
    _value(_kernel(30.0))
    run = CliRunner()
    (path,) = folder.iterdir()
    for words in (["cache", "--json"], ["cache", "show", "--json"]):
        assert json.loads(run.invoke(cli, words).output) == {
            "folder": str(folder), "usable": True, "files": 1, "bytes": path.stat().st_size
        }  # fmt: skip
    assert f"{folder}: 1 files" in run.invoke(cli, ["cache"]).output
    assert json.loads(run.invoke(cli, ["cache", "clear", "--json"]).output) == {"removed": 1}
    assert not list(folder.iterdir())


def test_the_command_says_what_it_cannot_clear(folder, monkeypatch, capsys):
    """As in a folder that another user has filled: nothing is said to be removed that is still there."""
    _value(_kernel(30.0))
    monkeypatch.setattr(Path, "unlink", lambda path: os.unlink(folder / "absent"))
    with pytest.raises(SystemExit) as end:
        main(["cache", "clear"])
    told = capsys.readouterr()
    assert (end.value.code, told.out) == (2, "")
    assert told.err == f"crossbody: 1 file of {folder} cannot be removed (0 were): the folder must be writable.\n"


def test_where_nothing_can_be_kept_the_command_says_so(tmp_path, monkeypatch, capsys):
    """A file in the way of the folder, and a home that nobody has."""
    (tmp_path / "file").touch()
    for place, shown, why in (
        (str(tmp_path / "file"), f"{tmp_path / 'file' / 'compiled'}", f"{tmp_path / 'file'} is a file"),
        ("~no such user/cache", None, "there is no such home folder"),
    ):
        monkeypatch.setenv("CROSSBODY_CACHE", place)
        with pytest.raises(SystemExit) as end:
            main(["cache", "show", "--json"])
        told = capsys.readouterr()
        assert json.loads(told.out) == {"folder": shown, "usable": False, "files": 0, "bytes": 0}
        assert end.value.code == 0
        assert f"({why}); every process compiles again. Set CROSSBODY_CACHE to another folder." in told.err


def test_a_folder_in_place_of_a_file_is_told_and_written_over(folder, capsys):
    """An empty one; one that holds something of somebody's stays where it is."""
    folder.mkdir(parents=True, mode=0o700)
    store = Store(folder)
    name, other = f"f-{0:032x}", f"g-{1:032x}"
    for taken in (name, other):
        (folder / (taken + CODE)).mkdir()
    (folder / (other + CODE) / "mine").touch()
    assert store.read(name) is store.read(other) is None
    assert capsys.readouterr().err.count("(it is a folder, a pipe or a device); it is compiled again") == 2
    store.write(name, b"code")
    store.write(other, b"code")
    assert store.read(name) == b"code"
    assert "cannot be kept" in capsys.readouterr().err
    assert (folder / (other + CODE) / "mine").exists()
