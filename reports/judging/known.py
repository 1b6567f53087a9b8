"""The known answers of all kinds, asked once for each version of the code: they depend on nothing of a run.

That all were right is kept beside compiled code, under a digest of what can change an answer: the bytes of all sources
that runs and judges are made of, plug-ins, versions of libraries, and the processor. Wrong ones are never kept.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np

from crossbody import cases, engines
from crossbody.cases import installed
from crossbody.cases.errors import OwnFault
from crossbody.cases.sources import readable
from crossbody.reference import code_store
from crossbody.reports.judging.stored import versions
from crossbody.reports.sources import SHOWN, code

Found = tuple[str, float, tuple[float, float], str]
KINDS = (
    "judging.known_answers", "judging.known_sides", "judging.known_touches", "judging.known_sources",
    "judging.known_impulses", "judging.known_growth", "judging.known_parts", "judging.known_steps",
    "judging.known_tables", "judging.known_equations", "judging.known_sentences", "judging.known_clocks",
    "pages.known_pages", "judging.known_verdicts", "judging.known_audits", "judging.known_arithmetic",
    "judging.known_samples", "judging.known_places", "judging.known_sizes", "judging.known_forces",
)  # fmt: skip
OF_FILES = ("judging.known_files", "judging.known_margins")
"""Of runs of files, beside: compilers take longer to import than all else that a short run does."""
OF_SCENES = ("judging.known_scenes", "judging.known_turns", "judging.known_rubs")
"""Of runs of scenes, beside: to compile the kernels of every scene takes half as long as all else of a first run."""
OF_ENGINES, OF_DRIVES = ("judging.known_engines",), ("judging.known_drives",)
"""Of an engine that runs, beside: others are not imported for it; and of its motors, likewise with those of scenes."""
OF_CASES = ("judging.known_units", "judging.known_dimensions", "pages.known_drawn")
"""Of one of crossbody's own cases, that runs."""
OF_CONTACTS = ("judging.known_contacts", "judging.known_flights", "judging.known_shares")
COMPILES = "reference"
"""Of an engine's contacts and of bodies in flight; and the engine that compiles for them what a ball does not use."""
OF_COMMANDS = {
    "replay": (
        "replay.known_logs", "replay.known_replay", "replay.known_fits", "replay.known_doubts", "replay.known_formats",
    ), "log": ("replay.known_logs", "replay.known_formats"), "list": ("known_described",),
    "bench": ("bench.known_bench",),
    "analyse": ("analysis.known_analysis",), "picture": ("pages.known_pictures",),
    "stress": ("sweep.known_sweep",), "gapmap": ("maps.known_maps", "maps.known_rules"),
}  # fmt: skip
"""Of commands that judge no run: they ask before they say a number."""
RUNS = "known_answers"
"""Under which name it is kept that those of runs were right."""
RIGHT = b"every known answer was right"

once = False
"""Whether what was right is believed: where a command has a process of its own, so that nobody replaced functions."""


def wrong(*, file: bool = False, scene: bool = False, ran: Iterable[str] = (), case: str = "") -> Iterator[Found]:
    """Yield metric, part or integrator, number, least and most, and of what, for every answer that is another.

    Args:
        file: whether a file is run: then those of readers of files are asked too.
        scene: whether a scene is run, or what drives a case: then friction, motors and controllers are asked for too.
        ran: engines that run: each of crossbody's own is asked for its answers.
        case: the name of what runs: of one of crossbody's own, its parameters are asked for.
    """
    yield from _once(RUNS, KINDS)
    if file:
        yield from _once(f"{RUNS}_files", OF_FILES)
    if scene:
        yield from _once(f"{RUNS}_scenes", OF_SCENES)
    if case in cases.REGISTRY.own():
        yield from _once(f"{RUNS}_units_{case}", OF_CASES, case)
    for name in sorted(set(ran) & set(engines.REGISTRY.own())):
        yield from _once(f"{RUNS}_{name}", OF_ENGINES, name)
        if scene or name != COMPILES:
            yield from _once(f"{RUNS}_contacts_{name}", OF_CONTACTS, name)
        if scene:
            yield from _once(f"{RUNS}_drives_{name}", OF_DRIVES, name)


def check(command: str) -> None:
    """Ask what a command says of made-up motions, logs and tables before it says anything else.

    Raises:
        OwnFault: with the first number that is another one than must be.
    """
    found = _once(f"{RUNS}_{command}", OF_COMMANDS[command])
    for name, value, (least, most), what in found:
        must = f"{least:.9g}" if least == most else f"between {least:.9g} and {most:.9g}"
        more = f" {len(found) - 1} more numbers are wrong." if len(found) > 1 else ""
        raise OwnFault(f"No number can be trusted: {name} of {what} is {value:.9g}, but must be {must}.{more}")


def _once(kept: str, names: tuple[str, ...], of: str = "") -> tuple[Found, ...]:
    """Return what is wrong of some modules, of an engine or a case where they ask one, once a version of the code."""
    store = code_store.current() if once and readable() else None
    name = "" if store is None else _name(kept, of)
    if store is not None and store.has(name) and store.read(name) == RIGHT:
        return ()
    found = tuple(_asked(names, *(of,) if of else ()))
    if store is not None and not found:
        store.write(name, RIGHT)
    return found


def _asked(names: tuple[str, ...] = KINDS, *of: str) -> Iterator[Found]:
    """Ask all of them, those of an engine or a case by its name."""
    for kind in kinds(names):
        yield from kind.wrong(*of)


def kinds(names: tuple[str, ...] = KINDS) -> tuple[ModuleType, ...]:
    """Return the modules that ask, each by its `wrong`: found by name, since pages import what is judged."""
    return tuple(import_module(f"crossbody.reports.{name}") for name in names)


def _templates() -> str:
    """Return the digest of what pages are filled into, which is no Python."""
    folder, found = Path(__file__).parents[1] / "pages" / "templates", hashlib.sha256()
    for entry in sorted(os.scandir(folder), key=lambda one: one.name):
        if entry.is_file() and not entry.name.endswith(".min.js"):
            found.update(entry.name.encode() + Path(entry.path).read_bytes())
    return found.hexdigest()


def _name(kept: str = RUNS, of: str = "") -> str:
    """Return under which name it is kept that all were right: readable, then a digest of all that they depend on."""
    from crossbody.reference.cache import debugging, machine

    depends = (
        code(SHOWN),
        _templates(),
        *machine(),
        np.__version__,
        installed.version("scipy"),
        str(debugging()),
        repr(sorted(installed.digests().items())),
        versions(of) if of in engines.REGISTRY.own() else "",
    )
    return code_store.named(kept, *depends)
