"""The elements of a MAT v5 file: one variable, unfolded within a budget before anything recurses into it."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path

from crossbody.cases import LogFormatError
from crossbody.hw.budget import MOST_COLUMNS, Budget

HEADER, TAG = 128, 8  # bytes of the file's own header, and of what stands before every element
MATRIX, COMPRESSED = 14, 15  # types of elements
DEEPEST = 16  # matrices inside one another: structs of structs
MOST = 100_000  # elements of one struct
FIRST = 1 << 16  # bytes in which class, shape and name of a variable stand
LOGICAL = 0x200
NAMES = "cell struct object char sparse double single int8 uint8 int16 uint16 int32 uint32 int64 uint64 function opaque"
CLASSES = dict(enumerate(NAMES.split(), start=1))
PIECE = 1 << 20  # bytes that are unfolded at a time


def starts(path: Path) -> list[int]:
    """Where each variable of a file begins, in the order of the file; reads tags only, each once."""
    found, at, end = list[int](), HEADER, path.stat().st_size
    with path.open("rb") as file:
        order = _order(file.read(HEADER))
        while at + TAG <= end:
            if len(found) == MOST_COLUMNS:
                text = f"holds more than {MOST_COLUMNS} variables; such a log is not read."
                raise LogFormatError(path, text)
            found.append(at)
            file.seek(at)
            at += TAG + _tag(file.read(TAG), order)[1]
    return found


def described(path: Path, start: int) -> tuple[str, tuple[int, ...], str]:
    """Name, shape and class of a variable, from its first bytes: a compressed one is not unfolded for them."""
    with path.open("rb") as file:
        order = _order(file.read(HEADER))
        file.seek(start)
        kind, size = _tag(file.read(TAG), order)
        raw = file.read(min(size, FIRST))
    head = zlib.decompressobj().decompress(raw, FIRST)[TAG:] if kind == COMPRESSED else raw
    try:
        flags, at = _element(head, 0, order)
        (word,) = struct.unpack(order + "I", flags[:4])
        found = "logical" if word & LOGICAL else CLASSES[word & 0xFF]
        if found == "opaque":
            return _element(head, at, order)[0].decode("latin-1"), (), found
        dims, at = _element(head, at, order)
        name, _ = _element(head, at, order)
        return name.decode("latin-1"), struct.unpack(f"{order}{len(dims) // 4}i", dims), found
    except (struct.error, KeyError):
        raise LogFormatError(path, f"has no MAT v5 variable at byte {start}.") from None


def _element(raw: bytes, at: int, order: str) -> tuple[bytes, int]:
    """The data of an element, and where the next one begins; a small one keeps its data in its own tag."""
    (word,) = struct.unpack(order + "I", raw[at : at + 4])
    if word >> 16:
        return raw[at + 4 : at + 4 + min(word >> 16, 4)], at + TAG
    _, size = _tag(raw[at : at + TAG], order)
    if at + TAG + size > len(raw):
        raise struct.error
    return raw[at + TAG : at + TAG + size], at + TAG + size + -size % 8


def whole_variable(path: Path, start: int, budget: Budget) -> io.BytesIO:
    """One variable, from where `starts` says, as a MAT file of its own that is not compressed."""
    with path.open("rb") as file:
        header = file.read(HEADER)
        order = _order(header)
        file.seek(start)
        kind, size = _tag(file.read(TAG), order)
        if kind == COMPRESSED:
            whole = _inflated(file, size, budget)
        else:
            budget.hold(3 * min(size, path.stat().st_size), "a struct and its arrays")
            whole = struct.pack(order + "II", kind, size) + file.read(size)
    budget.hold(3 * len(whole), "a struct and its arrays")
    _check_nesting(path, whole, order)
    budget.spend(len(whole))
    return io.BytesIO(header + whole)


def _order(header: bytes) -> str:
    """The byte order of a file, as `struct` has it."""
    return "<" if header[126:128] == b"IM" else ">"


def _tag(raw: bytes, order: str) -> tuple[int, int]:
    kind, size = struct.unpack(order + "II", raw)
    return kind, size


def _inflated(file: io.BufferedReader, size: int, budget: Budget) -> bytes:
    """The unfolded element, refused as soon as it is larger than what may be held."""
    unfold, pieces, length = zlib.decompressobj(), list[bytes](), 0
    while size > 0 and (raw := file.read(min(PIECE, size))):
        size -= len(raw)
        while raw or (pieces and len(pieces[-1]) == PIECE):  # a full piece may leave some inside
            pieces.append(unfold.decompress(raw, PIECE))
            raw, length = unfold.unconsumed_tail, length + len(pieces[-1])
            budget.hold(3 * length, "a struct and its arrays")  # joined, and as arrays
    return b"".join(pieces)


def _check_nesting(path: Path, whole: bytes, order: str) -> None:
    """Refuse structs that are nested deeper, or have more elements, than a log has any use for."""
    open_ends, at, count = [len(whole)], 0, 0
    while open_ends:
        while open_ends and at + 8 > open_ends[-1]:
            open_ends.pop()
        if not open_ends:
            return
        kind, size = _tag(whole[at : at + 8], order)
        count += 1
        if len(open_ends) > DEEPEST or count > MOST:
            text = f"has a struct of more than {DEEPEST} levels or {MOST} elements: save plain arrays instead."
            raise LogFormatError(path, text)
        if kind == MATRIX:
            open_ends.append(min(at + 8 + size, open_ends[-1]))
            at += 8
        else:  # a small element keeps its data in its own tag
            at += 8 if kind >> 16 else 8 + size + -size % 8
