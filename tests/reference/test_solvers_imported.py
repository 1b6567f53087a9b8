"""SUNDIALS without what it takes of scipy for sparse matrices, and with it where somebody asks."""

from __future__ import annotations

import subprocess
import sys

SCRIPT = """
import sys
from crossbody.reference.sundials.solvers import CVODE, FOR_SPARSE, IDA, VERSION
assert not {"scipy.optimize", *FOR_SPARSE} & set(sys.modules), sorted(sys.modules)
import numpy as np
from sksundae import _cy_cvode
matrix = __import__("scipy.sparse", fromlist=["x"]).csc_matrix(np.eye(3))
assert _cy_cvode.sp.issparse(matrix) and not _cy_cvode.sp.issparse(np.eye(3))
assert (_cy_cvode.sp.csc_matrix(np.eye(3)) != matrix).nnz == 0
assert _cy_cvode.group_columns(matrix).max() == 0
import scipy.sparse, scipy.optimize
assert callable(scipy.optimize.brentq) and scipy.optimize._numdiff.__file__
"""


def test_what_is_for_sparse_matrices_is_imported_once_it_is_used() -> None:
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
