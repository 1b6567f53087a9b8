"""Which shapes of a compiled MuJoCo model may touch, and how: its filters, its own pairs and its rules of mixing.

Rules: MuJoCo's documentation, "Computation: Collision detection" and "Contact".
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import combinations
from typing import Any

import numpy as np

from crossbody.cases.errors import SceneError
from crossbody.cases.scene import Pair, RowLaw

SMALLEST = 1e-15  # weights below it count as none


def pairs_of(model: Any, name: Callable[[int], str], law: Callable[[Any, Any, Any], RowLaw]) -> tuple[Pair, ...]:
    """Return the pairs of a compiled model; `law` makes that of a row from the model, solref and solimp."""
    _check_fields(model, name)
    given = [_explicit(model, i, name, law) for i in range(model.npair)]
    listed = {frozenset(pair) for pair in _listed(model)}
    return (*given, *(_mixed(model, a, b, name, law) for a, b in _met(model) if frozenset((a, b)) not in listed))


def _check_fields(model: Any, name: Callable[[int], str]) -> None:
    import mujoco

    unknown = {
        int(kind): word
        for word, kind in (
            ("height field", mujoco.mjtGeom.mjGEOM_HFIELD),
            ("signed-distance function", mujoco.mjtGeom.mjGEOM_SDF),
        )
    }
    for pair in allowed(model):
        for one, other in (pair, pair[::-1]):
            if (word := unknown.get(int(model.geom_type[one]))) is not None:
                raise SceneError(
                    f"Shape {name(one)!r} is a {word}, whose contacts are not supported, and "
                    f"{name(other)!r} may touch it; valid: contype and conaffinity 0 for one of "
                    "them, or without=contacts, which leaves all contacts out of every engine."
                )


def allowed(model: Any) -> Iterator[tuple[int, int]]:
    """Yield the numbers of shapes that may touch, by the file's pairs or filters; some twice."""
    yield from _listed(model)
    yield from _met(model)


def _listed(model: Any) -> Iterator[tuple[int, int]]:
    yield from zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(), strict=True)


def constants_of(model: Any, name: Callable[[int], str]) -> dict[frozenset[str], tuple[Any, Any, Any]]:
    """Return solref, solimp and solreffriction of every pair of shapes that may touch, by their names."""
    listed = {
        frozenset((name(a), name(b))): (model.pair_solref[i], model.pair_solimp[i], model.pair_solreffriction[i])
        for i, (a, b) in enumerate(_listed(model))
    }
    return {frozenset((name(a), name(b))): (*_softness(model, a, b), 0.0) for a, b in _met(model)} | listed


def _met(model: Any) -> Iterator[tuple[int, int]]:
    """Yield the numbers of shapes that the filters let touch."""
    import mujoco

    weld = model.body_weldid
    above = weld[model.body_parentid[weld]]
    parents = not model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_FILTERPARENT)
    apart = {(int(s) >> 16, int(s) & 0xFFFF) for s in model.exclude_signature}
    types, wanted, body = model.geom_contype, model.geom_conaffinity, model.geom_bodyid
    for a, b in combinations(range(model.ngeom), 2):
        one, two = int(weld[body[a]]), int(weld[body[b]])
        if one == two or not (types[a] & wanted[b] or types[b] & wanted[a]):
            continue
        if parents and one and two and (one == above[two] or two == above[one]):
            continue
        first, second = sorted((int(body[a]), int(body[b])))
        if (first, second) not in apart and (second, first) not in apart:
            yield a, b


def _explicit(model: Any, i: int, name: Callable[[int], str], law: Callable[[Any, Any, Any], RowLaw]) -> Pair:
    a, b = int(model.pair_geom1[i]), int(model.pair_geom2[i])
    return Pair(
        name=f"{name(a)}:{name(b)}",
        first=name(a),
        second=name(b),
        margin=float(model.pair_margin[i]),
        friction=tuple(map(float, model.pair_friction[i])),
        dimension=int(model.pair_dim[i]),
        law=law(model, model.pair_solref[i], model.pair_solimp[i]),
    )


def _mixed(model: Any, a: int, b: int, name: Callable[[int], str], law: Callable[[Any, Any, Any], RowLaw]) -> Pair:
    """Return two shapes with what the one of higher priority says, or both: the larger friction, a mean of the rest."""
    if order := int(model.geom_priority[a]) - int(model.geom_priority[b]):
        ruling = a if order > 0 else b
        friction, dimension = model.geom_friction[ruling], int(model.geom_condim[ruling])
    else:
        friction = np.maximum(model.geom_friction[a], model.geom_friction[b])
        dimension = int(max(model.geom_condim[a], model.geom_condim[b]))
    slide, spin, roll = map(float, friction)
    return Pair(
        name=f"{name(a)}:{name(b)}",
        first=name(a),
        second=name(b),
        margin=float(model.geom_margin[a] + model.geom_margin[b]),
        friction=(slide, slide, spin, roll, roll),
        dimension=dimension,
        law=law(model, *_softness(model, a, b)),
    )


def _softness(model: Any, a: int, b: int) -> tuple[Any, Any]:
    """Return solref and solimp of two shapes: of the one of higher priority, else a mean (the lesser, if direct)."""
    if order := int(model.geom_priority[a]) - int(model.geom_priority[b]):
        ruling = a if order > 0 else b
        return model.geom_solref[ruling], model.geom_solimp[ruling]
    share, one, two = _share(model, a, b), model.geom_solref[a], model.geom_solref[b]
    direct = one[0] <= 0.0 or two[0] <= 0.0
    solref = np.minimum(one, two) if direct else share * one + (1.0 - share) * two
    return solref, share * model.geom_solimp[a] + (1.0 - share) * model.geom_solimp[b]


def _share(model: Any, a: int, b: int) -> float:
    """Return the weight of the first shape's constants."""
    one, two = float(model.geom_solmix[a]), float(model.geom_solmix[b])
    if one >= SMALLEST and two >= SMALLEST:
        return one / (one + two)
    return 0.5 if one < SMALLEST and two < SMALLEST else float(one >= SMALLEST)
