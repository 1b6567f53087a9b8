"""Parameters of other kinds than one number or one word: lists of numbers, a number or a word for it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from crossbody.cases.arguments import shown
from crossbody.cases.arrays import Floats
from crossbody.cases.case import Parameter, Value
from crossbody.cases.errors import InvalidValue


@dataclass(frozen=True, slots=True, kw_only=True)
class Numbers(Parameter):
    """Numbers in one text, separated by commas ("4,2,1"); the bounds hold for each of them."""

    def checked(self, where: str, value: Value | Iterable[float]) -> Value:
        """The text of the numbers, each in its shortest form.

        Args:
            where: what is checked, for messages.
            value: such a text, one number, or numbers in a sequence.
        """
        if isinstance(value, (int, float)):
            value = str(value)
        try:
            parts = value.split(",") if isinstance(value, str) else [str(part) for part in value]
        except TypeError:
            raise InvalidValue(f"{where} is {shown(value)}; it must be numbers, with commas between them.") from None
        if not parts:
            raise InvalidValue(f"{where} is empty; it must be one number or several separated by commas.")
        each = Parameter(default=0.0, unit=self.unit, low=self.low, high=self.high, open_low=self.open_low)
        places = [f"{where}[{i}]" for i in range(len(parts))] if len(parts) > 1 else [where]
        numbers = [float(each.checked(*pair)) for pair in zip(places, parts, strict=True)]
        return ",".join(repr(number).removesuffix(".0") for number in numbers)


@dataclass(frozen=True, slots=True, kw_only=True)
class NumberOrWord(Parameter):
    """A number inside the bounds, or one of the words of `choices`."""

    def checked(self, where: str, value: Value) -> Value:
        """The number or the word."""
        if isinstance(value, str) and value in self.choices:
            return value
        number = Parameter(default=0.0, unit=self.unit, low=self.low, high=self.high, open_low=self.open_low)
        try:
            return number.checked(where, value)
        except InvalidValue as error:
            raise InvalidValue(f"{str(error).removesuffix('.')}, or: {', '.join(self.choices)}.") from None


def spread(where: str, text: Value, count: int) -> Floats:
    """The numbers of a `Numbers` parameter (count,); one number serves all."""
    found = np.array([float(part) for part in str(text).split(",")])
    if len(found) not in (1, count):
        raise InvalidValue(f"{where} lists {len(found)} numbers; valid: one for all, or {count} separated by commas.")
    return np.repeat(found, count) if len(found) == 1 else found


def of_numbers(parameters: Mapping[str, Value]) -> dict[str, float]:
    """Return the parameters that are numbers, by name."""
    return {name: float(value) for name, value in parameters.items() if not isinstance(value, str)}
