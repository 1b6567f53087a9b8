"""MuJoCo's compiler, and what it warns of: else that goes to stderr and to MUJOCO_LOG.TXT in the working directory."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from crossbody.cases.errors import CrossbodyError, SceneError

NOT_A_NUMBER = "'NaN'"  # what MuJoCo's warning names; it takes such an entry as not given


@contextmanager
def captured() -> Iterator[list[str]]:
    """Collect the warnings: those of the library, and those of its Python layer."""
    import mujoco

    messages: list[str] = []
    previous = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(messages.append)
    try:
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            yield messages
        messages += [str(one.message) for one in told]
    finally:
        mujoco.set_mju_user_warning(previous)


def compiled(path: Path, compiler: Callable[[], Any]) -> tuple[Any, list[str]]:
    """Return what a compiler makes of a file, and what MuJoCo warns of meanwhile."""
    with captured() as warned:
        try:
            found = compiler()
        except CrossbodyError:
            raise
        except ValueError as error:
            raise SceneError(f"{path}: MuJoCo's compiler refuses it: {error}") from None
    if any(NOT_A_NUMBER in text for text in warned):
        raise SceneError(f"{path}: an entry is NaN; valid: numbers. MuJoCo would treat it as not given.")
    return found, warned


def sentences(warned: Sequence[str]) -> list[str]:
    """Return warnings as sentences, each once."""
    return [f"MuJoCo warns: {' '.join(text.split())}." for text in dict.fromkeys(warned)]
