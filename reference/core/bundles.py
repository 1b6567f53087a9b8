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

TABLE = types.int64[:, ::1]  # one line a field: address, rows, columns
ADDRESSES = types.int64[::1]  # of functions


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
    dtype = context.get_data_type(kind.dtype)
    itemsize = ir.Constant(word, kind.dtype.bitwidth // 8)
    strides = [itemsize] if kind.ndim == 1 else [builder.mul(itemsize, shape[1]), itemsize]
    # No proxy in memory, as numba makes one: there are more than a thousand of these to compile.
    model = context.data_model_manager[kind]
    parts = {
        "data": builder.inttoptr(address, dtype.as_pointer()), "itemsize": itemsize,
        "nitems": shape[0] if kind.ndim == 1 else builder.mul(*shape, flags=["nsw"]),
        "shape": cgutils.pack_array(builder, shape), "strides": cgutils.pack_array(builder, strides),
    }  # fmt: skip
    view = ir.Constant(model.get_value_type(), None)  # which neither belongs to an object nor counts references
    for name, part in parts.items():
        view = builder.insert_value(view, part, model.get_field_position(name))
    return view


class FunctionsType(BundleType):
    """Type of a bundle of functions: its table has one address a field. By value they would be thirty arguments."""


register_model(FunctionsType)(_BundleModel)


@lower_getattr_generic(FunctionsType)
def _read_function(context: Any, builder: Any, functions: FunctionsType, value: Any, name: str) -> Any:
    """Make the function from its address."""
    row = functions.index[name]
    word = ir.IntType(64)
    address = builder.load(builder.gep(builder.bitcast(value, word.as_pointer()), [ir.Constant(word, row)]))
    return function_at(context, builder, functions.fields[row][1], address)


def function_at(context: Any, builder: Any, kind: types.FunctionType, address: Any) -> Any:
    """Return what compiled code calls as from C, where it is lowered."""
    made = cgutils.create_struct_proxy(kind)(context, builder)
    made.c_addr = builder.inttoptr(address, cgutils.voidptr_t)
    return made._getvalue()


def opener(kind: BundleType) -> Any:
    """A compiled function that turns a table into the bundle."""

    @intrinsic
    def bundle(typingctx: Any, table: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            array = cgutils.create_struct_proxy(signature.args[0])(context, builder, args[0])
            return builder.bitcast(array.data, cgutils.voidptr_t)

        return kind(ADDRESSES if isinstance(kind, FunctionsType) else TABLE), generate

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
