"""HDF5, by h5py."""

from __future__ import annotations

from pathlib import Path

import msgspec

from crossbody.hw.formats._hdf import SIGNATURE, HdfReader

SUFFIXES = (".h5", ".hdf5", ".hdf")


class Options(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """Nothing to choose."""


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file begins as HDF5 does, with or without a user block that is not MATLAB's."""
    return not head.startswith(b"MATLAB") and any(head[n : n + 8] == SIGNATURE for n in (0, 512, 1024, 2048))


def open_log(path: Path, options: Options) -> HdfReader:
    """Open an HDF5 file; columns are named by their path, `rig/angle[0]`."""
    return HdfReader(path, "HDF5 file", "/")
