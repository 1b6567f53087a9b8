"""What acts on a robot's file from outside: controls from a table or a controller of the user's own, and pushes.

A table has a column t in s, and one for every actuator by its name.
"""

from __future__ import annotations

import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from crossbody.cases.arguments import shown
from crossbody.cases.arrays import Floats, distinct
from crossbody.cases.case import Case, Inputs
from crossbody.cases.control import Control
from crossbody.cases.errors import InvalidValue, NoFile, UnknownName
from crossbody.cases.installed import from_file
from crossbody.cases.regular import open_regular
from crossbody.cases.scene import Push, Scene

LARGEST = 1 << 28  # bytes in memory: an hour of eight actuators at 1 kHz


def read_controls(path: Path, scene: Scene) -> Inputs:
    """Return what a table says, each row held until the next.

    A CSV or Parquet table has a head, an NPZ t (m,) and ctrl (m, nu).
    """
    names = [actuator.name for actuator in scene.actuators]
    if not path.is_file():
        raise NoFile("table of controls", path)
    if not names:
        raise InvalidValue(f"Controls {path}: the robot has no actuators, which alone take controls.")
    try:
        open_regular(path).close()
        times, values = _from_npz(path) if path.suffix == ".npz" else _from_table(path, names)
    except Exception as error:  # damaged, a table makes its library raise anything
        told = (str(error) or type(error).__name__).removesuffix(".")
        of_npz = f"arrays t (m,) and ctrl (m, {len(names)})"
        valid = of_npz if path.suffix == ".npz" else f"a table with the columns {', '.join(('t', *names))}"
        raise InvalidValue(f"Controls {path}: {told}; valid: {valid}.") from None
    if values.shape != (len(times), len(names)):
        raise InvalidValue(f"Controls {path} have the shape {values.shape}; valid: ({len(times)}, {len(names)}).")
    if not len(times):
        raise InvalidValue(f"Controls {path} have no rows; valid: one or more.")
    fine = np.isfinite(times) & (times >= 0.0) & np.append(True, np.diff(times) > 0.0)
    if not fine.all():
        i = int(np.argmin(fine))
        raise InvalidValue(
            f"Controls {path}: t must be finite, at least 0 and increasing; row {i + 1} has {times[i]:g}."
        )
    if not np.isfinite(values).all():
        i, j = np.argwhere(~np.isfinite(values))[0]
        raise InvalidValue(
            f"Controls {path}: every value must be finite; row {i + 1} has {values[i, j]:g} for {names[j]!r}."
        )
    return Inputs(names=tuple(names), times=times, values=values)


def _from_npz(path: Path) -> tuple[Floats, Floats]:
    with zipfile.ZipFile(path) as held:
        _check_size(sum(one.file_size for one in held.infolist()))
    with np.load(path, allow_pickle=False) as held:
        return np.asarray(held["t"], dtype=float), np.asarray(held["ctrl"], dtype=float)


def _from_table(path: Path, names: list[str]) -> tuple[Floats, Floats]:
    import pandas as pd

    if path.suffix == ".parquet":
        table = _parquet(path, names)
    else:
        table = pd.read_csv(path)
        _check_columns(list(map(str, table.columns)), names)
    columns = [_numbers(table[name]) for name in ("t", *names)]
    return columns[0], np.stack(columns[1:], axis=1) if names else np.zeros((len(table), 0))


def _numbers(column: Any) -> Floats:
    """Return a column of a table; what is no number is told with its row."""
    import pandas as pd

    found = pd.to_numeric(column, errors="coerce")
    wrong = np.flatnonzero(found.isna() & column.notna())
    if len(wrong):
        raise ValueError(f"row {wrong[0] + 1} has {column.iloc[wrong[0]]!r} for {column.name!r}, which is no number")
    return np.asarray(found, dtype=float)


def _parquet(path: Path, names: list[str]) -> Any:
    import pyarrow.parquet as pq

    with pq.ParquetFile(path) as file:
        _check_columns(file.schema_arrow.names, names)
        _check_size(8 * file.metadata.num_rows * file.metadata.num_columns)
        return file.read().to_pandas()


def _check_columns(columns: list[str], names: list[str]) -> None:
    """Refuse a table that lacks a column, or has one that is no actuator's."""
    for name in ("t", *names):
        if name not in columns:
            raise ValueError(f"there is no column {name!r}; it has: {', '.join(columns)}.")
    for name in columns:
        if name not in ("t", *names):
            raise ValueError(f"the column {name!r} does not belong to an actuator.")


def _check_size(size: int) -> None:
    """Refuse what a small file would unfold to."""
    if size > LARGEST:
        raise ValueError(f"the table needs {size / 1e6:.0f} MB in memory; valid: at most {LARGEST / 1e6:.0f} MB.")


def read_control(text: str, tick: float) -> Control:
    """Return the controller FILE.py:NAME."""
    file, colon, name = text.rpartition(":")
    if not (colon and file.endswith(".py") and name.isidentifier()):
        raise InvalidValue(f"control is {shown(text)}; valid: FILE.py:NAME of a callable of (t, q, v), or of a class.")
    module = from_file("controller", Path(file))
    if not hasattr(module, name):
        raise UnknownName(f"name in {file}", name, [one for one in vars(module) if not one.startswith("_")])
    return Control(getattr(module, name), tick)


def under(case: Case, control: Control) -> Case:
    """Return a scene's case with a controller in place of the controls that a keyframe holds."""
    if case.parameters.get("ctrl"):
        raise InvalidValue(f"{case.label} has a table of controls (ctrl) and a controller; valid: one of them.")
    inputs = case.inputs
    if inputs is not None and case.scene is not None:
        values = inputs.values.copy()
        values[:, : len(case.scene.actuators)] = 0.0
        inputs = replace(inputs, values=values)
    told = {"control": case.parameters.get("control") or control.label, "tick": control.tick}
    return replace(case, control=control, inputs=inputs, parameters={**case.parameters, **told})


def pushed(scene: Scene, inputs: Inputs | None, text: str) -> tuple[Scene, Inputs | None]:
    """Return a scene with pushes, and what acts on it with them.

    The text has BODY FX FY FZ T0 T1, in N and s, of every push, parted by semicolons.
    """
    if not (given := [_push(part, scene) for part in text.split(";") if part.strip()]):
        return scene, inputs
    scene = scene.replace(pushes=[Push(name=f"push {i}", body=body) for i, (body, _, _) in enumerate(given)])
    own = [] if inputs is None else inputs.times.tolist()
    times = distinct([*own, *(t for _, _, span in given for t in span if np.isfinite(t))])
    values = np.zeros((len(times), len(scene.inputs)))
    if inputs is not None:
        values[:, : len(inputs.names)] = inputs.at(times)
    pushes = values[:, len(scene.actuators) :].reshape(len(times), -1, 3)
    for i, (_, force, (start, end)) in enumerate(given):
        pushes[(times >= start) & (times < end), i] = force
    return scene, Inputs(names=scene.inputs, times=times, values=values)


def movable(scene: Scene) -> list[str]:
    """Return the bodies that joints move, their own or those of what they hang on."""
    jointed, found = {joint.body for joint in scene.joints}, dict[str, None]()
    for body in scene.bodies:  # behind those on which they hang
        if body.name in jointed or body.parent in found:
            found[body.name] = None
    return list(found)


def _push(text: str, scene: Scene) -> tuple[str, Floats, tuple[float, float]]:
    """Return body, force and times of a push."""
    body, *numbers = text.rsplit(maxsplit=5)
    try:
        *force, start, end = (float(number) for number in numbers)
    except ValueError:
        force, start, end = [], 0.0, 0.0
    if len(force) != 3 or not (np.isfinite(force).all() and 0.0 <= start < end):
        valid = "BODY FX FY FZ T0 T1 with finite forces and 0 <= T0 < T1"
        raise InvalidValue(f"push: {shown(text.strip())} is not a push; valid: {valid}.")
    names, can = [one.name for one in scene.bodies], movable(scene)
    if body.strip() not in can:
        why = f"{shown(body.strip())} is fixed: no joint moves it"
        why = why if body.strip() in names else f"there is no body {shown(body.strip())}"
        raise InvalidValue(f"push: {why}; valid: {', '.join(can) or 'none'}.")
    return body.strip(), np.array(force), (start, end)
