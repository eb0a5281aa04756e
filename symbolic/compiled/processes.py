"""Whether a process is no more, for what it left behind."""

from __future__ import annotations

import os


def is_gone(process: int) -> bool:
    """Whether no process of this machine has this number; False where asking is not possible.

    Nor is it on Windows, where asking may end the process.
    """
    if os.name == "nt" or not hasattr(os, "kill"):
        return False
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return True
    except (OSError, OverflowError):
        pass
    return False
