"""What a robot's file and its user ask for, read by another route than the case that is run was.

A start that every engine is given is compared with nothing by comparing engines. So keyframes are read from the text of
the file here, tables of controls as text, and pushes from what was asked for: each of them must be what the case has.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from crossbody.cases import Case
from crossbody.cases.arrays import Floats
from crossbody.cases.regular import open_regular
from crossbody.reports.judging.audit import AuditRow

ROUNDED = 1e-12
"""Part of a number by which what was normalised, or summed in another order, differs."""
KEY = "key"
DEEP = 16  # includes within each other
HALF = 0.5
Keys = list[Mapping[str, str]]


def start_of_file(case: Case) -> tuple[AuditRow, ...]:
    """Return rows for the parity audit of a case from a file: start, controls and pushes; none of another."""
    if not case.file or case.scene is None:
        return ()
    key = _key(case)
    start = _start(case, key) if key is not None else ()
    return (*start, *_as_asked(case), *_laws(case), *_pushes(case), *_table(case))


def _key(case: Case) -> Mapping[str, str] | None:
    """Return the keyframe that is run by the text of the file, an empty one without; None where models are attached."""
    from crossbody.cases.files.case import REFERENCE_POSE, open_file

    try:
        keys = list(_keys(Path(case.file)))
    except (ElementTree.ParseError, OSError):
        return None
    variants = list(open_file(case.file).VARIANTS)
    if not keys:
        return {} if variants == [REFERENCE_POSE] else None
    named = [key.get("name") or f"key{i}" for i, key in enumerate(keys)]
    return dict(zip(named, keys, strict=True)).get(case.variant) if named == variants else None


def _keys(path: Path, deep: int = 0) -> Iterator[Mapping[str, str]]:
    """Yield the attributes of every keyframe of a file and of what it includes, in their order."""
    with open_regular(path) as file:
        root = ElementTree.parse(file).getroot()
    for part in root.iter():
        if part.tag == "include" and deep < DEEP and (path.parent / part.get("file", "")).is_file():
            yield from _keys(path.parent / part.get("file", ""), deep + 1)
        elif part.tag == KEY:
            yield part.attrib


def _start(case: Case, key: Mapping[str, str]) -> Iterator[AuditRow]:
    """Yield positions, velocities, activations and controls of a keyframe, 0 where it names none, and of the case."""
    p, scene = case.parameters, case.scene
    assert scene is not None
    q = _numbers(key.get("qpos"), 0)
    if len(q) == len(case.q0) and not p.get("assemble"):
        q[[at for at, _ in _asked(case, "start")]] = [value for _, value in _asked(case, "start")]
        for at in case.quaternions:
            q[at : at + 4] /= float(np.sqrt(np.sum(q[at : at + 4] ** 2))) or 1.0
        yield _row("q of the file", case.q0, q)
    if not p.get("assemble"):
        v = _numbers(key.get("qvel"), len(case.v0))
        v[[at for at, _ in _asked(case, "rate")]] = [value for _, value in _asked(case, "rate")]
        yield _row("v of the file", case.v0, v)
    if scene.activated:
        yield _row("activations of the file", case.act0, _numbers(key.get("act"), len(scene.activated)))
    if case.inputs is not None and scene.actuators and not (p.get("ctrl") or p.get("control")):
        held = case.inputs.values[:, : len(scene.actuators)]
        yield _row("controls of the file", held, np.tile(_numbers(key.get("ctrl"), held.shape[1]), (len(held), 1)))


def _asked(case: Case, name: str) -> list[tuple[int, float]]:
    """Return the places and values of the start that were asked for: those of a slide, a hinge or a place of a body."""
    assert case.scene is not None
    widths = {"free": (7, 6), "ball": (4, 3), "slide": (1, 1), "hinge": (1, 1)}
    first, found, rate = 0, dict[str, int](), name == "rate"
    for joint in case.scene.joints:
        inside = ("x", "y", "z", *(("rx", "ry", "rz") if rate else ())) if joint.type == "free" else ()
        inside = ("rx", "ry", "rz") if joint.type == "ball" and rate else inside
        names = [f"{joint.name} {one}" for one in inside] or [joint.name]
        found |= {one: first + k for k, one in enumerate(names)}
        first += widths[joint.type][rate]
    parts = [part.rsplit(maxsplit=1) for part in str(case.parameters.get(name, "")).split(";") if part.strip()]
    return [(found[entry.strip()], float(value)) for entry, value in parts]


def _as_asked(case: Case) -> Iterator[AuditRow]:
    """Yield positions and velocities at the start that were asked for, and those of the case."""
    for name, start in (("start", case.q0), ("rate", case.v0)):
        if (asked := _asked(case, name)) and not case.parameters.get("assemble"):
            at, wanted = zip(*asked, strict=True)
            yield _row(f"{name} as asked", start[list(at)], np.array(wanted))


def _laws(case: Case) -> Iterator[AuditRow]:
    """Yield the constants of all rows that were asked for, and those of the case; friction holds no place, by no a0."""
    for name, mine in (("a0", case.law.a0[case.law.touches | ~case.law.unilateral]), ("a1", case.law.a1)):
        if (asked := float(case.parameters.get(name, -1.0))) >= 0.0:
            yield _row(f"{name} as asked", mine, np.full(len(mine), asked))


def _numbers(text: str | None, count: int) -> Floats:
    """Return the numbers of an attribute; zeros where it is not there."""
    return np.zeros(count) if text is None else np.array(text.split(), dtype=float)


def _pushes(case: Case) -> Iterator[AuditRow]:
    """Yield the impulse of every push up to the horizon, and its force amid its time, of the case and as asked."""
    scene, inputs = case.scene, case.inputs
    asked = [part.split() for part in str(case.parameters.get("push", "")).split(";") if part.strip()]
    if not asked or scene is None or inputs is None:
        return
    ends = np.append(inputs.times, np.inf).clip(0.0, case.t_end)
    forces = inputs.values[:, len(scene.actuators) :].reshape(len(inputs.times), -1, 3)
    found = np.einsum("i,ijk->jk", np.diff(ends), forces)
    spans = np.array([[float(x) for x in part[-2:]] for part in asked])
    wanted = np.array([[float(x) for x in part[-5:-2]] for part in asked])
    took = np.diff(spans.clip(0.0, case.t_end), axis=1)
    yield _row("impulse of pushes", found, took * wanted)
    bodies = [" ".join(part[:-5]) for part in asked]
    amid = inputs.at(spans.clip(0.0, case.t_end).mean(axis=1))[:, len(scene.actuators) :]
    acts = np.where(took > 0.0, np.einsum("iij->ij", amid.reshape(len(asked), -1, 3)), wanted)  # some come behind it
    same = [push.body for push in scene.pushes] == [" ".join(body.split()) for body in bodies]
    yield _row("force of pushes", acts if same else np.full_like(acts, np.nan), wanted)


def _table(case: Case) -> Iterator[AuditRow]:
    """Yield what a table of controls has, read as text, and what the case has amid its rows."""
    path, scene = Path(str(case.parameters.get("ctrl") or "")), case.scene
    if path.suffix != ".csv" or scene is None or case.inputs is None:
        return
    with open_regular(path) as file:
        rows = list(csv.DictReader(line.decode() for line in file))
    t = np.array([float(row["t"]) for row in rows])
    wanted = np.array([[float(row[one.name]) for one in scene.actuators] for row in rows])
    amid = t + HALF * np.diff(t, append=t[-1] + 1.0)
    yield _row("controls of the table", case.inputs.at(amid)[:, : len(scene.actuators)], wanted)


def _row(quantity: str, mine: Floats, theirs: Floats) -> AuditRow:
    """Return both, by the largest number of what was asked for."""
    a, b = np.asarray(mine, dtype=float), np.asarray(theirs, dtype=float)
    off = float(np.max(np.abs(a - b), initial=0.0)) if a.shape == b.shape else np.inf
    size = float(np.max(np.abs(b), initial=0.0)) or 1.0
    words = (" ".join(f"{x + 0.0:.6g}" for x in one.ravel()) for one in (a, b))
    return AuditRow(
        quantity=quantity, mine=next(words), theirs=next(words),
        difference=off / size if np.isfinite(off) else np.inf, tolerance=ROUNDED,
    )  # fmt: skip
