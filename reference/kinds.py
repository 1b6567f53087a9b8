"""Types of arrays in the kernels; real or complex, so that derivatives can be checked by complex step."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
Floats = NDArray[np.float64]
Index = NDArray[np.int64]
Bytes = NDArray[np.int8]
# In bundles of compiled code the number of dimensions is part of the name.
Floats2 = NDArray[np.float64]
Index2 = NDArray[np.int64]
Bytes2 = NDArray[np.int8]
