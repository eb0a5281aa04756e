"""Limits on the work of a solve, stated beforehand: iterations and time, whatever method spends them.

A solve that has a limit runs inside `limited`. Every iteration of Newton's methods and of IPOPT calls
`count`, longer pieces of work without iterations call `check`; both raise `LimitError` once the work
is used up. It is no `RunError`: what tries other starts after a failure does not try them after the
limit. The limits that hold are those of the context, so no solver hands them on.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field

from ..symbolic import RunError, StationkeepError
from ..symbolic.arrays import Array


@dataclass(frozen=True)
class Reached:
    """The trajectory that a method had reached when it was ended, not a converged one.

    Attributes
    ----------
    times : (N + 1,) [s]
    states : (N + 1, n)
    v : (N, k) single-player input at times[1:]
    cost : what the method minimises, along it
    """

    times: Array
    states: Array
    v: Array
    cost: float


@dataclass(frozen=True)
class Limits:
    """How much work a solve may take, all of its parts together.

    Attributes
    ----------
    max_iterations : of all methods
    max_seconds : [s]
    name : what a message calls the group of the two settings
    """

    max_iterations: float = 10_000
    max_seconds: float = 300.0
    name: str = "offline"


@dataclass(eq=False)
class Work:
    """The work that was done since `limited` began.

    Attributes
    ----------
    limits : that hold
    around : the work that this is a part of, if any
    iterations : so far
    ended : what the limit said when it was reached, or nothing
    """

    limits: Limits
    around: Work | None = None
    iterations: int = 0
    ended: str = ""
    started: float = field(default_factory=time.monotonic)

    @property
    def seconds(self) -> float:
        """Wall time so far [s]."""
        return time.monotonic() - self.started

    def require(self, more: int = 0) -> None:
        """Raise LimitError if `more` iterations go beyond a limit, here or in what this is part of."""
        limits, spent = self.limits, None
        if self.iterations + more > limits.max_iterations:
            spent = f"{limits.name}.max_iterations = {limits.max_iterations:g}"
        elif self.seconds > limits.max_seconds:
            spent = f"{limits.name}.max_seconds = {limits.max_seconds:g}"
        if spent is not None:
            self.ended = (
                f"the solve was ended after {self.iterations} iterations and {self.seconds:.1f} s by "
                f"its limit {spent}, which may be raised"
            )
            raise LimitError(self.ended, self)
        if self.around is not None:
            self.around.require(more)

    def add(self) -> None:
        """Count an iteration, here and in what this is a part of."""
        self.iterations += 1
        if self.around is not None:
            self.around.add()


class LimitError(StationkeepError):
    """The work that a solve may take is used up; the message says which limit.

    Attributes
    ----------
    work : whose limit it was
    reached : the trajectory that the method had then; None before there was one
    """

    def __init__(self, message: str, work: Work) -> None:
        super().__init__(message)
        self.work = work
        self.reached: Reached | None = None


class EndedByLimitError(RunError):
    """A solve ended by its limit before it had a result.

    Attributes
    ----------
    reached : the trajectory that the method had then, not a converged one; None before there was one
    """

    def __init__(self, message: str, reached: Reached | None) -> None:
        super().__init__(message)
        self.reached = reached


_work: ContextVar[Work | None] = ContextVar("work", default=None)


@contextmanager
def limited(limits: Limits) -> Iterator[Work]:
    """Hold the work inside to the limits.

    Raises
    ------
    EndedByLimitError
        If the limits are reached and the `LimitError` of that is not caught inside.
    """
    work = Work(limits, _work.get())
    token = _work.set(work)
    try:
        yield work
    except LimitError as limit:
        if limit.work is not work:
            raise
        raise EndedByLimitError(str(limit), limit.reached) from None
    finally:
        _work.reset(token)


def count() -> None:
    """Count an iteration of any method; raises LimitError once there are too many, or time is up."""
    work = _work.get()
    if work is not None:
        work.require(1)
        work.add()


def check() -> None:
    """Raise LimitError if a limit is reached."""
    work = _work.get()
    if work is not None:
        work.require()
