"""What watches IPOPT from inside: the limits of a solve, and Ctrl-C.

IPOPT calls back after each iteration. CasADi swallows what is raised while it calls Python back, and
makes a failure of IPOPT of Ctrl-C, after which a search would go on with its next start. So both are
kept, IPOPT is asked to stop, and they are raised when it has.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

import casadi
from casadi import Sparsity

from ..limits import count


class Monitor(casadi.Callback):
    """Counts the iterations of one program's solver against the limits of the solve.

    Parameters
    ----------
    n_unknowns, n_constraints, n_parameters : of the program
    """

    def __init__(self, n_unknowns: int, n_constraints: int, n_parameters: int) -> None:
        casadi.Callback.__init__(self)
        self._raised: BaseException | None = None
        self._interrupted = False
        sizes = {"x": n_unknowns, "g": n_constraints, "p": n_parameters, "f": 1}
        self._sizes = [sizes[name.removeprefix("lam_")] for name in casadi.nlpsol_out()]
        self.construct("monitor", {})

    def get_n_in(self) -> int:
        """Return the number of what IPOPT hands over."""
        return len(self._sizes)

    def get_n_out(self) -> int:
        """Return 1: whether to stop."""
        return 1

    def get_sparsity_in(self, i: int) -> Sparsity:
        """Return the shape of what IPOPT hands over, all dense columns."""
        return Sparsity.dense(self._sizes[i], 1)

    def eval(self, _: object) -> list[int]:
        """Count an iteration; return 1 to stop IPOPT."""
        try:
            count()
        except BaseException as error:  # raised again in `watching`
            self._raised = error
        return [int(self._interrupted or self._raised is not None)]

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Raise after the solve what came up in it: Ctrl-C as its handler has it, a limit."""
        self._raised, self._interrupted = None, False
        before = signal.getsignal(signal.SIGINT)
        ours = threading.current_thread() is threading.main_thread() and callable(before)
        if ours:
            signal.signal(signal.SIGINT, self._press)
        try:
            yield
        finally:
            if ours:
                signal.signal(signal.SIGINT, before)
        if self._interrupted:
            if callable(before):
                before(signal.SIGINT, None)
            raise KeyboardInterrupt
        if self._raised is not None:
            raise self._raised

    def _press(self, number: int, frame: FrameType | None) -> None:
        self._interrupted = True
