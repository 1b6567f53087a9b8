"""Calls of code that is compiled on its own, at its address.

A unit of its own is compiled beside the others, on another processor, or not at all where no scene needs it. An
address costs a few ns a call: it is for what is asked once a step or once an event.
"""

from __future__ import annotations

from typing import Any

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic


def code_at(result: Any) -> Any:
    """Return what calls code at an address with a tuple of arguments and hands on what it raises.

    Args:
        result: numba's type of what the code returns.
    """

    @intrinsic
    def call(typingctx: Any, address: Any, given: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            convention = context.call_conv
            kind = convention.get_function_type(result, given.types)
            function = builder.inttoptr(args[0], kind.as_pointer())
            each = cgutils.unpack_tuple(builder, args[1])
            status, found = convention.call_function(builder, function, result, given.types, each)
            with cgutils.if_unlikely(builder, status.is_error):
                convention.return_status_propagate(builder, status)
            return found

        return result(types.int64, given), generate

    return call


number_at = code_at(types.float64)
count_at = code_at(types.int64)
