"""Results that are kept under a key: made once, made again when what they depend on has changed."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

import xarray as xr

from ...online import load, save
from ...online.records import read_parts
from ...symbolic import InputError


def key_of(*parts: str) -> str:
    """Return the key of a result, the SHA-256 of all that its numbers depend on."""
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


def kept_key(path: Path, attribute: str = "key") -> str | None:
    """Return the key that the record at `path` has; None where there is no record that can be read."""
    try:
        return str(read_parts(path)[0].get(attribute, ""))
    except InputError:
        return None


def reused(path: Path | None, key: str, make: Callable[[], xr.Dataset]) -> xr.Dataset:
    """Return the record at `path` if it is whole and of this key, or make it and keep it there.

    What was interrupted is made again, and so is a record that can't be read.
    """
    if path is not None and kept_key(path) == key:
        try:
            kept = load(path)
        except InputError:
            kept = None
        # one that ended by itself would end so again
        if kept is not None and not str(kept.attrs.get("stopped", "")).startswith("interrupted"):
            return kept
    dataset = make()
    if path is not None:
        save(dataset, path)
    return dataset
