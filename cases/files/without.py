"""What a user takes out of a file's model, in every engine alike."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from crossbody.cases.errors import InvalidValue

ALL = ("friction", "contacts", "meshes", "limits", "actuators", "loops", "tendons")


def leaves_out(without: str, *words: str) -> bool:
    """Return whether one of the words that leave features out is among these."""
    return not {part.strip() for part in without.split(",")}.isdisjoint(words)


def strip(model: Any, without: str) -> None:
    """Take features out of a compiled model.

    Args:
        model: MuJoCo's; it is changed.
        without: words separated by commas: one of `ALL`, or kind:NAME of an actuator, loop or tendon.

    Raises:
        InvalidValue: for a word that names nothing.
    """
    for word in filter(None, (part.strip() for part in without.split(","))):
        kind, _, name = word.partition(":")
        if not name and kind in ALL:
            _WHOLE[kind](model)
        elif name and kind in _ONE:
            _ONE[kind](model, _index(model, kind, name))
        else:
            named = ", ".join(f"{one}:NAME" for one in _ONE)
            raise InvalidValue(f"without: {word!r} is nothing that can be left out; valid: {', '.join(ALL)}, {named}.")


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


def _contacts(model: Any) -> None:
    import mujoco

    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)


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
    "contacts": _contacts,
    "meshes": lambda model: None,  # the readers do it
    "limits": _limits,
    "actuators": _every(_actuator, "nu"),
    "loops": _every(_loop, "neq"),
    "tendons": _every(_tendon, "ntendon"),
}
