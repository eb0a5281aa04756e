"""Controllers of one scenario in threads of their own: the very same numbers as one after the other."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator

import casadi
import numpy as np
import pytest
from casadi import SX
from stationkeep.comparison import Scenario
from stationkeep.online import Controller
from stationkeep.symbolic import Kernel
from stationkeep.symbolic.compiled import export

from .games import QUICK, Array, quick_scenario

N_THREADS = 2


@pytest.fixture
def hurried() -> Iterator[None]:
    """Let the interpreter change threads as often as it can."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


def together(work: Callable[[int], object]) -> list[object]:
    """Return the results of work(0), work(1), ..., each in a thread that waits for all to begin."""
    results: list[object] = [None] * N_THREADS
    ready = threading.Barrier(N_THREADS)

    def begin(i: int) -> None:
        ready.wait()
        results[i] = work(i)

    threads = [threading.Thread(target=begin, args=(i,)) for i in range(N_THREADS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return results


def wrenches(controller: Controller, seed: int, steps: int) -> Array:
    """Return the wrenches along a path that decays and the weights behind them."""
    rng = np.random.default_rng(seed)
    eta, eta_dot = 0.3 * rng.uniform(-1.0, 1.0, 6), 0.1 * rng.uniform(-1.0, 1.0, 6)
    decay = np.exp(-0.01 * np.arange(steps))
    given = [controller.step(eta * part, eta_dot * part, 0.02) for part in decay]
    return np.concatenate([*given, controller.learner.critic])


@pytest.mark.parametrize(("learn", "steps"), [(False, 1500), (True, 27)])
def test_threads_give_what_one_thread_gives(learn: bool, steps: int, hurried: None) -> None:
    scenario = quick_scenario()
    alone = [wrenches(Controller(scenario, learn=learn), seed, steps) for seed in range(N_THREADS)]
    controllers = [Controller(scenario, learn=learn) for _ in range(N_THREADS)]
    found = together(lambda i: wrenches(controllers[i], i, steps))
    for one, other in zip(alone, found, strict=True):
        np.testing.assert_array_equal(other, one)


def test_controllers_are_made_in_threads(hurried: None) -> None:
    """What is compiled when it is first used may be first used by two at once."""
    alone = wrenches(Controller(quick_scenario()), 0, 2)
    scenario = Scenario.load("bluerov2-heavy", [*QUICK])
    for found in together(lambda i: wrenches(Controller(scenario), 0, 2)):
        np.testing.assert_array_equal(found, alone)


def test_controllers_of_one_scenario_do_not_touch_each_other() -> None:
    """One that learns in between leaves the other's wrenches and weights as they are."""
    scenario = quick_scenario()
    alone = wrenches(Controller(scenario, learn=False), 1, 40)
    first, second = Controller(scenario, learn=False), Controller(scenario)
    wrenches(second, 2, 20)
    np.testing.assert_array_equal(wrenches(first, 1, 40), alone)
    assert not np.array_equal(second.learner.critic, first.learner.critic)


@pytest.mark.parametrize("compiled", [True, False])
def test_a_kernel_has_buffers_for_every_thread(compiled: bool) -> None:
    """What one thread writes no other reads; the constants are there in each."""
    x, factor = SX.sym("x", 2), SX.sym("factor", 2)
    product = casadi.Function("product", [x, factor], [casadi.densify(x * factor)])
    kernel, _ = export(product, compiled=compiled, constants=[np.array([2.0, 3.0])])

    def work(i: int) -> tuple[int, Array]:
        kernel.inputs[0][...] = i
        waiting.wait()  # until all have written
        kernel.evaluate()
        return int(kernel.inputs[0].ctypes.data), kernel.outputs[0].copy()

    waiting = threading.Barrier(N_THREADS)
    found = together(work)
    assert len({address for address, _ in found}) == N_THREADS  # type: ignore[misc]
    for i, (_, result) in enumerate(found):  # type: ignore[misc]
        np.testing.assert_array_equal(result, [2.0 * i, 3.0 * i])


def test_constants_are_the_last_inputs() -> None:
    x, factor = SX.sym("x", 2), SX.sym("factor", 2)
    kernel = Kernel(casadi.Function("sum", [x, factor], [x + factor]), [np.array([1.0, -1.0])])
    kernel.inputs[0][...] = [5.0, 5.0]
    kernel.evaluate()
    np.testing.assert_array_equal(kernel.outputs[0], [6.0, 4.0])
