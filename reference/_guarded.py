"""Calls between guard cells: what a kernel reads or writes beyond its arrays is seen, and what it does not fill."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from crossbody.cases.errors import KernelError
from crossbody.reference.kinds import Floats

GUARD = 64  # cells before and behind an array, beside as many as it has itself
AROUND, INSIDE = (np.nan, 3.3), (1234567.25, -7654321.5)  # beyond the arrays and in what is to be filled, in two calls
DEBUG = "With CROSSBODY_DEBUG=1 in the environment kernels check every index."


@dataclass(frozen=True, slots=True)
class GuardedCall:
    """One kernel and its arguments.

    Attributes:
        name: of the kernel.
        kernel: compiled.
        order: names of its arguments.
        inputs: numbers, and arrays that it only reads.
        outputs: arrays that it fills, NaN where it must and other values where these may stay.
        hints: for arrays that may be too short, what makes them longer.
    """

    name: str
    kernel: Any
    order: tuple[str, ...]
    inputs: Mapping[str, Any]
    outputs: Mapping[str, Floats]
    hints: Mapping[str, str]

    def filled(self) -> dict[str, Floats]:
        """Call the kernel twice, with other values beyond its arrays and in what it must fill; return what it filled.

        Raises:
            KernelError: naming kernel, array and entry, if it writes what it may only read, reads
                or writes beyond an array, or leaves an entry unfilled.
        """
        first, second = (self._call(dict.fromkeys(self.order, AROUND[i]), INSIDE[i]) for i in range(2))
        for name, wanted in self.outputs.items():
            a, b = first[name], second[name]
            unfilled = np.isnan(wanted) & (a == INSIDE[0]) & (b == INSIDE[1])
            if np.any(unfilled):
                raise KernelError(f"Kernel {self.name} leaves {entry(name, unfilled)} unfilled; it fills every entry.")
            differs = ~((a == b) | (np.isnan(a) & np.isnan(b)))
            if np.any(differs):
                raise KernelError(self._origin(name, entry(name, differs)))
        return first

    def _call(self, around: Mapping[str, float], inside: float) -> dict[str, Floats]:
        lines, arguments = {}, []
        for name in self.order:
            value = self.outputs[name] if name in self.outputs else self.inputs[name]
            if isinstance(value, np.ndarray):
                lines[name] = _line(value, around[name])
                value = lines[name][1]
                if name in self.outputs:
                    value[np.isnan(value)] = inside
            arguments.append(value)
        try:
            self.kernel(*arguments)
        except IndexError as error:
            raise KernelError(f"Kernel {self.name} reads or writes beyond an array: {error}.") from None
        for name, (line, array) in lines.items():
            expected, _ = _line(array, around[name])
            if line.tobytes() != expected.tobytes():
                raise KernelError(f"Kernel {self.name} writes beyond {name}, whose shape is {array.shape}. {DEBUG}")
            if name in self.inputs and array.tobytes() != self.inputs[name].tobytes():
                raise KernelError(f"Kernel {self.name} writes {name}, which is read-only.")
        return {name: lines[name][1] for name in self.outputs}

    def _origin(self, name: str, where: str) -> str:
        """Say what an entry depends on that it must not: cells beyond an argument, or what stood in it before."""
        for argument in self.order:
            if isinstance(self.inputs.get(argument, self.outputs.get(argument)), np.ndarray):
                a, b = (self._call(dict.fromkeys(self.order, 0.0) | {argument: x}, 0.0)[name] for x in (1.25, 3.5))
                if a.tobytes() != b.tobytes():
                    array = self.inputs.get(argument, self.outputs.get(argument))
                    hint = self.hints.get(argument, "")
                    return f"Kernel {self.name} reads beyond {argument}, whose shape is {array.shape}. {hint}{DEBUG}"
        return f"Kernel {self.name} makes {where} from the previous content of its arrays, which are not zeroed."


def _line(value: Any, around: float) -> tuple[Any, Any]:
    """Return a line of memory and, in its middle, a copy of an array."""
    guard = GUARD + value.size
    line = np.full(value.size + 2 * guard, around if value.dtype == np.float64 else 0, value.dtype)
    array = line[guard : guard + value.size].reshape(value.shape)
    array[...] = value
    return line, array


def entry(name: str, where: Any) -> str:
    """Name the first entry of an array for which something holds, as in `H[0, 2]`."""
    index = np.argwhere(where)
    return f"{name}[{', '.join(map(str, index[0]))}]" if len(index) else name
