"""Tasks in spawned processes: in the order of their plan, whatever becomes of a process.

Nothing of CasADi can be pickled, so a worker is told what to build, builds it once and then works on
one task after the other. A worker that dies (killed, out of memory, crashed) costs its task one of two
attempts and is replaced; the others go on. Workers have one BLAS thread, never see Ctrl-C, and end
with the process that started them.
"""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import threading
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from typing import Generic, TypeVar

from ...symbolic import InputError, RunError, StationkeepError
from .guard import NO_GUARD, WORKER, no_guard, refuse_in_worker

S = TypeVar("S")  # what is shipped to every worker
T = TypeVar("T")  # a task
M = TypeVar("M")  # what a task says of its progress

Work = Callable[[T], Iterator[M]]
ATTEMPTS = 2
_SPAWN = multiprocessing.get_context("spawn")
_HAS_MASKS = hasattr(signal, "pthread_sigmask")  # not on Windows
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True)
class Event(Generic[M]):
    """What a task said, or why it was given up.

    Attributes
    ----------
    task : its number
    message : what its work yielded; None with a failure
    failure : why the task was given up, or None
    """

    task: int
    message: M | None = None
    failure: str | None = None


def default_workers() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def run_tasks(
    setup: Callable[[S], Work[T, M]], shipment: S, tasks: Sequence[T], n_workers: int
) -> Generator[Event[M], None, None]:
    """Work on all tasks, and yield what they say as they say it.

    With one worker or one task everything happens in this process. Close the generator
    (`contextlib.closing`) to end the workers at once.

    Parameters
    ----------
    setup : a module's function; makes from the shipment what works on tasks, once in each worker
    shipment, tasks : can be pickled
    n_workers : at least 1; no more are started than there are tasks

    Raises
    ------
    StationkeepError
        What a task or the setup raises of it ends the whole run.
    InputError
        If the script that starts workers has no main guard.
    """
    if n_workers <= 1 or len(tasks) <= 1:
        work = setup(shipment)
        for number, task in enumerate(tasks):
            for message in work(task):
                yield Event(number, message)
        return
    refuse_in_worker()
    pool = _Pool(setup, shipment, tasks)
    try:
        yield from pool.run(n_workers)
    finally:
        pool.close()


class _Worker(Generic[S, T, M]):
    """A process, this end of its pipe and the task it is at."""

    def __init__(self, setup: Callable[[S], Work[T, M]], shipment: S) -> None:
        self.connection, theirs = _SPAWN.Pipe()
        self.task = -1
        self.process: SpawnProcess = _SPAWN.Process(
            target=_serve, name=WORKER, args=(theirs, setup, shipment), daemon=True
        )
        self.process.start()
        theirs.close()

    def give(self, number: int, task: T) -> None:
        """Send a task; one that is dead already is noticed when it is listened to."""
        self.task = number
        try:
            self.connection.send(task)
        except OSError:
            return

    def end(self) -> str:
        """Stop the process whatever it does; return how it ended."""
        self.process.kill()
        self.process.join()
        self.connection.close()
        code = self.process.exitcode or 0
        return f"was killed ({_signal_name(-code)})" if code < 0 else f"ended with code {code}"


def _signal_name(number: int) -> str:
    """Return a signal's name as this platform has it, or its number."""
    known = {int(one): one.name for one in signal.Signals}
    return known.get(number, f"signal {number}")


class _Pool(Generic[S, T, M]):
    def __init__(self, setup: Callable[[S], Work[T, M]], shipment: S, tasks: Sequence[T]) -> None:
        self.setup = setup
        self.shipment = shipment
        self.tasks = tasks
        self.n_given = 0  # tasks before this number were given to a worker
        self.again: deque[int] = deque()
        self.attempts: Counter[int] = Counter()  # of what is not done
        self.busy: dict[Connection, _Worker[S, T, M]] = {}

    def run(self, n_workers: int) -> Iterator[Event[M]]:
        """Yield events until no task is left."""
        while self.is_waiting or self.busy:
            while self.is_waiting and len(self.busy) < n_workers:
                with _as_workers_need_it():
                    worker: _Worker[S, T, M] = _Worker(self.setup, self.shipment)
                    self.busy[worker.connection] = worker
                self._give(worker)
            for connection in wait([*self.busy]):
                yield from self._listen(self.busy[connection])  # type: ignore[index]

    @property
    def is_waiting(self) -> bool:
        """Whether a task has no worker."""
        return bool(self.again) or self.n_given < len(self.tasks)

    def close(self) -> None:
        """End every worker."""
        for worker in self.busy.values():
            worker.end()
        self.busy.clear()

    def _give(self, worker: _Worker[S, T, M]) -> None:
        number = self.again.popleft() if self.again else self.n_given
        self.n_given = max(self.n_given, number + 1)
        self.attempts[number] += 1
        worker.give(number, self.tasks[number])

    def _listen(self, worker: _Worker[S, T, M]) -> Iterator[Event[M]]:
        try:
            kind, content = worker.connection.recv()
        except (EOFError, OSError):
            yield from self._bury(worker)
            return
        if kind == "message":
            yield Event(worker.task, content)
        elif kind == "bad input":
            raise InputError(content)
        elif kind == "failed":
            raise RunError(content)
        else:
            del self.attempts[worker.task]
            if self.is_waiting:
                self._give(worker)
            else:
                del self.busy[worker.connection]
                worker.end()

    def _bury(self, worker: _Worker[S, T, M]) -> Iterator[Event[M]]:
        """Give the task of a dead worker another attempt, or up."""
        del self.busy[worker.connection]
        how = worker.end()
        if worker.process.exitcode == NO_GUARD:
            raise no_guard() from None
        if self.attempts[worker.task] < ATTEMPTS:
            self.again.appendleft(worker.task)
        else:
            del self.attempts[worker.task]
            reason = f"its process {how}, and {ATTEMPTS} attempts were made"
            yield Event(worker.task, failure=reason)


@contextmanager
def _as_workers_need_it() -> Iterator[None]:
    """Let a process start with one BLAS thread and deaf to Ctrl-C, which is for its parent."""
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))
    try:
        with _deaf():
            yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@contextmanager
def _deaf() -> Iterator[None]:
    """Block Ctrl-C for what is started meanwhile; a platform without signal masks can't."""
    if not _HAS_MASKS:
        yield
        return
    resource_tracker.ensure_running()  # when it starts, Python 3.11 lets SIGINT through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _serve(connection: Connection, setup: Callable[[S], Work[T, M]], shipment: S) -> None:
    """Work on the tasks that come through the pipe, in the worker."""
    if not _HAS_MASKS:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    logging.getLogger("stationkeep").addHandler(logging.NullHandler())  # the parent said it already
    try:
        work = setup(shipment)
        while True:
            for message in work(connection.recv()):
                connection.send(("message", message))
            connection.send(("done", None))
    except (EOFError, ConnectionError):
        return  # nobody is there any more
    except StationkeepError as error:
        connection.send(("bad input" if isinstance(error, InputError) else "failed", str(error)))


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
