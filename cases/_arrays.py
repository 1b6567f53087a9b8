"""Read-only, shape-checked float arrays for the frozen types."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from crossbody.cases._errors import SceneError

Floats = NDArray[np.float64]
Bytes = NDArray[np.int8]


def frozen(owner: str, field: str, value: Any, shape: tuple[int | None, ...], dtype: DTypeLike = np.float64) -> Any:
    """Copy `value` into a read-only array of the given shape (None admits any length).

    Raises:
        SceneError: naming the owner, the field, the shape found and the shape wanted.
    """
    try:
        if np.iscomplexobj(value):
            raise TypeError("complex numbers are not admitted")
        with np.errstate(all="raise"):  # a number that is no integer is not cut to one in silence
            array = np.array(value, dtype=dtype, order="C")
    except (TypeError, ValueError, OverflowError, FloatingPointError) as error:
        raise SceneError(f"{owner}.{field} is not an array of {np.dtype(dtype).name}: {error}.") from None
    if array.ndim != len(shape) or any(w is not None and g != w for g, w in zip(array.shape, shape, strict=True)):
        wanted = str(tuple("any" if w is None else w for w in shape)).replace("'", "")
        raise SceneError(f"{owner}.{field} has shape {array.shape}; it must have shape {wanted}.")
    array.setflags(write=False)
    return array
