"""What a run that has finished says of its motion: where the law leaves it open, and what touches gave out."""

from __future__ import annotations

from collections.abc import Mapping

NOTES = {
    "indeterminate": (
        "indeterminate: how contacts that slid shared their load, which the law does not "
        "determine, moved the bodies; the least norm was used."
    ),
    "not_unique": "modes_not_unique: more than one set of sticking and sliding contacts was consistent at an instant; "
    "the one that was reached first was used.",
    "unmet": "sticks_contradict: contacts that stuck at an instant excluded each other, and no set of modes was found "
    "that all of them meet; they were met in the least squares.",
    "touches_that_gained": "touches_that_gained: touches with friction ({touches_that_gained}) gave out more energy "
    "than they took in, {energy_gained:.3g} J in all. The law prescribes how a gap moves whatever friction does to the "
    "load (Kane's paradox); a larger a1 or a smaller mu dissipates more.",
    "starts_inside": "starts_inside: contacts with friction ({starts_inside}) began below their surface and gave out "
    "{energy_handed:.3g} J on their way out of it, which is in no energy at the start.",
}
_LOOPS_PRESS = (
    "indeterminate: loops hold a contact that may slide, so that its normal force and friction are "
    "undetermined; it was computed without friction."
)
_SHARES_MOVE = " Other shares would move a contact by up to {open_way:.2g} m until the end, to first order."
AMOUNTS = ("energy_gained", "energy_handed", "open_way")  # J, J and m, that notes name


def noted(state: Mapping[str, float], loops_press: bool = False) -> str:
    """Return the notes of what was counted.

    Args:
        state: counts by the names of `NOTES`, and `AMOUNTS`.
        loops_press: whether loops hold a contact that may slide.
    """
    moved = NOTES["indeterminate"] + (_SHARES_MOVE if state.get("open_way") else "")
    texts = NOTES | {"indeterminate": _LOOPS_PRESS if loops_press else moved}
    return " ".join(text.format(**state) for name, text in texts.items() if state.get(name))
