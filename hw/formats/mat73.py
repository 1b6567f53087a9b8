"""MATLAB files of version 7.3, by h5py; objects are refused, never built."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from crossbody.hw.formats._tables import NoOptions as Options
from crossbody.hw.formats.hdf5 import SIGNATURE, HdfReader, text_of
from crossbody.hw.formats.mat import HINT, NUMBERS

SUFFIXES = (".mat",)


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file begins as MAT v7.3 does: MATLAB's text, then HDF5."""
    return head.startswith(b"MATLAB 7.3 MAT-file") and head[512:520] == SIGNATURE


def open_log(path: Path, options: Options) -> MatReader:
    """Open a MAT v7.3 file; columns are named as in MATLAB, `s.angle[0]`."""
    return MatReader(path, "MAT v7.3 file", ".")


class MatReader(HdfReader):
    """HDF5 that tells the MATLAB class of every dataset."""

    def why_not(self, item: Any) -> str:
        """Why a variable is no column of numbers; empty if it may be one."""
        kind = text_of(item, "MATLAB_class") or "double"
        if kind not in NUMBERS or "MATLAB_object_decode" in item.attrs:
            return f"is a MATLAB {kind}: {HINT}"
        return "holds nothing" if "MATLAB_empty" in item.attrs else super().why_not(item)
