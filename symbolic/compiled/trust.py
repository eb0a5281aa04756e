"""Whether what lies in the cache is the user's own: a library that is loaded is a program that runs."""

from __future__ import annotations

import os
import stat
from pathlib import Path

_OTHERS = stat.S_IWGRP | stat.S_IWOTH


def why_untrusted(path: Path) -> str | None:
    """Return why somebody else may have written what a folder or file holds, or None.

    It must be the user's own, a link to nowhere else, and writable by nobody else; and the folder it
    lies in must keep others from putting another in its place. Where files have no owner in this
    sense, on Windows, everything is trusted.
    """
    if not hasattr(os, "geteuid"):
        return None
    try:
        found, above = path.lstat(), path.parent.stat()
    except OSError:
        return None  # nothing there
    if stat.S_ISLNK(found.st_mode):
        return f"'{path}' is a link; only what lies in the folder itself is loaded"
    if found.st_uid != os.geteuid():
        return f"'{path}' belongs to another user"
    if found.st_mode & _OTHERS:
        return f"'{path}' can be written by others (mode {stat.S_IMODE(found.st_mode):o})"
    if above.st_mode & _OTHERS and not above.st_mode & stat.S_ISVTX:
        return f"'{path.parent}' can be written by others (mode {stat.S_IMODE(above.st_mode):o})"
    return None
