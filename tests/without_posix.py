"""Hide from stationkeep what only POSIX has: no fcntl, no signal masks, no fork.

As the `sitecustomize` of a process and of all that it starts: what stationkeep imports lacks what
Windows lacks, while Python's own library, which could start no process without it here, keeps it.
"""

from __future__ import annotations

import builtins
import os
import signal
import types
from typing import Any

MODULES = {"fcntl", "grp", "posix", "pwd", "pty", "resource", "syslog", "termios", "tty"}
SIGNALS = {"SIGABRT", "SIGFPE", "SIGILL", "SIGINT", "SIGSEGV", "SIGTERM"}
MASKS = {"SIG_BLOCK", "SIG_UNBLOCK", "SIG_SETMASK", "ITIMER_REAL", "ITIMER_VIRTUAL", "ITIMER_PROF"}
CALLS = {
    *("alarm", "getitimer", "pause", "pthread_kill", "pthread_sigmask", "setitimer", "siginterrupt"),
    *("sigpending", "sigtimedwait", "sigwait", "sigwaitinfo"),
}
OF_OS = {
    *("chown", "chroot", "confstr", "ctermid", "fchmod", "fchown", "fork", "forkpty", "getegid"),
    *("geteuid", "getgid", "getgrouplist", "getgroups", "getloadavg", "getpgid", "getpgrp"),
    *("getpriority", "getresgid", "getresuid", "getsid", "getuid", "initgroups", "kill", "killpg"),
    *("lchown", "lockf", "major", "minor", "mkfifo", "mknod", "nice", "openpty", "pathconf"),
    *("pipe2", "posix_fadvise", "posix_fallocate", "posix_spawn", "posix_spawnp", "pread", "preadv"),
    *("pwrite", "pwritev", "readv", "register_at_fork", "sched_getaffinity", "sched_setaffinity"),
    *("sched_yield", "sendfile", "setgid", "setgroups", "setpgid", "setpriority", "setsid", "setuid"),
    *("statvfs", "sync", "sysconf", "tcgetpgrp", "ttyname", "uname", "wait", "wait3", "wait4"),
    *("waitid", "writev", "O_CLOEXEC", "O_DIRECTORY", "O_NOCTTY", "O_NOFOLLOW", "O_NONBLOCK"),
    *("O_SYNC", "WNOHANG"),
}


def without(module: types.ModuleType, names: set[str]) -> types.ModuleType:
    """Return a module with fewer names."""
    fewer = types.ModuleType(module.__name__, module.__doc__)
    vars(fewer).update({name: value for name, value in vars(module).items() if name not in names})
    return fewer


def is_posix_signal(name: str) -> bool:
    """Return whether a name of `signal` is that of a signal that Windows has not."""
    return name.startswith("SIG") and not name.startswith("SIG_") and name not in SIGNALS


SEEN = {
    "os": without(os, OF_OS),
    "signal": without(signal, MASKS | CALLS | {n for n in vars(signal) if is_posix_signal(n)}),
}
_import = builtins.__import__


def hiding(
    name: str,
    globals: Any = None,  # the names are Python's own
    locals: Any = None,
    fromlist: Any = (),
    level: int = 0,
) -> types.ModuleType:
    """Import as ever, but for stationkeep and its lock library what another platform has."""
    importer = str((globals or {}).get("__name__", "")).partition(".")[0]
    if level == 0 and importer in ("stationkeep", "filelock"):
        top = name.partition(".")[0]
        if top in MODULES:
            raise ModuleNotFoundError(f"No module named '{name}'", name=name)
        if importer == "stationkeep" and top in SEEN and (name == top or not fromlist):
            return SEEN[top]
    return _import(name, globals, locals, fromlist, level)


builtins.__import__ = hiding
