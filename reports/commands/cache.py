"""The command `crossbody cache`: where compiled code is kept, how much it is, and how it is removed."""

from __future__ import annotations

import json

from crossbody.reference import code_store
from crossbody.reports import voice


def show() -> int:
    """Print the folder, the number of its files and their size."""
    where, store = code_store.base(), code_store.current()
    entries = store.entries() if store else []
    size = sum(found.st_size for _, found in entries)
    if voice.as_json():
        print(json.dumps({"folder": str(where), "usable": store is not None, "files": len(entries), "bytes": size}))
    else:
        print(f"{where}: {len(entries)} files, {size / 1e6:.1f} MB" + ("" if store else " (not used)"))
    return 0


def clear() -> int:
    """Remove all compiled code; other files of the folder stay."""
    store = code_store.current()
    removed = store.clear() if store else 0
    if voice.as_json():
        print(json.dumps({"removed": removed}))
    elif not voice.quiet():
        print(f"Removed {removed} files of compiled code; the next run compiles again.")
    return 0
