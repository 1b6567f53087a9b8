"""Plug-ins from elsewhere: modules that other distributions name by entry points, and files of a user's own.

The pyproject.toml of a distribution says, for example,

    [project.entry-points."crossbody.cases"]
    gripper = "my_package.gripper"

and likewise for "crossbody.engines", "crossbody.reports.metrics", "crossbody.hw.formats" and
every other folder of plug-ins. A file is given to `use`, as the commands do with --plugin FILE,
pytest with --crossbody-plugin FILE, and both with the files that the pyproject.toml of the folder
one works in names, or of the nearest folder above it:

    [tool.crossbody]
    plugins = ["engines/euler.py"]  # from the folder of the pyproject.toml

A plug-in is called like its file, and is of every kind whose public names it has (`public_names`).
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import re
import sys
import tomllib
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache, partial
from importlib.machinery import PathFinder
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

from crossbody.cases import arguments
from crossbody.cases.errors import CrossbodyError, InvalidValue, KernelError, NoFile, SceneError, shown
from crossbody.cases.public_names import KINDS, check, groups_of, what_is_missing

_Made = TypeVar("_Made")

_FILES: dict[Path, ModuleType] = {}
_OWN: dict[str, str] = {}
"""File of a user's own that was imported -> what it is called in messages."""
OURS = tuple(
    os.path.join(Path(__file__).parents[1], folder, "") for folder in ("cases", "engines", "hw", "reference", "reports")
)
"""How the paths of crossbody's own modules begin; a checkout may hold an environment with other libraries too."""


def modules(group: str) -> Mapping[str, str]:
    """Return the module of each plug-in by its name; what entry points name is not imported."""
    own = {path.stem: module.__name__ for path, module in _FILES.items() if group in groups_of(module)}
    return {**_entry_points(group), **own}


@cache
def _entry_points(group: str) -> Mapping[str, str]:
    if not _other_finders() and not any(map(_may_name_plugins, sys.path)):
        return {}
    return {point.name: point.module for point in _every_entry_point().select(group=group)}


def _may_name_plugins(place: str) -> bool:
    """Return whether what is installed there may name a plug-in: the text says it sooner than a parser."""
    found = _distributions(place)
    return found is None or any(map(_names_plugins, found.values()))


@cache
def _distributions(place: str) -> Mapping[str, str] | None:
    """Return the folder of what is told of each distribution that is installed there; None of an archive."""
    try:
        with os.scandir(place or ".") as found:
            return {
                _plain(entry.name.partition("-")[0].removesuffix(".egg").removesuffix(".egg-info")): entry.path
                for entry in found
                if entry.name.endswith((".dist-info", ".egg-info", ".egg"))
            }
    except NotADirectoryError:  # it has its own reader
        return None
    except OSError:
        return {}


def _plain(name: str) -> str:
    """Return a name as all spellings of it are compared."""
    return re.sub(r"[-_.]+", "-", name).lower()


def _names_plugins(distribution: str) -> bool:
    if distribution.endswith(".egg"):
        return True
    with suppress(OSError), open(os.path.join(distribution, "entry_points.txt"), "rb") as file:
        return b"[crossbody." in file.read()
    return False


@cache
def _every_entry_point() -> Any:
    from importlib.metadata import entry_points  # reads what is installed: once a process

    return entry_points()


def version(name: str) -> str:
    """Return the version of a distribution.

    `importlib.metadata.version` parses its whole README for that, and imports readers of e-mails and archives.

    Raises:
        ModuleNotFoundError: if it is not installed.
    """
    places = list(map(_distributions, sys.path))
    told = next((place[_plain(name)] for place in places if place and _plain(name) in place), "")
    for file in ("METADATA", "PKG-INFO") if told else ():
        with suppress(OSError), open(os.path.join(told, file), encoding="utf-8", errors="replace") as text:
            for line in text:
                if line.startswith("Version:"):
                    return line.removeprefix("Version:").strip()
    if not told and None not in places and not _other_finders():
        raise ModuleNotFoundError(f"{name} is not installed", name=name)
    from importlib.metadata import version

    return version(name)


def _other_finders() -> bool:
    """Return whether distributions are found elsewhere than in the folders of `sys.path`."""
    return any(one is not PathFinder and hasattr(one, "find_distributions") for one in sys.meta_path)


def use(files: Iterable[str | os.PathLike[str]]) -> None:
    """Import files as plug-ins of this process; one that it has already is left as it is."""
    for file in files:
        path = Path(arguments.path("plug-in", file)).expanduser().resolve()
        if path not in _FILES:
            _FILES[path] = _opened(path)


def _opened(path: Path) -> ModuleType:
    if path.suffix != ".py" or not path.stem.isidentifier():
        raise InvalidValue(f"The plug-in {path} is not called NAME.py, with a NAME of letters, digits and _.")
    if not os.path.isfile(path):
        raise NoFile("plug-in file", path)
    if same := [other for other in _FILES if other.stem == path.stem]:
        raise InvalidValue(f"The plug-ins {same[0]} and {path} have the same name: rename one of the files.")
    module = from_file("plugin", path)
    try:
        _check(path, module)
    except CrossbodyError:
        del sys.modules[module.__name__]
        raise
    return module


def _check(path: Path, module: ModuleType) -> None:
    if not (groups := groups_of(module)):
        raise InvalidValue(f"The plug-in file {path} {what_is_missing(module)}")
    for group in groups:
        package = f"{group}.library" if group == "crossbody.cases" else group
        taken = find_spec(f"{package}.{path.stem}") or path.stem in getattr(sys.modules[package], "OWN", ())
        if taken or path.stem in _entry_points(group):
            raise InvalidValue(f"The {KINDS[group].name} {path.stem!r} already exists: rename the plug-in {path}.")
        check(module, group)


def configured(folder: str | os.PathLike[str]) -> tuple[Path, ...]:
    """Return the files that the pyproject.toml of a folder names, or of the nearest one above it."""
    given = Path(folder).absolute()
    places = (here / "pyproject.toml" for here in (given, *given.parents))
    found = next(filter(os.path.isfile, places), None)
    return () if found is None else tuple(found.parent / Path(name).expanduser() for name in _named_in(found))


def _named_in(path: Path) -> list[str]:
    try:
        tool = tomllib.loads(path.read_text(encoding="utf-8")).get("tool", {})
    except (OSError, ValueError) as error:  # TOML and UTF-8 that are none are a ValueError
        raise InvalidValue(f"{path} cannot be read: {error}.") from None
    table = tool.get("crossbody", {}) if isinstance(tool, dict) else {}
    names = table.get("plugins", []) if isinstance(table, dict) and set(table) <= {"plugins"} else None
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise InvalidValue(f'{path}: [tool.crossbody] is {shown(table)}; valid: plugins = ["FILE.py", ...] alone.')
    return names


def options() -> list[str]:
    """Return the words of a command line that give this process's files to another."""
    return [word for path in _FILES for word in ("--plugin", str(path))]


def digests() -> dict[str, str]:
    """Return what tells this process's files from others of their names, by their paths."""
    return {str(path): hashlib.sha256(path.read_bytes()).hexdigest() for path in _FILES}


def shared(function: Callable[..., _Made]) -> Callable[..., _Made]:
    """Return a function to be called in another process, which knows the files of this one there."""
    return partial(_knowing, tuple(map(str, _FILES)), function) if _FILES else function


def _knowing(files: Iterable[str], function: Callable[..., _Made], *given: Any) -> _Made:
    use(files)
    return function(*given)


def from_file(kind: str, path: Path, known: Iterable[str] = ()) -> ModuleType:
    """Import a file of a user's own.

    Messages say what `kind` it is ("case", "plugin", "controller") and what `known` names stand in
    its place.
    """
    spec = importlib.util.spec_from_file_location(f"crossbody_{kind}_{path.stem}", path)
    if spec is None or spec.loader is None or not path.is_file():
        raise NoFile(f"{kind} file", path, known)
    loaded = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = loaded  # dataclasses look their module up there
    _OWN[str(path.absolute())] = f"{kind.replace('plugin', 'plug-in')} file {path}"
    try:
        with _unwritten():
            spec.loader.exec_module(loaded)
    except (CrossbodyError, KeyboardInterrupt):
        del sys.modules[spec.name]
        raise
    except (Exception, SystemExit) as error:
        del sys.modules[spec.name]
        raise SceneError(_failed(path, error)) from error
    return loaded


@contextmanager
def _unwritten() -> Iterator[None]:
    """Import without `__pycache__` beside the files that are imported: their folder is the user's."""
    before, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    try:
        yield
    finally:
        sys.dont_write_bytecode = before


def _failed(path: Path, error: BaseException) -> str:
    """Why a file of a user's own cannot be imported, and the last of its lines that was reached."""
    file, line, why = str(path), _line_in(str(path.absolute()), error), str(error)
    if isinstance(error, SyntaxError):
        file, line, why = error.filename or file, error.lineno, error.msg
    where = file if line is None else f"{file}, line {line}"
    return f"The {_OWN[str(path.absolute())]} cannot be imported: {_what(error, why)} in {where}."


def _line_in(file: str, error: BaseException) -> int | None:
    own = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    return own[-1] if own else None


def _what(error: BaseException, why: str) -> str:
    return f"{type(error).__name__}{f' ({why[:300]})' if why else ''}"


def sentence(error: BaseException) -> str | None:
    """Return what goes wrong in a file of a user's own, with the line; None for a fault that is not its.

    Wrong use is told in its own words. Any other error is the file's if neither crossbody's code nor that of
    another file of this kind was called from the last of its lines.
    """
    frames = [frame.filename for frame in traceback.extract_tb(error.__traceback__)]
    own = [file for file in frames if file in _OWN]
    if isinstance(error, KernelError) and not _OWN:  # nobody but crossbody has written a kernel
        return None
    if isinstance(error, CrossbodyError):
        where = f" It was raised in {own[-1]}, line {_line_in(own[-1], error)}." if own else ""
        return f"{error}{where}"
    last = next((file for file in reversed(frames) if file in _OWN or file.startswith(OURS)), "")
    if last not in _OWN:
        return None
    return f"The {_OWN[last]} raises {_what(error, str(error))} in line {_line_in(last, error)}."
