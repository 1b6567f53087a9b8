"""Bundles of arrays that compiled functions hand on by one pointer.

A named tuple of arrays is handed on word by word: forty arrays are three hundred arguments and forty reference counts a
call. A bundle is one pointer to a table of addresses and shapes; reading a field makes a view of it. The arrays belong
to the Python object, which must outlive the call, as it does.
"""

from __future__ import annotations

import hashlib
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, intrinsic, lower_getattr_generic, models, register_model
from numba.np.arrayobj import populate_array

TABLE = types.int64[:, ::1]  # one line a field: address, rows, columns


class BundleType(types.Type):
    """Type of a bundle in compiled code: its fields' names and array types."""

    def __init__(self, name: str, fields: tuple[tuple[str, Any], ...]) -> None:
        self.fields = fields
        self.index = {field: i for i, (field, _) in enumerate(fields)}
        # Machine code is kept on disk by the names of its types: without its layout in the name, code for an older one
        # would be read back.
        layout = hashlib.sha256(repr([(field, str(kind)) for field, kind in fields]).encode()).hexdigest()[:16]
        super().__init__(name=f"Bundle.{name}.{layout}")


@register_model(BundleType)
class _BundleModel(models.OpaqueModel):  # type: ignore[misc]
    """A pointer."""


@infer_getattr
class _BundleFields(AttributeTemplate):  # type: ignore[misc]
    key = BundleType

    def generic_resolve(self, bundle: BundleType, name: str) -> Any:
        """The array type of a field."""
        return bundle.fields[bundle.index[name]][1] if name in bundle.index else None


@lower_getattr_generic(BundleType)
def _read_field(context: Any, builder: Any, bundle: BundleType, value: Any, name: str) -> Any:
    """Make the view from the table's line."""
    row = bundle.index[name]
    kind = bundle.fields[row][1]
    word = ir.IntType(64)
    table = builder.bitcast(value, word.as_pointer())
    address, *shape = (builder.load(builder.gep(table, [ir.Constant(word, 3 * row + i)])) for i in range(1 + kind.ndim))
    itemsize = ir.Constant(word, context.get_abi_sizeof(context.get_data_type(kind.dtype)))
    strides = [itemsize] if kind.ndim == 1 else [builder.mul(itemsize, shape[1]), itemsize]
    view = context.make_array(kind)(context, builder)
    data = builder.inttoptr(address, context.get_data_type(kind.dtype).as_pointer())
    populate_array(view, data=data, shape=shape, strides=strides, itemsize=itemsize, meminfo=None)
    return view._getvalue()


def opener(kind: BundleType) -> Any:
    """A compiled function that turns a table into the bundle."""

    @intrinsic
    def bundle(typingctx: Any, table: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            array = cgutils.create_struct_proxy(TABLE)(context, builder, args[0])
            return builder.bitcast(array.data, cgutils.voidptr_t)

        return kind(TABLE), generate

    return bundle


def table(arrays: list[np.ndarray[Any, Any]]) -> np.ndarray[Any, Any]:
    """Addresses and shapes of C-contiguous arrays, in the order of the fields."""
    lines = np.zeros((len(arrays), 3), dtype=np.int64)
    for line, array in zip(lines, arrays, strict=True):
        line[0] = array.ctypes.data
        line[1 : 1 + array.ndim] = array.shape
    return lines


def bundle_type(cls: type) -> BundleType:
    """The compiled type of a class whose annotations are numba array types' names of this module."""
    kinds = {"Floats": numba.float64, "Index": numba.int64, "Bytes": numba.int8}
    fields = []
    for name, annotation in cls.__annotations__.items():
        scalar = kinds[annotation.removesuffix("2")]
        fields.append((name, scalar[:, ::1] if annotation.endswith("2") else scalar[::1]))
    return BundleType(cls.__name__, tuple(fields))
