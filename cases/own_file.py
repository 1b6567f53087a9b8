"""Importing a Python file of a user's own."""

from __future__ import annotations

import importlib.util
import sys
import traceback
from collections.abc import Iterable
from pathlib import Path
from types import ModuleType

from crossbody.cases.errors import CrossbodyError, SceneError, UnknownName


def from_file(kind: str, path: Path, known: Iterable[str] = ()) -> ModuleType:
    """Import a file of a user's own.

    Args:
        kind: what it holds, for example "case", "plugin" or "controller".
        path: of the file.
        known: names that would be valid in its place.

    Raises:
        UnknownName: if it is not there.
        SceneError: if it cannot be imported, with the line.
    """
    spec = importlib.util.spec_from_file_location(f"crossbody_{kind}_{path.stem}", path)
    if spec is None or spec.loader is None or not path.is_file():
        raise UnknownName(f"{kind} file", str(path), known)
    loaded = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = loaded  # dataclasses look their module up there
    try:
        spec.loader.exec_module(loaded)
    except (CrossbodyError, KeyboardInterrupt):
        del sys.modules[spec.name]
        raise
    except (Exception, SystemExit) as error:
        del sys.modules[spec.name]
        raise SceneError(_failed(kind, path, error)) from error
    return loaded


def _failed(kind: str, path: Path, error: BaseException) -> str:
    """Why a file of a user's own cannot be imported, and the last of its lines that was reached."""
    if isinstance(error, SyntaxError):
        file, line, why = error.filename or str(path), error.lineno, error.msg
    else:
        own = [frame for frame in traceback.extract_tb(error.__traceback__) if Path(frame.filename) == path.absolute()]
        file, line, why = str(path), own[-1].lineno if own else None, str(error)
    where = file if line is None else f"{file}, line {line}"
    what = type(error).__name__
    return f"The {kind} file {path} cannot be imported: {what}{f' ({why[:300]})' if why else ''} in {where}."
