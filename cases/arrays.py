"""Read-only, shape-checked float arrays for the frozen types."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from crossbody.cases.errors import SceneError

Floats = NDArray[np.float64]
Bytes = NDArray[np.int8]


def frozen(owner: str, field: str, value: Any, shape: tuple[int | None, ...], dtype: DTypeLike = np.float64) -> Any:
    """Copy `value` into a read-only array of the given shape (None admits any length)."""
    array = numbers(owner, field, value, dtype)
    if array.ndim != len(shape) or any(w is not None and g != w for g, w in zip(array.shape, shape, strict=True)):
        wanted = str(tuple("any" if w is None else w for w in shape)).replace("'", "")
        raise SceneError(f"{owner}.{field} has shape {array.shape}; it must have shape {wanted}.")
    array.setflags(write=False)
    return array


def numbers(owner: str, field: str, value: Any, dtype: DTypeLike = np.float64) -> Any:
    """Copy `value` into an array of whatever shape it has."""
    if type(value) is np.ndarray and value.dtype == dtype:
        return np.array(value, order="C")
    try:
        if np.iscomplexobj(value) or np.asarray(value).dtype.kind in "US":
            raise TypeError("complex numbers and text are not allowed")
        with np.errstate(all="raise"):  # a number that is no integer is not cut to one in silence
            return np.array(value, dtype=dtype, order="C")
    except (TypeError, ValueError, OverflowError, FloatingPointError) as error:
        raise SceneError(f"{owner}.{field} is not an array of {np.dtype(dtype).name}: {error}.") from None


def distinct(*values: Any) -> NDArray[Any]:
    """Return the values of arrays of any shape, each once and in order (n,).

    As `np.unique` does, which imports masked arrays to see whether it was given one: that takes longer than a run.
    """
    return np.unique(np.concatenate([np.ravel(one) for one in values]), return_index=True)[0]


def quantiles(values: Any, *parts: float) -> Floats:
    """Return what parts (m,), 0 to 1, of values (n,) lie below, linear between them: as `np.quantile`, and as above."""
    ordered = np.sort(values, axis=None)
    found: Floats = np.interp(np.multiply(parts, len(ordered) - 1), np.arange(len(ordered)), ordered)
    return found


def is_number(value: Any) -> bool:
    """Return whether a value stands alone, not in an array; what it is, is not looked at."""
    return np.isscalar(value) or getattr(value, "shape", None) == ()


def full(owner: str, field: str, value: Any, count: int, dtype: DTypeLike = np.float64) -> Any:
    """As `frozen` for an array (count,), which a number alone fills."""
    whole = [value] * count if is_number(value) else value
    return frozen(owner, field, whole, (count,), dtype)
