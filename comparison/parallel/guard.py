"""Scripts without main guard: every worker process runs them again, up to where workers are started."""

from __future__ import annotations

import multiprocessing
import os
import sys
from pathlib import Path

from ...symbolic import InputError

WORKER = "stationkeep-worker"  # the name of a worker's process
NO_GUARD = 79  # a worker's exit code: the script that it ran would have started workers


def refuse_in_worker() -> None:
    """Refuse to start workers in a process that is still running the script of the one it works for.

    A worker of this package ends here at once, and the process that started it says why. In a process
    that something else has started it is an error.

    Raises
    ------
    InputError
        If the script has no main guard.
    """
    process = multiprocessing.current_process()
    if not getattr(process, "_inheriting", False):  # as multiprocessing itself finds it out
        return
    if process.name == WORKER:
        os._exit(NO_GUARD)
    raise no_guard()


def no_guard() -> InputError:
    """Return the error that names the main guard, and the script that needs it."""
    path = getattr(sys.modules.get("__main__"), "__file__", None)
    script = f"'{Path(path).name}'" if path else "the script"
    return InputError(
        f"every worker process runs {script} again, which would start workers itself; put the lines "
        "that start them below 'if __name__ == \"__main__\":', or ask for one worker"
    )
