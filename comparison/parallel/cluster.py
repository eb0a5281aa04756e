"""Tasks on a dask cluster: what `pool.run_tasks` does, on workers that somebody else has started."""

from __future__ import annotations

import importlib
import logging
import queue
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from importlib.metadata import version
from typing import Any, TypeVar

from ...online.records import versions
from ...symbolic import InputError, RunError, StationkeepError
from .pool import Event, Work

S = TypeVar("S")
T = TypeVar("T")
M = TypeVar("M")

CONNECT = "20s"
POLL = 5.0  # s between two looks at the workers
PATIENCE = 12  # such looks without a worker
AHEAD = 2  # tasks a thread has waiting, so that it never waits itself
_building = threading.Lock()
_built: dict[tuple[Any, str], Any] = {}


def run_on_cluster(
    address: str, setup: Callable[[S], Work[T, M]], shipment: S, tasks: Sequence[T]
) -> Generator[Event[M], None, None]:
    """Work on all tasks on the cluster of this scheduler, and yield what they say.

    Each worker builds what works on tasks for itself, once; a few tasks a thread are under way. What a
    worker that died was at goes to another one; a task that was given up is an event with the reason.

    Raises
    ------
    InputError
        If dask.distributed is not installed, nothing answers, or a worker has another stationkeep.
    RunError
        If the scheduler or the last worker is lost.
    """
    try:
        distributed = importlib.import_module("distributed")
    except ModuleNotFoundError:
        raise InputError(
            "--cluster needs dask.distributed, which is not installed; pip install "
            "'stationkeep[cluster]'"
        ) from None
    with _connected(distributed, address) as client:
        yield from _Flow(client, address, (setup, shipment), tasks).events()


class _Flow:
    """Tasks on their way through a cluster."""

    def __init__(self, client: Any, address: str, arguments: tuple[Any, Any], tasks: Any) -> None:
        self.client, self.address = client, address
        self.arguments = (versions()["stationkeep_version"], *arguments)
        self.tasks = tasks
        self.given = 0
        self.pending: dict[Any, int] = {}
        self.over: queue.SimpleQueue[Any] = queue.SimpleQueue()

    def events(self) -> Iterator[Event[Any]]:
        """Yield events until no task is left."""
        looks = 0
        while self.given < len(self.tasks) or self.pending:
            threads = self._threads()
            looks = 0 if threads else looks + 1
            if looks > PATIENCE:
                raise _lost(self.address, "has no workers any more")
            while self.given < len(self.tasks) and len(self.pending) < AHEAD * max(threads, 1):
                task = self.tasks[self.given]
                future = self.client.submit(_work, *self.arguments, task, pure=False)
                self.pending[future] = self.given
                future.add_done_callback(self.over.put)
                self.given += 1
            with suppress(queue.Empty):
                yield from self._told(self.over.get(timeout=POLL))

    def _threads(self) -> int:
        with suppress(OSError, ValueError, TimeoutError):
            if self.client.status == "running":
                return sum(self.client.nthreads().values())
        raise _lost(self.address, "was lost")

    def _told(self, future: Any) -> Iterator[Event[Any]]:
        number = self.pending.pop(future)
        if future.status in ("cancelled", "lost"):
            raise _lost(self.address, "was lost")
        try:
            messages = future.result()
        except importlib.import_module("distributed").KilledWorker:
            yield Event(number, failure="its worker was lost, again and again")
        except StationkeepError:
            raise
        except Exception as error:  # whatever a worker's process could raise
            yield Event(number, failure=f"its worker failed: {type(error).__name__}: {error}")
        else:
            yield from (Event(number, message) for message in messages)


def _lost(address: str, how: str) -> RunError:
    return RunError(
        f"the scheduler {address} {how}; what was finished is kept, start a cluster and run "
        "the sweep again"
    )


def _work(needed: str, setup: Callable[[S], Work[T, M]], shipment: S, task: T) -> list[M]:
    """Work on a task in a worker's process; one at a time, since CasADi knows nothing of threads.

    Each worker looks at its own version: it may have joined when others were long at work.
    """
    if version("stationkeep") != needed:
        address = importlib.import_module("distributed").get_worker().address
        raise InputError(
            f"the worker {address} needs stationkeep {needed}, but has: {version('stationkeep')}"
        )
    config = importlib.import_module("dask.config")
    # xarray would ask the scheduler for a lock on every file that it writes in a worker
    with _building, config.set(scheduler="synchronous"):
        name = (setup, repr(shipment))
        if name not in _built:
            _built.clear()  # of another sweep
            _built[name] = setup(shipment)
        return [*_built[name](task)]


@contextmanager
def _connected(distributed: Any, address: str) -> Iterator[Any]:
    for name in ("distributed", "distributed.client", "tornado"):  # they tell of every lost connection
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        client = distributed.Client(address, timeout=CONNECT, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(
            f"no dask scheduler answers at '{address}' ({type(error).__name__}); start one with "
            "'dask scheduler', workers with 'dask worker', and give its address, tcp://HOST:8786"
        ) from None
    with closing(client):
        yield client
