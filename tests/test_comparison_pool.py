"""Tasks in spawned processes: what they say, what kills them, and what is left of it."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from stationkeep.comparison.parallel import Event, default_workers, run_tasks
from stationkeep.symbolic import InputError, RunError

# a task is what to do; functions of a script's own module reach the workers
SCRIPT = """
import json, multiprocessing, os, signal, sys, time
from contextlib import closing
from pathlib import Path
from stationkeep.comparison.parallel import run_tasks
from stationkeep.symbolic import InputError, RunError


def setup(folder):
    with open(folder + "/built", "a") as file:
        file.write(f"{os.getpid()}\\n")
    blocked = signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, [])
    if not blocked and signal.getsignal(signal.SIGINT) != signal.SIG_IGN:
        Path(folder, f"hears-{os.getpid()}").touch()

    def work(task):
        first = Path(folder, task.replace(" ", "-"))
        again = first.exists()
        first.touch()
        if task.startswith("kill") or task.startswith("once") and not again:
            yield "before"
            os.kill(os.getpid(), signal.SIGKILL)
        if task.startswith("leave"):
            os._exit(3)
        if task.startswith("raise"):
            raise {"input": InputError, "run": RunError}[task.split()[1]]("a sentence")
        if task.startswith("crash"):
            print(1 / 0)
        if task.startswith("threads"):
            yield [os.environ[name] for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")]
        if task.startswith("wait"):
            yield os.getpid()
            time.sleep(60)
        yield os.getpid()
    return work


def main(folder, n_workers, *tasks):
    os.environ.pop("OPENBLAS_NUM_THREADS", None)
    os.environ["OMP_NUM_THREADS"] = "7"
    told = []
    with closing(run_tasks(setup, folder, tasks, int(n_workers))) as events:
        try:
            for event in events:
                told.append((event.task, event.message, event.failure))
                if tasks[event.task].startswith("last"):
                    break
        except (InputError, RunError) as error:
            told.append((type(error).__name__, str(error), None))
    assert os.environ["OMP_NUM_THREADS"] == "7"
    assert "OPENBLAS_NUM_THREADS" not in os.environ
    print(json.dumps([os.getpid(), len(multiprocessing.active_children()), told]))


if __name__ == "__main__":
    main(*sys.argv[1:])
"""


class Told:
    """What a run of the script told."""

    def __init__(self, folder: Path, n_workers: int, *tasks: str) -> None:
        script = folder / "script.py"
        script.write_text(SCRIPT, encoding="utf-8")
        done = subprocess.run(
            [sys.executable, str(script), str(folder), str(n_workers), *tasks],
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        self.err = done.stderr
        self.pid: int
        self.events: list[tuple[Any, Any, str | None]]
        self.pid, self.children, self.events = json.loads(done.stdout)
        self.built = (folder / "built").read_text(encoding="utf-8").split()

    def of(self, task: int) -> list[Any]:
        """Return the messages of a task, and why it was given up."""
        return [failure or message for number, message, failure in self.events if number == task]


@pytest.mark.slow
def test_workers_do_all_tasks_and_others_do_those_of_the_dead(tmp_path: Path) -> None:
    told = Told(tmp_path, 2, "fine 1", "kill", "fine 2", "once", "threads", "fine 3")
    pids = [told.of(task)[0] for task in (0, 2, 5)]
    assert told.pid not in pids
    assert told.of(1)[:2] == ["before", "before"], "there are two attempts"
    assert "was killed (SIGKILL)" in told.of(1)[2]
    assert "2 attempts" in told.of(1)[2]
    assert len(told.of(1)) == 3
    assert told.of(3)[0] == "before"
    assert isinstance(told.of(3)[1], int), "the second attempt went well"
    assert told.of(4)[0] == ["1", "1"]
    assert not [*tmp_path.glob("hears-*")], "every worker is deaf to Ctrl-C from its first moment"
    assert 3 <= len(told.built) == len(set(told.built)) <= 2 + 3
    assert told.children == 0


@pytest.mark.slow
def test_workers_that_leave_or_crash(tmp_path: Path) -> None:
    told = Told(tmp_path, 2, "leave", "crash", "fine")
    (left,), (crashed,), (fine, *_) = (told.of(task) for task in range(3))
    assert "ended with code 3" in left
    assert "ended with code 1" in crashed
    assert "ZeroDivisionError" in told.err
    assert isinstance(fine, int)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "name"), [("input", "InputError"), ("run", "RunError")])
def test_an_error_for_the_user_ends_the_run(kind: str, name: str, tmp_path: Path) -> None:
    """The other worker would be busy for a minute."""
    told = Told(tmp_path, 2, f"raise {kind}", "wait")
    assert told.events[-1] == [name, "a sentence", None]
    assert told.children == 0
    assert told.err == ""


@pytest.mark.slow
def test_closing_ends_the_workers(tmp_path: Path) -> None:
    told = Told(tmp_path, 2, "last", "wait", "fine")
    assert told.events[-1][0] == 0
    assert told.children == 0
    for number in told.built:
        assert not Path(f"/proc/{number}").exists()
    assert told.err == ""


@pytest.mark.slow
def test_one_worker_is_this_process(tmp_path: Path) -> None:
    told = Told(tmp_path, 1, "fine 1", "fine 2")
    assert told.built == [str(told.pid)]
    assert told.events == [[0, told.pid, None], [1, told.pid, None]]
    assert Told(tmp_path, 4, "fine 3").events[0][0] == 0


def test_errors_and_order_in_this_process() -> None:
    def setup(step: int):  # type: ignore[no-untyped-def]
        def work(task: int):  # type: ignore[no-untyped-def]
            if task == 3:
                raise InputError("three")
            yield step * task
            yield -task

        return work

    events = [*run_tasks(setup, 10, [1, 2], 1)]
    assert events == [Event(0, 10), Event(0, -1), Event(1, 20), Event(1, -2)]
    assert [*run_tasks(setup, 10, [], 5)] == []
    with pytest.raises(InputError, match="three"):
        [*run_tasks(setup, 10, [3], 5)]
    assert not issubclass(InputError, RunError)


def test_default_is_what_this_process_may_use() -> None:
    assert default_workers() >= 1
