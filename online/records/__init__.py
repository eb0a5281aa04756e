"""The record of a run, and files that are written whole."""

from .files import (
    remove_temporaries,
    save,
    versions,
    writable_folder,
    write_text,
    written_whole,
)
from .reader import load, read_parts
from .record import listed, load_weights, to_dataset

__all__ = [
    "listed",
    "load",
    "load_weights",
    "read_parts",
    "remove_temporaries",
    "save",
    "to_dataset",
    "versions",
    "writable_folder",
    "write_text",
    "written_whole",
]
