"""Templates that were compiled to Python before, from the folder of compiled code."""

from __future__ import annotations

import hashlib
import sys

import jinja2
from jinja2.bccache import Bucket, BytecodeCache

from crossbody.reference import code_store


class KeptTemplates(BytecodeCache):
    """Keeps each template under a digest of its name, its text and the versions that read it."""

    def load_bytecode(self, bucket: Bucket) -> None:
        """Read a template back, if it is there."""
        store = code_store.current()
        data = store.read(_name(bucket)) if store is not None else None
        if data is not None:
            bucket.bytecode_from_string(data)

    def dump_bytecode(self, bucket: Bucket) -> None:
        """Keep a template."""
        if (store := code_store.current()) is not None:
            store.write(_name(bucket), bucket.bytecode_to_string())


def _name(bucket: Bucket) -> str:
    what = "\0".join((bucket.key, bucket.checksum, jinja2.__version__, sys.version))
    return f"template-{hashlib.sha256(what.encode()).hexdigest()[:32]}"
