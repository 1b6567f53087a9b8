"""What a user takes out of a file's model, in every engine alike."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from crossbody.cases.errors import InvalidValue

ALL = ("friction", "rolling", "contacts", "medium", "meshes", "overlaps", "limits", "actuators", "loops", "tendons")
SLIDING = 3
"""Of MuJoCo's dimensions of a contact: friction along its surface; 4 has it about the normal too, 6 against rolling."""


def without_meshes(without: str) -> bool:
    """Return whether no mesh touches anything."""
    return not {"meshes", "contacts"}.isdisjoint(_words(without))


def apart(spec: Any, without: str) -> Any:
    """Return the compiled model in which pairs of bodies that are left out do not touch each other.

    Args:
        spec: MuJoCo's; it is changed.
        without: of `strip`; here count pair:BODY:BODY and overlaps: bodies that do so in the reference pose.
    """
    words = _words(without)
    bodies = {body.name for body in spec.bodies}
    for word in words:
        kind, *names = word.split(":")
        if kind == "pair":
            if len(names) != 2 or not bodies.issuperset(names):
                known = ", ".join(sorted(filter(None, bodies)))
                raise InvalidValue(
                    f"without: {word!r} is not a pair of bodies (pair:BODY:BODY); the file has: {known}."
                )
            spec.add_exclude(bodyname1=names[0], bodyname2=names[1])
    model = spec.compile()
    return _without_overlaps(spec, model) if "overlaps" in words else model


def _without_overlaps(spec: Any, model: Any) -> Any:
    """Return the model where bodies never touch whose shapes overlap in the reference pose, planes aside."""
    import mujoco

    data, plane = mujoco.MjData(model), int(mujoco.mjtGeom.mjGEOM_PLANE)
    mujoco.mj_forward(model, data)
    met = [contact.geom for contact in data.contact if contact.dist < 0.0]
    pairs = {tuple(model.geom_bodyid[pair].tolist()) for pair in met if plane not in model.geom_type[pair]}
    for body in spec.bodies:
        body.name = body.name or f"body{body.id}"
    named = {body.id: body.name for body in spec.bodies}
    for one, two in sorted(pairs):
        spec.add_exclude(bodyname1=named[one], bodyname2=named[two])
    return spec.compile()


def strip(model: Any, without: str) -> None:
    """Take features out of a compiled model.

    Args:
        model: MuJoCo's; it is changed.
        without: words separated by commas: one of `ALL`, kind:NAME of an actuator, loop or
            tendon, or what `apart` has done before.
    """
    for word in _words(without):
        kind, _, name = word.partition(":")
        if not name and kind in ALL:
            if kind in _WHOLE:  # the rest was left out before the model was compiled
                _WHOLE[kind](model)
        elif name and kind in _ONE:
            _ONE[kind](model, _index(model, kind, name))
        elif kind != "pair":
            named = ", ".join(f"{one}:NAME" for one in _ONE)
            raise InvalidValue(
                f"without: {word!r} cannot be left out; valid: {', '.join(ALL)}, {named}, pair:BODY:BODY."
            )


def _words(without: str) -> list[str]:
    return [word for part in without.split(",") if (word := part.strip())]


def _index(model: Any, kind: str, name: str) -> int:
    parts = {
        "actuator": (model.actuator, model.nu),
        "loop": (model.eq, model.neq),
        "tendon": (model.tendon, model.ntendon),
    }
    named, count = parts[kind]
    names = [named(i).name or f"{kind}{i}" for i in range(count)]
    if name not in names:
        raise InvalidValue(f"without: the file has no {kind} {name!r}; it has: {', '.join(names) or 'none'}.")
    return names.index(name)


def _friction(model: Any) -> None:
    model.dof_frictionloss[:] = 0.0
    model.tendon_frictionloss[:] = 0.0
    model.geom_condim[:] = 1
    model.pair_dim[:] = 1


def _rolling(model: Any) -> None:
    """Leave contacts no more than sliding friction: none about their normals, and none against rolling."""
    model.geom_condim[:] = np.minimum(model.geom_condim, SLIDING)
    model.pair_dim[:] = np.minimum(model.pair_dim, SLIDING)


def _contacts(model: Any) -> None:
    import mujoco

    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)


def _medium(model: Any) -> None:
    model.opt.density = model.opt.viscosity = 0.0
    model.opt.wind[:] = 0.0


def _limits(model: Any) -> None:
    model.jnt_limited[:] = 0
    model.tendon_limited[:] = 0


def _actuator(model: Any, i: int) -> None:
    model.actuator_gainprm[i] = 0.0
    model.actuator_biasprm[i] = 0.0


def _loop(model: Any, i: int) -> None:
    model.eq_active0[i] = 0


def _tendon(model: Any, i: int) -> None:
    model.tendon_stiffness[i] = model.tendon_damping[i] = model.tendon_frictionloss[i] = 0.0
    model.tendon_armature[i] = 0.0
    model.tendon_stiffnesspoly[i] = model.tendon_dampingpoly[i] = 0.0
    model.tendon_limited[i] = 0


def _every(one: Callable[[Any, int], None], count: str) -> Callable[[Any], None]:
    def strip_all(model: Any) -> None:
        for i in range(getattr(model, count)):
            one(model, i)

    return strip_all


_ONE: dict[str, Callable[[Any, int], None]] = {"actuator": _actuator, "loop": _loop, "tendon": _tendon}
_WHOLE: dict[str, Callable[[Any], None]] = {
    "friction": _friction,
    "rolling": _rolling,
    "contacts": _contacts,
    "medium": _medium,
    "limits": _limits,
    "actuators": _every(_actuator, "nu"),
    "loops": _every(_loop, "neq"),
    "tendons": _every(_tendon, "ntendon"),
}
