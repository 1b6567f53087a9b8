"""Which reader a file needs, and what its text says that the compiler would pass over.

A file may come from anywhere: it includes nothing from outside its folder, and it has no more
bodies than a scene.
"""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

from crossbody.cases.errors import EngineUnavailable, InvalidValue, NoFile, SceneError
from crossbody.cases.files.without import strip
from crossbody.cases.regular import open_regular
from crossbody.cases.scene import LARGEST, Scene

if TYPE_CHECKING:
    import mujoco


SUFFIXES = (".xml", ".urdf")
HEAD = 4096
"""Bytes in which the root of a file must begin, behind comments that are longer it is taken for MJCF."""
BYTES = 50_000_000  # of a file
BODIES = ("body", "link")


def existing(path: Path) -> Path:
    """Return the path of a robot file.

    Raises:
        EngineUnavailable: where MuJoCo, whose compiler reads robot files, is not installed.
    """
    if not path.is_file():
        raise NoFile("robot file", path)
    if path.suffix not in SUFFIXES:
        raise InvalidValue(f"The robot file {path} ends in {path.suffix!r}; valid: {', '.join(SUFFIXES)}.")
    if find_spec("mujoco") is None:
        raise EngineUnavailable(
            f"The robot file {path} is read by the compiler of the package 'mujoco', which is not installed; install "
            "it with: pip install 'crossbody[mujoco]'"
        )
    return path


def is_urdf(path: Path) -> bool:
    """Return whether a file is a URDF."""
    with open_regular(path) as file:
        return path.suffix == ".urdf" or b"<robot" in file.read(HEAD)


def read(path: Path, without: str = "") -> tuple[mujoco.MjModel, list[str]]:
    """Return the compiled model whose tree, shapes and filters are the file's; inertias of a URDF are placeholders.

    With it sentences on what the compiler found strange.
    """
    from crossbody.cases.files import mjcf, urdf  # which cases that are no file do without

    model, told = (urdf if is_urdf(path) else mjcf).read(path, without)
    strip(model, without)
    return model, told


def model_of(path: Path, without: str = "") -> mujoco.MjModel:
    """Return the model that `read` does."""
    return read(path, without)[0]


def scene_of(path: Path, model: mujoco.MjModel) -> Scene:
    """Return the scene of a file by its model."""
    from crossbody.cases.files import mjcf, urdf

    scene = mjcf.scene_of(model)
    return urdf.with_inertias(path, scene) if is_urdf(path) else scene


def findings_of(path: Path) -> list[str]:
    """Return sentences on what is strange in a file to us, not to its compiler, but is taken as it stands."""
    from crossbody.cases.files import urdf

    return urdf.findings(path) if is_urdf(path) else []


def check_text(path: Path) -> None:
    """Check a file and what it includes; what is no XML is left to the compiler, which names the line."""
    _count(path, path.resolve().parent, {path.resolve()})


def _count(path: Path, folder: Path, seen: set[Path]) -> int:
    """Return how many bodies a file has with its includes."""
    total, copies = 0, [1]
    if path.stat().st_size > BYTES:
        raise SceneError(f"{path} has {path.stat().st_size} bytes; valid: at most {BYTES}.")
    with open_regular(path) as file:
        try:
            for event, part in ElementTree.iterparse(file, ("start", "end")):
                if part.tag == "replicate":
                    count = part.get("count", "1")
                    times = int(count) if count.isdecimal() else 1
                    copies = copies[:-1] if event == "end" else [*copies, copies[-1] * times]
                elif event == "start" and part.tag in BODIES:
                    total += copies[-1]
                elif event == "start" and part.tag == "include":
                    total += copies[-1] * _included(part.get("file", ""), path, folder, seen)
                if total > LARGEST:
                    raise SceneError(f"{path} has more than {LARGEST} bodies, the maximum of a scene.")
                part.clear() if event == "end" else None
        except ElementTree.ParseError:
            return total
    return total


def _included(name: str, path: Path, folder: Path, seen: set[Path]) -> int:
    there = (folder / name).resolve()
    if not there.is_relative_to(folder):
        raise SceneError(f"{path} includes {name!r} from outside its folder {folder}; valid: files in there.")
    if there in seen or not there.is_file():
        return 0
    seen.add(there)
    return _count(there, folder, seen)
