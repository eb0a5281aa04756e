"""A mesh settled on the events of its own solution.

Where a switching function changes sign, as the drag |ν|ν does with its velocity, the plant is only C^1,
which limits collocation to low order unless a mesh point is there. The times are those of the solution
itself: solve, locate the sign changes, put mesh points on them, and repeat until they stay.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from ...symbolic.arrays import Array
from .mesh import aligned_mesh
from .plant import Plant
from .verification import Motion, sign_changes

S = TypeVar("S")


def settle(
    plant: Plant,
    mesh: Array,
    first: S,
    motion: Callable[[S], Motion],
    solve_on: Callable[[Array, S], S],
    *,
    fixed: Array | None = None,
    tolerance: float = 1e-6,
    rounds: int = 6,
) -> tuple[list[S], Array]:
    """Solve again on aligned meshes until the sign changes move by less than `tolerance` [s].

    Parameters
    ----------
    plant : with the switching functions
    mesh : (K + 1,) before alignment [s]
    first : the solution on it
    motion : the trajectory of a solution
    solve_on : solves on a mesh, started from a solution
    fixed : points of the mesh that stay where they are [s]
    rounds : at most

    Returns
    -------
    solutions : all of them in their order, the last on the settled mesh
    events : (e,) sign changes where that mesh has points [s]
    """
    solutions, known = [first], np.empty(0)
    for _ in range(rounds):
        events = sign_changes(plant, motion(solutions[-1]))
        if len(events) == len(known) and np.abs(events - known).max(initial=0.0) <= tolerance:
            break
        known = events
        solutions.append(solve_on(aligned_mesh(mesh, events, fixed=fixed), solutions[-1]))
    return solutions, known
