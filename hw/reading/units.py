"""Units, by pint: needed once, while a log is read; afterwards everything is SI."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from crossbody.cases import InvalidValue
from crossbody.cases.arrays import Floats
from crossbody.hw.formats import unavailable

# What a file calls a unit reaches pint only if it is one by this grammar, which is bounded in every direction: pint
# computes powers as they stand, and `m^9^9^9` would never end. No text is two tokens, so that nothing backtracks.
TOKEN = re.compile(r"(?P<operand>[A-Za-z_µμΩ°%]++|1(?![\w.]))|(?P<power>(?:\*\*|\^)\s*+-?[1-9](?![\w.])|[²³])"
                   r"|(?P<sign>[*/·])|(?P<open>\()|(?P<close>\))|(?P<space>\s++)")  # fmt: skip
LONGEST = 40  # characters
DEEPEST = 2  # brackets inside one another
PREFERRED = ("N", "N m", "N s", "N/m", "N s/m", "Pa", "W", "V", "ohm", "kg", "A", "m", "s", "K")
SPELLED = {
    "°": "degree", "%": "percent", "": "dimensionless", "1": "dimensionless", "Ns": "newton * second",
    "Nms": "newton * meter * second", "As": "ampere * second", "Vs": "volt * second", "Ws": "watt * second",
}  # fmt: skip
"""What pint reads as something else: an s behind a symbol is its plural there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Conversion:
    """SI value = factor * value + shift.

    Attributes:
        si: name of the SI unit; "1" for a pure number.
        factor: SI units in one unit.
        shift: SI value of zero (temperatures).
    """

    si: str
    factor: float
    shift: float = 0.0

    def apply(self, values: Floats) -> Floats:
        """Convert; where the unit is a whole fraction of the SI unit, by a division, which rounds once."""
        if self.factor != 1.0:
            inverse = round(1.0 / self.factor) if abs(self.factor) < 1.0 else 0
            values = values / inverse if inverse and 1.0 / inverse == self.factor else values * self.factor
        return values + self.shift if self.shift else values


def to_si(unit: str) -> Conversion:
    """The conversion of a unit to SI, as people write it: "deg", "rpm", "N m", "m/s^2", "mm", "degC", "1"."""
    try:
        return _convert(unit.strip())
    except ModuleNotFoundError as error:
        raise unavailable("Reading units", error) from None
    except Exception as error:  # pint raises its own, tokenizer's and arithmetic errors
        known = "rad, deg, rpm, m, mm, N, N m, s, ms, V, A, 1 for a pure number"
        raise InvalidValue(f"{unit!r} is not a unit; write for example {known}.") from error


def is_time(unit: str) -> bool:
    """Whether a unit measures time."""
    return to_si(unit).si == "s"


@lru_cache(maxsize=1)
def _registry() -> Any:
    import pint

    found = pint.UnitRegistry(cache_folder=None, on_redefinition="ignore")
    found.define("newton_meter = newton * meter = Nm")  # pint's own Nm is a number of yarns, and mNm a thousandth of it
    return found


def _check_grammar(text: str) -> None:
    """Refuse what is no product of names and their powers, before a parser sees it."""
    at, depth, before = 0, 0, "sign"
    while at < len(text):
        token = TOKEN.match(text, at) if len(text) <= LONGEST else None
        kind = token.lastgroup if token else None
        depth += (kind == "open") - (kind == "close")
        after_operand = before in ("operand", "power", "close")
        if token is None or not 0 <= depth <= DEEPEST:
            raise ValueError(text)
        if (kind in ("sign", "close") and not after_operand) or (
            kind == "power" and before in ("sign", "open", "power")
        ):
            raise ValueError(text)
        at, before = token.end(), before if kind == "space" else str(kind)
    if depth or before in ("sign", "open"):
        raise ValueError(text)


@lru_cache(maxsize=256)
def _convert(unit: str) -> Conversion:
    if unit:
        _check_grammar(unit)
    registry = _registry()
    text = re.sub(r"(?<=[A-Za-z)])\s+(?=[A-Za-z(])", " * ", SPELLED.get(unit, unit)).replace("·", "*")
    parsed = registry.Unit(text)
    zero, one, two = (registry.Quantity(x, parsed).to_base_units() for x in (0.0, 1.0, 2.0))
    step = one.magnitude - zero.magnitude
    if not (0.0 < step < math.inf and math.isclose(two.magnitude - one.magnitude, step, rel_tol=1e-9)):
        raise ValueError(unit)  # a logarithmic one is no factor and shift
    if zero.magnitude:
        return Conversion(si=_name(one.units), factor=step, shift=zero.magnitude)
    return Conversion(si=_name(one.units), factor=one.magnitude)


@lru_cache(maxsize=256)
def _name(base: Any) -> str:
    """The SI name of a product of base units: N m where the parts are kg m2/s2, rad/s as it is."""
    if base.dimensionless and not base._units:
        return "1"
    for name in PREFERRED:
        if _registry().Unit(name.replace(" ", "*")).is_compatible_with(base) and not base._units.get("radian", 0):
            return name
    return f"{base:~C}".replace("**", "^").replace("*", " ")
