"""Which reader a file needs: by its suffix, or by its root where that says nothing."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from crossbody.cases.errors import InvalidValue, NoFile
from crossbody.cases.files import mjcf, urdf
from crossbody.cases.files.without import strip
from crossbody.cases.regular import open_regular
from crossbody.cases.scene import Scene

if TYPE_CHECKING:
    import mujoco

SUFFIXES = (".xml", ".urdf")
HEAD = 4096
"""Bytes in which the root of a file must begin, behind comments that are longer it is taken for MJCF."""


def existing(path: Path) -> Path:
    """Return the path of a robot file.

    Raises:
        NoFile: if it is not there.
        InvalidValue: for another suffix, by which MuJoCo's compiler knows what it reads.
    """
    if not path.is_file():
        raise NoFile("robot file", path)
    if path.suffix not in SUFFIXES:
        raise InvalidValue(f"The robot file {path} ends in {path.suffix!r}; valid: {', '.join(SUFFIXES)}.")
    return path


def is_urdf(path: Path) -> bool:
    """Return whether a file is a URDF."""
    with open_regular(path) as file:
        return path.suffix == ".urdf" or b"<robot" in file.read(HEAD)


def read(path: Path, without: str = "") -> tuple[mujoco.MjModel, list[str]]:
    """Return the compiled model whose tree, shapes and filters are the file's; inertias of a URDF are placeholders.

    With it sentences on what the compiler found strange.

    Raises:
        SceneError: with the compiler's own sentence.
        InvalidValue: for a word in `without` that names nothing.
    """
    model, told = (urdf if is_urdf(path) else mjcf).read(path, without)
    strip(model, without)
    return model, told


def model_of(path: Path, without: str = "") -> mujoco.MjModel:
    """Return the model that `read` does."""
    return read(path, without)[0]


def scene_of(path: Path, model: mujoco.MjModel) -> Scene:
    """Return the scene of a file by its model.

    Raises:
        SceneError: for what a scene does not have, by name.
    """
    scene = mjcf.scene_of(model)
    return urdf.with_inertias(path, scene) if is_urdf(path) else scene


def findings_of(path: Path) -> list[str]:
    """Return sentences on what is strange in a file to us, not to its compiler, but is taken as it stands."""
    return urdf.findings(path) if is_urdf(path) else []
