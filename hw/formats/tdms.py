"""NI TDMS files, by npTDMS."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import LogFormatError
from crossbody.hw.budget import current
from crossbody.hw.formats._bounded import MeteredFile
from crossbody.hw.formats._contract import Block, Column, Group
from crossbody.hw.formats._tables import NoOptions as Options
from crossbody.hw.formats._tables import sliced
from crossbody.hw.guard import closing, library, parsing

SUFFIXES = (".tdms",)
WHAT = "TDMS file"


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file begins as TDMS does."""
    return head.startswith(b"TDSm")


def open_log(path: Path, options: Options) -> TdmsReader:
    """Open a TDMS file; columns are named `group/channel`."""
    return TdmsReader(path)


class TdmsReader:
    """Scaled numeric channels, in blocks of rows."""

    def __init__(self, path: Path) -> None:
        from nptdms import TdmsFile

        self._path = path
        self._budget = current(path)
        self.library = library("npTDMS")
        self.refused: dict[str, str] = {}
        self._channels: dict[str, Any] = {}
        self._raw = MeteredFile(path, self._budget)  # a file of our own is closed whatever happens in there
        with closing(self._raw), parsing(path, WHAT):
            self._file = TdmsFile.open(self._raw)
            self._raw.metered = False
            if self._file.file_status.incomplete_final_segment:
                raise LogFormatError(path, "was cut off: its last segment is incomplete.")
            self.groups = tuple(self._groups())

    def _groups(self) -> Iterator[Group]:
        """Channels of one TDMS group and one length; LabVIEW does not promise that they are equally long."""
        for source in self._file.groups():
            found: dict[tuple[int, float, float], list[Column]] = {}
            for channel in source.channels():
                column = self._column(f"{source.name}/{channel.name}", channel)
                if column is not None:
                    clock = [float(channel.properties.get(k, 0.0)) for k in ("wf_increment", "wf_start_offset")]
                    found.setdefault((len(channel), clock[0], clock[1]), []).append(column)
            for (rows, step, start), columns in found.items():
                name = source.name if len(found) == 1 else f"{source.name} ({rows} rows, step {step:g} s)"
                yield Group(name=name, rows=rows, columns=tuple(columns), step=step, start=start)

    def _column(self, name: str, channel: Any) -> Column | None:
        dtype = np.dtype(channel.dtype) if channel.dtype is not None else np.dtype(object)
        if dtype.kind not in "fiubM" or not len(channel):
            self.refused[name] = f"holds {dtype}, not numbers" if len(channel) else "holds nothing"
            return None
        self._channels[name] = channel
        unit = str(channel.properties.get("unit_string", ""))
        return Column(
            name=name, type="int64" if dtype.kind == "M" else dtype.name, unit="ns" if dtype.kind == "M" else unit
        )

    def blocks(self, group: Group, columns: Sequence[str]) -> Iterator[Block]:
        """See `Reader`."""
        return sliced(self._path, WHAT, group, columns, self._get)

    def _get(self, name: str, start: int, stop: int) -> NDArray[Any]:
        self._budget.spend(0)  # every chunk goes through all channels before this one
        found = np.asarray(self._channels[name].read_data(start, stop - start))
        return found.astype("datetime64[ns]").astype(np.int64) if found.dtype.kind == "M" else found

    def close(self) -> None:
        """See `Reader`."""
        self._file.close()
        self._raw.close()
