"""One robot file through every importer: what each makes of it beside what the file says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence, Set
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import Any
from xml.etree import ElementTree

import numpy as np

from crossbody.cases import SceneError
from crossbody.cases.arrays import Floats
from crossbody.cases.files import mjcf
from crossbody.cases.files.inertias import Inertia, of_shapes, six
from crossbody.cases.files.reading import check_text, findings_of, is_urdf, read, scene_of
from crossbody.cases.files.urdf import bounds, parsed, planar
from crossbody.cases.files.without import without_meshes
from crossbody.cases.scene import Body, Scene
from crossbody.engines.importers import SECONDS, Reading
from crossbody.reports.importers.compare import Row, rows
from crossbody.reports.importers.declared import excused
from crossbody.reports.importers.expected import expected, job_of
from crossbody.reports.importers.forms import Forms
from crossbody.reports.importers.forms import named as lines_named
from crossbody.reports.importers.parts import SINGLE

FIRST, BEHIND = "mujoco", 5
"""Reader whose answer is to come first, as the other yardstick, and how nice the others are to it and us."""


@dataclass(slots=True)
class Audit:
    """A file before its importers.

    Attributes:
        path: of the file.
        scene: what it says.
        job, wanted: states, and what a reader without fault makes of them.
        findings: sentences on what is strange in the file itself.
        told: importer -> what it said while it read.
        absent: importer -> why it is not there.
        strange: importer -> what is to be said of its version.
        named: line of the file -> tag -> names of the parts that stand there.
    """

    path: Path
    scene: Scene
    job: dict[str, Any]
    wanted: dict[str, Any]
    findings: tuple[str, ...] = ()
    told: dict[str, list[str]] = field(default_factory=dict)
    absent: dict[str, str] = field(default_factory=dict)
    strange: dict[str, str] = field(default_factory=dict)
    named: dict[int, dict[str, set[str]]] = field(default_factory=dict)


def audited(
    path: Path, engines: Sequence[str], without: str = "", seconds: float = SECONDS, audit: Audit | None = None
) -> Iterator[tuple[Audit, str, list[Row]]]:
    """Return the audit, and of each importer its rows, as they are there, within so many seconds each."""
    check_text(path)
    left_out = _left_out(path, without)
    with TemporaryDirectory(prefix="crossbody-audit-") as folder:
        given = meshless(path, Path(folder)) if is_urdf(path) and without_meshes(without) else path
        readings = [Reading(name, given, is_urdf(path), seconds, int(name != FIRST) * BEHIND) for name in engines]
        try:
            found = audit or opened(path, without)
        except BaseException:
            for reading in readings:
                reading.abandon()
            raise
        with Forms(path, lambda form: opened(form, without, found.job)) as forms:
            yield from _answered(found, readings, left_out, forms)


def _left_out(path: Path, without: str) -> set[str]:
    """Return the quantities to which no reader is held: readers have the whole file."""
    found = {word.strip().partition(":")[0].removesuffix("s") + "s" for word in without.split(",")}
    if is_urdf(path):
        return found | {"actuators"}  # of transmissions, which move nothing by themselves
    if not found & {"frictions", "limits", "tendons"}:
        return found
    model, _ = read(path)
    if "tendons" in found and model.tendon_armature.any():
        found |= {"M", "energy"}
    if ("limits" in found and model.tendon_limited.any()) or ("frictions" in found and model.tendon_frictionloss.any()):
        found.add("tendons")  # whose numbers are one quantity
    return found | {"friction", "surfaces"} if "frictions" in found else found


def meshless(path: Path, folder: Path) -> Path:
    """Return a copy of a URDF without what is drawn or touches by a mesh, none of which moves it."""
    root = parsed(path)
    for link in root.findall("link"):
        for part in [*link.findall("visual"), *link.findall("collision")]:
            if part.find("geometry/mesh") is not None:
                link.remove(part)
    copy = folder / path.name
    ElementTree.ElementTree(root).write(copy, encoding="utf-8")
    return copy


def _answered(
    found: Audit, readings: Sequence[Reading], left_out: Set[str], forms: Forms
) -> Iterator[tuple[Audit, str, list[Row]]]:
    with ThreadPoolExecutor(max(len(readings), 1)) as pool:
        answers = {pool.submit(reading.answer, found.job): reading.name for reading in readings}
        for done in as_completed(answers):
            name, answer = answers[done], done.result()
            found.told[name] = answer["told"]
            if answer["status"] == "absent":
                found.absent[name] = answer["why"]
            else:
                found.strange[name] = answer.get("strange", "")
                told = rows(name, answer, found.wanted, found.job["joints"], found.named)
                told = excused(told, answer, found, forms)
                yield found, name, [row for row in told if row.quantity not in left_out]


def opened(path: Path, without: str = "", job: dict[str, Any] | None = None) -> Audit:
    """Return what a file says, less what is left out, with the states at which it is compared.

    Those of a job are taken where the file has its joints.
    """
    model, told = read(path, without)
    scene = scene_of(path, model)
    if not scene.joints:
        raise SceneError(f"{path} has no joint: there is no motion in which readers could differ; valid: one at least.")
    own = {} if is_urdf(path) else of_shapes(path)
    scene = with_closed_forms(scene, own)
    of_key = mjcf.names(model, "key")
    keys = {of_key(i): np.array(q) for i, q in enumerate(model.key_qpos)}
    paired = {*model.pair_geom1.tolist(), *model.pair_geom2.tolist()}
    meets = [bool(one) or i in paired for i, one in enumerate(model.geom_contype | model.geom_conaffinity)]
    named = mjcf.names(model, "geom")
    touching = [named(i) for i, one in enumerate(meets) if one]
    found = of_scene(path, scene, keys, (*told, *findings_of(path)), touching, job)
    found.named = lines_named(path)
    found.wanted["precision"] = SINGLE if None in own.values() else 0.0
    if is_urdf(path):
        found.wanted["planar"] = planar(path)
        found.wanted["contacts"], found.wanted["softness"] = None, {}  # of which a URDF says nothing
        for name, own_bounds in bounds(path).items():
            for key, value in own_bounds.items():
                if name in found.wanted["numbers"][key]:
                    found.wanted["numbers"][key][name] = [value]
    return found


def with_closed_forms(scene: Scene, own: Mapping[str, Inertia | None]) -> Scene:
    """Return the scene with inertias of shapes as we compute them: what the compiler makes of them shows."""

    def of(body: Body) -> Body:
        if (inertia := own.get(body.name)) is None:
            return body
        return replace(body, mass=inertia.mass, com=tuple(inertia.com.tolist()), inertia=six(inertia.about))

    return scene.replace(bodies=tuple(map(of, scene.bodies)))


def of_scene(
    path: Path, scene: Scene, keys: Mapping[str, Floats] = MappingProxyType({}),
    findings: tuple[str, ...] = (), touching: Sequence[str] | None = None,
    job: dict[str, Any] | None = None,
) -> Audit:  # fmt: skip
    """Return the audit of a file by the scene that it means; without `touching` shapes are not compared."""
    own = job_of(scene, keys)
    job = job if job is not None and job["joints"] == own["joints"] else own
    return Audit(path=path, scene=scene, job=job, wanted=expected(scene, job, touching), findings=findings)
