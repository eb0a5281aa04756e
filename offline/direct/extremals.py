"""More than one extremal: where the value has several candidates, and where its gradient is not unique.

First-order conditions hold at every extremal, and a symmetric start stays on a symmetric one: from pure
heave the straight way home can be stationary with a conjugate point, while two mirror images beside it
are cheaper, since quadratic drag along each axis rewards diagonal motion. The lowest minimum found is
the value. Two of the same value make it a kink: V is the lower envelope of both, directionally
differentiable with the smaller slope, and either costate is an optimal one. Near half a turn of an
angle the two turns home are two candidates, too.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

import numpy as np

from ...symbolic import RunError
from ...symbolic.arrays import Array
from ..path import Trajectory
from .direct import DirectSolution, DirectSolver

T = TypeVar("T")


def by_turns(starts: Sequence[Array], solve: Callable[[Array], T]) -> list[T]:
    """Return what is found from each way to write a state, `Problem.starts`, those that fail left out.

    Raises
    ------
    RunError
        That of the first, if all of them fail.
    """
    found: list[T] = []
    failures: list[RunError] = []
    for start in starts:
        try:
            found.append(solve(start))
        except RunError as failure:
            failures.append(failure)
    if not found:
        raise failures[0]
    return found


def find_extremals(
    direct: DirectSolver, first: DirectSolution, *, starts: int = 4, seed: int = 0
) -> list[DirectSolution]:
    """Return different extremals from the initial state of `first`, the cheapest first.

    Started from both sides of a conjugate point, and by continuation from `starts` pairs of initial
    states to either side (seeded), each solved from its own linear H-infinity trajectory.
    """
    found = [first]
    for guess in _guesses(direct, first, starts, seed):
        with contextlib.suppress(RunError):
            mesh = first.trajectory.mesh
            other = direct.solve(first.zeta, mesh=mesh, guess=guess, verify=False, safety_net=False)
            if all(_differ(other, known, direct.problem.scale) for known in found):
                found.append(other)
    return sorted(found, key=lambda solution: solution.value)


def _guesses(
    direct: DirectSolver, first: DirectSolution, starts: int, seed: int, spread: float = 0.1
) -> Iterator[Trajectory]:
    for side in (0.05, -0.05):
        guess = direct.beside(first, side)
        if guess is not None:
            yield guess
    scale, mesh = direct.problem.scale, first.trajectory.mesh
    for direction in np.random.default_rng(seed).standard_normal((starts, len(scale))):
        shift = spread * scale * direction
        for start in (first.zeta + shift, first.zeta - shift):
            with contextlib.suppress(RunError, ValueError):
                yield direct.solve(start, mesh=mesh, verify=False, safety_net=False).trajectory


def _differ(one: DirectSolution, other: DirectSolution, scale: Array) -> bool:
    """Whether two solutions have different costates, beyond what a solver leaves open."""
    gap = np.linalg.norm((one.costate - other.costate) * scale)
    return bool(gap > 1e-5 * np.linalg.norm(one.costate * scale))
