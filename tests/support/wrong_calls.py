"""Draws of calls that a user may make by mistake: every entry point of Python and every command, cheap scenes only."""

from __future__ import annotations

import io
import math
import random
from collections.abc import Callable, Iterator, Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import click
import numpy as np

from crossbody import cases, engines, hw, reports
from crossbody.cases import Case, CrossbodyError, Parameter
from crossbody.cases.arrays import is_number
from crossbody.engines.equations import system_of
from crossbody.reference import Options, System, ensemble, linear, prepare, recheck, simulate
from crossbody.reports import cli

BOUNDED = {"max_steps": 300, "time_limit": 2.0}
COSTLY = "From here on it takes time."
"""What commands say that are stopped where they would begin to compute."""


@dataclass(frozen=True)
class Call:
    """What is tried, in words that can be pasted, and the call itself."""

    text: str
    make: Callable[[], Any]


def failure(call: Call) -> str:
    """What a call raises that is no sentence of ours; empty if it returns or refuses as it should."""
    import traceback

    try:
        call.make()
    except CrossbodyError as error:
        return "" if str(error).strip() else f"{call.text}: {type(error).__name__} without a word"
    except Exception as error:
        return f"{call.text}: {type(error).__name__}: {error}\n{''.join(traceback.format_tb(error.__traceback__)[-2:])}"
    return ""


WRONG: tuple[Any, ...] = (
    None, "", "x", "1e3", b"7", True, math.nan, math.inf, -math.inf, 0, -1, 10**400, 1e308, -1e-308, 3 + 4j,
    [], [1, 2, 3], ["a"], [[1.0]], [[1.0], [1.0, 2.0]], (), {}, {"a": 1}, {1, 2}, object(), int, len, np.zeros(0),
    np.zeros((2, 2)), np.array("x"), np.array([None]), np.float32(1.5), np.int64(3), Path("x"), range(3), "\0",
    "../..", "ä" * 300, lambda: 0,
)  # fmt: skip
"""Values of a type, a shape or a size that few arguments admit."""


def wrong(rng: random.Random) -> Any:
    """One of them."""
    return rng.choice(WRONG)


def number(rng: random.Random, parameter: Parameter) -> Any:
    """A value that a parameter admits, its ends and extremes more often than others."""
    if parameter.choices:
        return rng.choice(parameter.choices)
    if isinstance(parameter.default, str):
        return parameter.default
    low, high = max(parameter.low, -1e9), min(parameter.high, 1e9)
    drawn = rng.choice((low, high, float(parameter.default), rng.uniform(low, high), 10.0 ** rng.uniform(-9, 9)))
    value = min(max(drawn, low), high)
    return round(value) if isinstance(parameter.default, int) else value


def parameters(rng: random.Random, known: dict[str, Parameter], mistakes: float = 0.4) -> dict[str, Any]:
    """Some parameters by their names, some of them outside what they admit."""
    names = rng.sample(sorted(known), min(len(known), rng.randrange(4)))
    given = {name: wrong(rng) if rng.random() < mistakes else number(rng, known[name]) for name in names}
    return given | ({rng.choice(("nonsense", "a 0", "t_End")): 1.0} if rng.random() < 0.05 else {})


@cache
def scenes() -> dict[str, dict[str, Parameter]]:
    from crossbody.cases.loading import module

    return {name: dict(module(name).PARAMETERS) for name in cases.names()}


@cache
def ball() -> Case:
    return cases.load("bouncing_ball", "linear", t_end=0.6)


@cache
def motion() -> Any:
    return engines.load("reference").prepare(ball(), "compiled", **BOUNDED).run()


def _load(rng: random.Random) -> Call:
    name = rng.choice(sorted(scenes()))
    given = parameters(rng, scenes()[name])
    variant: Any = rng.choice((None, None, *cases.variants(name)))
    called: Any = name
    if rng.random() < 0.1:
        called, variant = rng.choice(((wrong(rng), variant), (name, wrong(rng))))
    return Call(f"cases.load({called!r}, {variant!r}, **{given!r})", lambda: cases.load(called, variant, **given))


def _prepare(rng: random.Random) -> Call:
    name = rng.choice(("reference", "reference", "mujoco", "pinocchio"))
    known = {
        "rtol": Parameter(default=1e-9, low=1e-14, high=0.1), "atol": Parameter(default=0.0, low=0.0),
        "dt": Parameter(default=1e-3, low=1e-4, high=1.0), "samples": Parameter(default=0, low=0, high=1e4),
        "ledger": Parameter(default=True, low=0, high=1), "fsm": Parameter(default="level", choices=("level", "edge")),
        "index": Parameter(default=1, low=1, high=3), "shortcuts": Parameter(default=True, low=0, high=1),
        "implicit": Parameter(default=True, low=0, high=1),
    }  # fmt: skip
    given = parameters(rng, known) | (BOUNDED if name == "reference" else {})
    profile: Any = rng.choice(("matched", "compiled", "cvode")) if name == "reference" else "matched"
    called, case = name, ball()
    mistake = rng.random()
    if mistake < 0.1:
        called, profile, case = rng.choice(
            ((wrong(rng), profile, case), (name, wrong(rng), case), (name, profile, wrong(rng)))
        )
    text = (
        f"engines.load({called!r}).prepare({'ball' if case is ball() else repr(case)}, {profile!r}, **{given!r}).run()"
    )
    return Call(text, lambda: engines.load(called).prepare(case, profile, **given).run())


OPTIONS = {
    "rtol": Parameter(default=1e-6, low=1e-14, high=0.1), "atol": Parameter(default=1e-9, low=1e-15, high=1.0),
    "fsm": Parameter(default="level", choices=("level", "edge", "memoryless")),
    "collisions": Parameter(default="sequential", choices=("sequential", "simultaneous", "resolved")),
    "solver": Parameter(default="compiled", choices=("compiled", "cvode", "ida")),
    "samples": Parameter(default=0.0), "inputs": Parameter(default=0.0),
    "ledger": Parameter(default=True, low=0, high=1),
    "events": Parameter(default=True, low=0, high=1), "shortcuts": Parameter(default=True, low=0, high=1),
    "implicit": Parameter(default=True, low=0, high=1), "index": Parameter(default=1, low=1, high=3),
    "max_step": Parameter(default=0.1, low=1e-3, high=10.0), "max_steps": Parameter(default=300, low=1, high=300),
    "time_limit": Parameter(default=2.0, low=1e-3, high=2.0),
}  # fmt: skip


def _simulate(rng: random.Random, costly: bool) -> Call:
    given = BOUNDED | parameters(rng, OPTIONS)
    if rng.random() < 0.3:
        given["samples"] = rng.choice(
            ([0.0, 0.1], [0.1, 0.05], [], [[0.1]], [-1.0], [9.0], [math.nan], np.zeros(3), "0")
        )
    if rng.random() < 0.2:
        given["inputs"] = rng.choice(
            (([0.0], [[1.0]]), ([], []), ([0.0], [1.0]), (1,), "ab", None, ([0.1, 0.0], [[], []]))
        )
    q0, v0, t_end = [1.0], [0.0], 0.6
    start: list[Any] = [system_of(ball()), q0, v0, t_end]
    if rng.random() < 0.4:
        start[rng.randrange(4)] = wrong(rng)
    if not isinstance(given["max_steps"], int) or isinstance(given["max_steps"], bool) or given["max_steps"] > 300:
        start[3] = start[3] if start[3] is not None and not is_number(start[3]) else 1e-3
    text = f"simulate({start!r}, **{given!r})"
    if rng.random() < 0.1 and given.keys() <= Options.__dataclass_fields__.keys():
        return Call(f"Options(t_end={start[3]!r}, **{given!r})", lambda: Options(t_end=start[3], **given))
    if costly and rng.random() < 0.1:
        return Call(f"ensemble({start!r})", lambda: ensemble(start[0], [start[1]], [start[2]], start[3], max_steps=300))
    return Call(text, lambda: _has_a_start(simulate(*start, **given)))


def _has_a_start(run: Any) -> None:
    """Every motion has its start at least."""
    assert len(run.t) >= 1, f"no rows ({run.outcome})"
    assert all(len(getattr(run, name)) == len(run.t) for name in ("q", "v", "gap", "lam", "energy", "mode"))


def _system(rng: random.Random) -> Call:
    own = system_of(ball())
    names = [n for n in System.__dataclass_fields__ if System.__dataclass_fields__[n].init]
    given = {name: getattr(own, name) for name in names if name not in ("alpha", "beta")}
    changed = {name: wrong(rng) for name in rng.sample(names, rng.choice((1, 1, 2)))}
    return Call(f"System(**ball | {changed!r})", lambda: System(**given | changed))


def fields_of_a_system() -> Iterator[Call]:
    """Every field of a system with every wrong value; a system that this makes is run for a moment."""
    own = system_of(ball())
    names = [name for name, one in System.__dataclass_fields__.items() if one.init]
    given = {name: getattr(own, name) for name in names}
    for name in names:
        for value in WRONG:
            yield Call(f"System(**ball | {{{name!r}: {value!r}}})", partial(_short, given | {name: value}))


def _short(given: dict[str, Any]) -> None:
    simulate(System(**given), [1.0], [0.0], 0.01, **BOUNDED)


def arguments_of_entry_points() -> Iterator[Call]:
    """Every argument of the functions that take a system or a linear model, with every wrong value."""
    own, model = system_of(ball()), linear.linearise(system_of(ball()), [1.0], [0.0])
    start: dict[str, Any] = {"system": own, "q": [1.0]}
    record = {"system": own, "t": [0.0, 0.1], "unknown": linear.Unknown(rows=(0,))}
    run = {"system": own, "q0": [1.0], "v0": [0.0], "t_end": 0.01, "max_steps": 300}
    points: tuple[tuple[Callable[..., Any], dict[str, Any], str], ...] = (
        (linear.linearise, start, "v u active outputs reduce names t colliding"),
        (linear.trim, start, "v u active free rates inputs t"),
        (linear.tangents, start | {"q": [[1.0]]}, "v u active t threads"),
        (linear.poses, start | {"q": [[1.0]], "hold": (), "active": [0]}, "u t threads"),
        (linear.sensitivity, run, "parameters u rtol collisions"), (linear.modes, {"model": model}, ""),
        (linear.controllable, {"model": model}, "tolerance"), (linear.observable, {"model": model}, "tolerance"),
        (linear.filtered, record | {"y": [[1.0], [1.0]], "measured": [0], "std_y": 1e-3, "q0": [1.0],
         "std_force": 1.0, "time_force": 0.1}, "u v0 active std_q0 std_v0 smooth"),
        (linear.balanced, record | {"q": [[1.0], [1.0]], "v": [[0.0], [0.0]], "vd": [[0.0], [0.0]], "std_vd": 1.0},
         "u active std_q std_v std_u"),
        (linear.Unknown, {}, "inputs rows"), (_poles_over, {"values": [1.0]}, ""),
        (ensemble, run | {"q0": [[1.0]], "v0": [[0.0]]}, "parameters law threads"),
        (prepare, {"system": own, "q0": [1.0], "v0": [0.0], "options": Options(t_end=0.1)}, ""),
        (own.check, {"q": [1.0]}, "v t_end states"), (own.gap, {"q": [1.0]}, "v"),
        (own.constraint, {"q": [1.0]}, "v"), (own.terms, {"q": [1.0]}, "v u t"), (own.project, {"q": [1.0]}, "v"),
    )  # fmt: skip
    for entry, given, others in points:
        entry(**given)
        for name in (*given, *others.split()):
            for value in WRONG:
                text = f"{entry.__qualname__}(good | {{{name!r}: {value!r}}})"
                yield Call(text, partial(entry, **given | {name: value}))


def _poles_over(values: Any) -> None:
    model = linear.linearise(system_of(ball()), [1.0], [0.0])
    linear.locus(lambda _: model, values)


def _compare(rng: random.Random) -> Call:
    given: list[Any] = [ball(), [reports.Entry(engine="a", profile="b", run=motion())]]
    more: dict[str, Any] = {}
    place = rng.randrange(4)
    if place < 2:
        given[place] = wrong(rng) if rng.random() < 0.6 else [wrong(rng)]
    else:
        more = {("truth", "command")[place - 2]: wrong(rng)}
    return Call(f"reports.compare(*{given!r}, **{more!r})", lambda: reports.compare(*given, **more))


def _read(rng: random.Random, folder: Path) -> Call:
    path: Any = (
        folder
        / f"junk{rng.randrange(10**9)}.{rng.choice(('csv', 'parquet', 'mat', 'h5', 'mcap', 'mf4', 'tdms', 'bag', 'x'))}"
    )
    kind = rng.random()
    if kind < 0.5:
        path.write_bytes(
            rng.choice(
                (
                    b"",
                    b"t,x\n0,1\n1,2\n",
                    rng.randbytes(200),
                    b"PAR1" + rng.randbytes(50),
                    b"\x89HDF\r\n\x1a\n" + rng.randbytes(90),
                )
            )
        )
    elif kind < 0.6:
        path.mkdir()
    columns: Any = rng.choice((None, None, "nonsense", "multiarm_double", str(path), 7, {}, folder))
    more: dict[str, Any] = {name: wrong(rng) for name in ("part", "repair", "limit") if rng.random() < 0.15}
    called = wrong(rng) if rng.random() < 0.2 else path
    return Call(f"hw.read({called!r}, {columns!r}, **{more!r})", lambda: hw.read(called, columns, **more))


@cache
def log() -> hw.Log:
    """A swinging pendulum, so short that nothing on it takes long."""
    t = np.arange(80) * 0.01
    made = tuple(
        hw.Channel(role=role, name="q", unit=unit, values=np.cos(t), delay=0.0, column="q")
        for role, unit in ((hw.Role.COORDINATES, "rad"), (hw.Role.SENSORS, "1"))
    )
    told = hw.Provenance(file="none", sha256="", format="csv", library="")
    return hw.Log(time=t, channels=made, sample_time=0.01, provenance=told)


def _map() -> hw.Columns:
    return hw.Columns(time=hw.Time(column="t"), sensors={"x": hw.Signal(column="x", unit="1")})


def _logs(rng: random.Random, folder: Path) -> Call:
    """An entry point of `hw`, or another that takes what was computed, with one argument or two of a wrong kind."""
    path = folder / "short.csv"
    path.write_text("t,x\n0,1\n1,2\n2,3\n")
    replayed = {"log": log(), "model": "single_pendulum"}
    more = dict.fromkeys(("parameters", "delay"))
    points: tuple[tuple[Callable[..., Any], dict[str, Any], Sequence[str]], ...] = (
        (hw.load_columns, {"source": "nonsense"}, ()), (hw.parse_columns, {"text": "[time]"}, ("path",)),
        (hw.dump_columns, {"columns": _map()}, ()), (_scanned, {"path": path, "columns": _map()}, ("part", "memory")),
        (hw.check, {"path": path, "columns": _map()}, ("part", "memory")),
        (hw.parts, {"path": path, "columns": _map()}, ("memory",)), (hw.survey, {"path": path}, ("columns", "memory")),
        (hw.store, {"log": log(), "path": folder / "stored.parquet"}, ()), (hw.draft_text, {"found": None}, ()),
        (hw.unlagged, {"t": [0.0, 1.0], "y": [[1.0], [2.0]], "rate": 1.0, "noise": 0.1}, ("quantum",)),
        (hw.Log.window, {"self": log(), "start": 0.1, "stop": 0.2}, ()),
        (hw.replay, replayed, (*more, "kind", "wanted", "restart", "horizon", "settings")),
        (hw.identify, {**replayed, "free": ["k1"], "budget": 1e-9},
         (*more, "restart", "horizon", "starts", "hold", "stride", "bounds", "engine")),
        (hw.inverse, replayed, (*more, "half", "degree", "stride")),
        (recheck, {"system": system_of(ball()), "run": motion()}, ("rtol",)), (reports.truth_of, {"case": ball()}, ()),
    )  # fmt: skip
    entry, given, others = rng.choice(points)
    names = [*(name for name in given if name != "self"), *others]
    changed = {name: wrong(rng) for name in rng.sample(names, min(len(names), rng.choice((1, 1, 2))))}
    return Call(f"{entry.__qualname__}(good | {changed!r})", lambda: entry(**given | changed))


def _scanned(**given: Any) -> None:
    with hw.scan(**given) as found:
        for _ in found.rows():
            pass


WORDS = (
    "bouncing_ball", "nonsense", "soft_contact", "delta_impulse", "", "--", "-e", "mujoco", "reference:nonsense",
    "absent",
    "--set", "a1=5", "a1=x", "a1=", "=5", "t_end=1e999", "nonsense=1", "a0=-1", "--variant", "linear", "nonsense",
    "--rtol", "1e-9", "nan", "0", "-1", "--set-engine", "dt=0", "rtol=x", "samples=1e99", "--out", "/proc/x", "file",
    "folder", "--against", "--with", "--json", "--quiet", "--full", "--repeats", "3", "--skip", "--throughput",
    "--n", "--points", "--runs", "--seed", "--jobs", "--scheduler", "tcp://", "--resume", "--at", "z=0.4", "z=x",
    "--bode", "--locus", "kstar=0..x", "kstar=..", "--map", "--single-file", "info", "--columns", "--part", "--draft",
    "-m", "single_pendulum", "-f", "k1", "--restart", "--horizon", "--delay", "--hold", "--starts", "free", "--stride",
    "--repair", "drop_duplicates", "--time-limit", "--tls-ca", "--nonsense", "ä" * 50,
)  # fmt: skip


FILES = {
    "file": "x", "empty.xml": "", "cut.xml": "<mujoco><worldbody><body", "cut.urdf": "<robot name='a'><link", "nan.csv":
    "t,x\n0,1\n1,nan\n2,inf\n", "text.csv": "a;b\nc;d\n", "empty.csv": "", "cut.toml": "[time\n", "bad.py": "def (",
}  # fmt: skip
FOLDERS = ("folder", "folder.xml", "folder.csv")
"""What is no case, robot, log or output folder; in the folder that one works in."""


def make_files(folder: Path) -> None:
    """Make these."""
    for name, text in FILES.items():
        (folder / name).write_text(text)
    for name in FOLDERS:
        (folder / name).mkdir()


def _value(rng: random.Random) -> str:
    return rng.choice((*WORDS, *FILES, *FOLDERS))


def _words(rng: random.Random) -> list[str]:
    """Return a command with its arguments and some of its own options, each with a value that it may not admit."""
    words, command = list[str](), cli.cli
    while isinstance(command, click.Group) and command.commands:
        words.append(rng.choice(sorted(command.commands)))
        command = command.commands[words[-1]]  # type: ignore[assignment]
    for one in command.params:
        if isinstance(one, click.Argument):
            words += [_value(rng) for _ in range(rng.randrange(3) if one.nargs < 0 else rng.choice((1, 1, 1, 0)))]
    options = [one for one in command.params if isinstance(one, click.Option)]
    for one in rng.choices(options, k=rng.randrange(4)):
        words += [rng.choice(one.opts), *(_value(rng) for _ in range(0 if one.is_flag else one.nargs))]
    return words


def _below() -> dict[Path, int]:
    return {path: path.stat().st_size for path in Path().rglob("*") if "__pycache__" not in path.parts}


def _command(rng: random.Random) -> Call:
    """A command with words of any kind or with its own options; what it refuses, it has not begun to write."""
    words = _words(rng) if rng.random() < 0.7 else [rng.choice(sorted(cli.cli.commands)), *rng.choices(WORDS, k=3)]

    def make() -> None:
        before, said = _below(), io.StringIO()
        with redirect_stderr(said), redirect_stdout(io.StringIO()):
            code = cli._obey(words)
        assert code in (0, 1, 2), f"exit code {code}"
        assert code != 2 or said.getvalue().startswith("crossbody: "), said.getvalue()
        assert code != 2 or COSTLY in said.getvalue() or _below() == before, "something was written"

    return Call(f"crossbody {words!r}", make)


def calls(rng: random.Random, count: int, folder: Path, costly: bool = True) -> Iterator[Call]:
    """So many draws of all kinds; those that compile something large only if `costly`."""
    kinds: list[tuple[int, Callable[[], Call]]] = [
        (30, lambda: _load(rng)), (10, lambda: _prepare(rng)), (20, lambda: _simulate(rng, costly)),
        (10, lambda: _system(rng)), (4, lambda: _compare(rng)), (10, lambda: _read(rng, folder)),
        (16, lambda: _command(rng)), (20, lambda: _logs(rng, folder)),
    ]  # fmt: skip
    weights = [weight for weight, _ in kinds]
    for _ in range(count):
        yield rng.choices(kinds, weights)[0][1]()
