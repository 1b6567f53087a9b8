"""Meshes that robot files name: where they are, and which of them a model can do without."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.errors import SceneError
from crossbody.cases.regular import open_regular

BYTES = 50_000_000  # of a mesh
READ = (".stl", ".obj", ".msh")
"""Formats that MuJoCo reads; of others Coal, Pinocchio's collision library, reads those of Assimp."""

TEXT = re.compile(rb"\s*solid\b[^\0]*\bfacet\b")
"""Beginning of an STL file in text, which MuJoCo does not read."""


def content(path: Path) -> bytes:
    """Return what a mesh's file holds."""
    try:
        with open_regular(path) as file:
            found = file.read(BYTES + 1)
    except OSError as error:
        raise SceneError(f"Mesh {path} cannot be read: {error.strerror}.") from None
    if len(found) > BYTES:
        raise SceneError(f"Mesh {path} has more than {BYTES} bytes; valid: at most so many.")
    return found


def check_files(spec: Any, path: Path) -> None:
    """Check every mesh of an MJCF file that is there: MuJoCo would wait for a pipe, and take any size."""
    for _, file in _files(spec, path):
        if file.exists():
            content(file)


def leave_out_colliding(spec: Any) -> None:
    """Let no mesh of an MJCF file touch anything, and take out those that then are only drawn."""
    meshes = [geom for geom in spec.geoms if geom.meshname]
    for pair in list(spec.pairs):
        if {pair.geomname1, pair.geomname2} & {geom.name for geom in meshes}:
            spec.delete(pair)
    for geom in meshes:
        geom.contype = geom.conaffinity = 0
    _leave_out(spec, {_name(mesh) for mesh in spec.meshes})


def leave_out_missing(spec: Any, path: Path) -> list[str]:
    """Take out meshes that are not there and are only drawn; return a sentence on each.

    A mesh that may touch or that gives its body inertia stays, for the compiler to name its file.
    """
    gone = {_name(mesh): file for mesh, file in _files(spec, path) if not file.exists()}
    taken = _leave_out(spec, set(gone))
    return [f"Mesh {name!r} is purely visual, and left out: there is no file {gone[name]}." for name in taken]


def _leave_out(spec: Any, names: set[str]) -> list[str]:
    """Take out those of the meshes of these names that are only drawn; return which."""
    touching = {name for pair in spec.pairs for name in (pair.geomname1, pair.geomname2)}
    using = {name: [geom for geom in spec.geoms if geom.meshname == name] for name in names}
    taken = sorted(name for name in names if all(_only_drawn(spec, geom, touching) for geom in using[name]))
    meshes = [mesh for mesh in spec.meshes if _name(mesh) in taken]
    for part in [*(geom for name in taken for geom in using[name]), *meshes]:
        spec.delete(part)
    return taken


def _name(mesh: Any) -> str:
    return mesh.name or Path(mesh.file).stem


def _files(spec: Any, path: Path) -> Iterator[tuple[Any, Path]]:
    yield from ((mesh, path.parent / spec.meshdir / mesh.file) for mesh in spec.meshes if mesh.file)


def _only_drawn(spec: Any, geom: Any, touching: set[str]) -> bool:
    import mujoco

    if geom.contype or geom.conaffinity or geom.name in touching:
        return False
    first, last = spec.compiler.inertiagrouprange
    given = int(mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE)
    own = geom.parent.explicitinertial and int(spec.compiler.inertiafromgeom) != given
    weightless = geom.mass == 0.0 or (np.isnan(geom.mass) and geom.density == 0.0)
    return bool(own or weightless or not first <= geom.group <= last)


def supplied(root: ElementTree.Element, path: Path) -> dict[str, bytes]:
    """Return the meshes that a URDF names as MuJoCo's assets, and name them so there."""
    found: dict[str, bytes] = {}
    names: dict[Path, str] = {}
    for mesh in root.findall("link/collision/geometry/mesh"):
        file = located(mesh.get("filename", ""), path)
        if file not in names:
            held, suffix = content(file), file.suffix.lower()
            foreign = suffix not in READ or (suffix == ".stl" and TEXT.match(held))
            names[file] = f"{file.stem} {len(names)}{'.obj' if foreign else suffix}"
            found[names[file]] = _by_coal(file) if foreign else held
        mesh.set("filename", names[file])
    return found


def located(name: str, path: Path) -> Path:
    """Return where a mesh is that a URDF names: beside it, or in a package above it for package://PACKAGE/..."""
    scheme, _, rest = name.rpartition("://")
    inside = Path(rest.lstrip("/") if scheme == "package" else rest)
    above = path.resolve().parents
    if scheme == "package":
        package = inside.parts[0] if inside.parts else ""
        tried = [folder / inside for folder in above]
        tried += [folder.joinpath(*inside.parts[1:]) for folder in above if folder.name == package]
    else:
        tried = [above[0] / inside]
    for file in tried:
        if file.exists():
            return file
    raise SceneError(
        f"{path}: the mesh {name!r}, with which a link collides, is not there (tried {tried[0]}"
        f"{' and its like above' if scheme == 'package' else ''}); --without meshes leaves all of them out."
    )


def _by_coal(file: Path) -> bytes:
    """Return the hull of a mesh in a format that MuJoCo does not read, as an OBJ file."""
    try:
        import coal
    except ImportError:
        valid = ", ".join(READ)
        raise SceneError(
            f"Mesh {file} is in a format that only Coal reads, which comes with pin; valid without it: {valid}."
        ) from None
    try:
        points = np.array(coal.MeshLoader().load(str(file), np.ones(3)).vertices(), dtype=float).reshape(-1, 3)
    except (RuntimeError, ValueError) as error:
        raise SceneError(f"Mesh {file} cannot be read: {' '.join(str(error).split())}.") from None
    return _obj(points, file)


def _obj(points: Floats, file: Path) -> bytes:
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        raise SceneError(
            f"Mesh {file} has {len(points)} points that fill no space; a hull needs four that do."
        ) from None
    corners = points[hull.vertices]
    number = np.empty(len(points), dtype=int)
    number[hull.vertices] = np.arange(1, len(corners) + 1)
    faces = number[hull.simplices]
    lines = [*("v {:.17g} {:.17g} {:.17g}".format(*x) for x in corners), *("f {} {} {}".format(*f) for f in faces)]
    return "\n".join(lines).encode()
